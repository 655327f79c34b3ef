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
"""The velocity gate: the only object of a node that publishes velocities."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
import math
import threading
import time

from kachaka_simple_control.control.events import Event, VelocityKind, VelocitySent
from kachaka_simple_control.control.guardian_memory import Latch, SharedFlag
from kachaka_simple_control.control.timing import PUBLISH_TIMEOUT
from kachaka_simple_control.errors import (
    ControlError,
    HELD_UP_ADVICE,
    InvalidMotionError,
    MotionRefusedError,
    RunFaultError,
)
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.process.processes import boottime
from kachaka_simple_control.process.signals import signal_dispatcher


class GateState(Enum):
    """Whether the velocity gate may publish velocities: not yet, now, or never again."""

    #: This program does not control the robot yet.  Even a zero velocity is blocked, because it
    #: makes a Kachaka leave its dock.
    NOT_OPENED = 'not taken yet'
    #: This program has control of the robot.
    OPEN = 'open'
    #: The robot was released.  Everything is blocked, because even a zero velocity would control
    #: the robot again.
    CLOSED = 'released'


class Permit:
    """
    The right of a drive to send velocities to a robot; only the newest one has it.

    :param max_gap: the longest allowed time between two messages, without that spent in DDS [s]
    :param command_timeout: the same with it: the robot has then stopped by itself [s]
    """

    def __init__(
            self, max_gap: float = math.inf, command_timeout: float = math.inf) -> None:
        self.max_gap = max_gap
        self.command_timeout = command_timeout
        #: t = 0 of the drive [s on the steady clock]; nan before the drive begins
        self.began = math.nan
        #: when DDS had accepted the last message [s on the gate's ``gap_clock``]; None before the
        #: first
        self.last_sent: float | None = None
        #: the value of ``PortTime.total`` at that time [s]
        self.waited_before = 0.0
        #: why the drive was ended; None while it may send
        self.ended_by: ControlError | None = None


class PortTime:
    """
    The time that one thread has spent in DDS calls, for all robots that it drives.

    It cannot send to other robots meanwhile, so the time between two messages to a robot may be
    longer by it, but by no more than PUBLISH_TIMEOUT.
    """

    def __init__(self) -> None:
        #: the total time so far [s]
        self.total = 0.0


def _unchanged(velocity: Velocity) -> Velocity:
    return velocity


class VelocityGate:
    """
    The only object of a node that publishes velocities; it first checks each velocity.

    It converts a velocity by the calibration, checks the limits, the latch and the time since the
    last message, publishes, and reports the event, all under one lock: after the first zero of a
    stop, no thread can send a velocity of the stopped drive.

    :param limits: a velocity beyond them is never published
    :param sending: set while a DDS call runs
    :param gap_clock: for the time between two messages [s]; it counts while the machine is
        suspended, too
    """

    def __init__(
            self,
            transmit: Callable[[Velocity], None],
            limits: Limits,
            latch: Latch,
            sending: SharedFlag | None = None,
            clock: Callable[[], float] = time.monotonic,
            gap_clock: Callable[[], float] = boottime,
            command: Callable[[Velocity], Velocity] = _unchanged) -> None:
        self._transmit = transmit
        self._limits = limits
        self._within_limits = ZERO
        self._latch = latch
        self._sending = sending or SharedFlag()
        self._clock = clock
        self._gap_clock = gap_clock
        self._command = command
        self._lock = threading.Lock()
        self._state = GateState.NOT_OPENED
        self._has_logged_guardian = False
        self._permit: Permit | None = None
        #: puts an event into a queue, and returns at once
        self.publish: Callable[[Event], None] = lambda _: None
        #: returns whether somebody needs the events of a type
        self.has_readers: Callable[[type], bool] = lambda _: True
        #: time of the driving thread in DDS calls; all gates of this thread share one object
        self.port_time = PortTime()
        #: makes the thread that drives check at once whether its drive was ended
        self.wake: Callable[[], None] = lambda: None
        #: that of a drive that has not begun, for example because it waits for the robot
        self._pending: Permit | None = None

    @property
    def state(self) -> GateState:
        """Return whether this object may publish velocities: not yet, now, or never again."""
        return self._state

    @property
    def permit(self) -> Permit | None:
        """Return that of the drive that has begun last, even if it is over; None if none has."""
        return self._permit

    def open(self) -> None:  # noqa: A003
        """Allow to publish, now that the robot is taken; no effect after ``close``."""
        with self._lock:
            if self._state is GateState.NOT_OPENED:
                self._state = GateState.OPEN

    def close(self) -> None:
        """Block all velocities from now on, even zero velocities; this cannot be undone."""
        with self._lock:
            self._state = GateState.CLOSED

    def prepare(self) -> Permit:
        """Return a permit, valid from ``begin`` on; ``cancel`` can end it from now on."""
        permit = Permit()
        with self._lock:
            self._pending = permit
        return permit

    def begin(
            self, max_gap: float, permit: Permit | None = None,
            command_timeout: float = math.inf, began: float = math.nan) -> Permit:
        """
        Begin a drive; the previous one can no longer send velocities.

        :param max_gap: the longest allowed time between two messages, without that spent in DDS
            [s]
        :param permit: from ``prepare``; None for a new one
        :param began: t = 0 [s]
        :raises ControlError: if the drive was cancelled, nothing may be published, or the latch is
            set
        """
        permit = permit or Permit()
        with self._lock:
            if permit.ended_by is not None:
                raise permit.ended_by
            self._require_permission()
            permit.max_gap, permit.command_timeout, permit.began = max_gap, command_timeout, began
            self._permit, self._pending = permit, None
        return permit

    def send(
            self, permit: Permit, velocity: Velocity, kind: VelocityKind = VelocityKind.PLAN,
            due: float | None = None, plan_time: float | None = None, skipped: int = 0) -> float:
        """
        Check a velocity of a drive and publish it.

        :param velocity: the wanted velocity of the robot, before the calibration
        :param due: when the velocity is due [s after t = 0]
        :param plan_time: the point in the plan [s]; None without a plan
        :param skipped: how many velocities directly before this one were left out, being too late
        :returns: when it was sent [s on the steady clock]
        :raises ControlError: if the drive was ended, the last message was sent too long ago, or
            the velocity is beyond the limits; then nothing was published
        """
        command = self._command(velocity)
        # Without ``deferred``, Ctrl+C between the message and its event would lose the event.
        with self._lock, signal_dispatcher.deferred():
            self._require_limits(command)
            self._check(permit)
            self._require_no_gap(permit)
            # Read the time directly before: DDS stamps a message when it accepts the message.
            now, before = self._clock(), self._gap_clock()
            self._sending.set()
            try:
                self._transmit(command)
            finally:
                self._sending.clear()
                # While a node joins the graph, DDS may take up to 0.3 s.  This does not mean that
                # this program was held up.
                after = self._gap_clock()
                self.port_time.total += after - before
            self._publish_guardian_stop(now)
            if self.has_readers(VelocitySent):
                self.publish(VelocitySent(
                    now, command, kind, due, plan_time, skipped,
                    None if command is velocity else velocity))
            permit.last_sent, permit.waited_before = after, self.port_time.total
            # If the program was frozen during the DDS call, the guardian has stopped the robot by
            # now.  Without this check the program would start its own stop only at the next tick.
            self._check(permit)
            return now

    def wait_for_dds(self, ask: Callable[[], None]) -> None:
        """
        Call a function that may wait for DDS; its time does not count as one between messages.

        A graph query takes up to 0.17 s while nodes join or leave (measured).
        """
        began = self._gap_clock()
        self._sending.set()
        try:
            ask()
        finally:
            self._sending.clear()
            self.port_time.total += self._gap_clock() - began

    def check(self, permit: Permit) -> None:
        """
        Check that a drive may still send velocities.

        :raises ControlError: if it was ended, a newer one has begun, or nothing may be published
        """
        self._check(permit)

    def cancel(self, reason: ControlError) -> Permit | None:
        """
        End the newest drive, and one that was prepared but has not begun.

        :param reason: what ``begin``, ``send`` and ``check`` raise for these runs
        :returns: the newest drive that has begun; None if no drive has begun
        """
        with self._lock:
            for permit in (self._permit, self._pending):
                if permit is not None and permit.ended_by is None:
                    permit.ended_by = reason
            cancelled = self._permit
        self.wake()
        return cancelled

    def send_zero(self, after: Permit | None, kind: VelocityKind = VelocityKind.STOP) -> bool:
        """
        Publish a zero velocity, if publishing is allowed and no newer drive has begun.

        :param after: that of the drive which it follows; None if no drive has begun
        :returns: whether it was published
        """
        with self._lock, signal_dispatcher.deferred():
            if self._state is not GateState.OPEN or self._permit is not after:
                return False
            now = self._clock()
            self._sending.set()
            try:
                self._transmit(ZERO)
            finally:
                self._sending.clear()
            self._publish_guardian_stop(now)
            if self.has_readers(VelocitySent):
                self.publish(VelocitySent(now, ZERO, kind))
            return True

    def _publish_guardian_stop(self, now: float) -> None:
        """Report, once, that the guardian began to stop the robot before a time."""
        stopped = self._latch.guardian_stop_time
        if stopped is not None and not self._has_logged_guardian and stopped < now:
            self._has_logged_guardian = True
            self.publish(VelocitySent(stopped, ZERO, VelocityKind.GUARDIAN))

    def _check(self, permit: Permit) -> None:
        if permit.ended_by is not None:
            raise permit.ended_by
        if permit is not self._permit:
            raise MotionRefusedError('this drive is over: another one has begun')
        self._require_permission()

    def _require_permission(self) -> None:
        if self._latch.is_set:
            raise MotionRefusedError(
                'the robot was stopped permanently; only a new node moves it again')
        if self._state is not GateState.OPEN:
            raise MotionRefusedError(f'the robot cannot be driven: it is {self._state.value}')

    def _require_limits(self, velocity: Velocity) -> None:
        # A velocity object never changes, and the same object is often sent many times.
        if velocity is self._within_limits:
            return
        try:
            self._limits.check(velocity)
        except InvalidMotionError as error:
            raise RunFaultError(f'a velocity was not sent: {error}') from None
        self._within_limits = velocity

    def _require_no_gap(self, permit: Permit) -> None:
        if permit.last_sent is None:
            return
        gap = self._gap_clock() - permit.last_sent
        # DDS may take no longer than the guardian allows.  The robot's command timeout limits the
        # whole gap.
        waited = self.port_time.total - permit.waited_before
        allowed = min(permit.max_gap + min(waited, PUBLISH_TIMEOUT), permit.command_timeout)
        if gap > allowed:
            raise RunFaultError(
                f'nothing was sent for {gap * 1e3:.0f} ms, more than the {allowed * 1e3:.0f} '
                f'ms allowed: the program was held up, {HELD_UP_ADVICE}')
