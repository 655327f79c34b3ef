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
"""Rules for requests: when a resume is confirmed, and that none is served at a stop; pure."""

from __future__ import annotations

from collections.abc import Callable
import threading
import time

from kachaka_simple_control.control.timing import (
    RESUME_CONFIRM_TIMEOUT,
    RESUME_QUIET_TIME,
    STOP_REQUEST_WINDOW,
)
from kachaka_simple_control.errors import MotionRefusedError


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
