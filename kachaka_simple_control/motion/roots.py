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
"""Find where a function changes its sign.  Tested by test/motion/test_transition.py."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

#: How often an interval is halved to find a number in it.  This is enough for the last bit of a
#: float, except for numbers close to zero.
BISECTIONS = 120
#: Into how many equal steps ``largest_part`` divides the range from 0 to 1.
GRID = 1 << 20
#: How often ``root`` improves its result at most; about ten times are enough for the last bit.
ROOT_STEPS = 100


def bisection(
        low: float, high: float, is_above: Callable[[float], bool],
        count: int = BISECTIONS) -> tuple[float, float]:
    """
    Find a number in an interval by bisection.

    :param is_above: whether its argument is above the number to find
    """
    for _ in range(count):
        middle = (low + high) / 2.0
        if not low < middle < high:
            break
        if is_above(middle):
            high = middle
        else:
            low = middle
    return low, high


@dataclass
class _Bracket:
    """An interval with the sign change of a rising function: Illinois regula falsi."""

    low: float
    high: float
    below: float
    above: float
    _last: int = 0

    @property
    def guess(self) -> float:
        """Return the place in the interval where the function is probably 0."""
        return self.low + (self.high - self.low) * (self.below / (self.below - self.above))

    def narrow(self, place: float, value: float, is_low: bool) -> None:
        """Make the interval smaller."""
        # If the same end moves twice, the other value is halved, so that the next guess moves it.
        if is_low:
            self.above /= 2.0 if self._last < 0 else 1.0
            self.low, self.below, self._last = place, value, -1
        else:
            self.below /= 2.0 if self._last > 0 else 1.0
            self.high, self.above, self._last = place, value, 1


def largest_part(excess: Callable[[float], float]) -> float:
    """
    Return the largest part, from 0 to 1, at which a rising function is not above 0.

    The parts are whole multiples of 1 / GRID, so that rounding hardly ever changes the result.

    :param excess: the function; at 0 it is taken as not above 0
    """
    above = excess(1.0)
    if above <= 0.0:
        return 1.0
    bracket = _Bracket(0, GRID, min(-1e-300, excess(0.0)), above)
    while bracket.high - bracket.low > 1:
        guess = min(max(bracket.low + 1, round(bracket.guess)), bracket.high - 1)
        value = excess(guess / GRID)
        bracket.narrow(guess, value if value > 0.0 else min(-1e-300, value), value <= 0.0)
    return bracket.low / GRID


def root(
        function: Callable[[float], float], low: float, high: float, below: float,
        above: float) -> float:
    """
    Return where a rising function changes its sign, to the last bits.

    :param low: a place where the function is negative
    :param high: a place where the function is not negative
    """
    best, least, bracket = high, above, _Bracket(low, high, below, above)
    for _ in range(ROOT_STEPS):
        guess = bracket.guess
        if not least or not bracket.low < guess < bracket.high:
            break
        value = function(guess)
        if abs(value) <= abs(least):
            best, least = guess, value
        bracket.narrow(guess, value, value < 0.0)
    return best
