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
"""Accept or refuse requests to drive a robot, and requests to resume a paused drive."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
import threading
import time

from kachaka_simple_control.control.timing import (
    RESUME_CONFIRM_TIMEOUT,
    RESUME_QUIET_TIME,
    STOP_REQUEST_WINDOW,
)
from kachaka_simple_control.control.velocity_gate import Permit, VelocityGate
from kachaka_simple_control.errors import ControlError, MotionRefusedError, MotionRunningError


@dataclass
class DriveRequest:
    """
    An accepted request to drive robots, and what has happened since.

    :param permits: by the gate of each robot; a stop cancels them, even before the drive has begun
    :param ended: when the drive was complete [s]; None before, or if it ended early
    :param stopped_by: the error that says how another thread has stopped the robot since; or None
    :param period: the time between two velocities of this drive [s]; 0 until its plan is known
    :param is_over: whether the drive has ended, at its planned end or early
    """

    permits: Mapping[VelocityGate, Permit]
    thread: int = field(default_factory=threading.get_ident)
    ended: float | None = None
    stopped_by: ControlError | None = None
    period: float = 0.0
    is_over: bool = False

    @property
    def cancelled_by(self) -> ControlError | None:
        """Why the drive of a robot was ended; None if none was."""
        return next((permit.ended_by for permit in self.permits.values() if permit.ended_by), None)


class DriveRequests:
    """
    Accepts or refuses requests to drive the robots of some gates: one drive at a time.

    A stop by another thread also ends a series: drives that one thread requests, each within one
    period after the one before was complete.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._newest: dict[VelocityGate, DriveRequest] = {}

    def is_busy(self, gates: Iterable[VelocityGate]) -> bool:
        """Return whether a drive of one of the robots was accepted and has not ended yet."""
        return any(gate in self._newest and not self._newest[gate].is_over for gate in gates)

    def accept(self, gates: Sequence[VelocityGate]) -> DriveRequest:
        """
        Accept a new drive; the caller has to call ``finish`` when it has ended.

        :raises ControlError: if another drive of one of the robots is under way, or another thread
            has stopped the series
        """
        with self._lock:
            if self.is_busy(gates):
                raise MotionRunningError(
                    'a motion is running already; wait for its end, or stop it')
            request = DriveRequest({gate: gate.prepare() for gate in gates})
            before = [self._newest[gate] for gate in gates if gate in self._newest]
            self._newest.update(dict.fromkeys(gates, request))
        # The order matters.  A stop at this moment finds either the new drive or the previous
        # request.  So check the previous requests only after the drive was prepared.
        for previous in before:
            if previous.stopped_by is not None and self._continues(previous, request):
                self.finish(request, is_complete=False)
                raise previous.stopped_by
        return request

    def renew(self, request: DriveRequest) -> None:
        """
        Let an accepted request drive once more, after a drive that was complete.

        :raises ControlError: if another thread has stopped it since
        """
        # The order matters: a stop at this moment finds either the new permits or the old ones.
        before, request.permits = request.permits, {
            gate: gate.prepare() for gate in request.permits}
        for permit in before.values():
            if permit.ended_by is not None:
                raise permit.ended_by

    def is_ending(self, gates: Iterable[VelocityGate]) -> bool:
        """Return whether another thread still has to end a drive that was stopped as a whole."""
        return any(
            not newest.is_over and newest.thread != threading.get_ident()
            and all(permit.ended_by is not None for permit in newest.permits.values())
            for newest in [self._newest[gate] for gate in gates if gate in self._newest])

    def finish(self, request: DriveRequest, is_complete: bool) -> None:
        """Record that a drive has ended, at its planned end or early."""
        request.ended, request.is_over = self._clock() if is_complete else None, True

    def on_stop(self, reason: ControlError, gates: Iterable[VelocityGate]) -> None:
        """
        Record that the calling thread stops robots; call this before their drives are cancelled.

        A thread may stop its own drive and then drive again: that is not recorded.

        :param reason: what ``accept`` raises if the series goes on
        """
        for newest in [self._newest[gate] for gate in gates if gate in self._newest]:
            # A thread that stops its own drive may drive again.
            if newest.thread != threading.get_ident():
                newest.stopped_by = newest.stopped_by or reason

    def _continues(self, previous: DriveRequest, request: DriveRequest) -> bool:
        return (previous.ended is not None and previous.thread == request.thread
                and self._clock() - previous.ended <= previous.period)


class ResumeConfirmation:
    """
    Decides whether a paused drive may be resumed in spite of a warning.

    A request to resume is refused with a warning if somebody moved the robot in the pause.  It is
    accepted when it is repeated: within RESUME_CONFIRM_TIMEOUT after the warning, and at least
    RESUME_QUIET_TIME after the request before, so that a key that is held down stays refused.
    Each warning allows one request.  Any thread may call the methods.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._requested = self._warned = float('-inf')

    def on_request(self) -> bool:
        """Record a request to resume, and return whether it overrides a warning."""
        with self._lock:
            now = self._clock()
            is_late_enough = now - self._requested >= RESUME_QUIET_TIME
            is_confirmed = is_late_enough and now - self._warned <= RESUME_CONFIRM_TIMEOUT
            self._requested = now
            if is_confirmed:
                self._warned = float('-inf')
            return is_confirmed

    def on_warning(self) -> None:
        """Record that a request was refused with a warning."""
        with self._lock:
            self._warned = self._clock()


class StopRequests:
    """
    Refuses requests that start a motion within a short time after a request to stop.

    A client may request a drive, and directly after it a stop, which the node may process first.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._newest = float('-inf')

    def on_stop(self) -> None:
        """Record that a client requests a stop now."""
        self._newest = self._clock()

    def require_none(self) -> None:
        """
        Check that no client has requested a stop during the last STOP_REQUEST_WINDOW.

        :raises MotionRefusedError: if one has
        """
        if self._clock() - self._newest < STOP_REQUEST_WINDOW:
            raise MotionRefusedError('a stop came at the same time: call again')
