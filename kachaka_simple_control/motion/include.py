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
The step of a motion that drives another motion.

Tested by test/files/test_motion_reader.py.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.path_segment import PathSegment
from kachaka_simple_control.motion.placing import leaves, Placer
from kachaka_simple_control.motion.step_base import (
    in_file,
    nesting_of,
    Step,
    step_tuple,
    StepList,
    Text,
)
from kachaka_simple_control.motion.steps import MAX_INCLUDES
from kachaka_simple_control.motion.units import TOLERANCE


@dataclass(frozen=True)
class Include(Step):
    """
    Drive another motion from here on.

    Its points and headings are seen from where this step begins.

    :param steps: its steps, in order; a list is converted to a tuple
    :param name: its name, to show
    :param corners: how far the robot may pass its corners [m]; None: as the motion says that
        includes it
    """

    form = 'a motion, as in ./mine.yaml, or {motion: square, with: {side: 1 m}}'
    synonyms = ('import', 'call', 'motion', 'file', 'run')
    has_frame = True
    steps: tuple[Step, ...] = field(metadata=in_file(
        StepList(), 'What to do, in order, instead of a motion from a file.',
        [{'forward': '0.5 m'}]))
    name: str | None = field(default=None, metadata=in_file(
        Text(), 'What people call the steps.', 'corner'))
    corners: float | None = field(default=None, metadata=in_file(
        TOLERANCE, 'How far the corners of the steps may be passed.', '5 cm'))

    def __post_init__(self) -> None:
        """Check each value, and how deeply includes are nested."""
        object.__setattr__(self, 'steps', step_tuple(self.steps))
        super().__post_init__()
        repeats, includes = nesting_of(self.steps)
        object.__setattr__(self, 'nesting', (repeats, includes + 1))
        if includes + 1 > MAX_INCLUDES:
            raise InvalidMotionError(
                f'it includes motions {includes + 1} deep; at most {MAX_INCLUDES} may be nested')

    def path(self) -> tuple[PathSegment, ...]:
        """Return the path segments of the steps in driving order."""
        parts = Placer(0.0, _accept, _accept).parts(self.steps, '')
        return tuple(segment for leaf in leaves(parts) for segment in leaf.step.path())

    def describe(self) -> str:
        """Return the name of the motion as text."""
        return f'include {self.name or "steps"}'

    def block(self) -> tuple[int, tuple[Step, ...]]:
        """Return 1 and the steps."""
        return 1, self.steps

    def with_stops(self) -> Include:
        """Return this step without a tolerance of corners, also of its steps."""
        return replace(self, corners=None, steps=tuple(step.with_stops() for step in self.steps))


def _accept(*_: object) -> None:
    """Leave out a point that the robot cannot drive to."""
