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
"""Choose robot, rate, control, watch and corners of a motion: option or ``-p``, file, default."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
import math
from typing import TYPE_CHECKING

from kachaka_simple_control.control.timing import rate_problem
from kachaka_simple_control.errors import InvalidMotionError, UsageError
from kachaka_simple_control.files.document import FileError
from kachaka_simple_control.files.robot_profile import find_robot, RobotProfile
from kachaka_simple_control.motion.units import number_advice, require_number, TOLERANCE
from kachaka_simple_control.ros.node_parameters import NodeParameters, parameter_arguments
from kachaka_simple_control.text import escaped, quoted

if TYPE_CHECKING:
    from kachaka_simple_control.commands.cli import Options
    from kachaka_simple_control.files.motion_file import MotionFile
    from kachaka_simple_control.motion.drive_order import DriveOrder

#: The settings that an option, a ROS parameter (``-p``) or a motion's file can set.
NAMES = ('robot', 'rate', 'closed_loop', 'watch', 'corners')
#: The units of the settings that have one.
UNITS = {'rate': 'Hz', 'corners': 'm'}


@dataclass(frozen=True)
class Settings:
    """
    The robot, the message rate and the kind of control for which a motion is planned.

    :param watch: whether the robot is held before obstacles
    :param corners: how far the robot may pass the corners between steps [m]; 0 to stop there
    """

    robot: str
    rate: float
    profile: RobotProfile
    closed_loop: bool = False
    corners: float = 0.0
    watch: bool = False


def choose_settings(options: Options, motion_file: MotionFile | None) -> Settings:
    """
    Choose the robot, the message rate, the control, the watch and the corners of a motion.

    :param motion_file: None for the lesson
    :raises UsageError: if an option and a ROS parameter differ, a value is invalid, or the robot
        does not support closed-loop control, or has no laser for a watch
    :raises MotionFileError: if the file's robot is unknown, or its rate is out of range
    """
    given = _given(options)
    values = {'robot': NodeParameters.robot, 'rate': NodeParameters.rate,
              'closed_loop': NodeParameters.closed_loop, 'watch': NodeParameters.watch,
              'corners': NodeParameters.corners, **in_file(motion_file), **given}
    robot, rate = str(values['robot']), require_number('rate', values['rate'], 'Hz')
    profile = _find_profile(robot, None if 'robot' in given else motion_file)
    if text := rate_problem(rate, profile.command_timeout, profile.name):
        if motion_file is None or motion_file.rate is None or 'rate' in given:
            raise UsageError(f'rate is {text}')
        raise motion_file.error_at('rate', text)
    closed_loop = bool(values['closed_loop'])
    if closed_loop:
        profile.feedback_delay()
    watch = bool(values['watch'])
    if watch:
        profile.watching_laser()
    corners = require_number('corners', values['corners'], 'm')
    return Settings(robot, rate, profile, closed_loop, corners, watch)


def _find_profile(robot: str, motion_file: MotionFile | None) -> RobotProfile:
    """
    Read the profile of a robot; an unknown robot is refused with the line of a motion's file.

    :param motion_file: the motion's file; None if the robot is not from there
    """
    try:
        return find_robot(robot)
    except FileError as error:
        # An error in the profile has the line in the profile.
        if motion_file is None or motion_file.robot is None or error.problems[0].line is not None:
            raise
        raise motion_file.error_at('robot', str(error)) from None


def order_of(
        options: Options, motion_file: MotionFile, used: Settings | NodeParameters,
        profile: RobotProfile) -> DriveOrder:
    """
    Return what to drive: a motion, and what options, ROS parameters and its file say of it.

    :param used: the settings that were chosen; with a node, those of its ROS parameters
    :raises MotionFileError: if the robot cannot drive it, in a closed loop with a share for
        corrections, or a step cannot be watched; a line for each problem
    """
    motion = replace(motion_file.motion, corners=used.corners)
    if _given(options).get('corners') == 0.0:
        motion = motion.with_stops()
    return replace(motion_file, motion=motion).order(
        profile, used.rate, used.closed_loop, watch=used.watch)


def describe_overrides(
        options: Options, motion_file: MotionFile | None,
        used: Settings | NodeParameters) -> list[str]:
    """Return a line, with both values, for each setting of the file that is overridden."""
    lines = []
    for name, said in in_file(motion_file).items():
        value = getattr(used, name)
        if value == said:
            continue
        source = f'parameter {name}'
        if getattr(options, name) is not None:
            source = _option(name, value).partition(' ')[0]
        unit = f' {UNITS[name]}' if name in UNITS else ''
        lines.append(
            f'{name} is {_text(value)}{unit} by {source}, not {_text(said)}{unit} as in '
            f'{escaped(motion_file.source if motion_file else "")}')
    return lines


def in_file(motion_file: MotionFile | None) -> dict[str, object]:
    """Return the values of all these settings that a motion's file contains."""
    values = {name: getattr(motion_file, name, None) for name in NAMES}
    return {name: value for name, value in values.items() if value is not None}


def _given(options: Options) -> dict[str, object]:
    """
    Return the values of all these settings by option or ``-p``.

    :raises UsageError: if an option and a ROS parameter differ, or a value is invalid
    """
    values = {name: option for name in NAMES if (option := getattr(options, name)) is not None}
    parameters = parameter_arguments(options.ros_arguments)
    for name in NAMES:
        if name in parameters:
            parameter = _READERS[name](name, parameters[name].strip().strip('\'"'))
            if name in values and values[name] != parameter:
                raise UsageError(f'{_option(name, values[name])} and -p {name}:='
                                 f'{_text(parameter)} differ: give one')
            values[name] = parameter
    return values


def chosen_speed(options: Options) -> float | None:
    """
    Return the value of ``--speed`` as a fraction of the planned speed; None if not given.

    :raises UsageError: if the ROS parameter ``speed_factor`` has a different value
    """
    speed = options.speed
    text = parameter_arguments(options.ros_arguments).get('speed_factor')
    if speed is not None and text is not None and _number('speed_factor', text) != speed:
        raise UsageError(
            f'--speed {100.0 * speed:g}% and -p speed_factor:={escaped(text)} differ: give one')
    return speed


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        advice = number_advice(text, UNITS.get(name, ''))
        raise UsageError(f'parameter {name} is {quoted(text, 60)}; {advice}') from None


def _tolerance(name: str, text: str) -> float:
    tolerance = _number(name, text)
    try:
        TOLERANCE.require(name, tolerance)
    except InvalidMotionError as error:
        raise UsageError(f'parameter {error}') from None
    return tolerance


def _boolean(name: str, text: str) -> bool:
    # The words that ROS accepts for a boolean.
    for value, words in ((True, ('true', 'yes', 'on', 'y')), (False, ('false', 'no', 'off', 'n'))):
        if text.lower() in words:
            return value
    raise UsageError(f'parameter {name} is {quoted(text, 60)}; it must be true or false')


#: The functions that convert the text of a parameter to its value.
_READERS: dict[str, Callable[[str, str], object]] = {
    'robot': lambda _, text: text, 'rate': _number, 'closed_loop': _boolean,
    'watch': _boolean, 'corners': _tolerance}


def _option(name: str, value: object) -> str:
    """Return a setting as an option of the command line, for example ``--rate 50``."""
    word = name.replace('_', '-')
    if isinstance(value, bool):
        return f'--{word}' if value else f'--no-{word}'
    # The option --corners needs a unit; --rate has none.
    return f'--{word} {_text(value)}{"m" if name == "corners" else ""}'


def _text(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f'{value:g}' if isinstance(value, float) and math.isfinite(value) else escaped(value)
