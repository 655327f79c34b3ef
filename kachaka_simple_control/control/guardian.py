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
"""A second process that stops the robot when this one no longer can."""

from __future__ import annotations

from collections.abc import Sequence
import contextlib
import mmap
import os
import subprocess
import tempfile
import threading
import time

from kachaka_simple_control.control.latch import Latch, SharedFlag
from kachaka_simple_control.control.timing import GUARDIAN_EXIT_TIMEOUT, HEARTBEAT_PERIOD
from kachaka_simple_control.control.watchdog import GuardianMessage
from kachaka_simple_control.errors import RunFaultError


class NullGuardian:
    """In place of a guardian where none is wanted."""

    participants: frozenset[bytes] = frozenset()
    is_matched = True
    stopped_because: str | None = None

    def __init__(self) -> None:
        """Have a latch that only this process can set."""
        self.latch, self.sending = Latch(), SharedFlag()
        self.prime_count = 0

    def prime(self) -> None:
        """Publish nothing, and be done at once."""
        self.prime_count += 1

    def heartbeat(self) -> None:
        """Tell nobody."""

    def report_stopping(self) -> None:
        """Tell nobody."""

    def report_stopped(self) -> None:
        """Tell nobody."""

    def shutdown(self) -> None:
        """Dismiss nobody."""


class Guardian:
    """
    One process's side of its guardian.

    The guardian hears signs of life over a pipe.  The pipe's end or silence, before the whole stop
    was told, makes it set the latch and stop the robot.  The pipe
    belongs to this process alone: it is closed in every child, so that its end is this process's
    end.
    """

    def __init__(
            self, command: Sequence[str], environment: dict[str, str], *kept: int) -> None:
        """
        Start it; a fresh program, in a session of its own that Ctrl+C does not reach.

        :param command: what to run; it gets two descriptors as its last arguments, one to read
            signs from and one whose first two bytes are the latch and the flag
        :param environment: what it runs in
        :param kept: descriptors that it keeps open as long as it is there
        """
        with tempfile.TemporaryFile() as memory:
            memory.truncate(mmap.PAGESIZE)
            shared = memoryview(mmap.mmap(memory.fileno(), mmap.PAGESIZE))
            self.latch, self.sending = Latch(shared[:1]), SharedFlag(shared[1:2])
            signs, self._pipe = os.pipe()
            os.set_blocking(self._pipe, False)
            os.register_at_fork(after_in_child=self._close_in_child)
            self._process = subprocess.Popen(
                [*command, str(signs), str(memory.fileno())], env=environment,
                pass_fds=(signs, memory.fileno(), *kept), stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE, start_new_session=True, text=True)
            os.close(signs)
        self._writing = threading.Lock()
        self._last_heartbeat = float('-inf')
        self._primed = 0
        #: what tells its publishers from others on the ROS graph: it may leave and come anew
        self.participants: set[bytes] = set()
        #: whether its publisher has met a subscriber
        self.is_matched = False
        #: why it stopped the robot; None if it did not
        self.stopped_because: str | None = None
        threading.Thread(target=self._listen, name='guardian', daemon=True).start()

    def prime(self) -> None:
        """
        Have it publish one zero.

        :raises RunFaultError: if it is gone
        """
        self._send(GuardianMessage.PRIME)

    @property
    def prime_count(self) -> int:
        """Return how many zeros it has published on request."""
        return self._primed

    def heartbeat(self) -> None:
        """
        Show a sign of life: a run is on.

        :raises RunFaultError: if it is gone
        """
        now = time.monotonic()
        if now - self._last_heartbeat >= HEARTBEAT_PERIOD:
            self._last_heartbeat = now
            self._send(GuardianMessage.BEAT)

    def report_stopping(self) -> None:
        """Say that the run is over, and that its stop goes on."""
        self._send_if_alive(GuardianMessage.REST)

    def report_stopped(self) -> None:
        """Say that the whole stop was sent."""
        self._send_if_alive(GuardianMessage.STOPPED)

    def shutdown(self) -> None:
        """Close the pipe, and return when its publisher is gone; first it stops what moves yet."""
        self._close()
        try:
            self._process.wait(GUARDIAN_EXIT_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _send_if_alive(self, sign: GuardianMessage) -> None:
        self._last_heartbeat = float('-inf')
        with contextlib.suppress(RunFaultError):
            self._send(sign)

    def _send(self, sign: GuardianMessage) -> None:
        try:
            with self._writing:
                os.write(self._pipe, sign.value)
        except OSError as error:
            # Broken: it has ended.  Full: it has not read for minutes.
            raise RunFaultError(
                f'the guardian is gone ({error.strerror}), so the motion was given up') from None

    def _listen(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for line in lines:
                word, _, value = line.strip().partition(' ')
                if word == 'primed':
                    self._primed += 1
                elif word == 'participant':
                    self.participants.add(bytes.fromhex(value))
                elif word == 'matched':
                    self.is_matched = True
                elif word == 'stopped':
                    self.stopped_because = value

    def _close(self) -> None:
        with self._writing:
            pipe, self._pipe = self._pipe, -1
        if pipe >= 0:
            os.close(pipe)

    def _close_in_child(self) -> None:
        # A lock that another thread held at the fork stays locked in the child.
        self._writing = threading.Lock()
        self._close()
