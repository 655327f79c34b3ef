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
"""Say what the obstacle watch watches, and find what it cannot."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
import math

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.robot_profile import Laser, RobotProfile
from kachaka_simple_control.motion.step_base import Step
from kachaka_simple_control.motion.steps import Motion
from kachaka_simple_control.motion.units import format_number


def require_watchable(motion: Motion, robot: RobotProfile) -> None:
    """
    Check that the obstacle watch can watch a motion.

    :raises InvalidMotionError: if the laser of the robot does not see where a step drives
    :raises UsageError: if the robot has no laser
    """
    for error in watch_errors(motion, robot.watching_laser(), robot.name):
        raise error


def watch_text(laser: Laser) -> str:
    """Return what the obstacle watch does, as text for a plan."""
    view = 'all around' if laser.sees_behind else (
        f'{format_number(math.degrees(laser.view))} deg around ahead')
    return (f'Watched: the laser sees {view}; holds before what is nearer than '
            f'{format_number(100.0 * laser.margin)} cm to the outline; no safety device')


def watch_errors(motion: Motion, laser: Laser, robot: str) -> list[InvalidMotionError]:
    """
    Return an error for each step that drives where a laser does not see: backwards.

    :param robot: its name, for the errors
    """
    if laser.sees_behind:
        return []
    return [InvalidMotionError(
        f'driven backwards, where the laser of {robot} does not see: drive forward, or leave '
        'watch out', path) for path in _backward_steps(motion.steps, '')]


def _backward_steps(steps: Iterable[Step], prefix: str) -> Iterator[str]:
    """Yield the place of each step that drives backwards, as in ``steps[2].forward``."""
    for index, step in enumerate(steps):
        place = f'{prefix}steps[{index}].{step.keyword}'
        if (block := step.block()) is not None:
            times, parts = block
            if times:
                yield from _backward_steps(parts, f'{place}.')
        # A step that depends on the pose at its start drives forwards.
        elif not step.is_placed and any(segment.length < 0.0 for segment in step.path()):
            yield place
