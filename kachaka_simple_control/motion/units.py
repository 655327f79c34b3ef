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
"""Quantities as people write them, ``0.5 m`` or ``90 deg``, and as the program reckons."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
import math
import re

from kachaka_simple_control.escaping import quoted

#: A number without its sign.  A text matches in one way only, or a long one would take hours.
DIGITS = r'([0-9]+([.][0-9]*)?|[.][0-9]+)([eE][-+]?[0-9]+)?'
_PARTS = re.compile(f'(?P<number>[-+]?{DIGITS}) *(?P<unit>.*)', re.DOTALL)
_CLOCK = re.compile('[0-9]*:[0-9]+')


class UnitError(ValueError):
    """A text is no quantity of the kind asked for; the text says why, and what is."""


class SignRule(Enum):
    """Which numbers a quantity may be."""

    ANY = 'any'
    NOT_NEGATIVE = 'zero or more'
    POSITIVE = 'above zero'


@dataclass(frozen=True)
class Quantity:
    """
    A kind of quantity, and the units it may be written in.

    :param name: what people call it, with its article
    :param units: each unit, as a fraction of the SI unit: a numerator and a denominator, because
        57 / 100 is 0.57 and 57 * 0.01 is not; the first is the SI unit itself
    :param example: one, written out
    :param sign: whether it may be negative, may be zero but not negative, or neither
    :param largest: the largest there may be, in the SI unit
    """

    name: str
    units: dict[str, tuple[float, float]]
    example: str
    sign: SignRule = SignRule.POSITIVE
    largest: float = math.inf

    @property
    def unit(self) -> str:
        """Return the SI unit, which a bare number is in."""
        return next(iter(self.units))

    @property
    def pattern(self) -> str:
        """Return the regular expression, for Python and ECMA alike, of a text that is one."""
        units = '|'.join(unit.replace('^', r'\^') for unit in self.units)
        return f'^[{"-" if self.sign is SignRule.ANY else ""}+]?{DIGITS} *({units})?$'

    def parse(self, text: str) -> float:
        """
        Return what a text says.

        :param text: a number and a unit; a number alone is in the SI unit
        :returns: the quantity in the SI unit
        :raises UnitError: if the text is none
        """
        match = _PARTS.fullmatch(text)
        if match is None:
            raise UnitError(f'{quoted(text)}; {self._hint(text)}')
        unit = match['unit'] or self.unit
        if unit not in self.units:
            raise UnitError(f'{quoted(text)}; {self._hint(unit)}')
        numerator, denominator = self.units[unit]
        value = float(match['number']) * numerator / denominator
        self._check(value, text)
        return value

    def _check(self, value: float, text: str) -> None:
        if not math.isfinite(value):
            raise UnitError(f'{quoted(text)} is too large a number')
        if text.startswith('-') and self.sign is not SignRule.ANY:
            raise UnitError(f'{quoted(text)}; it must not be negative')
        if value == 0.0 and self.sign is SignRule.POSITIVE:
            raise UnitError(f'{quoted(text)}; it must be above 0 {self.unit}')
        if value > self.largest:
            raise UnitError(f'{quoted(text)}; it must be at most {self.largest:g} {self.unit}')

    @property
    def wanted(self) -> str:
        """Return what to write for one."""
        *others, last = self.units
        units = f'{", ".join(others)} or {last}' if others else last
        return f'{self.name}, as in {self.example} (in {units})'

    def _hint(self, text: str) -> str:
        is_clock = self.units is _SECOND and _CLOCK.search(text)
        return 'write 1:30 as 90 s or 1.5 min' if is_clock else f'it must be {self.wanted}'


def _per(units: dict[str, tuple[float, float]], by: str) -> dict[str, tuple[float, float]]:
    return {f'{unit}/{by}': size for unit, size in units.items()}


_METRE = {'m': (1.0, 1.0), 'cm': (1.0, 100.0), 'mm': (1.0, 1000.0)}
_SECOND = {'s': (1.0, 1.0), 'ms': (1.0, 1000.0), 'min': (60.0, 1.0)}
_RADIAN = {'rad': (1.0, 1.0), 'deg': (math.pi, 180.0)}

LENGTH = Quantity('a length', _METRE, '0.5 m', SignRule.ANY)
SIZE = Quantity('a size', _METRE, '0.4 m')
ANGLE = Quantity('an angle', _RADIAN, '90 deg', SignRule.ANY)
TIME = Quantity('a time', _SECOND, '2 s', SignRule.NOT_NEGATIVE)
COMMAND_TIMEOUT = Quantity('a time above zero', _SECOND, '0.3 s')
FREQUENCY = Quantity('a frequency', {'Hz': (1.0, 1.0)}, '20 Hz', largest=1000.0)
LINEAR_VELOCITY = Quantity('a linear velocity', _per(_METRE, 's'), '0.2 m/s', SignRule.ANY)
ANGULAR_VELOCITY = Quantity('an angular velocity', _per(_RADIAN, 's'), '45 deg/s', SignRule.ANY)
POSITIVE_LINEAR_VELOCITY = Quantity('a speed', _per(_METRE, 's'), '0.2 m/s')
POSITIVE_ANGULAR_VELOCITY = Quantity('a turning speed', _per(_RADIAN, 's'), '45 deg/s')
LINEAR_ACCELERATION = Quantity('a linear acceleration', _per(_METRE, 's^2'), '0.5 m/s^2')
ANGULAR_ACCELERATION = Quantity('an angular acceleration', _per(_RADIAN, 's^2'), '90 deg/s^2')
LINEAR_JERK = Quantity('a linear jerk', _per(_METRE, 's^3'), '2 m/s^3')
ANGULAR_JERK = Quantity('an angular jerk', _per(_RADIAN, 's^3'), '360 deg/s^3')

#: By the words that stand for them in the schemas.
QUANTITIES = {quantity.name.split(' ', 1)[1]: quantity for quantity in (
    LENGTH, SIZE, ANGLE, TIME, COMMAND_TIMEOUT, FREQUENCY, LINEAR_VELOCITY, ANGULAR_VELOCITY,
    POSITIVE_LINEAR_VELOCITY,
    POSITIVE_ANGULAR_VELOCITY, LINEAR_ACCELERATION, ANGULAR_ACCELERATION, LINEAR_JERK,
    ANGULAR_JERK)}
