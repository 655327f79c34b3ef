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
"""Measure CPU time, messages and memory of a block of code, and sleep until an exact time."""

from __future__ import annotations

import ctypes
import errno
import os
import time
from typing import Any

from benchmarks.process_usage import peak_memory, process_time
from program import children_of
from rclpy.publisher import Publisher

TIMER_ABSTIME = 1
BILLION = 1_000_000_000


class ResourceMeter:
    """
    Measures the resources of its ``with`` block, with the messages of all publishers.

    The meter must be created before a publisher is used.  Helpers are child processes, for example
    a guardian.
    """

    def __init__(self) -> None:
        self._sent = 0
        self._marks: tuple[float, ...] = ()
        self._publish = Publisher.publish
        Publisher.publish = self._counted()  # type: ignore[method-assign]

    def __enter__(self) -> None:
        """Start measuring."""
        self._marks = self._now()

    def __exit__(self, *error: object) -> None:
        """Stop measuring."""
        self._marks = tuple(new - old for new, old in zip(self._now(), self._marks))

    def report(self) -> dict[str, float]:
        """
        Return the resources that the block used.

        :returns: the CPU time of thread, process and helpers [s], the number of sent messages,
            and the peak memory of process and helpers so far [MB]
        """
        names = ('sent', 'thread', 'process', 'helpers')
        return {
            **dict(zip(names, self._marks)),
            'memory': peak_memory(os.getpid()),
            'helper_memory': sum(map(peak_memory, children_of(os.getpid())))}

    def _now(self) -> tuple[float, ...]:
        return (
            self._sent, time.thread_time(), time.process_time(),
            sum(map(process_time, children_of(os.getpid()))))

    def _counted(self) -> Any:
        def publish(publisher: Publisher, message: Any) -> None:
            self._sent += 1
            self._publish(publisher, message)
        return publish


class _Timespec(ctypes.Structure):
    _fields_ = [('seconds', ctypes.c_long), ('nanoseconds', ctypes.c_long)]


_sleep = ctypes.CDLL(None).clock_nanosleep
_sleep.argtypes = [
    ctypes.c_int, ctypes.c_int, ctypes.POINTER(_Timespec), ctypes.POINTER(_Timespec)]


def sleep_until(deadline: int) -> None:
    """
    Sleep until a time on the clock of ``time.monotonic_ns`` [ns].

    :raises OSError: if the system call fails
    """
    request = _Timespec(*divmod(deadline, BILLION))
    code = errno.EINTR
    while code == errno.EINTR:
        code = _sleep(time.CLOCK_MONOTONIC, TIMER_ABSTIME, ctypes.byref(request), None)
    if code:
        raise OSError(code, os.strerror(code))
