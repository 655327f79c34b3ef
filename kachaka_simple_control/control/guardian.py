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
The node's side of the guardian, a separate process that stops the robot if the node cannot.

The latch, the flag and the counter are in a memory page that both processes share.
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
    A byte in memory that two processes can share; reads and writes are atomic.

    :param memory: one writable byte, 0 at the start; None: use memory of this process only
    """

    def __init__(self, memory: bytearray | memoryview | None = None) -> None:
        self._memory = bytearray(1) if memory is None else memory

    @property
    def is_set(self) -> bool:
        """Whether the byte is 1."""
        return self._memory[0] != 0


class Latch(SharedByte):
    """
    Blocks all motion after it is set; it cannot be reset.

    :param memory: ``Latch.SIZE`` writable bytes, 0 at the start; None: use memory of this process
    """

    #: size in memory [bytes]: one byte that is 1 if the latch is set, and the time of the
    #: guardian's stop
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
            # Write the time before the byte: a reader that sees the byte set reads a valid time.
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
    """A counter from 0 to 255; after 255 it restarts at 0."""

    @property
    def value(self) -> int:
        """Return the count."""
        return self._memory[0]

    def increment(self) -> None:
        """Add 1 to the count; only one process may call this."""
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
    Return the three objects that the node and its guardian share.

    :param memory: the shared memory page
    :returns: the latch, which is set before the first zero of the guardian's stop; the flag, which
        is set while the node waits in a DDS call; the counter of the heartbeats that the guardian
        has processed
    """
    end = Latch.SIZE
    return (Latch(memory[:end]), SharedFlag(memory[end:end + 1]),
            SharedCounter(memory[end + 1:end + 2]))


class NullGuardian:
    """Replaces the guardian if the parameter ``guardian`` is false; most methods do nothing."""

    participants: frozenset[bytes] = frozenset()
    is_matched = True
    stopped_because: str | None = None
    shared_file: int | None = None

    def __init__(self) -> None:
        self.latch, self.sending = Latch(), SharedFlag()
        self.prime_count = 0

    def prime(self) -> None:
        """Increment ``prime_count`` as if the guardian had published a zero."""
        self.prime_count += 1

    def heartbeat(self) -> None:
        """Do nothing: there is no guardian."""

    def report_stopping(self) -> None:
        """Do nothing: there is no guardian."""

    def report_stopped(self) -> None:
        """Do nothing: there is no guardian."""

    def shutdown(self) -> None:
        """Do nothing: there is no guardian."""


class Guardian:
    """
    Starts the guardian's program and sends heartbeats to it over a pipe.

    If the pipe closes or the heartbeats stop before the node has reported a complete stop, the
    guardian sets the latch and stops the robot.  The guardian runs in its own session, so Ctrl+C
    does not reach it.  Child processes of the node close the pipe, so the pipe closes exactly when
    the node ends.

    :param command: the guardian's program; it gets two descriptors as its last arguments: the
        reading end of the pipe, and a file in memory that contains the ``shared_state``
    :param environment: the environment variables of the program
    :param kept: descriptors that the program keeps open while it runs
    """

    def __init__(
            self, command: Sequence[str], environment: dict[str, str], *kept: int) -> None:
        with tempfile.TemporaryFile() as memory:
            memory.truncate(mmap.PAGESIZE)
            shared = memoryview(mmap.mmap(memory.fileno(), mmap.PAGESIZE))
            self.latch, self.sending, self._served = shared_state(shared)
            #: descriptor of the shared memory, for a process that reads the time of the guardian's
            #: stop; None after it was closed
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
        #: number of zeros that the guardian has published on request
        self.prime_count = 0
        #: DDS participants of the guardian; several if it has left the graph and joined it again
        self.participants: set[bytes] = set()
        #: whether the guardian's publisher has matched a subscriber
        self.is_matched = False
        #: why the guardian stopped the robot; None if it did not
        self.stopped_because: str | None = None
        threading.Thread(target=self._read_output, name='guardian', daemon=True).start()

    def prime(self) -> None:
        """
        Ask the guardian to publish one zero.

        :raises RunFaultError: if the guardian has ended
        """
        self._send(GuardianMessage.PRIME)

    def heartbeat(self) -> None:
        """
        Send a heartbeat during a run, at most one per HEARTBEAT_PERIOD.

        :raises RunFaultError: if the guardian has ended or is frozen
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
        """Report that the run is over and that zeros of its stop follow."""
        self._send_if_alive(GuardianMessage.STOPPING)

    def report_stopped(self) -> None:
        """Report that the complete stop was sent."""
        self._send_if_alive(GuardianMessage.STOPPED)

    def shutdown(self) -> None:
        """
        Close the pipe, and return when the guardian has ended.

        If no complete stop was reported after a run, the guardian first stops the robot.
        """
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
            # If the pipe is broken, the guardian has ended.  If it is full, the guardian has not
            # read for minutes.
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
        # A new lock: if another thread held the old one at the fork, it stays locked in the child.
        self._writing = threading.Lock()
        self._close()
