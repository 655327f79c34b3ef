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
"""Which robot and rate: an option or ``-p`` wins over the motion's file, that over defaults."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import TYPE_CHECKING

from kachaka_simple_control.control.plan_runner import min_rate
from kachaka_simple_control.control.timing import MAX_RATE
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.escaping import escaped, quoted
from kachaka_simple_control.files.robot_profile import find_robot, RobotProfile
from kachaka_simple_control.motion.units import require_number
from kachaka_simple_control.ros.node_parameters import NodeParameters, parameter_arguments

if TYPE_CHECKING:
    from kachaka_simple_control.cli import Options
    from kachaka_simple_control.files.motion_file import MotionFile

#: What an option, ``-p`` and a motion's file can all say.
NAMES = ('robot', 'rate')


@dataclass(frozen=True)
class Settings:
    """
    What a motion is planned for.

    :param robot: name or file of the robot's profile
    :param rate: how often a velocity is sent [Hz]
    :param profile: the profile
    """

    robot: str
    rate: float
    profile: RobotProfile


def choose_settings(options: Options, motion_file: MotionFile | None) -> Settings:
    """
    Choose robot and rate: option or ``-p``, else the motion's file, else the parameters' defaults.

    :param options: of the command
    :param motion_file: the motion; None for the lesson
    :raises UsageError: if an option and ``-p`` differ, or a value is invalid
    :raises MotionFileError: if the rate of the file cannot be used
    """
    given = _given(options)
    values = {'robot': NodeParameters.robot, 'rate': NodeParameters.rate,
              **_in_file(motion_file), **given}
    robot, rate = str(values['robot']), require_number('rate', values['rate'], 'Hz')
    profile = find_robot(robot)
    try:
        check_rate(rate, profile)
    except UsageError as error:
        if motion_file is None or motion_file.rate is None or 'rate' in given:
            raise
        raise motion_file.error_at('rate', str(error)) from None
    return Settings(robot, rate, profile)


def check_rate(rate: float, profile: RobotProfile) -> None:
    """
    Check that a robot can be driven at a rate.

    :param rate: how often a velocity is sent [Hz]
    :raises UsageError: if it cannot
    """
    lowest = min_rate(profile.command_timeout)
    if not lowest <= rate <= MAX_RATE:
        raise UsageError(
            f'rate is {rate:g} Hz; for {profile.name} it must be from {lowest:g} to '
            f'{MAX_RATE:g} Hz')


def describe_overrides(
        options: Options, motion_file: MotionFile | None, robot: str, rate: float) -> list[str]:
    """
    Return a line for each value of the motion's file that something else has overridden.

    :param robot: the name or file of the robot's profile that is used
    :param rate: the rate that is used [Hz]
    """
    values: dict[str, object] = {'robot': robot, 'rate': rate}
    lines = []
    for name, said in _in_file(motion_file).items():
        if values[name] == said:
            continue
        source = f'--{name}' if getattr(options, name) is not None else f'parameter {name}'
        unit = ' Hz' if name == 'rate' else ''
        lines.append(
            f'{name} is {_text(values[name])}{unit} by {source}, not {_text(said)}{unit} as in '
            f'{escaped(motion_file.source if motion_file else "")}')
    return lines


def _in_file(motion_file: MotionFile | None) -> dict[str, object]:
    """Return what the motion's file says of robot and rate."""
    values = {name: getattr(motion_file, name, None) for name in NAMES}
    return {name: value for name, value in values.items() if value is not None}


def _given(options: Options) -> dict[str, object]:
    """Return what the command line says of robot and rate."""
    values: dict[str, object] = {}
    parameters = parameter_arguments(options.ros_arguments)
    for name in NAMES:
        option, parameter = getattr(options, name), None
        if name in parameters:
            text = parameters[name].strip().strip('\'"')
            parameter = text if name == 'robot' else _number(name, text)
        if option is not None and parameter is not None and option != parameter:
            raise UsageError(
                f'--{name} {_text(option)} and -p {name}:={_text(parameter)} differ: give one')
        value = option if option is not None else parameter
        if value is not None:
            values[name] = value
    return values


def chosen_speed(options: Options) -> float | None:
    """
    Return the speed factor of the option ``--speed``; None if it is not given.

    :raises UsageError: if the parameter ``speed_factor`` says something else
    """
    text = parameter_arguments(options.ros_arguments).get('speed_factor')
    if options.speed is not None and text is not None and _number('speed_factor', text) != (
            options.speed):
        raise UsageError(
            f'--speed {options.speed:g} and -p speed_factor:={escaped(text)} differ: give one')
    return options.speed


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise UsageError(f'parameter {name} is {quoted(text, 60)}; it must be a number') from None


def _text(value: object) -> str:
    return f'{value:g}' if isinstance(value, float) and math.isfinite(value) else escaped(value)
