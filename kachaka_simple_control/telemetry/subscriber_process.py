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
"""Events, over pipes from the process that drives to those that show, record or keep them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import contextlib
from dataclasses import dataclass
import fcntl
import io
import os
import pickle
import subprocess
import sys
import tempfile
import threading
import time
from typing import Any, BinaryIO, IO

from kachaka_simple_control.control import processes
from kachaka_simple_control.control.events import (
    Event,
    MotionPlanned,
    SessionEnded,
    SessionStarted,
)
from kachaka_simple_control.control.output import has_room
from kachaka_simple_control.control.signals import signal_dispatcher
from kachaka_simple_control.control.waiting import wait_until
from kachaka_simple_control.telemetry.event_bus import EventBus

#: The largest write that a pipe takes whole or not at all [bytes]: PIPE_BUF of Linux, and POSIX's
#: least on others.
ATOMIC_WRITE_SIZE = 4096
#: Data in one chunk of a larger event [bytes]; the rest of the write is for pickle's frame.
CHUNK_SIZE = 3500
#: Room for what a subscriber has not read yet [bytes]: about a minute of a drive at 50 Hz.
PIPE_SIZE = 1 << 20
#: How long the start of a session or a plan may wait for room [s]; nothing else waits, for only
#: these come before motion.
PLAN_WRITE_TIMEOUT = 2.0
#: How long a subscriber may take to end, mostly for its report [s].
FINISH_TIMEOUT = 60.0
#: One that is suspended for so long meanwhile is killed [s]; how often that is checked [s].
FROZEN_TIMEOUT, CLOSE_PERIOD = 2.0, 0.1
#: How long it may delay a program that a signal ended [s]; it goes on by itself.
FINISH_TIMEOUT_WHEN_STOPPED = 1.0


@dataclass(frozen=True)
class Chunk:
    """A part of a pickled event that is too large for one write."""

    data: bytes
    is_last: bool


def encode(event: object) -> list[bytes]:
    """
    Return an event as packets for a pipe, mostly one.

    A pipe takes each packet whole or not at all, so that several threads may write.

    :param event: anything that can be pickled
    """
    data = pickle.dumps(event, pickle.HIGHEST_PROTOCOL)
    if len(data) <= ATOMIC_WRITE_SIZE:
        return [data]
    starts = range(0, len(data), CHUNK_SIZE)
    return [pickle.dumps(Chunk(data[start:start + CHUNK_SIZE], start == starts[-1]),
                         pickle.HIGHEST_PROTOCOL) for start in starts]


def decode(stream: BinaryIO) -> Iterator[Any]:
    """
    Yield the events written to a pipe, in order, until its end; an incomplete one is dropped.

    :param stream: the reading end of the pipe
    """
    chunks = b''
    while True:
        try:
            event = pickle.load(stream)  # from the process that started this one
        except (EOFError, pickle.UnpicklingError):
            return
        if isinstance(event, Chunk):
            chunks += event.data
            if not event.is_last:
                continue
            event, chunks = pickle.loads(chunks), b''
        yield event


class SubscriberProcess:
    """
    A process that receives events over a pipe; this is the sending side.

    It runs in a session of its own, which Ctrl+C does not reach, and sees from the end of the
    pipe that the sender ended, whatever ended it.  Sending never blocks: to a process that does
    not read, or is gone, nothing more is sent.

    :param command: what to run; it reads events from its standard input
    :param stdout: the file that it prints to; None for that of this process
    :param pass_fds: descriptors of this process that it keeps
    """

    def __init__(
            self, command: Sequence[str], stdout: IO[bytes] | None = None,
            pass_fds: Sequence[int] = ()) -> None:
        reader, self._pipe = os.pipe()
        os.set_blocking(self._pipe, False)
        # Linux alone can enlarge a pipe, and may refuse to; a smaller one does as well.
        with contextlib.suppress(AttributeError, OSError):
            fcntl.fcntl(self._pipe, fcntl.F_SETPIPE_SZ, PIPE_SIZE)
        os.register_at_fork(after_in_child=self._close)
        self._process = subprocess.Popen(
            command, env=processes.child_environment(), stdin=reader, stdout=stdout,
            start_new_session=True, pass_fds=pass_fds)
        os.close(reader)
        self._plan_lock, self._counting = threading.Lock(), threading.Lock()
        #: how much it was sent [bytes]
        self.sent_bytes = 0
        #: why nothing more is sent; None as long as all is
        self.failure: str | None = None
        #: how it ended; None while it runs
        self.exit_code: int | None = None

    def send(self, event: Event) -> None:
        """Send an event; return at once, but for what is sent before a robot moves."""
        if self.failure is not None:
            return
        try:
            if isinstance(event, (SessionStarted, MotionPlanned)):
                self._send_with_timeout(event)
            else:
                for packet in encode(event):
                    self._write(packet)
        except BlockingIOError:
            self.failure = 'it did not keep up'
        except OSError as error:
            self.failure = f'it is gone ({error.strerror})'

    def fail(self, reason: str) -> None:
        """Send nothing more."""
        self.failure = self.failure or reason

    def close(self, timeout: float) -> int | None:
        """
        Close the pipe and wait for the process to exit.

        :param timeout: how long to wait [s]; a process that takes longer is left running, one that
            is suspended is killed
        :returns: its exit code; None if it still runs
        """
        self._close()
        end, frozen = time.monotonic() + timeout, 0.0
        while self.exit_code is None and time.monotonic() < end:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.exit_code = self._process.wait(CLOSE_PERIOD)
            frozen = frozen + CLOSE_PERIOD if processes.is_stopped(self._process.pid) else 0.0
            if self.exit_code is None and frozen >= FROZEN_TIMEOUT:
                self._process.kill()
                self.failure = self.failure or 'its process is suspended, and was killed'
                self.exit_code = self._process.wait()
        return self.exit_code

    def _send_with_timeout(self, event: Event) -> None:
        # Chunks of two events must not be mixed; other events may come between them.
        end = time.monotonic() + PLAN_WRITE_TIMEOUT
        with self._plan_lock:
            for packet in encode(event):
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
    The subscriber processes of one program, a context manager.

    Its end sends them ``SessionEnded`` and waits until they have exited.
    """

    def __init__(self, event_bus: EventBus) -> None:
        self._event_bus = event_bus
        self._subscribers: list[SubscriberProcess] = []
        #: how long after the stop began odometry showed standstill [s]; None if it did not
        self.stop_confirmed_after: float | None = None

    def start(
            self, module: str, *arguments: str, pass_fds: Sequence[int] = ()) -> SubscriberProcess:
        """Start a module's ``main`` in a process of its own and subscribe it."""
        subscriber = SubscriberProcess(
            [*processes.python_command(module), *arguments], pass_fds=pass_fds)
        self.add(subscriber)
        return subscriber

    def add(self, subscriber: SubscriberProcess) -> None:
        """Subscribe a process that was started; they are closed in the order of their adding."""
        self._subscribers.append(subscriber)
        self._event_bus.subscribe(subscriber.send, subscriber.fail)

    def __enter__(self) -> SubscriberProcesses:
        """Return itself."""
        return self

    def __exit__(self, kind: object, error: BaseException | None, traceback: object) -> None:
        """
        Tell the processes how the program ended, and wait for them.

        :param error: why the program failed; None if it did not
        """
        self._event_bus.flush()
        ended = SessionEnded(
            time.monotonic(), self.stop_confirmed_after, signal_dispatcher.signum,
            str(error) if isinstance(error, Exception) else None)
        timeout = (FINISH_TIMEOUT if signal_dispatcher.signum is None
                   else FINISH_TIMEOUT_WHEN_STOPPED)
        for subscriber in self._subscribers:
            # Not by the bus: the bus of a destroyed node is closed.
            subscriber.send(ended)
            subscriber.close(timeout)
            if subscriber.failure is not None:
                _print_error(f'what was shown or reported ends early: {subscriber.failure}')


def _print_error(text: str) -> None:
    # The terminal may be closed.
    with contextlib.suppress(OSError):
        print(f'kachaka_simple_control: {text}', file=sys.stderr, flush=True)


#: Copies standard input to a file; it needs no module of ours, and keeps nothing.
COPY = """
import os
while data := os.read(0, 1 << 16):
    while data:
        data = data[os.write(1, data):]
"""
#: How long the process may take to write what was sent [s].
WRITE_TIMEOUT = 5.0


class EventFile:
    """
    A file without a name that events are written to as they come.

    What a drive sends and receives would grow in the memory of the process that drives, and
    Python would search it for garbage in mid-motion: 58 ms after 38 s at 200 Hz (measured).
    """

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile()  # noqa: SIM115 (as long as the object)
        self._process = SubscriberProcess(
            [sys.executable, '-I', '-S', '-c', COPY], stdout=self._file)
        self.send, self.fail = self._process.send, self._process.fail

    @property
    def failure(self) -> str | None:
        """Return why later events are missing; None as long as none is."""
        return self._process.failure

    def close(self) -> None:
        """Write what was sent, and no more; harmless if that is done."""
        self._process.close(WRITE_TIMEOUT)

    def events(self) -> Iterator[Event]:
        """Yield the events so far, in order."""
        descriptor = self._file.fileno()
        wait_until(
            lambda: os.fstat(descriptor).st_size >= self._process.sent_bytes, WRITE_TIMEOUT)
        # By position: the process goes on writing at the end of the open file.
        yield from decode(io.BytesIO(os.pread(descriptor, os.fstat(descriptor).st_size, 0)))
