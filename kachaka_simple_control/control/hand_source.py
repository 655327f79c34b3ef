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
"""Velocities that a person commands directly, by hand, under a lease that lapses."""

from __future__ import annotations

from collections.abc import Callable
import math
import threading

from kachaka_simple_control.control.events import VelocityKind
from kachaka_simple_control.control.speed_factor import is_hold
from kachaka_simple_control.control.tick import Tick
from kachaka_simple_control.control.timing import HAND_LEASE_TIME, HAND_PERIOD
from kachaka_simple_control.errors import MotionRefusedError
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.process.processes import boottime

#: A command that is valid for less than this time is over: a shorter tick would be a rounding
#: error [s].
MIN_VALIDITY = 1e-6


class HandSource:
    """
    Returns the velocities that a person commands by hand, until ``end`` is called.

    Each command carries a sequence number and the newest stamp that its sender has received from
    here, so a delayed one is recognized whatever the clocks of the sender say.  It is valid until
    HAND_LEASE_TIME (0.25 s) after its stamp; then the velocity is zero at once.  After that, and
    after a pause, a zero must come before any other velocity: whoever has lost control has to
    release the stick first.

    A zero is sent at once.  All other changes keep the limits of acceleration, deceleration and
    jerk, for the linear and the angular part separately.

    :param on_change: called when a velocity must be sent at once
    :param cut: returns the part of a wanted velocity that an obstacle watch allows
    :param clock: the clock of the stamps [s]; it must also count while the machine is suspended
    """

    kind = VelocityKind.HAND
    skipped = 0
    plan_duration: float | None = None

    def __init__(
            self, limits: Limits, on_change: Callable[[], None] = lambda: None,
            clock: Callable[[], float] = boottime,
            cut: Callable[[Velocity], Velocity] = lambda velocity: velocity) -> None:
        self._limits = limits
        self._cut = cut
        #: what the sender has commanded last
        self._commanded = ZERO
        self._on_change = on_change
        self._clock = clock
        self._lock = threading.Lock()
        self._issued = self._newest_stamp = -math.inf
        self._sequence = -1
        self._wanted = self._acceleration = ZERO
        #: whether a zero must come before any other velocity
        self._needs_neutral = True
        self._is_over = False
        self._tick: Tick | None = None

    def stamp(self) -> float:
        """Return a new stamp for the sender of the commands [s on the clock of this object]."""
        with self._lock:
            self._issued = self._clock()
            return self._issued

    def command(self, velocity: Velocity, sequence: int, stamp: float) -> None:
        """
        Accept a command, which is valid until HAND_LEASE_TIME after its stamp; for any thread.

        :param sequence: larger than those of all earlier commands
        :param stamp: the newest result of ``stamp`` that the sender has received
        :raises MotionRefusedError: if the command is older than an accepted one, was sent too long
            ago, or if a zero must come first
        :raises InvalidMotionError: if the velocity is beyond the limits
        """
        self._limits.check(velocity)
        allowed = self._cut(velocity)
        with self._lock:
            self._check(velocity, sequence, stamp)
            was_zero, self._wanted = self._wanted.is_zero, allowed
            self._commanded = velocity
            self._sequence, self._newest_stamp = sequence, stamp
            if velocity.is_zero:
                self._needs_neutral = False
        if allowed.is_zero and not was_zero:
            self._on_change()

    def on_scan(self) -> None:
        """Apply ``cut`` to the newest command again, because something else was seen."""
        commanded = self._commanded
        allowed = self._cut(commanded)
        with self._lock:
            # Not after a stop or another command, nor when the command has run out.
            if commanded is not self._commanded or self._needs_neutral:
                return
            was_zero, self._wanted = self._wanted.is_zero, allowed
        if allowed.is_zero and not was_zero:
            self._on_change()

    def stop(self) -> None:
        """Set the wanted velocity to zero at once; a zero must come before any other velocity."""
        with self._lock:
            self._wanted, self._needs_neutral = ZERO, True
        self._on_change()

    def end(self) -> None:
        """End the drive with a zero velocity; from now on no command has an effect."""
        with self._lock:
            self._is_over = True
        self._on_change()

    def due(self, elapsed: float, factor: float = 1.0) -> Tick | None:
        """Return the velocity that is due; None after ``end``."""
        with self._lock:
            if self._is_over:
                return None
            left = self._newest_stamp + HAND_LEASE_TIME - self._clock()
            if left <= MIN_VALIDITY and not self._wanted.is_zero:
                self._wanted, self._needs_neutral = ZERO, True
            velocity = self._next(elapsed, factor)
            if is_hold(factor):
                self._needs_neutral = True
                if velocity.is_zero:
                    self._wanted = ZERO
            self._tick = tick = Tick(
                velocity, elapsed,
                elapsed + (HAND_PERIOD if velocity.is_zero else min(HAND_PERIOD, left)),
                math.inf if is_hold(factor) and velocity.is_zero else 0.0)
            return tick

    def watch(self) -> Callable[[], None]:
        """Return what returns None, for there is no plan."""
        return lambda: None

    def _check(self, velocity: Velocity, sequence: int, stamp: float) -> None:
        if sequence <= self._sequence or stamp < self._newest_stamp:
            raise MotionRefusedError('the command is older than one that was accepted')
        if not stamp <= self._issued:
            raise MotionRefusedError('the stamp of the command was never issued')
        if self._clock() - stamp >= HAND_LEASE_TIME:
            raise MotionRefusedError('the command was sent too long ago')
        if self._needs_neutral and not velocity.is_zero:
            raise MotionRefusedError('control was lost: release the controls first')

    def _next(self, elapsed: float, factor: float) -> Velocity:
        """Return the next velocity between the newest sent one and the wanted one."""
        if self._wanted.is_zero:
            self._acceleration = ZERO
            return ZERO
        before, duration = (ZERO, HAND_PERIOD) if self._tick is None else (
            self._tick.velocity, min(elapsed - self._tick.start, HAND_PERIOD))
        if duration <= 0.0:
            return before
        limits, rate = self._limits, self._acceleration
        velocity = Velocity(
            _ramped(before.linear_x, self._wanted.linear_x * factor, rate.linear_x, duration, (
                limits.max_linear_acceleration, limits.linear_deceleration,
                limits.max_linear_jerk, limits.max_linear_velocity)),
            _ramped(before.angular_z, self._wanted.angular_z * factor, rate.angular_z, duration, (
                limits.max_angular_acceleration, limits.angular_deceleration,
                limits.max_angular_jerk, limits.max_angular_velocity)))
        self._acceleration = Velocity(
            (velocity.linear_x - before.linear_x) / duration,
            (velocity.angular_z - before.angular_z) / duration)
        return velocity


def _ramped(
        before: float, wanted: float, rate: float, duration: float,
        limits: tuple[float, float, float, float]) -> float:
    """Return the value that is closest to the wanted one, and not too far from the one before."""
    away, towards, jerk, largest = limits
    if before * wanted < 0.0:  # first to zero
        wanted = 0.0
    way, sign = abs(wanted - before), math.copysign(1.0, wanted - before)
    most = min(way / duration, away if abs(wanted) > abs(before) else towards)
    change = jerk * duration
    if math.isfinite(change):
        # The largest rate from which steps of this change lead to a rate of 0 at the wanted value:
        # the rate and the ``count`` smaller ones after it, over this duration each, are the way.
        count = math.floor(math.sqrt(0.25 + 2.0 * way / (change * duration)) - 0.5)
        most = min(most, way / duration / (count + 1) + change * count / 2.0)
        most = min(max(most, sign * rate - change), sign * rate + change)
    value = before + sign * most * duration
    return 0.0 if value * before < 0.0 else min(max(value, -largest), largest)
