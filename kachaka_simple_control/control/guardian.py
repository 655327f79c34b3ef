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
"""
The guardian, the process that stops the robot when this one cannot: the node's side of it.

The latch, the flags and the counter are in a page of memory that both processes share.
"""

from __future__ import annotations

from collections.abc import Sequence
import contextlib
import mmap
import os
import struct
import subprocess
import tempfile
import threading
import time

from kachaka_simple_control.control.timing import (
    GUARDIAN_EXIT_TIMEOUT,
    GUARDIAN_TIMEOUT,
    HEARTBEAT_PERIOD,
)
from kachaka_simple_control.control.watchdog import GuardianMessage, GuardianWatch
from kachaka_simple_control.errors import HELD_UP_ADVICE, RunFaultError


class SharedByte:
    """
    A byte that is 0 or 1; reading and writing it is atomic.

    :param memory: one writable byte, 0 at the start; None for memory of this process alone
    """

    def __init__(self, memory: bytearray | memoryview | None = None) -> None:
        self._memory = bytearray(1) if memory is None else memory

    @property
    def is_set(self) -> bool:
        """Whether the byte is 1."""
        return self._memory[0] != 0


class Latch(SharedByte):
    """
    Blocks all motion once it is set; nothing resets it.

    :param memory: ``Latch.SIZE`` writable bytes, 0 at the start; None for memory of this process
    """

    #: its length in memory: a byte that is 1 if it is set, and the time of the guardian's stop
    SIZE = 9

    def __init__(self, memory: bytearray | memoryview | None = None) -> None:
        super().__init__(bytearray(self.SIZE) if memory is None else memory)

    def trip(self, stop_time: float = 0.0) -> None:
        """
        Set the latch.

        :param stop_time: when the guardian's stop begins [s on the steady clock, above 0]; 0 for
            a stop of the node itself
        """
        if stop_time:
            # Before the byte: whoever sees that set reads a whole number here.
            struct.pack_into('d', self._memory, 1, stop_time)
        self._memory[0] = 1

    @property
    def guardian_stop_time(self) -> float | None:
        """Return when the guardian's stop began [s on the steady clock]; None without one."""
        if not self.is_set:
            return None
        stop_time, = struct.unpack_from('d', self._memory, 1)
        return stop_time or None


class SharedCounter(SharedByte):
    """Counts from 0 to 255, and again from 0."""

    @property
    def value(self) -> int:
        """Return the count."""
        return self._memory[0]

    def increment(self) -> None:
        """Count one more; by one process alone."""
        self._memory[0] = (self._memory[0] + 1) % 256


class SharedFlag(SharedByte):
    """A flag that can be set and cleared."""

    def set(self) -> None:  # noqa: A003
        """Set the flag."""
        self._memory[0] = 1

    def clear(self) -> None:
        """Clear the flag."""
        self._memory[0] = 0


def shared_state(memory: memoryview) -> tuple[Latch, SharedFlag, SharedCounter]:
    """
    Return what the node and its guardian share.

    :param memory: the shared page
    :returns: the latch, set before the first zero of the guardian's stop; the flag that is set
        while the node is in DDS; the count of the heartbeats that the guardian has served
    """
    end = Latch.SIZE
    return (Latch(memory[:end]), SharedFlag(memory[end:end + 1]),
            SharedCounter(memory[end + 1:end + 2]))


class NullGuardian:
    """Takes the place of a guardian where none is wanted (parameter ``guardian: false``)."""

    participants: frozenset[bytes] = frozenset()
    is_matched = True
    stopped_because: str | None = None
    shared_file: int | None = None

    def __init__(self) -> None:
        self.latch, self.sending = Latch(), SharedFlag()
        self.prime_count = 0

    def prime(self) -> None:
        """Count the request as served."""
        self.prime_count += 1

    def heartbeat(self) -> None:
        """Do nothing."""

    def report_stopping(self) -> None:
        """Do nothing."""

    def report_stopped(self) -> None:
        """Do nothing."""

    def shutdown(self) -> None:
        """Do nothing."""


class Guardian:
    """
    Starts the guardian's program and sends it heartbeats over a pipe.

    When the pipe closes, or no heartbeat comes, before the stop was reported whole, the guardian
    sets the latch and stops the robot.  The program runs in a session of its own, which Ctrl+C
    does not reach.  Every child of this process closes the pipe, so its end is the end of this
    process.

    :param command: the program; it gets two descriptors as its last arguments: the pipe to read,
        and a file of memory that holds the ``shared_state``
    :param environment: the program's environment
    :param kept: descriptors that the program keeps open as long as it runs
    """

    def __init__(
            self, command: Sequence[str], environment: dict[str, str], *kept: int) -> None:
        with tempfile.TemporaryFile() as memory:
            memory.truncate(mmap.PAGESIZE)
            shared = memoryview(mmap.mmap(memory.fileno(), mmap.PAGESIZE))
            self.latch, self.sending, self._served = shared_state(shared)
            #: its descriptor, for a process that asks when the guardian stopped; None once closed
            self.shared_file: int | None = os.dup(memory.fileno())
            self._watch = GuardianWatch()
            messages, self._pipe = os.pipe()
            os.set_blocking(self._pipe, False)
            os.register_at_fork(after_in_child=self._close_in_child)
            self._process = subprocess.Popen(
                [*command, str(messages), str(memory.fileno())], env=environment,
                pass_fds=(messages, memory.fileno(), *kept), stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE, start_new_session=True, text=True)
            os.close(messages)
        self._writing = threading.Lock()
        self._last_heartbeat = float('-inf')
        #: number of zeros it has published on request
        self.prime_count = 0
        #: its DDS participants: it may leave the graph and join it anew
        self.participants: set[bytes] = set()
        #: whether its publisher has matched a subscriber
        self.is_matched = False
        #: why it stopped the robot; None if it did not
        self.stopped_because: str | None = None
        threading.Thread(target=self._read_output, name='guardian', daemon=True).start()

    def prime(self) -> None:
        """
        Ask it to publish one zero.

        :raises RunFaultError: if it has ended
        """
        self._send(GuardianMessage.PRIME)

    def heartbeat(self) -> None:
        """
        Send a heartbeat: a run is on.

        :raises RunFaultError: if it has ended, or is frozen
        """
        now = time.monotonic()
        if now - self._last_heartbeat >= HEARTBEAT_PERIOD:
            self._last_heartbeat = now
            if self._watch.is_frozen(now, self._served.value):
                raise RunFaultError(
                    f'the guardian has not answered for {GUARDIAN_TIMEOUT:g} s: it was held '
                    f'up, {HELD_UP_ADVICE}')
            self._send(GuardianMessage.HEARTBEAT)

    def report_stopping(self) -> None:
        """Report that the run is over and its stop goes on."""
        self._send_if_alive(GuardianMessage.STOPPING)

    def report_stopped(self) -> None:
        """Report that the stop was sent whole."""
        self._send_if_alive(GuardianMessage.STOPPED)

    def shutdown(self) -> None:
        """Close the pipe, and return when its publisher is gone; it stops a robot that moves."""
        self._close()
        if self.shared_file is not None:
            os.close(self.shared_file)
            self.shared_file = None
        try:
            self._process.wait(GUARDIAN_EXIT_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _send_if_alive(self, message: GuardianMessage) -> None:
        self._last_heartbeat = float('-inf')
        self._watch.reset()
        with contextlib.suppress(RunFaultError):
            self._send(message)

    def _send(self, message: GuardianMessage) -> None:
        try:
            with self._writing:
                os.write(self._pipe, message.value)
        except OSError as error:
            # A broken pipe: it has ended.  A full one: it has not read for minutes.
            raise RunFaultError(
                f'the guardian is gone ({error.strerror}), so the motion was given up') from None

    def _read_output(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for line in lines:
                word, _, value = line.strip().partition(' ')
                if word == 'primed':
                    self.prime_count += 1
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
