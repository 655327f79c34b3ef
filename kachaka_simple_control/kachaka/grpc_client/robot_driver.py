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
"""The threads that send velocities to a real Kachaka, get its odometry and errors, and log."""

from __future__ import annotations

from collections.abc import Callable
import contextlib
import math
import queue
import threading
import time
from typing import Any, TYPE_CHECKING

from kachaka_simple_control.control.diagnosis import Level
from kachaka_simple_control.control.timing import SHUTDOWN_RPC_TIMEOUT
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.kachaka.grpc_client.command_arbiter import (
    CommandArbiter,
    RpcKind,
    RpcRequest,
    VelocityCommand,
)
from kachaka_simple_control.kachaka.robot_status import (
    ConnectionEvent,
    ConnectionState,
    ErrorTexts,
    RpcFailure,
    RpcResult,
)
from kachaka_simple_control.text import escaped

if TYPE_CHECKING:
    from kachaka_simple_control.kachaka.grpc_client.client import RobotClient

#: The number of worker threads: while one makes a motion call, the other can send a stop.
WORKERS = 2
#: The longest time for the robot to respond when a client of the ROS service switches manual
#: control [s].
MANUAL_CONTROL_DEADLINE = 3.0
#: The period at which an idle worker thread checks for work [s].
WORKER_PERIOD = 0.1
GOES_ON = 'moves again after a zero, or after 1 s without velocities'


class RobotDriver:
    """
    Sends velocities to a robot over gRPC, in worker threads; for several threads.

    A ``CommandArbiter`` decides which call to make next.  Velocities are sent only after the robot
    has responded to a call of another kind.

    :param log: called with a level and a text; must not block
    :param on_abort: called with the reason if a motion is aborted; must not block
    """

    def __init__(
            self, client: RobotClient, command_timeout: float, texts: ErrorTexts,
            log: Callable[[Level, str], None],
            on_abort: Callable[[str], None] = lambda _: None) -> None:
        self._client = client
        self._command_timeout = command_timeout
        self._arbiter = CommandArbiter(command_timeout)
        self._log = log
        self._on_abort = on_abort
        self._changed = threading.Condition()
        self._is_over = False
        self._has_control, self._control_until = False, 0.0
        self._workers = [
            threading.Thread(target=self._work, name=f'robot-{number}', daemon=True)
            for number in range(WORKERS)]
        self.connection = ConnectionState()
        self.texts = texts
        #: the duration of the last velocity call [s]; NaN before the first one
        self.round_trip = math.nan
        for worker in self._workers:
            worker.start()

    @property
    def dropped(self) -> int:
        """Return how many commands were dropped: replaced, removed by a stop, or too old."""
        return self._arbiter.dropped

    def drive(self, command: VelocityCommand) -> None:
        """Queue a command, and return at once; a newer one may replace it."""
        with self._changed:
            self._arbiter.on_command(command)
            self._changed.notify()

    def set_manual_control(self, enabled: bool) -> RpcResult:
        """
        Switch manual control on or off; wait up to 3 s for the robot's response.

        Before it is switched off, all waiting velocities are dropped: one would switch it on
        again.
        """
        if not enabled:
            # Earlier commands must not switch manual control on again.
            with self._changed:
                self._arbiter.cancel_motion()
                self._changed.notify()
        begun = time.monotonic()
        result = self._client.set_manual_control(enabled, MANUAL_CONTROL_DEADLINE)
        with self._changed:
            self._update_connection(result, begun)
            if result.is_success:
                self._set_control(enabled)
        return result

    def on_result(self, result: RpcResult, begun: float) -> None:
        """Learn from another thread's call, begun at a time, whether the connection is lost."""
        with self._changed:
            self._update_connection(result, begun)

    def describe(self, result: RpcResult) -> str:
        """Return why a gRPC call failed, as text for the user."""
        return result.text if result.code is None else self.texts.describe(result.code)

    def close(self) -> None:
        """
        Stop the robot if it may be moving, and disconnect from it, within 2 s.

        Manual control is switched off if this object has switched it on.
        """
        with self._changed:
            self._is_over = True
            self._changed.notify_all()
            may_move, has_control = self._arbiter.may_move, self._has_control
        # Each call may stop the robot, so an error in one of them must not prevent the next.
        ignored = contextlib.suppress(Exception)
        with ignored:
            if may_move:
                self._client.set_velocity(0.0, 0.0, SHUTDOWN_RPC_TIMEOUT)
        for worker in self._workers:
            worker.join(SHUTDOWN_RPC_TIMEOUT)
        with ignored:
            if may_move:
                # Stop again, because a motion call may have been in progress.
                self._client.set_velocity(0.0, 0.0, SHUTDOWN_RPC_TIMEOUT)
        with ignored:
            if has_control:
                self._client.set_manual_control(False, SHUTDOWN_RPC_TIMEOUT)
        self._client.close()

    def _work(self) -> None:
        with self._changed:
            while not self._is_over:
                now = time.monotonic()
                request = self._arbiter.next_request(now)
                if request is not None:
                    self._execute(request)
                    continue
                self._wait(now)

    def _wait(self, now: float) -> None:
        """Wait up to 0.1 s for a call to make; check whether the process was suspended."""
        next_check = self._arbiter.next_check
        timeout = (WORKER_PERIOD if next_check is None
                   else max(0.0, min(next_check - now, WORKER_PERIOD)))
        self._changed.wait(timeout)
        self._detect_stall(now, timeout)

    def _detect_stall(self, begun: float, allowed: float) -> None:
        """Stop the robot if a wait or a call took so long that the process was suspended."""
        now = time.monotonic()
        if now - begun > allowed + self._command_timeout and not self._is_over:
            if self._arbiter.may_move:
                text = f'the bridge was held up for {now - begun:.1f} s; the robot {GOES_ON}'
                self._log(Level.WARN, text)
            self._arbiter.on_stall(now)

    def _execute(self, request: RpcRequest) -> None:
        self._changed.release()
        begun = time.monotonic()
        try:
            result = self._perform(request)
        except Exception as error:  # the thread must not end: it sends the next stop
            text = escaped(f'{type(error).__name__}: {error}')
            result = RpcResult(failure=RpcFailure.FAILED, text=text)
        finally:
            self._changed.acquire()
        was_blocked = self._arbiter.is_blocked
        self._arbiter.on_response(request, result, time.monotonic())
        if request.command is not None and result.got_response:
            self.round_trip = time.monotonic() - begun
        if request.kind is RpcKind.ENABLE and result.is_success:
            self._set_control(True)
        self._update_connection(result, begun)
        if self._arbiter.is_blocked and not was_blocked and self.connection.is_up:
            self._report_abort(request, result)
        # Commands received while the process was suspended in the call may be old, too.
        self._detect_stall(begun, request.deadline)
        self._changed.notify()

    def _perform(self, request: RpcRequest) -> RpcResult:
        command = request.command
        if command is None:
            return self._client.set_manual_control(True, request.deadline)
        return self._client.set_velocity(command.linear, command.angular, request.deadline)

    def _update_connection(self, result: RpcResult, begun: float) -> None:
        if self._is_over:
            return  # calls that close() cancels give no information about the connection
        event = self.connection.on_result(result, begun, time.monotonic())
        if event is ConnectionEvent.LOST:
            moved = self._arbiter.may_move
            self._arbiter.on_connection_lost()
            reason = self.connection.reason
            self._log(Level.ERROR, f'the link to the robot is lost: {reason}')
            if moved:
                self._on_abort(f'the link to the robot was lost: {reason}')
        elif event is not None:
            self._arbiter.on_connected()
            if event is ConnectionEvent.BACK:
                self._log(Level.WARN, f'the link to the robot is back; it {GOES_ON}')
            self._changed.notify()

    def _report_abort(self, request: RpcRequest, result: RpcResult) -> None:
        if result.failure is not None:
            reason = f'the robot did not answer a velocity: {result.text}'
        else:
            what = 'manual control' if request.kind is RpcKind.ENABLE else 'a velocity'
            reason = f'the robot refused {what}: {self.describe(result)}'
        self._log(Level.ERROR, f'{reason}; it {GOES_ON}')
        self._on_abort(reason)

    def _set_control(self, enabled: bool) -> None:
        # Log only changes, because clients repeat their request to renew manual control.
        now = time.monotonic()
        if enabled != (self._has_control and now < self._control_until):
            self._log(Level.OK, f"manual control {'enabled' if enabled else 'disabled'}")
        self._has_control = enabled
        self._control_until = now + KACHAKA.manual_control_timeout


#: A repeated text is logged again only if it did not come for this time [s].
LOG_REPEAT_PERIOD = 1.0
#: The longest time that ``close()`` waits until the queued texts are logged [s].
LOG_EXIT_TIMEOUT = 0.5


class LogThread(threading.Thread):
    """
    A thread that writes log messages, so that other threads never wait for the log.

    A message that was logged less than 1 s before is dropped.

    :param emit: writes a message with its level; it may block
    """

    def __init__(self, emit: Callable[[Level, str], None]) -> None:
        super().__init__(name='log', daemon=True)
        self._emit = emit
        self._queue: queue.SimpleQueue[tuple[Level, str, float] | None] = queue.SimpleQueue()
        self.start()

    def log(self, level: Level, text: str) -> None:
        """Queue a log message; any thread may call this method."""
        self._queue.put((level, text, time.monotonic()))

    def close(self) -> None:
        """Write the queued log messages and end the thread, but wait at most 0.5 s for the end."""
        self._queue.put(None)
        self.join(LOG_EXIT_TIMEOUT)

    def run(self) -> None:
        """Write the queued log messages, and wait for new ones, until ``close()`` is called."""
        last_times: dict[str, float] = {}
        while (entry := self._queue.get()) is not None:
            level, text, now = entry
            # Texts contain numbers, so there may be many different ones: keep only recent ones.
            last_times = {known: at for known, at in last_times.items()
                          if now - at < LOG_REPEAT_PERIOD}
            if text not in last_times:
                self._emit(level, text)
            last_times[text] = now


class Poller(threading.Thread):
    """The base class of threads that request data from the robot again and again."""

    def __init__(self, name: str) -> None:
        super().__init__(name=name, daemon=True)
        self.is_over = threading.Event()

    def poll(self) -> float:
        """Request data from the robot once; return how long to wait until the next request [s]."""
        raise NotImplementedError

    def run(self) -> None:
        """Call ``poll()`` again and again until ``stop()`` is called."""
        while not self.is_over.is_set():
            self.is_over.wait(self.poll())

    def stop(self) -> None:
        """Make the thread end after its current call, which the end of the client ends at once."""
        self.is_over.set()


#: The longest time for the robot to send a newer reading, and for the thread to end [s].
READING_DEADLINE = 1.0
#: The shortest time between two calls for a reading [s].  It limits their rate if a robot ignores
#: cursors.
MIN_READING_PERIOD = 0.01
#: The period of checks while a reading has no subscriber, or the robot does not respond [s].
IDLE_PERIOD = 0.1

Fetch = Callable[[int, float], tuple[RpcResult, Any]]


class ReadingPoller(Poller):
    """
    A thread that gets a reading of the robot over gRPC, odometry or a scan, and publishes it.

    :param fetch: waits for a reading newer than a cursor, for a time [s]; returns result and
        response
    :param is_wanted: whether the topic has a subscriber; else no reading is requested
    :param publish: called with each response
    :param on_result: called with result and start time of each call, but for timeouts, which can
        mean that there is no new reading
    :param takes_old: whether the first reading is published, which the robot may have had for long
    """

    def __init__(
            self, name: str, fetch: Fetch, is_wanted: Callable[[], bool],
            publish: Callable[[Any], None], on_result: Callable[[RpcResult, float], None],
            takes_old: bool = True) -> None:
        super().__init__(name)
        self._takes_old = takes_old
        self._fetch = fetch
        self._is_wanted = is_wanted
        self._publish = publish
        self._on_result = on_result
        self._cursor = 0

    def poll(self) -> float:
        """Get and publish a reading once, if it is wanted; return how long to wait then [s]."""
        if not self._is_wanted():
            self._cursor = 0
            return IDLE_PERIOD
        begun = time.monotonic()
        result, response = self._fetch(self._cursor, READING_DEADLINE)
        if self.is_over.is_set():
            return 0.0
        if result.failure is not RpcFailure.LATE:
            self._on_result(result, begun)
        if response is None:
            self._cursor = 0
            return 0.0 if result.failure is RpcFailure.LATE else IDLE_PERIOD
        cursor = response.metadata.cursor
        is_new = cursor != self._cursor and (self._takes_old or self._cursor != 0)
        if cursor == 0 or is_new:
            self._publish(response)
        self._cursor = cursor
        return max(0.0, begun + MIN_READING_PERIOD - time.monotonic())


#: The period of the polls for errors [s]: while the robot responds, and while the connection is
#: lost.
HEALTH_PERIOD = 1.0
HEALTH_PERIOD_WHEN_LOST = 0.3
#: The longest time for the robot to respond, and for the thread to end [s].
HEALTH_DEADLINE = 1.0
HEALTH_EXIT_TIMEOUT = 0.5
#: The period at which the robot is asked for the charge of its battery [s].
BATTERY_PERIOD = 10.0


class HealthPoller(Poller):
    """
    A thread that asks the robot for its errors, about once per second, and for its battery.

    The driver learns from these calls whether the connection is lost or back.

    :param on_poll: called after each call
    """

    def __init__(
            self, client: RobotClient, robot: RobotDriver, log: Callable[[Level, str], None],
            on_poll: Callable[[], None]) -> None:
        super().__init__('health')
        self._client = client
        self._robot = robot
        self._log = log
        self._on_poll = on_poll
        #: the codes of the errors that the robot reports
        self.codes: list[int] = []
        #: the charge of the robot's battery, from 0 to 1; None before the robot has told it
        self.battery: float | None = None
        self._battery_time = -math.inf

    def poll(self) -> float:
        """Ask the robot for its errors once, and log changes; return how long to wait then [s]."""
        begun = time.monotonic()
        result, codes = self._client.errors(HEALTH_DEADLINE)
        self._robot.on_result(result, begun)
        if result.is_success:
            self._fetch_texts(codes)
            self._report(codes)
            if begun - self._battery_time >= BATTERY_PERIOD:
                self._battery_time = begun
                _, self.battery = self._client.battery(HEALTH_DEADLINE)
        self._on_poll()
        return HEALTH_PERIOD if self._robot.connection.is_up else HEALTH_PERIOD_WHEN_LOST

    def _fetch_texts(self, codes: list[int]) -> None:
        """Ask for the texts again if a code has none: a starting robot may not have them."""
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
