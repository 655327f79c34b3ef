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
"""Send the events of a drive over pipes to other processes, which show or record the events."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
import contextlib
from dataclasses import dataclass
import fcntl
import os
import pickle
import subprocess
import sys
import threading
import time
from typing import Any, BinaryIO, IO

from kachaka_simple_control.control.events import (
    DETAILED,
    Event,
    FleetStarted,
    MotionPlanned,
    RobotEvent,
    SessionEnded,
    SessionStarted,
)
from kachaka_simple_control.process import processes
from kachaka_simple_control.process.output import has_room
from kachaka_simple_control.process.signals import signal_dispatcher
from kachaka_simple_control.telemetry.event_bus import EventBus

#: The largest write that a pipe accepts either completely or not at all [bytes].  On Linux this is
#: PIPE_BUF.
ATOMIC_WRITE_SIZE = 4096
#: Size of the data in one chunk of a larger event [bytes].  It is below ATOMIC_WRITE_SIZE, because
#: pickle adds some bytes.
CHUNK_SIZE = 3500
#: Room for data that a subscriber has not read yet [bytes]: about a minute of a drive at 50 Hz.
PIPE_SIZE = 1 << 20
#: Events that are sent while no robot moves.
AT_REST = (FleetStarted, SessionStarted, MotionPlanned)
#: How long an event that is not sent while the robot moves may wait for a subscriber that reads
#: nothing [s].  On a loaded machine one needs seconds to start, and a long plan is some megabytes.
PLAN_WRITE_TIMEOUT = 10.0
#: How long a subscriber may take to end, mostly to write its report [s].
FINISH_TIMEOUT = 60.0
#: A subscriber that is suspended for this time while it should end is killed [s].  The second
#: value is the period of this check [s].
FROZEN_TIMEOUT, CLOSE_PERIOD = 2.0, 0.1
#: How long a program that a signal ends waits for a subscriber to end [s].  After this time the
#: subscriber continues to run alone.
FINISH_TIMEOUT_WHEN_STOPPED = 1.0


@dataclass(frozen=True)
class Chunk:
    """One part of a pickled event that is too large for one write to a pipe."""

    data: bytes
    is_last: bool


def encode(*events: object) -> list[bytes]:
    """
    Convert events to packets, each of which is one write to a pipe.

    A pipe takes each packet whole or not at all, so several threads may write to it.  Events in
    one packet take less room and time than in one each.
    """
    data = pickle.dumps(
        events[0] if len(events) == 1 else [*events], pickle.HIGHEST_PROTOCOL)
    if len(data) <= ATOMIC_WRITE_SIZE:
        return [data]
    if len(events) > 1:
        middle = len(events) // 2
        return encode(*events[:middle]) + encode(*events[middle:])
    starts = range(0, len(data), CHUNK_SIZE)
    return [pickle.dumps(Chunk(data[start:start + CHUNK_SIZE], start == starts[-1]),
                         pickle.HIGHEST_PROTOCOL) for start in starts]


def decode(stream: BinaryIO) -> Iterator[Any]:
    """Yield the events that were written to a pipe or a file, without half a one at the end."""
    chunks = b''
    while True:
        try:
            event = pickle.load(stream)  # from the process that started this one
        except (EOFError, pickle.UnpicklingError):
            return
        if isinstance(event, list):
            yield from event
            continue
        if isinstance(event, Chunk):
            chunks += event.data
            if not event.is_last:
                continue
            event, chunks = pickle.loads(chunks), b''
        yield event


def _is_at_rest(event: Event | RobotEvent) -> bool:
    return isinstance(event.event if isinstance(event, RobotEvent) else event, AT_REST)


class SubscriberProcess:
    """
    Starts a child process, and sends events to it over a pipe.

    It has its own POSIX session, so Ctrl+C does not reach it; the end of the pipe shows it the end
    of the parent.  If it has ended or reads too slowly, no more is sent.  While the robot moves,
    ``send()`` never waits.

    :param command: reads events from its standard input
    :param stdout: for its standard output; None for that of the parent process
    """

    def __init__(
            self, command: Sequence[str], stdout: IO[bytes] | None = None,
            pass_fds: Sequence[int] = ()) -> None:
        reader, self._pipe = os.pipe()
        os.set_blocking(self._pipe, False)
        # Only Linux can enlarge a pipe, and it may refuse.  A smaller pipe also works.
        with contextlib.suppress(AttributeError, OSError):
            fcntl.fcntl(self._pipe, fcntl.F_SETPIPE_SZ, PIPE_SIZE)
        processes.call_in_forked_children(self._close)
        self._process = subprocess.Popen(
            command, env=processes.child_environment(), stdin=reader, stdout=stdout,
            start_new_session=True, pass_fds=pass_fds)
        os.close(reader)
        self._chunk_lock, self._counting = threading.Lock(), threading.Lock()
        #: amount of data written to the pipe [bytes]
        self.sent_bytes = 0
        #: why no more events are sent; None while all events are sent
        self.failure: str | None = None
        #: exit code of the process; None while it runs
        self.exit_code: int | None = None

    def send(self, event: Event | RobotEvent) -> None:
        """Send an event, as ``send_all`` does."""
        self.send_all((event,))

    def send_all(self, events: Sequence[Event | RobotEvent]) -> None:
        """
        Send events, unless the pipe is full or the process has ended: ``failure`` says why then.

        Events at rest (AT_REST, and those of several writes) wait until there is room; for up to
        PLAN_WRITE_TIMEOUT if the process reads nothing.
        """
        if self.failure is not None:
            return
        try:
            packets = encode(*events)
            may_wait = len(packets) > len(events) or any(map(_is_at_rest, events))
            self._write_all(packets, PLAN_WRITE_TIMEOUT if may_wait else 0.0)
        except BlockingIOError:
            self.failure = 'it did not keep up'
        except OSError as error:
            self.failure = f'it is gone ({error.strerror})'

    def fail(self, reason: str) -> None:
        """Send no more events to the process; the first reason is kept in ``failure``."""
        self.failure = self.failure or reason

    def close(self, timeout: float) -> int | None:
        """
        Close the pipe, and wait for the exit code; None if it still runs after the timeout.

        A process that is suspended for FROZEN_TIMEOUT during this wait is killed.
        """
        self._close()
        end, frozen = time.monotonic() + timeout, 0.0
        while self.exit_code is None and time.monotonic() < end:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.exit_code = self._process.wait(CLOSE_PERIOD)
            frozen = frozen + CLOSE_PERIOD if processes.is_stopped(self._process.pid) else 0.0
            if self.exit_code is None and frozen >= FROZEN_TIMEOUT:
                self._process.kill()
                self.fail('its process is suspended, and was killed')
                self.exit_code = self._process.wait()
        return self.exit_code

    def _write_all(self, packets: Sequence[bytes], timeout: float) -> None:
        # The chunks of two events must not be mixed, but a whole event may come between chunks:
        # the end of a session does not wait for a plan.
        with self._chunk_lock if len(packets) > 1 else contextlib.nullcontext():
            for packet in packets:
                end = time.monotonic() + timeout
                while True:
                    try:
                        self._write(packet)
                        break
                    except BlockingIOError:
                        if not has_room(self._pipe, max(0.0, end - time.monotonic())):
                            raise

    def _write(self, packet: bytes) -> None:
        size = os.write(self._pipe, packet)
        with self._counting:
            self.sent_bytes += size

    def _close(self) -> None:
        pipe, self._pipe = self._pipe, -1
        if pipe >= 0:
            os.close(pipe)


class SubscriberProcesses:
    """
    All processes to which one program sends events; a context manager.

    At the end of the block each gets ``SessionEnded``, and has a limited time to exit.
    """

    def __init__(self, event_bus: EventBus) -> None:
        self._event_bus = event_bus
        self._subscribers: list[SubscriberProcess] = []
        #: the process whose failure the program itself reports, if the program ends without a
        #: signal or an error; None if there is none
        self.required: SubscriberProcess | None = None
        #: the time from the start of the stop until odometry showed standstill [s]; None if it
        #: showed none
        self.stop_confirmed_after: float | None = None

    def start(
            self, module: str, *arguments: str, pass_fds: Sequence[int] = ()) -> SubscriberProcess:
        """Run the function ``main`` of a module in a new process, and send all events to it."""
        subscriber = SubscriberProcess(
            [*processes.python_command(module), *arguments], pass_fds=pass_fds)
        self.add(subscriber)
        return subscriber

    def add(
            self, subscriber: SubscriberProcess, kinds: Collection[type] = DETAILED) -> None:
        """
        Send all events of some types from now on to a process, of all robots.

        Pipes are closed in the same order.
        """
        self._subscribers.append(subscriber)
        self._event_bus.subscribe_to_all(subscriber.send_all, subscriber.fail, kinds)

    def __enter__(self) -> SubscriberProcesses:
        """Return this object."""
        return self

    def __exit__(self, kind: object, error: BaseException | None, traceback: object) -> None:
        """
        Send ``SessionEnded`` to all processes, and wait until they have exited.

        For each at most FINISH_TIMEOUT, or FINISH_TIMEOUT_WHEN_STOPPED after a signal.
        """
        self._event_bus.flush()
        ended = SessionEnded(
            time.monotonic(), self.stop_confirmed_after, signal_dispatcher.signum,
            str(error) if isinstance(error, Exception) else None)
        timeout = (FINISH_TIMEOUT if signal_dispatcher.signum is None
                   else FINISH_TIMEOUT_WHEN_STOPPED)
        for subscriber in self._subscribers:
            # Do not use the event bus: the bus of a destroyed node is closed.
            subscriber.send(ended)
            subscriber.close(timeout)
            is_reported = (
                subscriber is self.required and error is None and signal_dispatcher.signum is None)
            if subscriber.failure is not None and not is_reported:
                with contextlib.suppress(OSError):  # the terminal may be closed
                    print('kachaka_simple_control: what was shown or reported ends early: '
                          f'{subscriber.failure}', file=sys.stderr, flush=True)
