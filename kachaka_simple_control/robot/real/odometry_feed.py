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
"""Fetch odometry as long as somebody wants it."""

from __future__ import annotations

from collections.abc import Callable
import threading
import time
from typing import Any

from kachaka_simple_control.robot.real.outcome import Outcome, Trouble

#: How long the robot may take to have something newer [s].
DEADLINE = 1.0
#: Odometry is fetched at most every so many seconds, whatever a robot makes of cursors.
SPACING = 0.01
#: How often to look whether somebody wants odometry, or whether the robot is back [s].
IDLE = 0.1

Fetch = Callable[[int, float], tuple[Outcome, Any]]


class OdometryFeed:
    """Asks for what is newer than the last, again and again, in a thread of its own."""

    def __init__(
            self, name: str, fetch: Fetch, is_wanted: Callable[[], bool],
            publish: Callable[[Any], None], note: Callable[[Outcome, float], None]) -> None:
        """
        Fetch from ``start`` on.

        :param name: of the thread
        :param fetch: asks for what is newer than a cursor, with a deadline [s]
        :param is_wanted: whether somebody listens
        :param publish: called with each odometry that is new
        :param note: called with how a call ended, and when it began; but not with a call that
            ended without anything new, for that says nothing about the link
        """
        self._fetch = fetch
        self._is_wanted = is_wanted
        self._publish = publish
        self._note = note
        self._cursor = 0
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """End; a call under way is not waited for."""
        self._over.set()

    def join(self) -> None:
        """Wait for the end; soon after the connection was closed."""
        self._thread.join(DEADLINE)

    def step(self) -> float:
        """
        Fetch and publish once, if somebody listens.

        :returns: how long to wait before the next [s]
        """
        if not self._is_wanted():
            self._cursor = 0
            return IDLE
        begun = time.monotonic()
        outcome, answer = self._fetch(self._cursor, DEADLINE)
        if self._over.is_set():
            return 0.0
        if outcome.trouble is not Trouble.LATE:
            self._note(outcome, begun)
        if answer is None:
            self._cursor = 0
            return 0.0 if outcome.trouble is Trouble.LATE else IDLE
        cursor = answer.metadata.cursor
        if cursor == 0 or cursor != self._cursor:
            self._publish(answer.odometry)
        self._cursor = cursor
        return max(0.0, begun + SPACING - time.monotonic())

    def _run(self) -> None:
        while not self._over.is_set():
            pause = self.step()
            if pause > 0.0:
                self._over.wait(pause)
