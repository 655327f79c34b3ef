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
"""Write the files of the fleets that are measured; their robots stand far apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math
from pathlib import Path

#: The distance between two robots, which drive less than a metre away [m].
SPACING = 3.0
#: A movement at one velocity, as in the benchmark of one robot [m/s, s].
VELOCITY, MOVE_TIME = 0.1, 1.0
#: A drive that something ends [s].
LONG = 120.0


def names_of(count: int, prefix: str = 'r') -> list[str]:
    """Return names of robots."""
    return [f'{prefix}{number:03}' for number in range(1, count + 1)]


def write_fleet(
        file: Path, names: Sequence[str], motion: str, rate: float, on_fault: str = 'stop_all',
        profiles: Mapping[str, str] | None = None) -> Path:
    """
    Write the file of a fleet whose robots all drive one motion; return the file.

    :param profiles: the profile of each robot that is no plain Kachaka
    """
    profiles, width = profiles or {}, math.ceil(math.sqrt(len(names)))
    robots = []
    for number, name in enumerate(names):
        row, column = divmod(number, width)
        profile = f', robot: {profiles[name]}' if name in profiles else ''
        robots.append(
            f'  {name}: {{motion: {motion}, rate: {rate:g} Hz{profile}, '
            f'start: {{x: {column * SPACING:g} m, y: {row * SPACING:g} m}}}}')
    file.write_text('\n'.join([f'on_fault: {on_fault}', 'robots:', *robots, '']))
    return file


def write_moves(folder: Path, count: int) -> str:
    """Write a motion of ``count`` movements to and fro; return its path as a fleet writes it."""
    steps = [_move(-VELOCITY if number % 2 else VELOCITY, MOVE_TIME) for number in range(count)]
    return _write_motion(folder / f'moves_{count}.yaml', steps)


def write_long(folder: Path) -> str:
    """Write a motion of one long movement; return its path as a fleet writes it."""
    return _write_motion(folder / 'long.yaml', [_move(VELOCITY, LONG)])


def write_corner(folder: Path) -> str:
    """Write a motion around one corner of the square; return its path as a fleet writes it."""
    return _write_motion(folder / 'corner.yaml', [
        '  - forward: 0.5 m', '  - turn: 90 deg', '  - forward: 0.5 m'])


def write_profiles(folder: Path, names: Sequence[str]) -> dict[str, str]:
    """Write a profile for each robot with limits of its own; return the paths by name."""
    paths = {}
    for number, name in enumerate(names):
        part = number / max(1, len(names) - 1)
        (folder / f'{name}.yaml').write_text(
            'extends: kachaka\n'
            'limits:\n'
            f'  max_linear_velocity: {0.3 - 0.12 * part:.3f} m/s\n'
            f'  max_linear_acceleration: {0.5 - 0.3 * part:.3f} m/s^2\n'
            f'  max_angular_velocity: {1.2 - 0.5 * part:.3f} rad/s\n')
        paths[name] = f'./{name}.yaml'
    return paths


def write_blind_profile(folder: Path) -> str:
    """Write the profile of a robot without odometry; return its path as a fleet writes it."""
    (folder / 'blind.yaml').write_text('extends: kachaka\nodometry_topic: null\n')
    return './blind.yaml'


def _move(velocity: float, duration: float) -> str:
    return (f'  - move: {{linear_x: {velocity:g} m/s, angular_z: 0 rad/s, '
            f'duration: {duration:g} s}}')


def _write_motion(file: Path, steps: Sequence[str]) -> str:
    file.write_text('\n'.join(['steps:', *steps, '']))
    return f'./{file.name}'
