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
"""Sleep until an absolute time with ``clock_nanosleep``, which Python's library lacks."""

from __future__ import annotations

import ctypes
import errno
import os
import time

TIMER_ABSTIME = 1
BILLION = 1_000_000_000


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
