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
"""The velocity gate: the one object through which velocities leave."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
import math
import threading
import time

from kachaka_simple_control.control.events import Event, VelocityKind, VelocitySent
from kachaka_simple_control.control.guardian import Latch, SharedFlag
from kachaka_simple_control.control.processes import boottime
from kachaka_simple_control.control.signals import signal_dispatcher
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


class GateState(Enum):
    """Whether velocities may leave."""

    #: The robot has not been taken.  Not even a zero may leave: it takes a Kachaka off its dock.
    NOT_OPENED = 'not taken yet'
    #: This program has taken the robot.
    OPEN = 'open'
    #: The robot was released.  Nothing may leave: a zero would take it again.
    CLOSED = 'released'


class Run:
    """
    One motion, from the call that asks for it; only the newest run may send.

    :param max_gap: longest time between two messages, without the time that DDS takes [s]
    :param command_timeout: longest time with it: how long the robot keeps a velocity [s]
    """

    def __init__(
            self, max_gap: float = math.inf, command_timeout: float = math.inf) -> None:
        self.max_gap = max_gap
        self.command_timeout = command_timeout
        #: t = 0 [s on the steady clock]; nan before it begins
        self.began = math.nan
        #: when DDS had taken the last one [s on the clock for gaps]; None before
        self.last_sent: float | None = None
        #: time that the thread which drives had spent in ports by then [s]
        self.waited_before = 0.0
        #: why the run was ended; None as long as it may send
        self.ended_by: ControlError | None = None


class PortTime:
    """
    How long the thread that drives has spent in ports, such as DDS: for one robot or for many.

    While the thread waits for one robot's port, it cannot send to another: no fault of that one.
    """

    def __init__(self) -> None:
        #: the sum so far [s]
        self.total = 0.0


def _unchanged(velocity: Velocity) -> Velocity:
    return velocity


class VelocityGate:
    """
    The only publisher of velocities: calibration, latch, gap, limits, publish, telemetry.

    Checking and publishing happen under one lock.  Once a stop has sent its first zero, no
    velocity of the run that it stopped can follow, from any thread.

    :param transmit: publishes a velocity
    :param limits: the robot's limits; no velocity beyond them leaves, whatever planned it
    :param latch: once set, only zeros leave
    :param sending: set while DDS takes a message or answers a question
    :param clock: the steady clock [s]
    :param gap_clock: the clock for gaps [s]; it also counts while the machine sleeps
    :param command: returns what to send for a velocity, by the robot's calibration
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
        self._run: Run | None = None
        #: puts an event into a queue, and returns at once
        self.publish: Callable[[Event], None] = lambda _: None
        #: the time in ports of the thread that drives; one for all that it drives
        self.port_time = PortTime()
        #: makes the thread that drives look at once whether its run was ended
        self.wake: Callable[[], None] = lambda: None
        #: a run that was prepared and has not begun: it waits for the robot, for example
        self._pending: Run | None = None

    @property
    def state(self) -> GateState:
        """Return whether velocities may leave."""
        return self._state

    @property
    def run(self) -> Run | None:
        """Return the newest run that began, which may be over; None before the first."""
        return self._run

    def open(self) -> None:  # noqa: A003
        """Let velocities out: the robot is taken.  Without effect once the gate was closed."""
        with self._lock:
            if self._state is GateState.NOT_OPENED:
                self._state = GateState.OPEN

    def close(self) -> None:
        """Let nothing out from now on; it cannot be undone."""
        with self._lock:
            self._state = GateState.CLOSED

    def prepare(self) -> Run:
        """Return a run that has not begun; ``cancel`` ends it from now on."""
        run = Run()
        with self._lock:
            self._pending = run
        return run

    def begin(
            self, max_gap: float, run: Run | None = None,
            command_timeout: float = math.inf, began: float = math.nan) -> Run:
        """
        Begin a run; the run before it may send no more.

        :param max_gap: longest time between two messages, without the time that ports take [s]
        :param run: what ``prepare`` returned; None for a new run
        :param command_timeout: how long the robot keeps a velocity [s]: a longer gap ends the run
            whatever caused it, for the robot has stopped by itself
        :param began: t = 0 of the run [s on the clock]
        :returns: the run, for ``send``
        :raises ControlError: if the run was cancelled, the gate is not open or the latch is set
        """
        run = run or Run()
        with self._lock:
            if run.ended_by is not None:
                raise run.ended_by
            self._require_permission()
            run.max_gap, run.command_timeout, run.began = max_gap, command_timeout, began
            self._run, self._pending = run, None
        return run

    def send(
            self, run: Run, velocity: Velocity, kind: VelocityKind = VelocityKind.PLAN,
            due: float | None = None, plan_time: float | None = None, skipped: int = 0) -> float:
        """
        Publish a velocity of a run.

        :param velocity: what the robot is to do; what is sent follows by its calibration
        :param kind: what it is sent for
        :param due: when it is due [s after t = 0]
        :param plan_time: where on the plan that is [s of the plan]; None without a plan
        :param skipped: how many velocities before it were left out
        :returns: when it was sent [s on the clock]
        :raises ControlError: if the run was ended or the gap was too long, or the
            velocity is beyond the limits; nothing was published
        """
        command = self._command(velocity)
        # A Ctrl+C between the message and its event would lose the event.
        with self._lock, signal_dispatcher.deferred():
            self._require_limits(command)
            self._check(run)
            self._require_no_gap(run)
            # The time is read directly before: DDS stamps a message when it takes it.
            now, before = self._clock(), self._gap_clock()
            self._sending.set()
            try:
                self._transmit(command)
            finally:
                self._sending.clear()
                # What DDS takes while a node joins the graph, 0.3 s at worst, does not mean that
                # this program was held up.
                after = self._gap_clock()
                self.port_time.total += after - before
            self._publish_guardian_stop(now)
            self.publish(VelocitySent(
                now, command, kind, due, plan_time, skipped,
                None if command is velocity else velocity))
            run.last_sent, run.waited_before = after, self.port_time.total
            # A program that was frozen while DDS had the message has been stopped by now.  Without
            # this check it would wait for the next tick before its own stop.
            self._check(run)
            return now

    def wait_for_dds(self, ask: Callable[[], None]) -> None:
        """
        Call a function that may have to wait for DDS, and do not count that time as a gap.

        :param ask: the function; measured: 0.17 s to ask the graph while nodes join or leave
        """
        began = self._gap_clock()
        self._sending.set()
        try:
            ask()
        finally:
            self._sending.clear()
            self.port_time.total += self._gap_clock() - began

    def check(self, run: Run) -> None:
        """
        Check that a run may still send.

        :raises ControlError: if it may not
        """
        with self._lock:
            self._check(run)

    def cancel(self, reason: ControlError) -> Run | None:
        """
        End the newest run and the pending one: neither sends from now on.

        :param reason: what ``begin``, ``send`` and ``check`` raise for them
        :returns: the newest run that began; None before the first
        """
        with self._lock:
            for run in (self._run, self._pending):
                if run is not None and run.ended_by is None:
                    run.ended_by = reason
            cancelled = self._run
        self.wake()
        return cancelled

    def send_zero(self, after: Run | None, kind: VelocityKind = VelocityKind.STOP) -> bool:
        """
        Publish a zero, unless the gate is not open or a newer run has begun.

        :param after: the run that this zero follows; None before the first
        :param kind: what it is sent for
        :returns: whether it was published
        """
        with self._lock, signal_dispatcher.deferred():
            if self._state is not GateState.OPEN or self._run is not after:
                return False
            now = self._clock()
            self._sending.set()
            try:
                self._transmit(ZERO)
            finally:
                self._sending.clear()
            self._publish_guardian_stop(now)
            self.publish(VelocitySent(now, ZERO, kind))
            return True

    def _publish_guardian_stop(self, now: float) -> None:
        """Publish the guardian's first zero as an event, in its order."""
        stopped = self._latch.guardian_stop_time
        if stopped is not None and not self._has_logged_guardian and stopped < now:
            self._has_logged_guardian = True
            self.publish(VelocitySent(stopped, ZERO, VelocityKind.GUARDIAN))

    def _check(self, run: Run) -> None:
        if run.ended_by is not None:
            raise run.ended_by
        if run is not self._run:
            raise MotionRefusedError('this run is over: another one has begun')
        self._require_permission()

    def _require_permission(self) -> None:
        if self._latch.is_set:
            raise MotionRefusedError(
                'the robot was stopped permanently; only a new node moves it again')
        if self._state is not GateState.OPEN:
            raise MotionRefusedError(f'the robot cannot be driven: it is {self._state.value}')

    def _require_limits(self, velocity: Velocity) -> None:
        # A velocity object never changes, and the same one is sent many times.
        if velocity is self._within_limits:
            return
        try:
            self._limits.check(velocity)
        except InvalidMotionError as error:
            raise RunFaultError(f'a velocity was not sent: {error}') from None
        self._within_limits = velocity

    def _require_no_gap(self, run: Run) -> None:
        if run.last_sent is None:
            return
        gap = self._gap_clock() - run.last_sent
        # DDS may take no longer than the guardian allows, and the robot's command timeout bounds
        # the sum.
        waited = self.port_time.total - run.waited_before
        allowed = min(run.max_gap + min(waited, PUBLISH_TIMEOUT), run.command_timeout)
        if gap > allowed:
            raise RunFaultError(
                f'nothing was sent for {gap * 1e3:.0f} ms, more than the {allowed * 1e3:.0f} '
                f'ms allowed: the program was held up, {HELD_UP_ADVICE}')
