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
"""The parameters of the node, and the first event of a session."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, Field, field, fields
from difflib import get_close_matches
from itertools import pairwise
import platform
import time
from typing import Any

from kachaka_simple_control.control.events import SessionStarted
from kachaka_simple_control.control.speed_factor import MIN_SPEED_FACTOR
from kachaka_simple_control.control.timing import MAX_RATE, min_rate
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.files.robot_profile import find_robot, KACHAKA, RobotProfile
from kachaka_simple_control.ros.names import RobotNames
from kachaka_simple_control.text import escaped, quoted
from kachaka_simple_control.version import installed_version, ros_distro
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.utilities import get_rmw_implementation_identifier

#: Parameters of every rclpy node.
ROS_PARAMETERS = ('use_sim_time', 'start_type_description_service')
QOS_OVERRIDES_PREFIX = 'qos_overrides.'


def _parameter(
        default: Any, description: str, lowest: float = 0.0, highest: float = 0.0,
        read_only: bool = True) -> Any:
    return field(default=default, metadata={
        'description': description, 'range': (lowest, highest) if highest else None,
        'read_only': read_only})


@dataclass(frozen=True)
class NodeParameters:
    """
    The values of the node's parameters at its start.

    All parameters except ``speed_factor`` are read-only.  So the parameters of a plan do not
    change while it runs.
    """

    robot: str = _parameter(
        KACHAKA.name, 'Which robot: kachaka, turtlebot3, generic, or the path of a profile')
    robot_namespace: str = _parameter(
        KACHAKA.namespace,
        'ROS namespace of the robot; prefixes its topics and its service. By default that of its '
        'profile')
    rate: float = _parameter(
        10.0, 'How often a velocity is sent [Hz]', min_rate(KACHAKA.command_timeout), MAX_RATE)
    robot_timeout: float = _parameter(
        10.0, 'How long to wait for a robot before giving up [s]', 0.1, 3600.0)
    prime_time: float = _parameter(
        0.5, 'How long zeros are sent after the robot is matched, before it moves [s]', 0.0, 10.0)
    manual_control: bool = _parameter(
        True, 'Switch the manual control of the robot on before the first velocity, and renew it')
    release_manual_control: bool = _parameter(
        True, 'Release manual control at the end, if this node switched it on')
    guardian: bool = _parameter(
        True, 'Have a second process stop the robot if this one is killed, frozen or crashes')
    odometry_timeout: float = _parameter(
        1.0, 'How long odometry may be silent in a run before it is given up [s]; 0: no limit',
        0.0, 60.0)
    allow_other_publishers: bool = _parameter(
        False,
        'Drive even while another program sends velocities to the same robot; two instances of '
        'this program still exclude each other')
    pause_timeout: float = _parameter(
        600.0, 'How long a run may be paused before it is given up [s]', 1.0, 86_400.0)
    speed_factor: float = _parameter(
        1.0, 'Speed relative to the plan, 1: as planned; can be changed while the robot drives',
        MIN_SPEED_FACTOR, 1.0, read_only=False)
    closed_loop: bool = _parameter(
        False, 'Correct motions by odometry; the delay of the robot must be calibrated')
    summary: bool = _parameter(
        False, 'Record what is sent and what odometry reports, for the table at the end')


def parameter_arguments(arguments: Sequence[str]) -> dict[str, str]:
    """
    Return the parameters of this node that are set on the command line.

    :param arguments: the ROS arguments, from ``--ros-args`` on
    :returns: the values as written, by parameter name
    :raises UsageError: if a parameter is unknown; ROS itself ignores unknown parameters
    """
    own = [parameter.name for parameter in fields(NodeParameters)]
    known = [*own, *ROS_PARAMETERS]
    values = dict(_assignments(arguments))
    for name in values:
        if name not in known and not name.startswith(QOS_OVERRIDES_PREFIX):
            similar = get_close_matches(name, known, 1)
            hint = f'; did you mean {similar[0]}?' if similar else f': {", ".join(own)}'
            raise UsageError(f'there is no parameter {escaped(name, 60)}{hint}')
    return values


def _assignments(arguments: Sequence[str]) -> Iterator[tuple[str, str]]:
    for option, assignment in pairwise(arguments):
        name, is_assigned, value = assignment.partition(':=')
        # NODE:NAME:=VALUE sets a parameter of one node of several; such arguments are skipped.
        if option in ('-p', '--param') and is_assigned and ':' not in name:
            yield name, value


def require_parameters_only(option: str, arguments: Sequence[str]) -> None:
    """
    Refuse ROS arguments that an option without ROS cannot use.

    Such an option shows a plan and does not start ROS.  It accepts only ``-p NAME:=VALUE``.

    :param option: the name of the option, for the error message
    :param arguments: the ROS arguments, from ``--ros-args`` on
    :raises UsageError: if an argument is not ``-p NAME:=VALUE``, or sets ``speed_factor``, because
        a plan is always shown at full speed
    """
    if 'speed_factor' in dict(_assignments(arguments)):
        raise UsageError(f'{option} shows a plan at full speed: leave out speed_factor')
    words = iter(word for word in arguments if word not in ('--ros-args', '--'))
    for word in words:
        assignment = next(words, '') if word in ('-p', '--param') else ''
        name, is_assigned, _ = assignment.partition(':=')
        if not is_assigned or ':' in name:
            raise UsageError(
                f'{option} needs no ROS, and reads -p NAME:=VALUE alone of its arguments: leave '
                f'out {escaped(assignment or word, 60)}')


def declare_parameters(
        node: Node, defaults: Mapping[str, Any]) -> tuple[RobotProfile, NodeParameters]:
    """
    Declare the parameters on a node, and read their values.

    The profile of the robot sets some defaults and ranges.

    :param defaults: default values that replace the usual defaults, by parameter name
    :returns: the profile of the robot, and the values of the parameters
    :raises UsageError: if a value has the wrong type or is out of range, or the robot is unknown
    """
    robot, *others = fields(NodeParameters)
    name = str(_declare(node, robot, defaults.get('robot', robot.default), None))
    profile = find_robot(name)
    defaults = {'robot_namespace': profile.namespace, **defaults}
    ranges = {'rate': (min_rate(profile.command_timeout), MAX_RATE)}
    values = {
        parameter.name: _declare(
            node, parameter, defaults.get(parameter.name, parameter.default),
            ranges.get(parameter.name, parameter.metadata['range']))
        for parameter in others}
    return profile, NodeParameters(robot=name, **values)


def _declare(
        node: Node, parameter: Field[Any], default: Any,
        bounds: tuple[float, float] | None) -> Any:
    descriptor = ParameterDescriptor(
        description=parameter.metadata['description'],
        read_only=parameter.metadata['read_only'])
    if bounds:
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=bounds[0], to_value=bounds[1])]
        # Users write rate:=20, and rclpy would refuse an integer for a double parameter.
        descriptor.dynamic_typing = True
    try:
        value = node.declare_parameter(parameter.name, default, descriptor).value
    except ParameterException as error:
        allowed = f' It must be from {bounds[0]:g} to {bounds[1]:g}.' if bounds else ''
        raise UsageError(f'{escaped(error)}{allowed}') from None
    return _number(parameter.name, value, bounds) if bounds else value


def _number(name: str, value: Any, bounds: tuple[float, float]) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise UsageError(
            f'parameter {name} is {quoted(str(value), 60) if isinstance(value, str) else value}; '
            'it must be a number')
    if not bounds[0] <= value <= bounds[1]:
        raise UsageError(
            f'parameter {name} is {value}; it must be from {bounds[0]:g} to {bounds[1]:g}')
    return float(value)


def session_started(
        node: Node, title: str, profile: RobotProfile, names: RobotNames,
        parameters: NodeParameters, **about: Any) -> SessionStarted:
    """
    Return the first event of a session: the robot, its limits, topics, settings and versions.

    :param title: the name of the motion, for displays and reports
    :param profile: the kind of robot
    :param names: the names of the robot, before remapping
    :param parameters: the parameters of the node
    :param about: further fields of the event, set by the command
    """
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
        settings={**asdict(parameters), 'domain': node.context.get_domain_id(),
                  **{name: calibration.describe() for name, calibration in (
                      ('calibration', profile.calibration),
                      ('odometry_calibration', profile.odometry_calibration))
                     if calibration is not None}},
        versions=_versions(),
        **about)


def _versions() -> dict[str, str]:
    return {
        'kachaka_simple_control': installed_version(),
        'ROS': ros_distro(),
        'RMW': get_rmw_implementation_identifier(),
        'Python': platform.python_version(),
        'system': platform.platform(),
    }
