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
"""Threads that poll odometry and health, and one that logs."""

from __future__ import annotations

from collections.abc import Callable
import queue
import threading
import time
from typing import Any, TYPE_CHECKING

from kachaka_simple_control.kachaka.error_codes import ErrorTexts, Level
from kachaka_simple_control.kachaka.grpc_client.connection_state import RpcFailure, RpcResult
from kachaka_simple_control.kachaka.grpc_client.robot_driver import RobotDriver

if TYPE_CHECKING:
    from kachaka_simple_control.kachaka.grpc_client.client import RobotClient

#: The same text is said again only after so many seconds without it.
LOG_REPEAT_PERIOD = 1.0
#: How long to wait at the end until everything is said [s].
LOG_EXIT_TIMEOUT = 0.5


class LogThread:
    """Says what it is told in a thread of its own."""

    def __init__(self, say: Callable[[Level, str], None]) -> None:
        """
        Say nothing yet.

        :param say: says a text; may take its time
        """
        self._say = say
        self._texts: queue.SimpleQueue[tuple[Level, str] | None] = queue.SimpleQueue()
        self._heard: dict[str, float] = {}
        self._thread = threading.Thread(target=self._run, name='speaker', daemon=True)
        self._thread.start()

    def log(self, level: Level, text: str) -> None:
        """
        Have something said; returns at once.

        :param level: how bad it is
        :param text: the text; not said while the same one is repeated
        """
        now = time.monotonic()
        # Texts have figures in them: what was not heard lately is forgotten.
        self._heard = {
            known: at for known, at in self._heard.items() if now - at < LOG_REPEAT_PERIOD}
        if text not in self._heard:
            self._texts.put((level, text))
        self._heard[text] = now

    def close(self) -> None:
        """Say what is left."""
        self._texts.put(None)
        self._thread.join(LOG_EXIT_TIMEOUT)

    def _run(self) -> None:
        while (one := self._texts.get()) is not None:
            self._say(*one)


#: How long the robot may take to have something newer [s].
ODOMETRY_DEADLINE = 1.0
#: Odometry is fetched at most every so many seconds, whatever a robot makes of cursors.
SPACING = 0.01
#: How often to look whether somebody wants odometry, or whether the robot is back [s].
IDLE = 0.1

Fetch = Callable[[int, float], tuple[RpcResult, Any]]


class OdometryPoller:
    """Asks for what is newer than the last, again and again, in a thread of its own."""

    def __init__(
            self, name: str, fetch: Fetch, is_wanted: Callable[[], bool],
            publish: Callable[[Any], None], note: Callable[[RpcResult, float], None]) -> None:
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
        self._thread.join(ODOMETRY_DEADLINE)

    def poll(self) -> float:
        """
        Fetch and publish once, if somebody listens.

        :returns: how long to wait before the next [s]
        """
        if not self._is_wanted():
            self._cursor = 0
            return IDLE
        begun = time.monotonic()
        outcome, answer = self._fetch(self._cursor, ODOMETRY_DEADLINE)
        if self._over.is_set():
            return 0.0
        if outcome.failure is not RpcFailure.LATE:
            self._note(outcome, begun)
        if answer is None:
            self._cursor = 0
            return 0.0 if outcome.failure is RpcFailure.LATE else IDLE
        cursor = answer.metadata.cursor
        if cursor == 0 or cursor != self._cursor:
            self._publish(answer.odometry)
        self._cursor = cursor
        return max(0.0, begun + SPACING - time.monotonic())

    def _run(self) -> None:
        while not self._over.is_set():
            pause = self.poll()
            if pause > 0.0:
                self._over.wait(pause)


#: How often to look [s], while the robot is there and while it is not.
HEALTH_PERIOD = 1.0
HEALTH_PERIOD_WHEN_LOST = 0.3
#: How long it may take to answer [s].
HEALTH_DEADLINE = 1.0


class HealthPoller:
    """Looks at the robot in a thread of its own; so a lost link is noticed, and its return."""

    def __init__(
            self, client: RobotClient, robot: RobotDriver, tell: Callable[[Level, str], None],
            on_look: Callable[[], None]) -> None:
        """
        Look from ``start`` on.

        :param client: the robot's calls
        :param robot: told whether it answers
        :param tell: called with what a person should know
        :param on_look: called after each look
        """
        self._client = client
        self._robot = robot
        self._tell = tell
        self._on_look = on_look
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name='watch', daemon=True)
        #: the errors that the robot reports
        self.codes: list[int] = []

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """End; a look under way is not waited for."""
        self._over.set()
        self._thread.join(HEALTH_DEADLINE / 2.0)

    def poll(self) -> None:
        """Look once."""
        begun = time.monotonic()
        outcome, codes = self._client.errors(HEALTH_DEADLINE)
        self._robot.note(outcome, begun)
        if outcome.is_success:
            self._learn(codes)
            self._report(codes)
        self._on_look()

    def _run(self) -> None:
        while not self._over.is_set():
            self.poll()
            self._over.wait(HEALTH_PERIOD if self._robot.link.is_up else HEALTH_PERIOD_WHEN_LOST)

    def _learn(self, codes: list[int]) -> None:
        """Ask what errors mean if a new one has no text yet: the robot may not have been ready."""
        new = set(codes) - set(self.codes)
        if any(not self._robot.texts.find(code).title for code in new):
            outcome, text = self._client.error_texts(HEALTH_DEADLINE)
            if outcome.is_success:
                self._robot.texts = ErrorTexts(text)

    def _report(self, codes: list[int]) -> None:
        for code in codes:
            if code not in self.codes:
                level = self._robot.texts.find(code).level
                self._tell(level, f'the robot reports {self._robot.texts.describe(code)}')
        if self.codes and not codes:
            self._tell(Level.OK, 'the robot reports no errors any more')
        self.codes = codes
