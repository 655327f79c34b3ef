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
Accept requests: one drive at a time, and a resume that is confirmed; none of them at a stop.

A stop ends a drive from the call on that requests it.
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
    One drive, from the call that requests it to its end.

    :param run: what a stop cancels, even before the drive has begun
    :param thread: the thread that requested it
    :param ended: when it ended complete [s on the clock]; None before, and if it was cut short
    :param stopped_by: why another thread stopped it, or stopped the robot right after it
    """

    run: Run
    thread: int = field(default_factory=threading.get_ident)
    ended: float | None = None
    stopped_by: ControlError | None = None


class DriveRequests:
    """
    Accepts one drive at a time.

    Movements of one thread that follow each other within a period are one run to a caller that
    stops the robot from another thread: a stop between two of them refuses the second.

    :param gate: prepares the runs
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
        Accept a drive; ``finish`` has to follow.

        :raises ControlError: if another drive is under way, or a stop fell between the previous
            movement and this one
        """
        if not self._busy.acquire(blocking=False):
            raise MotionRunningError('a motion is running already; wait for its end, or stop it')
        request = DriveRequest(self._gate.prepare())
        previous, self._newest = self._newest, request
        # In this order: a stop that comes now finds either the run that was just prepared, or the
        # request before it, which is checked only here.
        if (previous is not None and previous.stopped_by is not None
                and self._continues(previous, request)):
            self.finish(request, is_complete=False)
            raise previous.stopped_by
        return request

    def finish(self, request: DriveRequest, is_complete: bool) -> None:
        """
        End a drive; the next may be accepted.

        :param request: what ``accept`` returned
        :param is_complete: whether it was driven to its end
        """
        request.ended = self._clock() if is_complete else None
        self._busy.release()

    def on_stop(self, reason: ControlError) -> None:
        """
        Record a stop, before the gate cancels the run.

        :param reason: the error with which a movement that follows at once is refused
        """
        newest = self._newest
        # A thread that stops its own drive may drive on.
        if newest is not None and newest.thread != threading.get_ident():
            newest.stopped_by = newest.stopped_by or reason

    def _continues(self, previous: DriveRequest, request: DriveRequest) -> bool:
        return (previous.ended is not None and previous.thread == request.thread
                and self._clock() - previous.ended <= self._period)


class ResumeConfirmation:
    """
    Tells whether a request to resume confirms one that was refused with a warning.

    It does if it comes after RESUME_QUIET_TIME without any request, and within
    RESUME_CONFIRM_TIMEOUT of the warning: a key that repeats, and many clients that ask at once,
    confirm nothing.  A warning is confirmed once.  Any thread may call this.

    :param clock: the steady clock [s]
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._requested = self._warned = float('-inf')

    def on_request(self) -> bool:
        """Take note of a request to resume; return whether it confirms the newest warning."""
        with self._lock:
            now = self._clock()
            is_late_enough = now - self._requested >= RESUME_QUIET_TIME
            is_confirmed = is_late_enough and now - self._warned <= RESUME_CONFIRM_TIMEOUT
            self._requested = now
            if is_confirmed:
                self._warned = float('-inf')
            return is_confirmed

    def on_warning(self) -> None:
        """Take note of a request that was refused with a warning."""
        with self._lock:
            self._warned = self._clock()


class StopRequests:
    """
    Refuses requests that start a motion at the same time as one that stops it.

    Two requests of one client may be served in either order: one to drive that was sent just
    before one to stop must not be served after it.

    :param clock: the steady clock [s]
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._newest = float('-inf')

    def on_stop(self) -> None:
        """Take note of a request to stop."""
        self._newest = self._clock()

    def require_none(self) -> None:
        """
        Check that no stop is requested at the same time.

        :raises MotionRefusedError: if one was within STOP_REQUEST_WINDOW
        """
        if self._clock() - self._newest < STOP_REQUEST_WINDOW:
            raise MotionRefusedError('a stop came at the same time: call again')
