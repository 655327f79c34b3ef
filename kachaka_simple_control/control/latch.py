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
"""Bytes that two processes may share, and read without a lock."""

from __future__ import annotations


class SharedByte:
    """
    A byte that is 0 or 1, so that no lock is needed to read or write it.

    The memory is the caller's: in shared memory, another process sees and sets it too.
    """

    def __init__(self, memory: bytearray | memoryview | None = None) -> None:
        """
        Begin with 0.

        :param memory: a writable byte, 0 at the start; without one the byte has its own
        """
        self._memory = bytearray(1) if memory is None else memory

    @property
    def is_set(self) -> bool:
        """Whether the byte is 1."""
        return self._memory[0] != 0


class Latch(SharedByte):
    """Only ever goes from 0 to 1: once set, this run never moves again."""

    def trip(self) -> None:
        """Set the latch, for good."""
        self._memory[0] = 1


class SharedFlag(SharedByte):
    """Says whether something is going on."""

    def set(self) -> None:
        """Say that it begins."""
        self._memory[0] = 1

    def clear(self) -> None:
        """Say that it is over."""
        self._memory[0] = 0
