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
"""Subscribers in processes of their own, which can never hold a drive up."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import contextlib
import fcntl
import os
import subprocess
import sys
import threading
import time

from kachaka_simple_control.control import processes
from kachaka_simple_control.control.signals import signal_dispatcher
from kachaka_simple_control.telemetry.event_stream import encode, wait_for_room
from kachaka_simple_control.telemetry.events import Event, EventBus, MotionPlanned, SessionEnded

#: Room for what a listener has not read yet [bytes]: about a minute of a drive at 50 Hz.
PIPE_SIZE = 1 << 20
#: How long a plan may wait for room [s]; nothing else waits, for only a plan comes before motion.
EXIT_TIMEOUT = 2.0


class SubscriberProcess:
    """
    One process's side of a listener: a fresh program that reads events from a pipe.

    The listener lives in a session of its own, which Ctrl+C does not reach, and learns from the
    end of the pipe that this process ended, whatever ended it.  Telling it never waits: when it
    does not read, or is gone, it is told nothing more.
    """

    def __init__(self, command: Sequence[str], environment: dict[str, str]) -> None:
        """
        Start it.

        :param command: what to run; it reads events from its standard input
        :param environment: what it runs in
        """
        reader, self._pipe = os.pipe()
        os.set_blocking(self._pipe, False)
        # Linux alone can enlarge a pipe, and may refuse to; a smaller one does as well.
        with contextlib.suppress(AttributeError, OSError):
            fcntl.fcntl(self._pipe, fcntl.F_SETPIPE_SZ, PIPE_SIZE)
        os.register_at_fork(after_in_child=self._close)
        self._process = subprocess.Popen(
            command, env=environment, stdin=reader, start_new_session=True)
        os.close(reader)
        self._planning = threading.Lock()
        #: why it is told nothing more; None as long as it hears all
        self.failure: str | None = None

    def send(self, event: Event) -> None:
        """
        Tell it what happened; returns at once, but for a plan.

        :param event: what happened
        """
        if self.failure is not None:
            return
        try:
            if isinstance(event, MotionPlanned):
                self._send_with_timeout(event)
            else:
                for packet in encode(event):
                    os.write(self._pipe, packet)
        except BlockingIOError:
            self.failure = 'it did not keep up'
        except OSError as error:
            self.failure = f'it is gone ({error.strerror})'

    def close(self, patience: float) -> int | None:
        """
        Tell it that nothing follows, and wait for its end.

        :param patience: how long to wait [s]; a process that takes longer is left to itself
        :returns: its exit code; None if it has not ended
        """
        self._close()
        try:
            return self._process.wait(patience)
        except subprocess.TimeoutExpired:
            return None

    def _send_with_timeout(self, event: Event) -> None:
        # Parts of two plans must not be mixed; whatever else is told meanwhile may come between.
        end = time.monotonic() + EXIT_TIMEOUT
        with self._planning:
            for packet in encode(event):
                while True:
                    try:
                        os.write(self._pipe, packet)
                        break
                    except BlockingIOError:
                        if not wait_for_room(self._pipe, max(0.0, end - time.monotonic())):
                            raise

    def _close(self) -> None:
        pipe, self._pipe = self._pipe, -1
        if pipe >= 0:
            os.close(pipe)


#: How long a report may take [s].
FINISH_TIMEOUT = 60.0
#: How long it may hold up a program that was told to end by a signal [s]; it goes on by itself.
FINISH_TIMEOUT_WHEN_STOPPED = 1.0
REPORTER = 'kachaka_simple_control.report.report_process'


class SubscriberProcesses:
    """
    The listeners of one program, and what it tells them in the end.

    :param audience: tells them what happens
    """

    def __init__(self, audience: EventBus) -> None:
        """Have none."""
        self._audience = audience
        self._tellers: list[SubscriberProcess] = []
        #: how long after the stop began odometry saw the robot still [s]; None if it did not
        self.still_after: float | None = None

    def start(self, module: str, *arguments: str) -> None:
        """
        Start one.

        :param module: its program
        :param arguments: what that is told
        """
        self.add(SubscriberProcess(
            [*processes.python_command(module), *arguments], processes.child_environment()))

    def add(self, teller: SubscriberProcess) -> None:
        """
        Add one that was started.

        :param teller: tells it; closed in the end, in the order of joining
        """
        self._tellers.append(teller)
        self._audience.subscribe(teller.send)

    def shutdown(self, error: BaseException | None) -> None:
        """
        Tell them how it ended, and wait until they are done.

        :param error: why the program failed; None if it did not
        """
        self._audience.publish(SessionEnded(
            time.monotonic(), self.still_after, signal_dispatcher.signum,
            str(error) if isinstance(error, Exception) else None))
        patience = (FINISH_TIMEOUT if signal_dispatcher.signum is None
                    else FINISH_TIMEOUT_WHEN_STOPPED)
        for teller in self._tellers:
            teller.close(patience)
            if teller.failure is not None:
                _say(f'what was shown or reported ends early: {teller.failure}')


def _say(text: str) -> None:
    # Somebody may have closed the terminal.
    with contextlib.suppress(OSError):
        print(f'kachaka_simple_control: {text}', file=sys.stderr, flush=True)


@contextlib.contextmanager
def subscriber_processes(audience: EventBus) -> Iterator[SubscriberProcesses]:
    """
    Have listeners as long as a block lasts.

    :param audience: tells them what happens
    :returns: a context manager for them
    """
    those = SubscriberProcesses(audience)
    try:
        yield those
    except BaseException as error:
        those.shutdown(error)
        raise
    those.shutdown(None)
