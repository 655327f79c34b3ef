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
Slow a motion down: the same path, with a time axis that is stretched.

Every value of a step changes by the power of seconds in its unit.  So the plan of a slowed motion,
under limits that are slowed likewise, has the same path at each time divided by the factor.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from kachaka_simple_control.motion.step_base import Step, StepList
from kachaka_simple_control.motion.steps import Motion
from kachaka_simple_control.motion.units import Quantity, require_between

#: The smallest factor; a test compares it with the smallest speed factor of a drive.
MIN_FACTOR = 0.01


def require_factor(factor: float) -> None:
    """
    Check the factor of a time scale.

    :raises InvalidMotionError: if it is not from 0.01 to 1
    """
    require_between('speed', factor, MIN_FACTOR, 1.0)


def slowed(motion: Motion, factor: float) -> Motion:
    """
    Return a motion that drives the path of another one slower; its plan needs ``Limits.slowed``.

    :param factor: the speed relative to that of the motion, from 0.01 to 1
    :raises InvalidMotionError: if the factor is out of range, or a value becomes infinite or 0
    """
    require_factor(factor)
    if factor == 1.0:
        return motion
    return replace(motion, steps=tuple(_slowed(step, factor) for step in motion.steps))


def _slowed(step: Step, factor: float) -> Step:
    values: dict[str, Any] = {}
    for name, part in step.file_fields().items():
        value = getattr(step, name)
        if isinstance(part.kind, StepList):
            values[name] = tuple(_slowed(inner, factor) for inner in value)
        elif isinstance(part.kind, Quantity) and part.kind.time_power and value is not None:
            values[name] = part.kind.slowed(value, factor)
    return replace(step, **values) if values else step  # type: ignore[type-var]
