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
"""The node's parameters, and the event that tells of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, Field, field, fields
from difflib import get_close_matches
from importlib import metadata
from itertools import pairwise
import os
import platform
import time
from typing import Any

from kachaka_simple_control.control.plan_runner import min_rate
from kachaka_simple_control.control.timing import MAX_RATE
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.escaping import escaped, quoted
from kachaka_simple_control.files.robot_profile import KACHAKA, RobotProfile
from kachaka_simple_control.ros.names import RobotNames
from kachaka_simple_control.telemetry.events import SessionStarted
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.utilities import get_rmw_implementation_identifier

#: What every node of rclpy has.
OF_ROS = ('use_sim_time', 'start_type_description_service')
QUALITIES = 'qos_overrides.'


def _setting(default: Any, description: str, lowest: float = 0.0, highest: float = 0.0) -> Any:
    return field(default=default, metadata={
        'description': description, 'range': (lowest, highest) if highest else None})


@dataclass(frozen=True)
class NodeParameters:
    """Every parameter of the node, fixed when the node is made."""

    robot: str = _setting(
        KACHAKA.name, 'Which robot: kachaka, turtlebot3, generic, or the path of a profile')
    robot_namespace: str = _setting(
        KACHAKA.namespace,
        'ROS namespace of the robot; prefixes its topics and its service. By default that of its '
        'profile')
    rate: float = _setting(
        10.0, 'How often a velocity is sent [Hz]', min_rate(KACHAKA.hold), MAX_RATE)
    robot_timeout: float = _setting(
        10.0, 'How long to wait for a robot before giving up [s]', 0.1, 3600.0)
    prime_time: float = _setting(
        0.5, 'How long zeros are sent to a robot just met, before it moves [s]', 0.0, 10.0)
    manual_control: bool = _setting(
        True, 'Switch the manual control of the robot on before the first velocity, and renew it')
    release_manual_control: bool = _setting(
        True, 'Give manual control back at the end, if this node switched it on')
    guardian: bool = _setting(
        True, 'Have a second process stop the robot if this one is killed, frozen or crashes')
    odometry_timeout: float = _setting(
        1.0, 'How long odometry may be silent in a run before it is given up [s]; 0: for ever',
        0.0, 60.0)
    allow_other_publishers: bool = _setting(
        False,
        'Drive even while somebody else sends velocities to the same robot; of two programs of '
        'this kind one drives all the same')
    summary: bool = _setting(
        False, 'Record what is sent and what odometry answers, for the table at the end')


def check_parameter_names(arguments: Sequence[str]) -> None:
    """
    Make sure that parameters of the command line are parameters of the node: ROS would not mind.

    :param arguments: what ROS is told, from ``--ros-args`` on
    :raises UsageError: if one is not
    """
    known = [*(setting.name for setting in fields(NodeParameters)), *OF_ROS]
    for option, assignment in pairwise(arguments):
        # Those for one node of several are written NODE:NAME:=VALUE.
        name, is_set, _ = assignment.partition(':=')
        if option not in ('-p', '--param') or not is_set or ':' in name:
            continue
        if name not in known and not name.startswith(QUALITIES):
            like = get_close_matches(name, known, 1)
            raise UsageError(
                f'there is no parameter {escaped(name, 60)}' + (
                    f'; did you mean {like[0]}?' if like else (
                        ': ' + ', '.join(setting.name for setting in fields(NodeParameters)))))


def declare_robot(node: Node) -> str:
    """
    Declare the parameter that says which robot it is, and read it; others depend on it.

    :param node: whose parameter it is
    :returns: the name or the file of a robot's profile
    :raises UsageError: if it is no text
    """
    (setting,) = (setting for setting in fields(NodeParameters) if setting.name == 'robot')
    return str(_declare_one(node, setting, setting.default, None))


def declare_parameters(node: Node, profile: RobotProfile) -> NodeParameters:
    """
    Declare the other parameters on a node, and read them.

    They are read-only: a drive keeps the settings that it was planned with.

    :param node: whose parameters they are
    :param profile: the robot, of which some defaults and bounds are taken
    :returns: the values of all
    :raises UsageError: if a value has the wrong type or is out of range
    """
    defaults = {'robot_namespace': profile.namespace}
    bounds = {'rate': (min_rate(profile.hold), MAX_RATE)}
    values = {
        setting.name: _declare_one(
            node, setting, defaults.get(setting.name, setting.default),
            bounds.get(setting.name, setting.metadata['range']))
        for setting in fields(NodeParameters) if setting.name != 'robot'}
    return NodeParameters(robot=str(node.get_parameter('robot').value), **values)


def _declare_one(
        node: Node, setting: Field[Any], default: Any,
        bounds: tuple[float, float] | None) -> Any:
    descriptor = ParameterDescriptor(description=setting.metadata['description'], read_only=True)
    if bounds:
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=bounds[0], to_value=bounds[1])]
        # People write rate:=20; rclpy would refuse an integer here.
        descriptor.dynamic_typing = True
    try:
        value = node.declare_parameter(setting.name, default, descriptor).value
    except ParameterException as error:
        allowed = f' It must be from {bounds[0]:g} to {bounds[1]:g}.' if bounds else ''
        raise UsageError(f'{escaped(error)}{allowed}') from None
    return _number(setting.name, value, bounds) if bounds else value


def _number(name: str, value: Any, bounds: tuple[float, float]) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise UsageError(
            f'parameter {name} is {quoted(str(value), 60) if isinstance(value, str) else value}; '
            'it must be a number')
    if not bounds[0] <= value <= bounds[1]:
        raise UsageError(
            f'parameter {name} is {value}; it must be from {bounds[0]:g} to {bounds[1]:g}')
    return float(value)


PACKAGE = 'kachaka_simple_control'


def session_started(
        node: Node, title: str, profile: RobotProfile, names: RobotNames,
        settings: NodeParameters) -> SessionStarted:
    """
    Return what there is to tell when a program begins.

    :param node: the node that drives
    :param title: what people call what it drives
    :param profile: the kind of robot
    :param names: the names of this one, before remapping
    :param settings: the parameters of the node
    :returns: the first event
    """
    return SessionStarted(
        title=title,
        robot=profile.name,
        limits=profile.limits,
        command_timeout=profile.hold,
        epoch=time.time() - time.monotonic(),
        velocity_topic=node.resolve_topic_name(names.velocity),
        odometry_topic=node.resolve_topic_name(names.odometry) if names.odometry else None,
        message_type=profile.message_type,
        frame=profile.frame,
        footprint=profile.footprint,
        settings={**asdict(settings), 'domain': node.context.get_domain_id()},
        versions=versions())


def versions() -> dict[str, str]:
    """
    Return what the program stands on.

    :returns: versions by name; 'unknown' where nobody tells
    """
    try:
        own = metadata.version(PACKAGE)
    except metadata.PackageNotFoundError:
        own = 'unknown'
    return {
        PACKAGE: own,
        'ROS': os.environ.get('ROS_DISTRO', 'unknown'),
        'RMW': get_rmw_implementation_identifier(),
        'Python': platform.python_version(),
        'system': platform.platform(),
    }
