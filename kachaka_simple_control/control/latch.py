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
    """Blocks all motion once it is set; nothing resets it."""

    def trip(self) -> None:
        """Set the latch."""
        self._memory[0] = 1


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
