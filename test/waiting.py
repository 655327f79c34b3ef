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
"""Wait until something is so; where it must be, fail with what was seen instead."""

from __future__ import annotations

from collections.abc import Callable
import inspect
from pathlib import Path
import time
from typing import TypeVar

#: Discovery may take 3 s, and longer on a loaded machine [s].
TIMEOUT = 15.0
#: How much of a value a failure shows, from its end: a log may be long [characters].
MAX_SHOWN = 5000

Value = TypeVar('Value')


def poll(condition: Callable[[], Value], timeout: float, period: float = 0.005) -> Value:
    """Return the first true value of a condition; its last one if none is true in time [s]."""
    end = time.monotonic() + timeout
    while not (value := condition()) and time.monotonic() < end:
        time.sleep(period)
    return value


def wait_until(condition: Callable[[], Value], timeout: float = TIMEOUT) -> Value:
    """
    Return the first true value of a condition; fail if none is true in time [s].

    The failure shows the values that the condition uses: of a program, what it printed.
    """
    value = poll(condition, timeout)
    if not value:
        used = (inspect.getclosurevars(condition).nonlocals if inspect.isfunction(condition) else
                {'it': getattr(condition, '__self__', condition)})
        raise AssertionError('\n'.join([f'it was not so within {timeout:g} s, but:', *(
            f'{name}: {str(seen)[-MAX_SHOWN:]}' for name, seen in used.items())]))
    return value


def wait_for_file(file: Path, size: int = 0) -> None:
    """Return when a file is larger than a size; fail if it is not in time."""
    wait_until(lambda: file.exists() and file.stat().st_size > size, 30.0)
