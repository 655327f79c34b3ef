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
"""Record the velocities that were really sent by hand as a motion of ``move`` steps."""

from __future__ import annotations

from collections.abc import Iterable

from kachaka_simple_control.console.folder import MAX_TEXT
from kachaka_simple_control.files.motion_file import dump
from kachaka_simple_control.motion.steps import Motion, Move

#: The bytes of the text without the steps, at most.
_HEAD = 1000


class Recording:
    """
    A recording that grows by segments; a segment is a velocity that was held for a time.

    :ivar is_full: whether a further segment would make the text too long; it then takes no more
    """

    def __init__(self) -> None:
        self.is_full = False
        self._steps: list[Move] = []
        self._size = _HEAD

    def add(self, segments: Iterable[tuple[float, float, float]]) -> None:
        """
        Append segments; one with the velocity of the segment before it is merged with that.

        :param segments: the linear velocity [m/s], the angular velocity [rad/s] and the duration
            [s] of each
        """
        for linear_x, angular_z, duration in segments:
            step = Move(linear_x, angular_z, duration)
            if self.is_full or not duration:
                continue
            if self._steps and self._steps[-1].velocity == step.velocity:
                held = self._steps[-1].duration + duration
                self._steps[-1] = Move(linear_x, angular_z, held)
                continue
            size = len(f'  - move: {{linear_x: {linear_x!r} m/s, angular_z: {angular_z!r} rad/s, '
                       f'duration: {duration!r} s}}') + 10
            if self._size + size > MAX_TEXT:
                self.is_full = True
                continue
            self._size += size
            self._steps.append(step)

    def motion(self, name: str, description: str = '') -> Motion | None:
        """Return the recorded motion, without rests at both ends; None if nothing was driven."""
        moving = [index for index, step in enumerate(self._steps) if not step.velocity.is_zero]
        if not moving:
            return None
        return Motion(name, tuple(self._steps[moving[0]:moving[-1] + 1]), description)

    def text(self, name: str, description: str = '') -> str:
        """Return the text of a motion file; empty if nothing was driven."""
        motion = self.motion(name, description)
        return '' if motion is None else dump(motion)
