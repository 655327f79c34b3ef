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
"""One drive at a time, which a stop ends from the call that asks for it on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
import threading
import time

from kachaka_simple_control.control.velocity_gate import Run, VelocityGate
from kachaka_simple_control.errors import ControlError, MotionRefusedError


@dataclass
class DriveRequest:
    """
    One drive, from the call that asks for it to its end.

    :param run: what a stop cancels, before it has begun as well
    :param thread: the thread that asked
    :param ended: when it ended whole [s on the clock]; None before, and if it was cut short
    :param stopped_by: why another thread stopped it, or stopped the robot right after it
    """

    run: Run
    thread: int = field(default_factory=threading.get_ident)
    ended: float | None = None
    stopped_by: ControlError | None = None


class DriveRequests:
    """
    Accepts one drive at a time.

    Movements of one thread that follow each other within a period are one run to whoever stops
    the robot from outside: a stop that falls between two of them refuses the second.
    """

    def __init__(
            self, edge: VelocityGate, period: float,
            clock: Callable[[], float] = time.monotonic) -> None:
        """
        Accept the first.

        :param edge: prepares the runs
        :param period: time between two messages of a run [s]
        :param clock: the steady clock [s]
        """
        self._edge = edge
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
        Accept a drive; ``finish`` ends it.

        :returns: the request
        :raises ControlError: if another drive is under way, or a stop fell between the movement
            before and this one
        """
        if not self._busy.acquire(blocking=False):
            raise MotionRefusedError('a motion is running already; wait for its end, or stop it')
        request = DriveRequest(self._edge.prepare())
        last, self._newest = self._newest, request
        # In this order: a stop that comes now finds either the run that was just prepared, or the
        # request before it, which is looked at only here.
        if last is not None and last.stopped_by is not None and self._continues(last, request):
            self.finish(request, is_whole=False)
            raise last.stopped_by
        return request

    def finish(self, request: DriveRequest, is_whole: bool) -> None:
        """
        End a drive; the next may be accepted.

        :param request: what ``accept`` returned
        :param is_whole: whether it was driven to its end
        """
        request.ended = self._clock() if is_whole else None
        self._busy.release()

    def on_stop(self, reason: ControlError) -> None:
        """
        Take note of a stop, before the edge cancels what is under way.

        :param reason: what a movement that follows at once is refused with
        """
        newest = self._newest
        # The thread that drives and stops by itself may go on as it likes.
        if newest is not None and newest.thread != threading.get_ident():
            newest.stopped_by = newest.stopped_by or reason

    def _continues(self, last: DriveRequest, request: DriveRequest) -> bool:
        return (last.ended is not None and last.thread == request.thread
                and self._clock() - last.ended <= self._period)
