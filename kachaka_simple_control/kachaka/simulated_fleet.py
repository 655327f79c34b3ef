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
"""Which simulated robots a fleet file brings, for ``kachaka_bridge --robots``; without ROS."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
import json

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.fleet_file import FleetFile
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.motion.geometry import Pose

#: A simulated robot: where it is at first on the floor, and its errors.
SimulatedStart = tuple[Pose, SimulationParameters]


def simulated_robots(fleet: FleetFile) -> dict[str, SimulatedStart]:
    """
    Return the simulated robots of a fleet, by their names.

    :raises FleetFileError: if a figure of a simulation is out of its range, or a robot is no
        Kachaka; a line for each
    """
    robots: dict[str, SimulatedStart] = {}
    problems: dict[str, str] = {}
    for robot in fleet.robots:
        path = f'robots.{robot.name}'
        if not robot.profile.is_kachaka:
            problems[path] = (
                f'this robot is a {robot.profile.name}; only a kachaka can be simulated')
            continue
        try:
            robots[robot.name] = robot.start, SimulationParameters(**robot.simulation)
        except InvalidMotionError as error:
            problems[f'{path}.simulation.{error.name}'] = error.message
    if problems:
        raise fleet.error(problems)
    return robots


def robots_text(robots: Mapping[str, SimulatedStart]) -> str:
    """
    Return the text of a fleet file with these simulated robots, for ``--robots``.

    A fleet needs motions, so each has one that is not driven.
    """
    lines = ['robots:']
    for name, (pose, parameters) in robots.items():
        start = {'x': _number(pose.x, 'm'), 'y': _number(pose.y, 'm'),
                 'heading': _number(pose.theta, 'rad')}
        simulation = {
            figure.name: _number(value, figure.metadata['unit'])
            for figure in fields(parameters)
            if (value := getattr(parameters, figure.name)) != figure.default}
        # In quotes: without them, a robot named `yes` would be called true.
        lines.append(f'  {json.dumps(name)}: {{motion: straight, start: {_mapping(start)}, '
                     f'simulation: {_mapping(simulation)}}}')
    return '\n'.join([*lines, ''])


def _mapping(values: Mapping[str, str]) -> str:
    return f'{{{", ".join(f"{key}: {value}" for key, value in values.items())}}}'


def _number(value: float, unit: str) -> str:
    mantissa, *exponent = repr(float(value)).partition('e')
    if '.' not in mantissa:
        mantissa += '.0'  # for YAML, 1e-05 is a text
    return f'{mantissa}{"".join(exponent)} {unit}'.rstrip()
