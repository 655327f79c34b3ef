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
"""Bytes of memory that two processes share, without a lock."""

from __future__ import annotations

import struct


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
