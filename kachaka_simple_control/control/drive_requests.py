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
Accept or refuse requests to drive and to resume a drive.

Only one drive is accepted at a time.  After a warning, a resume must be confirmed by a second
request.  Requests that come at the same time as a stop are refused.  A stop cancels a drive at any
time after the call that requests the drive.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
import threading
import time

from kachaka_simple_control.control.timing import (
    RESUME_CONFIRM_TIMEOUT,
    RESUME_QUIET_TIME,
    STOP_REQUEST_WINDOW,
)
from kachaka_simple_control.control.velocity_gate import Run, VelocityGate
from kachaka_simple_control.errors import ControlError, MotionRefusedError, MotionRunningError


@dataclass
class DriveRequest:
    """
    The state of one drive, from the call that requests the drive until its end.

    :param run: the run of the drive; a stop cancels it, even before the drive has begun
    :param thread: the thread that requested the drive
    :param ended: when the drive was complete [s on the clock]; None before that time, or if the
        drive ended early
    :param stopped_by: the error of a stop by another thread, during the drive or right after it;
        None if there was no such stop
    """

    run: Run
    thread: int = field(default_factory=threading.get_ident)
    ended: float | None = None
    stopped_by: ControlError | None = None


class DriveRequests:
    """
    Accepts one drive at a time.

    Another thread may stop the robot between two movements of a program.  The second movement is
    then refused, if it is requested within one period after the end of the first.

    :param gate: the velocity gate, which creates the runs
    :param period: time between two messages of a run [s]
    :param clock: the steady clock [s]
    """

    def __init__(
            self, gate: VelocityGate, period: float,
            clock: Callable[[], float] = time.monotonic) -> None:
        self._gate = gate
        self._period = period
        self._clock = clock
        self._busy = threading.Lock()
        self._newest: DriveRequest | None = None

    @property
    def is_busy(self) -> bool:
        """Whether a drive is under way."""
        return self._busy.locked()

    def accept(self) -> DriveRequest:
        """
        Accept a drive; the caller has to call ``finish`` at its end.

        :raises ControlError: if another drive is under way, or a stop came between the previous
            movement and this one
        """
        if not self._busy.acquire(blocking=False):
            raise MotionRunningError('a motion is running already; wait for its end, or stop it')
        request = DriveRequest(self._gate.prepare())
        previous, self._newest = self._newest, request
        # The order matters.  A stop at this moment finds either the new run or the previous
        # request.  So check the previous request only after the run was prepared.
        if (previous is not None and previous.stopped_by is not None
                and self._continues(previous, request)):
            self.finish(request, is_complete=False)
            raise previous.stopped_by
        return request

    def finish(self, request: DriveRequest, is_complete: bool) -> None:
        """
        End a drive, so that the next one can be accepted.

        :param request: the request that ``accept`` returned
        :param is_complete: whether the drive reached its end
        """
        request.ended = self._clock() if is_complete else None
        self._busy.release()

    def on_stop(self, reason: ControlError) -> None:
        """
        Record a stop; call this before the gate cancels the run.

        :param reason: the error that is raised for a movement right after the stop
        """
        newest = self._newest
        # A thread that stops its own drive may drive again.
        if newest is not None and newest.thread != threading.get_ident():
            newest.stopped_by = newest.stopped_by or reason

    def _continues(self, previous: DriveRequest, request: DriveRequest) -> bool:
        return (previous.ended is not None and previous.thread == request.thread
                and self._clock() - previous.ended <= self._period)


class ResumeConfirmation:
    """
    Decides whether a request to resume confirms an earlier one that was refused with a warning.

    A request confirms the newest warning if it comes within RESUME_CONFIRM_TIMEOUT after the
    warning, and if no other request came during RESUME_QUIET_TIME before it.  So the requests of a
    key that is held down, or of several clients at the same time, confirm nothing.  Each warning
    can be confirmed only once.  Any thread may call the methods.

    :param clock: the steady clock [s]
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._requested = self._warned = float('-inf')

    def on_request(self) -> bool:
        """Record a request to resume; return whether it confirms the newest warning."""
        with self._lock:
            now = self._clock()
            is_late_enough = now - self._requested >= RESUME_QUIET_TIME
            is_confirmed = is_late_enough and now - self._warned <= RESUME_CONFIRM_TIMEOUT
            self._requested = now
            if is_confirmed:
                self._warned = float('-inf')
            return is_confirmed

    def on_warning(self) -> None:
        """Record that a request to resume was refused with a warning."""
        with self._lock:
            self._warned = self._clock()


class StopRequests:
    """
    Refuses requests that start a motion within a short time after a request to stop.

    A client may send a request to drive and directly after it a request to stop.  The node may
    process these two requests in the opposite order.  The drive must not start in this case.

    :param clock: the steady clock [s]
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._newest = float('-inf')

    def on_stop(self) -> None:
        """Record a request to stop."""
        self._newest = self._clock()

    def require_none(self) -> None:
        """
        Check that no stop was requested within the last STOP_REQUEST_WINDOW.

        :raises MotionRefusedError: if a stop was requested in this time
        """
        if self._clock() - self._newest < STOP_REQUEST_WINDOW:
            raise MotionRefusedError('a stop came at the same time: call again')
