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
"""What every number of a motion has to be."""

from __future__ import annotations

import math
from numbers import Real

from kachaka_simple_control.motion.errors import InvalidMotionError


def require_number(name: str, value: object, unit: str) -> float:
    """
    Return a value that must be a number.

    :param name: what people call it
    :param value: the value
    :param unit: its unit
    :returns: the number; what is too large for one is infinite
    :raises InvalidMotionError: if it is none
    """
    # bool is a Real in Python, and move_robot(True, ...) is a mistake.
    if isinstance(value, bool) or not isinstance(value, (int, float, Real)):
        raise InvalidMotionError(f'{name} is {value!r}; it must be a number [{unit}]')
    try:
        return float(value)
    except OverflowError:  # a whole number may have any number of digits
        return -math.inf if value < 0.0 else math.inf


def require_finite(name: str, value: object, unit: str) -> float:
    """
    Return a value that must be a finite number.

    :param name: what people call it
    :param value: the value
    :param unit: its unit
    :returns: the number
    :raises InvalidMotionError: if it is none, or not finite
    """
    number = require_number(name, value, unit)
    if not math.isfinite(number):
        raise InvalidMotionError(f'{name} is {number} {unit}; it must be a finite number')
    return number


def require_duration(value: object) -> None:
    """
    Refuse what is no duration.

    :param value: the value [s]
    :raises InvalidMotionError: if it is no finite number, or negative
    """
    if require_finite('duration', value, 's') < 0.0:
        raise InvalidMotionError(f'duration is {value} s; it must be 0 s or longer')


def require_positive(name: str, value: object, unit: str) -> None:
    """
    Refuse what is not above zero; infinity is.

    :param name: what people call it
    :param value: the value
    :param unit: its unit
    :raises InvalidMotionError: if it is no number above zero
    """
    # Written so that NaN fails.
    if not require_number(name, value, unit) > 0.0:
        raise InvalidMotionError(f'{name} is {value} {unit}; it must be above 0 {unit}')


def require_speed(value: object, unit: str) -> None:
    """
    Refuse what is no speed for a goal.

    :param value: the value; None leaves the choice to the robot's limits
    :param unit: its unit
    :raises InvalidMotionError: if it is no finite number above zero
    """
    if value is None:
        return
    require_finite('speed', value, unit)
    require_positive('speed', value, unit)
