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
Accept or refuse requests to drive a robot, and requests to resume a paused drive.

Only one drive is accepted at a time.  A request to drive that comes at almost the same time as a
request to stop is refused.  A request to resume may be refused with a warning.  To resume in spite
of the warning, the user repeats the request.  A stop cancels a requested drive even before the
robot moves.
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
    An accepted request to drive the robot, and what has happened since this request.

    :param run: the permission to send the velocities of this drive; a stop cancels it, even before
        the drive has begun
    :param thread: the identifier of the thread that requested the drive
    :param ended: when the drive was complete [s on the steady clock]; None before that time, or if
        the drive ended early
    :param stopped_by: if another thread has stopped the robot since this request, an error that
        describes the stop; otherwise None
    :param period: the time between two velocities of this drive [s]; 0 until its plan is known
    """

    run: Run
    thread: int = field(default_factory=threading.get_ident)
    ended: float | None = None
    stopped_by: ControlError | None = None
    period: float = 0.0


class DriveRequests:
    """
    Accepts or refuses requests to drive, so that only one drive is under way at a time.

    A stop also ends a series of movements.  In a series, one thread requests each movement within
    one period after its previous movement was complete.  If another thread stops the robot between
    two movements of a series, the second of these movements is refused.

    :param gate: the velocity gate, the only object that publishes velocities; it creates a run,
        the permission to send velocities, for each drive
    :param clock: the steady clock [s]
    """

    def __init__(
            self, gate: VelocityGate, clock: Callable[[], float] = time.monotonic) -> None:
        self._gate = gate
        self._clock = clock
        self._busy = threading.Lock()
        self._newest: DriveRequest | None = None

    @property
    def is_busy(self) -> bool:
        """Whether a drive was accepted and has not ended yet."""
        return self._busy.locked()

    def accept(self) -> DriveRequest:
        """
        Accept a new drive, unless it must be refused.

        The caller has to call ``finish`` when the drive has ended.

        :returns: the accepted request; its ``run`` is needed to send the velocities of the drive
        :raises ControlError: if another drive is under way, or if the new drive would continue a
            series of movements that another thread has stopped
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
        Record that a drive has ended, so that the next drive can be accepted.

        :param request: the request that ``accept`` returned for the drive
        :param is_complete: True if the drive reached its planned end; False if it ended early
        """
        request.ended = self._clock() if is_complete else None
        self._busy.release()

    def on_stop(self, reason: ControlError) -> None:
        """
        Record that the calling thread stops the robot, so that a series of movements ends.

        Call this before the drive is cancelled.  A thread may stop its own drive, and then drive
        again at once.  So if the calling thread has requested the newest drive itself, nothing is
        recorded.

        :param reason: the error that ``accept`` raises if the thread of the newest drive requests
            its next movement right after the stop
        """
        newest = self._newest
        # A thread that stops its own drive may drive again.
        if newest is not None and newest.thread != threading.get_ident():
            newest.stopped_by = newest.stopped_by or reason

    def _continues(self, previous: DriveRequest, request: DriveRequest) -> bool:
        return (previous.ended is not None and previous.thread == request.thread
                and self._clock() - previous.ended <= previous.period)


class ResumeConfirmation:
    """
    Decides whether a paused drive may be resumed in spite of a warning.

    A request to resume is refused with a warning if somebody moved the robot during the pause.  To
    resume all the same, the user repeats the request.  The repeated request must come within
    RESUME_CONFIRM_TIMEOUT after the newest warning, and at least RESUME_QUIET_TIME after the
    request before it.  So if a key is held down, the requests that follow each other quickly stay
    refused.  After a warning, only one repeated request is accepted.  Any thread may call the
    methods.

    :param clock: the steady clock [s]
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._requested = self._warned = float('-inf')

    def on_request(self) -> bool:
        """
        Record a request to resume a paused drive, and decide whether it overrides a warning.

        :returns: True if the request was repeated at the right time after a warning, so that the
            drive may be resumed in spite of the warning
        """
        with self._lock:
            now = self._clock()
            is_late_enough = now - self._requested >= RESUME_QUIET_TIME
            is_confirmed = is_late_enough and now - self._warned <= RESUME_CONFIRM_TIMEOUT
            self._requested = now
            if is_confirmed:
                self._warned = float('-inf')
            return is_confirmed

    def on_warning(self) -> None:
        """
        Record that a request to resume was refused with a warning.

        After this, ``on_request`` can allow a repeated request.
        """
        with self._lock:
            self._warned = self._clock()


class StopRequests:
    """
    Refuses requests that start a motion within a short time after a request to stop.

    A client may request a drive, and directly after it a stop.  The node may process the stop
    first.  In this case the drive, which is processed second, must not start.

    :param clock: the steady clock [s]
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

        :raises MotionRefusedError: if a stop was requested in this time
        """
        if self._clock() - self._newest < STOP_REQUEST_WINDOW:
            raise MotionRefusedError('a stop came at the same time: call again')
