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
"""
The ROS parameters of the node, with their defaults, descriptions and ranges; without ROS.

Tested by test/ros/test_parameters.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from difflib import get_close_matches
from itertools import pairwise
from typing import Any

from kachaka_simple_control.control.end_check import EndTolerance
from kachaka_simple_control.control.speed_factor import MIN_SPEED_FACTOR
from kachaka_simple_control.control.timing import MAX_RATE, min_rate
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.text import escaped

#: Parameters of every rclpy node.
ROS_PARAMETERS = ('use_sim_time', 'start_type_description_service')
QOS_OVERRIDES_PREFIX = 'qos_overrides.'


def _parameter(
        default: Any, description: str, lowest: float = 0.0, highest: float = 0.0,
        unit: str = '', read_only: bool = True,
        parse: Callable[[str], object] | None = None) -> Any:
    return field(default=default, metadata={
        'description': description, 'range': (lowest, highest) if highest else None,
        'unit': unit, 'read_only': read_only, 'parse': parse})


@dataclass(frozen=True)
class NodeParameters:
    """The values of the node's ROS parameters at its start; all but ``speed_factor`` stay."""

    robot: str = _parameter(
        KACHAKA.name,
        'Which robot: kachaka, create3, turtlebot3, turtlesim, generic, or the path of a profile')
    robot_namespace: str = _parameter(
        KACHAKA.namespace,
        'ROS namespace of the robot; prefixes its topics and its service. By default that of its '
        'profile')
    rate: float = _parameter(
        10.0, 'How often a velocity is sent [Hz]', min_rate(KACHAKA.command_timeout), MAX_RATE,
        'Hz')
    robot_timeout: float = _parameter(
        10.0, 'How long to wait for a robot before giving up [s]', 0.1, 3600.0, 's')
    prime_time: float = _parameter(
        0.5, 'How long zeros are sent after the robot is matched, before it moves [s]', 0.0, 10.0,
        's')
    manual_control: bool = _parameter(
        True, 'Switch the manual control of the robot on before the first velocity, and renew it')
    release_manual_control: bool = _parameter(
        True, 'Release manual control at the end, if this node switched it on')
    guardian: bool = _parameter(
        True, 'Have a second process stop the robot if this one is killed, frozen or crashes')
    odometry_timeout: float = _parameter(
        1.0, 'How long odometry may be silent before a drive ends [s]; 0: no limit',
        0.0, 60.0, 's')
    allow_other_publishers: bool = _parameter(
        False,
        'Drive even while another program sends velocities to the same robot; two instances of '
        'this program still exclude each other')
    pause_timeout: float = _parameter(
        600.0, 'How long a drive may be paused before it ends [s]', 1.0, 86_400.0, 's')
    speed_factor: float = _parameter(
        1.0, 'Speed relative to the plan, 1: as planned; can be changed while the robot drives',
        MIN_SPEED_FACTOR, 1.0, read_only=False)
    closed_loop: bool = _parameter(
        False, 'Correct motions by odometry; the delay of the robot must be calibrated')
    watch: bool = _parameter(
        False, 'Hold before obstacles that the laser sees on the planned path; no safety device')
    corners: float = _parameter(
        0.0, 'How far a motion may pass its corners, to drive through them without a stop [m]; '
        '0: as the motion says', 0.0, 1.0, 'm')
    within: str = _parameter(
        '', 'How far from its plan a drive may end by odometry, as in 2cm or 2cm,3deg; farther is '
        'a fault. Empty: a warning beyond 2 cm or 3 degrees', parse=EndTolerance.parse)
    summary: bool = _parameter(
        False, 'Record what is sent and what odometry reports, for the table at the end')


def require_no_parameter(options: Mapping[str, Any]) -> None:
    """
    Check that the options of a node in a program are not parameters.

    :raises UsageError: if one of them has the name of a parameter
    """
    for parameter in fields(NodeParameters):
        if parameter.name in options:
            name, value = parameter.name, escaped(repr(options[parameter.name]), 60)
            raise UsageError(
                f'{name} is a parameter of the node: write KachakaSimpleControl({{{name!r}: '
                f'{value}}}), or use parameter_overrides')


def parameter_arguments(arguments: Sequence[str]) -> dict[str, str]:
    """
    Return the parameters of this node that the command line sets with ``-p NAME:=VALUE``.

    :raises UsageError: if the node has no such parameter, which ROS itself would ignore
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
    Refuse ROS arguments without effect on a plan: all but ``-p``, and ``speed_factor``.

    :raises UsageError: if there is one
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
