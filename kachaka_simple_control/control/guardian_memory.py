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
The memory that a node shares with its guardian: a slot for each robot, heartbeats of threads.

Tested by test/control/test_guardian_process.py.
"""

from __future__ import annotations

import mmap
import struct


class SharedByte:
    """
    A byte in memory that two processes can share; reads and writes are atomic.

    :param memory: one writable byte, 0 at the start; None for memory of this process
    """

    def __init__(self, memory: bytearray | memoryview | None = None) -> None:
        self._memory = bytearray(1) if memory is None else memory

    @property
    def is_set(self) -> bool:
        """Whether the byte is set, which means that its value is not 0."""
        return self._memory[0] != 0

    def detach(self) -> None:
        """Go on with a copy in the memory of this process, so that the shared one can be freed."""
        self._memory = bytearray(self._memory)


class Latch(SharedByte):
    """
    A flag in shared memory that limits a node to zero velocities for good once it is set.

    It also stores when the guardian began to stop the robot.

    :param memory: ``Latch.SIZE`` writable bytes, 0 at the start; None for memory of this process
    """

    #: size in memory [bytes]: one byte that is 1 if the latch is set, and the time of the
    #: guardian's stop
    SIZE = 9

    def __init__(self, memory: bytearray | memoryview | None = None) -> None:
        super().__init__(bytearray(self.SIZE) if memory is None else memory)

    def trip(self, stop_time: float = 0.0) -> None:
        """
        Set the latch.

        :param stop_time: when the guardian began to stop the robot [s]; 0 if the node stops it
        """
        if stop_time:
            # Write the time before the byte: a reader that sees the byte set reads a valid time.
            struct.pack_into('d', self._memory, 1, stop_time)
        self._memory[0] = 1

    @property
    def guardian_stop_time(self) -> float | None:
        """Return when the guardian began to stop the robot [s]; None if it has not."""
        if not self.is_set:
            return None
        stop_time, = struct.unpack_from('d', self._memory, 1)
        return stop_time or None


class SharedFlag(SharedByte):
    """
    A flag in memory that two processes can share; either can set it and clear it.

    :param memory: one writable byte, 0 at the start; None for memory of this process
    """

    def set(self) -> None:  # noqa: A003
        """Set the flag, for all processes that share it."""
        self._memory[0] = 1

    def clear(self) -> None:
        """Clear the flag, for all processes that share it."""
        self._memory[0] = 0


class RobotSlot:
    """
    The part of the memory shared with the guardian that belongs to one robot.

    :ivar latch: the guardian sets it before it sends its first zero velocity
    :ivar sending: set while the node waits in a call to DDS
    """

    #: size in memory [bytes]: the number of the thread, the latch and the flag, rounded up
    SIZE = 32

    def __init__(self, memory: memoryview) -> None:
        self._memory = memory
        self.latch = Latch(memory[8:8 + Latch.SIZE])
        self.sending = SharedFlag(memory[8 + Latch.SIZE:])

    @property
    def thread(self) -> int:
        """Return the number of the thread whose heartbeat counts; 0 before the first drive."""
        number, = struct.unpack_from('H', self._memory)
        return int(number)

    @thread.setter
    def thread(self, number: int) -> None:
        struct.pack_into('H', self._memory, 0, number)

    def detach(self) -> None:
        """Go on with a copy of the slot, so that the shared memory can be freed."""
        self._memory = memoryview(bytearray(self._memory))
        self.latch.detach()
        self.sending.detach()

    def clear(self) -> None:
        """Set all bytes of this memory to 0, so that another robot can use it."""
        self._memory[:] = bytes(self.SIZE)


class GuardianMemory:
    """
    The memory that a node shares with its guardian.

    Each robot has a slot in it, and each thread that drives has a heartbeat, to which the slots of
    its robots refer.

    :param file: the descriptor of a file of ``GuardianMemory.SIZE`` bytes
    """

    #: the largest number of robots; they use the slots 1 to MAX_ROBOTS, and slot 0 holds the
    #: values of the guardian itself
    MAX_ROBOTS = 255
    #: the largest number of a thread; they begin at 1, and there is always one to which no slot
    #: refers
    MAX_THREADS = 2 * MAX_ROBOTS
    _HEARTBEATS = (1 + MAX_ROBOTS) * RobotSlot.SIZE
    #: size in memory [bytes]
    SIZE = _HEARTBEATS + (1 + MAX_THREADS) * 8

    def __init__(self, file: int) -> None:
        self._memory = memoryview(mmap.mmap(file, self.SIZE))

    def detach(self) -> None:
        """Go on with a copy; the shared memory is freed when no slot refers to it any more."""
        self._memory = memoryview(bytearray(self._memory))

    @property
    def check_count(self) -> int:
        """Return how often the guardian has checked the heartbeats, modulo 256."""
        return self._memory[0]

    def count_check(self) -> None:
        """Add 1 to the number of heartbeat checks, modulo 256; only the guardian may call this."""
        self._memory[0] = (self._memory[0] + 1) % 256

    def slot(self, number: int) -> RobotSlot:
        """Return a slot, from 1 to ``MAX_ROBOTS``."""
        start = number * RobotSlot.SIZE
        return RobotSlot(self._memory[start:start + RobotSlot.SIZE])

    def heartbeat(self, thread: int) -> float:
        """Return when a thread, by its number, has written its newest heartbeat [s since boot]."""
        time, = struct.unpack_from('d', self._memory, self._HEARTBEATS + 8 * thread)
        return float(time)

    def write_heartbeat(self, thread: int, time: float) -> None:
        """Write the heartbeat of a thread, given by its number [s since boot]."""
        struct.pack_into('d', self._memory, self._HEARTBEATS + 8 * thread, time)
