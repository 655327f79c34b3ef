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
"""The only way out for a velocity: latch and gap, limits, publish, record."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
import math
import threading
import time

from kachaka_simple_control.control.latch import Latch, SharedFlag
from kachaka_simple_control.control.processes import boottime
from kachaka_simple_control.control.timing import PUBLISH_TIMEOUT
from kachaka_simple_control.errors import (
    ControlError,
    InvalidMotionError,
    MotionRefusedError,
    RunFaultError,
)
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits


class GateState(Enum):
    """What may be published."""

    #: the robot has not been taken: not even a zero, for a zero takes a Kachaka off its dock
    NOT_OPENED = 'not yet'
    #: the robot is ours
    OPEN = 'open'
    #: the robot was given back: nothing, for a zero would take it again
    CLOSED = 'closed'


class Run:
    """
    One stretch of motion, from the call that asks for it; only the newest one may send.

    :param max_gap: the longest time between two of its messages, without DDS's share [s]
    :param hold: the longest time with it: how long the robot keeps a velocity [s]
    """

    def __init__(self, max_gap: float = math.inf, hold: float = math.inf) -> None:
        """Begin with nothing sent."""
        self.max_gap = max_gap
        self.hold = hold
        #: when the first message left [s on the steady clock]: t = 0; nan before
        self.began = math.nan
        #: when the last one was out [s on the clock for gaps]
        self.last_sent: float | None = None
        #: for how long since then this program has waited for DDS [s]
        self.waited = 0.0
        #: why it may not send, or send any more; None as long as it may
        self.ended_by: ControlError | None = None


class VelocityGate:
    """
    Every velocity of this program passes here, one at a time.

    Checks and publishing happen under one lock: once a stop has sent its first zero, no velocity
    of the run that it stopped can follow, whichever threads are at work.
    """

    def __init__(
            self,
            transmit: Callable[[Velocity], None],
            limits: Limits,
            latch: Latch,
            sending: SharedFlag | None = None,
            clock: Callable[[], float] = time.monotonic,
            gap_clock: Callable[[], float] = boottime) -> None:
        """
        Make an edge that lets nothing out yet.

        :param transmit: puts a velocity on the wire
        :param limits: what is never exceeded, whoever planned it
        :param latch: once set, nothing but zeros leaves
        :param sending: up while DDS is handed a message or asked something, which may take its
            time
        :param clock: the steady clock [s]
        :param gap_clock: the clock that gaps are measured with [s]; it runs on while the machine
            sleeps
        """
        self._transmit = transmit
        self._limits = limits
        self._within_limits = ZERO
        self._latch = latch
        self._sending = sending or SharedFlag()
        self._clock = clock
        self._gap_clock = gap_clock
        self._lock = threading.Lock()
        self._access = GateState.NOT_OPENED
        self._run: Run | None = None
        #: a run that was asked for and has not begun: it waits for the robot, for example
        self._pending: Run | None = None
        #: called with the time [s on the clock] and the velocity of each message sent
        self.on_sent: Callable[[float, Velocity], None] = _ignore
        #: called with the time [s on the clock] when the first message of a run was sent: t = 0
        self.on_began: Callable[[float], None] = _ignore

    @property
    def state(self) -> GateState:
        """Return what may be published now."""
        return self._access

    @property
    def run(self) -> Run | None:
        """Return the newest run, which may be over; None if nothing ever moved."""
        return self._run

    def open(self) -> None:
        """Let velocities out from now on: the robot is ours."""
        with self._lock:
            if self._access is GateState.NOT_OPENED:
                self._access = GateState.OPEN

    def close(self) -> None:
        """Let nothing out any more, for good."""
        with self._lock:
            self._access = GateState.CLOSED

    def prepare(self) -> Run:
        """
        Make a run that has not begun; ``cancel`` ends it from now on, whatever it waits for.

        :returns: the run, for ``begin``
        """
        run = Run()
        with self._lock:
            self._pending = run
        return run

    def begin(self, max_gap: float, run: Run | None = None, hold: float = math.inf) -> Run:
        """
        Begin a run; the one before it may send no more.

        :param max_gap: the longest time between two of its messages [s]; waiting for DDS is not
            counted
        :param run: what ``prepare`` returned; None for a run that nobody had to wait for
        :param hold: how long the robot keeps a velocity without a new one [s]: no gap may be
            longer, whatever it was spent on, for the robot has stopped by itself by then
        :returns: the run, which ``send`` asks for
        :raises ControlError: if it was cancelled already, the robot is not ours or the latch is
            set
        """
        run = run or Run()
        with self._lock:
            if run.ended_by is not None:
                raise run.ended_by
            self._require_permission()
            run.max_gap, run.hold = max_gap, hold
            self._run, self._pending = run, None
        return run

    def send(self, run: Run, velocity: Velocity) -> None:
        """
        Publish a velocity of a run.

        :param run: the run it belongs to
        :param velocity: what to send
        :raises ControlError: if this run may not send any more, or was late, or the velocity is
            beyond the limits
        """
        with self._lock:
            self._require_limits(velocity)
            self._check(run)
            self._require_no_gap(run)
            sent = self._publish(velocity)
            if run.last_sent is None:
                run.began = sent
                self.on_began(sent)
            # Afterwards: what DDS takes while somebody joins the graph, 0.3 s at worst, is no sign
            # that this program was held up.
            run.last_sent, run.waited = self._gap_clock(), 0.0
            # Frozen while DDS had the message, this program has been stopped by now: then nothing
            # is to be waited for, and the stop follows at once.
            self._check(run)

    def wait_for_dds(self, run: Run, ask: Callable[[], None]) -> None:
        """
        Do what may have to wait for DDS: that is no sign that this program was held up.

        While others join or leave, asking the graph was seen to take a sixth of a second.

        :param run: the run in whose thread it is done
        :param ask: what to do; what it raises is passed on
        """
        began = self._gap_clock()
        self._sending.set()
        try:
            ask()
        finally:
            self._sending.clear()
            run.waited += self._gap_clock() - began

    def check(self, run: Run) -> None:
        """
        Raise what ``send`` would raise if the run has been stopped.

        :param run: the run to look at
        :raises ControlError: if this run may not send any more
        """
        with self._lock:
            self._check(run)

    def cancel(self, reason: ControlError) -> Run | None:
        """
        End the newest run, and the one that has not begun: neither sends from now on.

        :param reason: what ``begin``, ``send`` and ``check`` raise for them from now on
        :returns: the newest run that began, or None if there never was one
        """
        with self._lock:
            for run in (self._run, self._pending):
                if run is not None and run.ended_by is None:
                    run.ended_by = reason
            return self._run

    def send_zero(self, after: Run | None) -> bool:
        """
        Publish a zero, unless the robot is not ours or has begun a newer run.

        :param after: the run that this zero follows; None before the first one
        :returns: whether it was published
        """
        with self._lock:
            if self._access is not GateState.OPEN or self._run is not after:
                return False
            self._publish(ZERO)
            return True

    def _publish(self, velocity: Velocity) -> float:
        # Read directly before: DDS stamps a message as it takes it.
        now = self._clock()
        self._sending.set()
        try:
            self._transmit(velocity)
        finally:
            self._sending.clear()
        self.on_sent(now, velocity)
        return now

    def _check(self, run: Run) -> None:
        if run.ended_by is not None:
            raise run.ended_by
        if run is not self._run:
            raise MotionRefusedError('this run is over: another one has begun')
        self._require_permission()

    def _require_permission(self) -> None:
        if self._latch.is_set:
            raise MotionRefusedError(
                'the robot was stopped for good; only a new node moves it again')
        if self._access is not GateState.OPEN:
            raise MotionRefusedError(f'the robot is not ours ({self._access.value})')

    def _require_limits(self, velocity: Velocity) -> None:
        # The same one comes again and again, and never changes.
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
        # DDS may take no longer than the guardian lets it, however often it is asked.
        allowed = min(run.max_gap + min(run.waited, PUBLISH_TIMEOUT), run.hold)
        if gap > allowed:
            raise RunFaultError(
                f'nothing was sent for {gap * 1e3:.0f} ms, more than the {allowed * 1e3:.0f} '
                'ms allowed: the program was held up, so the motion was given up')


def _ignore(*what: object) -> None:
    """Record nothing."""
