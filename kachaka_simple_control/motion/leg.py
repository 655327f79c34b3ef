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
"""The steps of a motion under limits, with their repeats not yet written out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from kachaka_simple_control.motion.course import Course
from kachaka_simple_control.motion.steps import Step


# Compared by identity: whatever is repeated is one object.
@dataclass(frozen=True, eq=False)
class Leg:
    """
    A step at its place in a motion, under limits.

    :param path: its place, as in ``steps[3].repeat.steps[0]``
    :param step: the step; never a repeat
    :param course: what it comes to
    """

    path: str
    step: Step
    course: Course


@dataclass(frozen=True, eq=False)
class Round:
    """
    Some legs that are driven several times.

    :param times: how often
    :param parts: what is driven each time
    """

    times: int
    parts: Sequence[Part]


#: What a motion is driven as.
Part = Leg | Round


def total(parts: Sequence[Part], measure: Callable[[Leg], float]) -> float:
    """
    Add something up over all legs, looking at each but once.

    :param parts: what is driven
    :param measure: what to add
    :returns: the sum, all repeats counted
    """
    return sum(
        measure(part) if isinstance(part, Leg) else part.times * total(part.parts, measure)
        for part in parts)


def written_out(parts: Sequence[Part]) -> list[Leg]:
    """
    Return the legs one after the other.

    :param parts: what is driven
    :returns: every leg as often as it is driven
    """
    legs: list[Leg] = []
    for part in parts:
        if isinstance(part, Leg):
            legs.append(part)
        else:
            legs += written_out(part.parts) * part.times
    return legs
