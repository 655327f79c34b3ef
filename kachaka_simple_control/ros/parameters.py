# Copyright 2026 kachaka_simple_control contributors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""Declare the node's ROS parameters, and create the first event for displays and recordings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, Field, fields
from difflib import get_close_matches
import platform
import time
from typing import Any, TYPE_CHECKING

from kachaka_simple_control.control.events import SessionStarted
from kachaka_simple_control.control.timing import MAX_RATE, min_rate
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.files.robot_profile import find_robot, RobotProfile
from kachaka_simple_control.motion.units import number_advice, UnitError
from kachaka_simple_control.process.version import installed_version, ros_distro
from kachaka_simple_control.ros.names import (
    MAX_NAMESPACE_LENGTH,
    names_of,
    require_namespace,
    RobotNames,
)
from kachaka_simple_control.ros.node_parameters import (
    NodeParameters,
    QOS_OVERRIDES_PREFIX,
    ROS_PARAMETERS,
)
from kachaka_simple_control.text import escaped, quoted
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.utilities import get_rmw_implementation_identifier

if TYPE_CHECKING:
    from kachaka_simple_control.files.motion_file import MotionFile


@dataclass(frozen=True)
class RobotSettings:
    """
    What the parameters of a node say of one robot.

    :param name: prefixes its parameters, services and debug topics; empty for the only robot
    """

    name: str
    profile: RobotProfile
    parameters: NodeParameters
    names: RobotNames

    def full_name(self, parameter: str) -> str:
        """Return the name that a parameter of this robot has on its node."""
        return f'{self.name}.{parameter}' if self.name else parameter


def declare_parameters(node: Node, name: str, defaults: Mapping[str, Any]) -> RobotSettings:
    """
    Declare the ROS parameters for one robot of a node, and read their values and its profile.

    :param name: prefixes the parameters, as in ``NAME.rate``, and is the default of the robot's
        namespace; empty for the only robot of a node
    :param defaults: values that replace the usual defaults, by parameter
    :raises UsageError: if a value has the wrong type or is out of range, or the robot is unknown
    """
    prefix = f'{name}.' if name else ''
    require_namespace(f'/{name}', 'the name of a robot', MAX_NAMESPACE_LENGTH)
    robot, *others = fields(NodeParameters)
    kind = str(_declare(node, robot, prefix, defaults.get('robot', robot.default), None))
    profile = find_robot(kind)
    defaults = {'robot_namespace': name or profile.namespace, **defaults}
    ranges = {'rate': (min_rate(profile.command_timeout), MAX_RATE)}
    values = {
        parameter.name: _declare(
            node, parameter, prefix, defaults.get(parameter.name, parameter.default),
            ranges.get(parameter.name, parameter.metadata['range']))
        for parameter in others}
    parameters = NodeParameters(robot=kind, **values)
    return RobotSettings(name, profile, parameters, names_of(
        profile, parameters.robot_namespace, parameters.manual_control, parameters.watch))


def warn_of_unknown(node: Node, robots: Iterable[str]) -> None:
    """
    Warn of each parameter that was given to a node and that it has not declared.

    :param robots: the names of its robots
    """
    known = [*(f'{name}.{parameter.name}' if name else parameter.name
               for name in robots for parameter in fields(NodeParameters)), *ROS_PARAMETERS]
    for name in node._parameter_overrides:  # noqa: SLF001 (nothing public tells them)
        if name not in known and not name.startswith(QOS_OVERRIDES_PREFIX):
            similar = get_close_matches(name, known, 1)
            hint = f'; did you mean {similar[0]}?' if similar else ', so it has no effect'
            node.get_logger().warning(f'there is no parameter {escaped(name, 60)}{hint}')


def _declare(
        node: Node, parameter: Field[Any], prefix: str, default: Any,
        bounds: tuple[float, float] | None) -> Any:
    name = prefix + parameter.name
    descriptor = ParameterDescriptor(
        description=parameter.metadata['description'],
        read_only=parameter.metadata['read_only'])
    if bounds:
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=bounds[0], to_value=bounds[1])]
    # Users write rate:=20, and rclpy would refuse an integer for a double parameter; nor would it
    # say of within:=0.05 that a unit is missing.
    parse = parameter.metadata['parse']
    descriptor.dynamic_typing = bool(bounds or parse)
    # The range is set after the check, because the text of rclpy's refusal has no unit.
    first = ParameterDescriptor(dynamic_typing=True) if bounds else descriptor
    try:
        value = node.declare_parameter(name, default, first).value
    except ParameterException as error:
        raise UsageError(escaped(error)) from None
    if parse and (text := str(value)):
        try:
            parse(text)
        except UnitError as error:
            raise UsageError(f'parameter {name} is {error}') from None
        return text
    if bounds:
        value = _number(name, parameter.metadata['unit'], value, bounds)
        node.set_descriptor(name, descriptor)
    return value


def _number(name: str, unit: str, value: Any, bounds: tuple[float, float]) -> float:
    if isinstance(value, str):
        raise UsageError(
            f'parameter {name} is {quoted(value, 60)}; {number_advice(value, unit)}')
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise UsageError(f'parameter {name} is {value}; it must be a number')
    if not bounds[0] <= value <= bounds[1]:
        unit = unit and f' {unit}'
        raise UsageError(
            f'parameter {name} is {value:g}{unit}; it must be from {bounds[0]:g} to '
            f'{bounds[1]:g}{unit}')
    return float(value)


def session_started(
        node: Node, title: str, settings: RobotSettings, motion_file: MotionFile | None,
        **about: Any) -> SessionStarted:
    """
    Return the first event: robot, limits, topics, settings, versions, and the motion's file.

    :param motion_file: None if the motion is not from a file
    :param about: more fields of the event
    """
    profile, names = settings.profile, settings.names
    return SessionStarted(
        title=title,
        robot=profile.name,
        limits=profile.limits,
        command_timeout=profile.command_timeout,
        epoch=time.time() - time.monotonic(),
        velocity_topic=node.resolve_topic_name(names.velocity),
        odometry_topic=node.resolve_topic_name(names.odometry) if names.odometry else None,
        message_type=profile.message_type,
        frame=profile.frame,
        footprint=profile.footprint,
        settings={**asdict(settings.parameters), 'domain': node.context.get_domain_id(),
                  **{name: calibration.describe() for name, calibration in (
                      ('calibration', profile.calibration),
                      ('odometry_calibration', profile.odometry_calibration))
                     if calibration is not None}},
        versions=_versions(),
        motion_file=None if motion_file is None else motion_file.as_text(),
        **about)


def _versions() -> dict[str, str]:
    return {
        'kachaka_simple_control': installed_version(),
        'ROS': ros_distro(),
        'RMW': get_rmw_implementation_identifier(),
        'Python': platform.python_version(),
        'system': platform.platform(),
    }
