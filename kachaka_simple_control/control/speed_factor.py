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
"""The speed factor: the product of the factors that each source of slower speed sets."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import math
import threading
import time
from types import MappingProxyType

from kachaka_simple_control.errors import MotionRefusedError

#: Name of the factor that ``pause`` sets: 0 while paused.
PAUSE = 'pause'
#: Name of the factor that is 0 if a paused robot was moved: it holds the robot after a resume.
MOVED = 'moved'
#: Name of the factor of the obstacle watch: 0 while it holds the robot.
OBSTACLE = 'obstacle'
#: The smallest factor that a user may set; a user who wants 0 has to pause.  If the product of all
#: factors is lower, the robot is held at rest.  The value is chosen, not measured.
MIN_SPEED_FACTOR = 0.01
#: Name of the factor that a person sets with the parameter ``speed_factor``.
OVERRIDE = 'override'


class SpeedFactor:
    """
    The speed of the robot relative to its plan, from 0 to 1: a product of named factors.

    Any thread may set a factor.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        # Reentrant: the subscriber that ``on_change`` calls may set a factor itself.
        self._lock = threading.RLock()
        self._factors: Mapping[str, float] = MappingProxyType({})
        self._value = 1.0
        #: until when factors are valid [s on the clock], by name; only factors with a time limit
        self._expiries: dict[str, float] = {}
        #: called after a change with the time of the change [s on the clock] and all factors
        #: below 1
        self.on_change: Callable[[float, Mapping[str, float]], None] = lambda *_: None

    @property
    def factors(self) -> Mapping[str, float]:
        """Return the factors below 1, by the name of their source; the mapping never changes."""
        self._expire()
        return self._factors

    @property
    def value(self) -> float:
        """Return the product of all factors: the speed relative to the plan, from 0 to 1."""
        self._expire()
        return self._value

    def without(self, name: str) -> float:
        """Return the product of all factors but that of one source."""
        return product({other: factor for other, factor in self.factors.items() if other != name})

    def set(  # noqa: A003
            self, name: str, factor: float, valid_for: float | None = None) -> bool:
        """
        Set the factor of one source; a moving robot reaches its new speed within its limits.

        :param factor: from 0 to 1
        :param valid_for: how long it is valid, unless it is set again [s].  Then it is 0 and holds
            the robot, because the source may have failed.  None for no time limit
        :returns: whether it was another one before
        :raises MotionRefusedError: if the factor is not a number from 0 to 1, or the time is not
            above 0; then nothing has changed
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
        """Set each expired factor to 0, so that the robot is held at rest."""
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
        """Whether the product of all factors is so small that the robot is held at rest."""
        return is_hold(self.value)

    def describe(self) -> str:
        """Return a text such as ``paused, speed 50 %``; ``full speed`` if no factor is below 1."""
        return describe_factors(self.factors) or 'full speed'


def product(factors: Mapping[str, float]) -> float:
    """Return the product of all factors; 1 without any."""
    return math.prod(factors.values(), start=1.0)


def describe_factors(factors: Mapping[str, float]) -> str:
    """Return a text such as ``paused, speed 50 %, obstacle 40 %``; empty without factors."""
    return ', '.join(
        'paused' if name == PAUSE and factor == 0.0
        else f'{"speed" if name == OVERRIDE else name} {factor * 100.0:.3g} %'
        for name, factor in factors.items())


def is_hold(speed: float) -> bool:
    """Return whether a speed factor is below MIN_SPEED_FACTOR, so that the robot is held."""
    return speed < MIN_SPEED_FACTOR


def check_factor(factor: object) -> None:
    """
    Check that a value is a speed factor.

    :raises MotionRefusedError: if it is not a number from 0 to 1
    """
    if not (isinstance(factor, (int, float)) and 0.0 <= factor <= 1.0):
        raise MotionRefusedError(
            f'the speed factor is {factor!r}; it must be from 0 to 1: a plan is at the limits')


def _check_duration(valid_for: object) -> None:
    if valid_for is not None and not (isinstance(valid_for, (int, float)) and valid_for > 0.0):
        raise MotionRefusedError(
            f'valid_for is {valid_for!r} s; it must be above 0, or None for ever')
