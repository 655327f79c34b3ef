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
Amounts of lengths, angles, times, velocities and plain numbers, with 60 decimal digits.

Tested by test/files/test_expressions.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Context, Decimal
from functools import cache
import math
import re

from kachaka_simple_control.motion.units import (
    ANGLE,
    ANGULAR_VELOCITY,
    DIGITS,
    LENGTH,
    LINEAR_VELOCITY,
    sign_advice,
    TIME,
    UnitError,
)
from kachaka_simple_control.text import quoted

#: What a parameter may be, besides a number.
PARAMETER_QUANTITIES = (LENGTH, ANGLE, TIME, LINEAR_VELOCITY, ANGULAR_VELOCITY)
#: Enough digits for any sum of lengths, and for a third three times to be a whole number.
EXACT = Context(prec=60)
#: The longest number [characters].
MAX_NUMBER = 100
_SIZES = {unit: size for kind in PARAMETER_QUANTITIES for unit, size in kind.units.items()}
#: A pattern of all units, and one of a number with or without its unit.
UNITS = '|'.join(sorted(_SIZES, key=len, reverse=True))
VALUE = f'(?P<number>{DIGITS})( *(?P<unit>({UNITS})(?![A-Za-z0-9_])))?'
_SIGNED = re.compile(f'(?P<minus>-?)[+]?{VALUE}')

Dimension = tuple[int, int, int]


@dataclass(frozen=True)
class Amount:
    """
    A number with its dimension.

    :param number: in the SI unit times (pi / 180) ** ``degrees``
    :param dimension: the powers of metre, radian and second
    :param parsed: a number as ``Quantity.parse`` reads it [SI unit]; None for a result
    """

    number: Decimal
    dimension: Dimension = (0, 0, 0)
    degrees: int = 0
    parsed: float | None = None

    @property
    def value(self) -> float:
        """Return the number in the SI unit."""
        if self.parsed is not None:
            return self.parsed
        number = float(self.number)
        return number * math.pi / 180.0 if self.degrees == 1 else (
            number * (math.pi / 180.0) ** self.degrees)

    @property
    def kind(self) -> str:
        """Return what this is, as in ``a length``, ``a number`` or ``in m^2``."""
        return _kind(self.dimension)

    def __str__(self) -> str:
        """Return the amount with its unit, as in ``0.5 m`` or ``90 deg``."""
        unit = unit_of(self.dimension)
        if self.degrees != 1:
            return f'{self.value:.10g} {unit}'.rstrip()
        return f'{float(self.number):.10g} {unit.replace("rad", "deg", 1)}'

    def __neg__(self) -> Amount:
        """Return the amount with the other sign."""
        parsed = None if self.parsed is None else -self.parsed
        return Amount(self.number.copy_negate(), self.dimension, self.degrees, parsed)

    def __add__(self, other: Amount) -> Amount:
        """Return the sum of two amounts of the same dimension."""
        if self.degrees == other.degrees:
            return Amount(
                EXACT.add(self.number, other.number), self.dimension, self.degrees)
        return Amount(
            EXACT.add(Decimal(self.value), Decimal(other.value)), self.dimension)

    def __sub__(self, other: Amount) -> Amount:
        """Return the difference of two amounts of the same dimension."""
        return self + -other

    def __mul__(self, other: Amount) -> Amount:
        """Return the product."""
        return Amount(
            EXACT.multiply(self.number, other.number), _plus(self.dimension, other.dimension),
            self.degrees + other.degrees)

    def __truediv__(self, other: Amount) -> Amount:
        """Return the quotient."""
        return Amount(
            EXACT.divide(self.number, other.number), _plus(self.dimension, other.dimension, -1),
            self.degrees - other.degrees)

    def __lt__(self, other: Amount) -> bool:
        """Return whether this is less than an amount of the same dimension."""
        return (self - other).number < 0


def _plus(one: Dimension, two: Dimension, sign: int = 1) -> Dimension:
    metres, radians, seconds = (a + sign * b for a, b in zip(one, two))
    return metres, radians, seconds


@cache
def dimension_of(unit: str) -> Dimension:
    """Return the powers of metre, radian and second in an SI unit, as in ``m/s^2``."""
    powers = {'m': 0, 'rad': 0, 's': 0}
    above, _, below = ('/s' if unit == 'Hz' else unit).partition('/')
    for part, sign in ((above, 1), (below, -1)):
        base, _, power = part.partition('^')
        if base:
            powers[base] += sign * int(power or 1)
    return powers['m'], powers['rad'], powers['s']


def _kind(dimension: Dimension) -> str:
    names = {dimension_of(kind.unit): kind.name for kind in PARAMETER_QUANTITIES}
    return {(0, 0, 0): 'a number', **names}.get(dimension) or f'in {unit_of(dimension)}'


def unit_of(dimension: Dimension) -> str:
    """Return a dimension as an SI unit, as in ``m/s``; empty for a number."""
    def part(sign: int) -> str:
        return ' '.join(
            f'{unit}^{sign * power}' if sign * power > 1 else unit
            for unit, power in zip(('m', 'rad', 's'), dimension) if sign * power > 0)
    return f'{part(1)}/{part(-1)}'.rstrip('/') if part(1) or not part(-1) else f'1/{part(-1)}'


def read_value(text: str) -> Amount:
    """
    Return the amount of a number with or without a unit, such as ``-20 cm``.

    :raises UnitError: if the text is something else
    """
    found = _SIGNED.fullmatch(text.strip())
    if found is None:
        raise UnitError(f'{quoted(text)}; ' + (
            sign_advice(text) or 'it must be a number, or a number with a unit, as in 4 or 0.5 m'))
    amount = amount_of(found)
    return -amount if found['minus'] else amount


def amount_of(found: re.Match[str]) -> Amount:
    """Return the amount of a number that ``VALUE`` has found."""
    text, unit = found['number'], found['unit']
    number = float(text)
    if not math.isfinite(number) or len(text) > MAX_NUMBER:
        raise UnitError(f'{quoted(text)} is too large a number')
    # A number that is no float in a useful range is taken as the float that it is read as.
    exact = Decimal(text) if 1e-100 < number < 1e100 else Decimal(number)
    if unit is None:
        return Amount(exact, parsed=number)
    above, below = _SIZES[unit]
    dimension, size = _measure(unit)
    parsed = number * above / below
    if size is None:
        return Amount(exact, dimension, 1, parsed)
    return Amount(EXACT.multiply(exact, size), dimension, 0, parsed)


@cache
def _measure(unit: str) -> tuple[Dimension, Decimal | None]:
    """Return the dimension of a unit and its size in the SI unit; None for a degree."""
    dimension = dimension_of(next(
        kind.unit for kind in PARAMETER_QUANTITIES if unit in kind.units))
    if unit.startswith(('deg', '°')):
        return dimension, None
    return dimension, EXACT.divide(*map(Decimal, _SIZES[unit]))
