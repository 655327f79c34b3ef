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
"""The speed factor: the product of all that ask for less speed, each by its name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import math
import threading
import time
from types import MappingProxyType

from kachaka_simple_control.errors import MotionRefusedError

#: The factor of ``pause``: 0 while paused.
PAUSE = 'pause'
#: The factor that keeps a hold which was released after the robot was moved.
MOVED = 'moved'
#: The least factor that a person may set, and below which a run is held.  Chosen; to stop, pause.
MIN_SPEED_FACTOR = 0.01
#: The factor that a person sets: the parameter ``speed_factor``.
OVERRIDE = 'override'


class SpeedFactor:
    """
    One number from 0 to 1 by which a run is slower than planned: the product of named factors.

    Whoever wants less speed sets a factor of its own: a pause, a person, an obstacle.  Any thread
    may do so.

    :param clock: the steady clock [s]
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        # Entered anew by a subscriber that sets a factor when one changes.
        self._lock = threading.RLock()
        self._factors: Mapping[str, float] = MappingProxyType({})
        self._value = 1.0
        #: until when factors are valid [s on the clock], by name; without those that never end
        self._expiries: dict[str, float] = {}
        #: called after a change with its time [s on the clock] and all factors below 1
        self.on_change: Callable[[float, Mapping[str, float]], None] = lambda *_: None

    @property
    def factors(self) -> Mapping[str, float]:
        """Return the factors below 1, by name; the mapping never changes."""
        self._expire()
        return self._factors

    @property
    def value(self) -> float:
        """Return the product of all factors."""
        self._expire()
        return self._value

    def set(  # noqa: A003
            self, name: str, factor: float, valid_for: float | None = None) -> bool:
        """
        Set a named factor; the run under way reaches it within the robot's limits.

        :param name: whose it is
        :param factor: from 0 to 1
        :param valid_for: how long it holds unless it is set again [s]: then it is 0, and the robot
            is held, for whoever set it may be gone; None: for ever
        :returns: whether that changed anything
        :raises MotionRefusedError: if it is not a number from 0 to 1, or the time is not above 0;
            nothing has changed
        """
        check_factor(factor)
        _check_duration(valid_for)
        with self._lock:
            self._expiries.pop(name, None)
            if valid_for is not None:
                self._expiries[name] = self._clock() + valid_for
            return self._set(name, factor)

    def _set(self, name: str, factor: float) -> bool:
        before = self._factors
        factors = {**before, name: float(factor)}
        if factors[name] == 1.0:
            del factors[name]
        if factors == before:
            return False
        self._factors = MappingProxyType(factors)
        self._value = product(factors)
        self.on_change(self._clock(), self._factors)
        return True

    def _expire(self) -> None:
        """Hold the robot for each factor that was valid until now."""
        if not self._expiries:
            return
        now = self._clock()
        with self._lock:
            for name, expiry in [*self._expiries.items()]:
                if now >= expiry:
                    del self._expiries[name]
                    self._set(name, 0.0)

    @property
    def is_hold(self) -> bool:
        """Whether the product is too small to drive by."""
        return is_hold(self.value)

    def describe(self) -> str:
        """Return who asks for less speed, such as ``paused, speed 50 %``."""
        return describe_factors(self.factors) or 'full speed'


def product(factors: Mapping[str, float]) -> float:
    """Return the speed factor that results from named ones, from 0 to 1."""
    return math.prod(factors.values(), start=1.0)


def describe_factors(factors: Mapping[str, float]) -> str:
    """Return factors below 1 in words, such as ``paused, speed 50 %, obstacle 40 %``."""
    return ', '.join(
        'paused' if name == PAUSE and factor == 0.0
        else f'{"speed" if name == OVERRIDE else name} {factor * 100.0:.3g} %'
        for name, factor in factors.items())


def is_hold(speed: float) -> bool:
    """Return whether a product of factors is too small to drive by."""
    return speed < MIN_SPEED_FACTOR


def check_factor(factor: object) -> None:
    """
    Refuse what is no speed factor.

    :raises MotionRefusedError: if it is not a number from 0 to 1
    """
    if not (isinstance(factor, (int, float)) and 0.0 <= factor <= 1.0):
        raise MotionRefusedError(
            f'the speed factor is {factor!r}; it must be from 0 to 1: a plan is at the limits')


def _check_duration(valid_for: object) -> None:
    if valid_for is not None and not (isinstance(valid_for, (int, float)) and valid_for > 0.0):
        raise MotionRefusedError(
            f'valid_for is {valid_for!r} s; it must be above 0, or None for ever')
