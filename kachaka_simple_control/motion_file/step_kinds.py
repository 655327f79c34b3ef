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
"""The kinds of steps in a file, and the quantities they are made of."""

from __future__ import annotations

from dataclasses import dataclass

from kachaka_simple_control.motion.steps import Arc, Forward, Move, Turn, Wait
from kachaka_simple_control.motion_file.units import (
    ANGLE,
    ANGULAR_VELOCITY,
    LENGTH,
    LINEAR_VELOCITY,
    Quantity,
    SPEED,
    TIME,
    TURNING_SPEED,
)

#: A step that has no steps in it.
Simple = Move | Forward | Turn | Arc | Wait


@dataclass(frozen=True)
class Kind:
    """
    A kind of step.

    :param make: its class
    :param quantities: its fields, in the order of the class, and what each is
    :param has_short_form: whether its first field alone may stand for it, as in ``wait: 2 s``
    """

    make: type[Simple]
    quantities: dict[str, Quantity]
    has_short_form: bool = False

    @property
    def first(self) -> str:
        """Return the name of the first field."""
        return next(iter(self.quantities))


#: By the word that stands for them in a file; ``repeat``, which has steps in it, is apart.
KINDS = {
    'move': Kind(Move, {
        'linear_x': LINEAR_VELOCITY, 'angular_z': ANGULAR_VELOCITY, 'duration': TIME}),
    'forward': Kind(Forward, {'distance': LENGTH, 'speed': SPEED}, has_short_form=True),
    'turn': Kind(Turn, {'angle': ANGLE, 'speed': TURNING_SPEED}, has_short_form=True),
    'arc': Kind(Arc, {'radius': LENGTH, 'angle': ANGLE, 'speed': SPEED}),
    'wait': Kind(Wait, {'duration': TIME}, has_short_form=True),
}
REPEAT = 'repeat'
