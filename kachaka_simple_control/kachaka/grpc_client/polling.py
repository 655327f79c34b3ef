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
"""Threads that poll odometry and robot errors, and a thread that logs."""

from __future__ import annotations

from collections.abc import Callable
import queue
import threading
import time
from typing import Any, TYPE_CHECKING

from kachaka_simple_control.kachaka.grpc_client.robot_driver import RobotDriver
from kachaka_simple_control.kachaka.robot_status import ErrorTexts, RpcFailure, RpcResult
from kachaka_simple_control.telemetry.diagnosis import Level

if TYPE_CHECKING:
    from kachaka_simple_control.kachaka.grpc_client.client import RobotClient

#: A repeated text is logged again only after a gap of this time [s].
LOG_REPEAT_PERIOD = 1.0
#: The longest time that ``close()`` waits for the queue [s].
LOG_EXIT_TIMEOUT = 0.5


class LogThread(threading.Thread):
    """
    A thread that logs texts, so that the caller never waits; it drops repeated texts.

    :param emit: logs a text; may block
    """

    def __init__(self, emit: Callable[[Level, str], None]) -> None:
        super().__init__(name='log', daemon=True)
        self._emit = emit
        self._queue: queue.SimpleQueue[tuple[Level, str] | None] = queue.SimpleQueue()
        self._last_times: dict[str, float] = {}
        self.start()

    def log(self, level: Level, text: str) -> None:
        """Queue a text for the log, unless the same text is recent."""
        now = time.monotonic()
        # Texts contain numbers, so there may be many different ones: keep only recent ones.
        self._last_times = {
            known: at for known, at in self._last_times.items() if now - at < LOG_REPEAT_PERIOD}
        if text not in self._last_times:
            self._queue.put((level, text))
        self._last_times[text] = now

    def close(self) -> None:
        """Log the queued texts, and end the thread."""
        self._queue.put(None)
        self.join(LOG_EXIT_TIMEOUT)

    def run(self) -> None:
        """Log the texts of the queue until ``close()``."""
        while (entry := self._queue.get()) is not None:
            self._emit(*entry)


class Poller(threading.Thread):
    """
    The base class of threads that poll the robot.

    :param name: the name of the thread
    """

    def __init__(self, name: str) -> None:
        super().__init__(name=name, daemon=True)
        self.is_over = threading.Event()

    def poll(self) -> float:
        """Poll once; return the time to wait until the next poll [s]."""
        raise NotImplementedError

    def run(self) -> None:
        """Poll until ``stop()``."""
        while not self.is_over.is_set():
            self.is_over.wait(self.poll())

    def stop(self) -> None:
        """Make the thread end after the current call; a closed client makes this fast."""
        self.is_over.set()


#: The longest time to wait for newer odometry [s], also at the end of the thread.
ODOMETRY_DEADLINE = 1.0
#: The shortest period of odometry [s], even if a robot ignores cursors.
MIN_ODOMETRY_PERIOD = 0.01
#: The period of checks while odometry has no subscriber, or the robot does not respond [s].
IDLE_PERIOD = 0.1

Fetch = Callable[[int, float], tuple[RpcResult, Any]]


class OdometryPoller(Poller):
    """
    Fetches and publishes odometry in a thread, started by ``start()``.

    :param name: the name of the thread
    :param fetch: returns odometry newer than a cursor, within a deadline [s]
    :param is_wanted: returns whether odometry has a subscriber
    :param publish: called with each new odometry
    :param on_result: called with the result and the start time of each call, except a call that
        times out, because this gives no information about the connection
    """

    def __init__(
            self, name: str, fetch: Fetch, is_wanted: Callable[[], bool],
            publish: Callable[[Any], None], on_result: Callable[[RpcResult, float], None]) -> None:
        super().__init__(name)
        self._fetch = fetch
        self._is_wanted = is_wanted
        self._publish = publish
        self._on_result = on_result
        self._cursor = 0

    def poll(self) -> float:
        """Fetch and publish once if there is a subscriber; return the time to wait [s]."""
        if not self._is_wanted():
            self._cursor = 0
            return IDLE_PERIOD
        begun = time.monotonic()
        result, response = self._fetch(self._cursor, ODOMETRY_DEADLINE)
        if self.is_over.is_set():
            return 0.0
        if result.failure is not RpcFailure.LATE:
            self._on_result(result, begun)
        if response is None:
            self._cursor = 0
            return 0.0 if result.failure is RpcFailure.LATE else IDLE_PERIOD
        cursor = response.metadata.cursor
        if cursor == 0 or cursor != self._cursor:
            self._publish(response.odometry)
        self._cursor = cursor
        return max(0.0, begun + MIN_ODOMETRY_PERIOD - time.monotonic())


#: The period of the error polls [s], while the robot responds and while the connection is lost.
HEALTH_PERIOD = 1.0
HEALTH_PERIOD_WHEN_LOST = 0.3
#: The longest time for the robot to respond, and for the thread to end [s].
HEALTH_DEADLINE = 1.0
HEALTH_EXIT_TIMEOUT = 0.5


class HealthPoller(Poller):
    """
    Polls the robot's errors in a thread, started by ``start()``.

    The calls also detect when the connection is lost, and when it is back.

    :param client: the client for calls to the robot
    :param robot: the driver that receives the results of the calls
    :param log: called with texts for the user
    :param on_poll: called after each poll
    """

    def __init__(
            self, client: RobotClient, robot: RobotDriver, log: Callable[[Level, str], None],
            on_poll: Callable[[], None]) -> None:
        super().__init__('health')
        self._client = client
        self._robot = robot
        self._log = log
        self._on_poll = on_poll
        #: the errors that the robot reports
        self.codes: list[int] = []

    def poll(self) -> float:
        """Poll the robot's errors once, and log changes; return the time to wait [s]."""
        begun = time.monotonic()
        result, codes = self._client.errors(HEALTH_DEADLINE)
        self._robot.on_result(result, begun)
        if result.is_success:
            self._fetch_texts(codes)
            self._report(codes)
        self._on_poll()
        return HEALTH_PERIOD if self._robot.connection.is_up else HEALTH_PERIOD_WHEN_LOST

    def _fetch_texts(self, codes: list[int]) -> None:
        """Fetch the error texts if a new code has no text: a starting robot may have none yet."""
        new = set(codes) - set(self.codes)
        if any(not self._robot.texts.find(code).title for code in new):
            result, text = self._client.error_texts(HEALTH_DEADLINE)
            if result.is_success:
                self._robot.texts = ErrorTexts(text)

    def _report(self, codes: list[int]) -> None:
        for code in codes:
            if code not in self.codes:
                level = self._robot.texts.find(code).level
                self._log(level, f'the robot reports {self._robot.texts.describe(code)}')
        if self.codes and not codes:
            self._log(Level.OK, 'the robot reports no errors any more')
        self.codes = codes
