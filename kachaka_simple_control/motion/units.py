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
"""Physical quantities: their units, their text format, and their allowed values."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
import math
from numbers import Real
import re

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.foreign_units import in_known_units, narrowed
from kachaka_simple_control.text import quoted

#: The regular expression of a number without its sign.  It matches each text in one way only;
#: a second way would make the search slow.
DIGITS = r'([0-9]+([.][0-9]*)?|[.][0-9]+)([eE][-+]?[0-9]+)?'
_PARTS = re.compile(f'(?P<number>[-+]?{DIGITS}) *(?P<unit>.*)', re.DOTALL)
# Used only at the start of a text, because a search in a long text takes too long.
_CLOCK = re.compile('[0-9]*:[0-9]+')
_DECIMAL_COMMA = re.compile('([-+]?[0-9]+),(?=[0-9])')
#: The minus sign that a word processor writes instead of a hyphen before a number.
MINUS = '\u2212'


class UnitError(ValueError):
    """A text is not a quantity of the expected kind; the message says what to write instead."""


class SignRule(Enum):
    """The values that a quantity may have: any, not below zero, or only above zero."""

    ANY = 'any'
    NOT_NEGATIVE = 'zero or more'
    POSITIVE = 'above zero'


@dataclass(frozen=True)
class Quantity:
    """
    A kind of quantity, such as a length, with the units in which users may write it.

    :param units: from each unit to its size in the SI unit, which comes first, as numerator and
        denominator: ``{'m': (1, 1), 'cm': (1, 100)}``
    :param largest: the largest value allowed in a text [SI unit]
    :param needs_unit: whether a text must have one, as an angle: ``turn: 90`` means degrees
    """

    name: str
    # A numerator and a denominator, because 57 / 100 gives 0.57, but 57 * 0.01 gives
    # 0.5700000000000001.
    units: dict[str, tuple[float, float]]
    example: str
    sign: SignRule = SignRule.POSITIVE
    largest: float = math.inf
    needs_unit: bool = False

    @property
    def unit(self) -> str:
        """Return the SI unit of the quantity as text, as in ``m/s``."""
        return next(iter(self.units))

    @property
    def time_power(self) -> int:
        """Return the power of seconds in the unit: 1 of ``s``, -2 of ``m/s^2``, 0 of ``m``."""
        above, _, below = self.unit.partition('/')
        base, _, power = (below or above).partition('^')
        size = {'s': 1, 'Hz': -1}.get(base, 0) * int(power or 1)
        return -size if below else size

    def slowed(self, value: float, factor: float) -> float:
        """Return a value for a lower speed: a time divided by the factor, a velocity times it."""
        power = self.time_power
        return value / factor ** power if power > 0 else value * factor ** -power

    @property
    def keyword(self) -> str:
        """Return the name of the quantity without its article, as in ``length``."""
        return self.name.split(' ', 1)[1]

    @property
    def pattern(self) -> str:
        """Return a regular expression, valid in ECMAScript, of a number with a unit."""
        units = '|'.join(unit.replace('^', r'\^') for unit in self.units)
        sign = f'[{"-" if self.sign is SignRule.ANY else ""}+]?'
        return f'^{sign}{DIGITS} *({units}){"" if self.needs_unit else "?"}$'

    @property
    def wanted(self) -> str:
        """Return how to write the quantity, with an example and the allowed units."""
        *others, last = self.units
        units = f'{", ".join(others)} or {last}' if others else last
        return f'{self.name}, as in {self.example} (in {units})'

    def parse(self, text: str) -> float:
        """
        Convert a text, such as ``20 cm``, to a number in the SI unit.

        :raises UnitError: if the text is not a valid quantity of this kind
        """
        match = _PARTS.fullmatch(text)
        if match is None:
            raise UnitError(f'{quoted(text)}; {self._hint(text)}')
        if self.needs_unit and not match['unit']:
            raise UnitError(self.without_unit(match['number']))
        unit = match['unit'] or self.unit
        if unit not in self.units:
            raise UnitError(f'{quoted(text)}; {self._hint(text)}')
        numerator, denominator = self.units[unit]
        value = float(match['number']) * numerator / denominator
        self.check(value, text)
        return value

    def without_unit(self, number: object) -> str:
        """Return the message for a number that must have a unit, but has none."""
        second, first, *_ = self.units
        meant = [text for text in (f'{number} {first}', f'{number} {second}') if self._takes(text)]
        return f'{number} has no unit; {self.name} needs one: ' + (
            f'write {" or ".join(meant)}' if meant else f'it must be {self.wanted}')

    def _takes(self, text: str) -> bool:
        try:
            self.parse(text)
        except UnitError:
            return False
        return True

    def require(self, name: str, value: object) -> None:
        """Check that a value [SI unit] is a finite number with an allowed sign."""
        number = require_finite(name, value, self.unit)
        if self.sign is SignRule.NOT_NEGATIVE and number < 0.0:
            raise InvalidMotionError(f'{value} {self.unit}; it must not be negative', name=name)
        if self.sign is SignRule.POSITIVE:
            require_positive(name, value, self.unit)
        if number > self.largest:
            raise InvalidMotionError(
                f'{value} {self.unit}; it must be at most {self.largest:g} {self.unit}', name=name)

    def check(self, value: float, text: str) -> None:
        """
        Check a value [SI unit] that was written in some way.

        :raises UnitError: if the value is not allowed
        """
        if not math.isfinite(value):
            raise UnitError(f'{quoted(text)} is too large a number')
        if text.startswith('-') and self.sign is not SignRule.ANY:
            raise UnitError(f'{quoted(text)}; it must not be negative')
        if value == 0.0 and self.sign is SignRule.POSITIVE:
            raise UnitError(f'{quoted(text)}; it must be above 0 {self.unit}')
        if value > self.largest:
            raise UnitError(f'{quoted(text)}; it must be at most {self.largest:g} {self.unit}')

    def _hint(self, text: str) -> str:
        if self.units is _SECOND and _CLOCK.match(text):
            return 'write 1:30 as 90 s or 1.5 min'
        if advice := sign_advice(text):
            return advice
        known = in_known_units(text, self.units)
        is_known = known is not None and self._takes(known)
        return f'write {quoted(str(known))}' if is_known else f'it must be {self.wanted}'


def point_advice(text: str) -> str | None:
    """Return the advice to write a decimal point instead of a comma; None if there is none."""
    plain = _with_point(text)
    return None if plain == text else f'write {quoted(plain)}, with a point'


def sign_advice(text: str) -> str | None:
    """Return the advice for a full-width number, a comma or the minus sign U+2212; or None."""
    if (plain := narrowed(text)) != text:
        plain = _with_point(plain.replace(MINUS, '-'))
        return f'full-width: write {quoted(plain)}'
    if MINUS in text:
        plain = _with_point(text.replace(MINUS, '-'))
        return f'its minus is U+2212: write that of the keyboard, {quoted(plain)}'
    return point_advice(text)


def _with_point(text: str) -> str:
    # Matched at the start alone, because a search in a long text takes too long.
    comma = _DECIMAL_COMMA.match(text)
    return text if comma is None else f'{comma[1]}.{text[comma.end():]}'


def number_advice(text: str, unit: str = '') -> str:
    """
    Return what to write instead of a text that is not a plain number.

    :param unit: the unit of the number; empty for a ratio
    """
    number = text.strip().removesuffix(unit).rstrip()
    if advice := sign_advice(number):
        return advice
    try:
        float(number)
    except ValueError:
        return f'it must be a number in {unit}' if unit else 'it must be a number'
    if number == text.strip():
        return 'it is a text in quotes: leave the quotes out'
    return f'write {quoted(number)}, without its unit'


def parse_number(text: str, unit: str = '') -> float:
    """
    Convert a text, such as ``50`` or ``50 Hz``, to a number.

    :param unit: the unit of the number; empty for a ratio
    :raises UnitError: if the text is not such a number
    """
    try:
        return float(text.strip().removesuffix(unit))
    except ValueError:
        raise UnitError(f'{quoted(text, 60)}; {number_advice(text, unit)}') from None


def _per(units: dict[str, tuple[float, float]], by: str) -> dict[str, tuple[float, float]]:
    return {f'{unit}/{by}': size for unit, size in units.items()}


_METRE = {'m': (1.0, 1.0), 'cm': (1.0, 100.0), 'mm': (1.0, 1000.0)}
_SECOND = {'s': (1.0, 1.0), 'ms': (1.0, 1000.0), 'min': (60.0, 1.0)}
_RADIAN = {'rad': (1.0, 1.0), 'deg': (math.pi, 180.0), '°': (math.pi, 180.0)}

LENGTH = Quantity('a length', _METRE, '0.5 m', SignRule.ANY, needs_unit=True)
SIZE = Quantity('a size', _METRE, '0.4 m', needs_unit=True)
TOLERANCE = Quantity(
    'a tolerance', _METRE, '5 cm', SignRule.NOT_NEGATIVE, largest=1.0, needs_unit=True)
ANGLE_TOLERANCE = Quantity(
    'an angle', _RADIAN, '3 deg', SignRule.NOT_NEGATIVE, largest=math.pi, needs_unit=True)
ANGLE = Quantity('an angle', _RADIAN, '90 deg', SignRule.ANY, needs_unit=True)
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
VEER = Quantity('a veer', _per(_RADIAN, 'm'), '2 deg/m', SignRule.ANY, needs_unit=True)
ANGULAR_JERK = Quantity('an angular jerk', _per(_RADIAN, 's^3'), '360 deg/s^3')

#: The quantity for each keyword in the JSON Schemas.
QUANTITIES = {quantity.keyword: quantity for quantity in (
    LENGTH, SIZE, TOLERANCE, ANGLE, TIME, COMMAND_TIMEOUT, FREQUENCY, LINEAR_VELOCITY,
    ANGULAR_VELOCITY, POSITIVE_LINEAR_VELOCITY, POSITIVE_ANGULAR_VELOCITY, LINEAR_ACCELERATION,
    ANGULAR_ACCELERATION, LINEAR_JERK, ANGULAR_JERK, VEER)}


def require_number(name: str, value: object, unit: str) -> float:
    """
    Return a value as a float; a bool is no number, an integer too large becomes infinite.

    :raises InvalidMotionError: if the value is not a number
    """
    # bool is a Real in Python, and move_robot(True, ...) is a mistake.
    if isinstance(value, bool) or not isinstance(value, (int, float, Real)):
        raise InvalidMotionError(f'{value!r}; it must be a number [{unit}]', name=name)
    try:
        return float(value)
    except OverflowError:  # an int may have any number of digits
        return -math.inf if value < 0.0 else math.inf


def require_finite(name: str, value: object, unit: str) -> float:
    """
    Return a value as a finite float, or raise an error.

    :raises InvalidMotionError: if the value is not a number, or not finite
    """
    number = require_number(name, value, unit)
    if not math.isfinite(number):
        raise InvalidMotionError(f'{number} {unit}; it must be a finite number', name=name)
    return number


def require_between(
        name: str, value: float, lowest: float, highest: float, unit: str = '') -> None:
    """
    Check that a value is a number within a range.

    :param unit: of the value and of the range; empty for a ratio
    :raises InvalidMotionError: if it is not
    """
    require_finite(name, value, unit)
    unit = unit and f' {unit}'
    if not lowest <= value <= highest:
        raise InvalidMotionError(
            f'{value}{unit}; it must be from {lowest:g} to {highest:g}{unit}', name=name)


def require_positive(name: str, value: object, unit: str) -> None:
    """
    Check that a value is a number above zero, which may be infinite.

    :raises InvalidMotionError: if it is not
    """
    # Written so that NaN fails.
    if not require_number(name, value, unit) > 0.0:
        raise InvalidMotionError(f'{value} {unit}; it must be above 0 {unit}', name=name)


def format_number(value: float) -> str:
    """Return a number with at most five significant digits, as in 0.5, and 0 instead of -0."""
    return f'{value + 0.0:.5g}'
