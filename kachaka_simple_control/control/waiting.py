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
"""Wait until a time, or until a condition holds."""

from __future__ import annotations

from collections.abc import Callable
import time

from kachaka_simple_control.control.timing import POLL_PERIOD


def sleep_until(
        deadline: float,
        beat: Callable[[], None],
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep) -> None:
    """
    Sleep until a deadline, in naps; nobody sleeps for one that has passed.

    :param deadline: when to wake [s on the clock]
    :param beat: called after each nap, and once if there is none: a motion that is always late,
        because publishing takes longer than a period, is alive, too; what it raises ends the wait
    :param clock: the steady clock [s]
    :param sleep: sleeps for a time [s]
    """
    left = deadline - clock()
    if left <= 0.0:
        beat()
    while left > 0.0:
        sleep(min(left, POLL_PERIOD))
        beat()
        left = deadline - clock()


def wait_until(
        condition: Callable[[], bool], timeout: float,
        check: Callable[[], None] = lambda: None) -> bool:
    """
    Wait for something, and look at it often.

    :param condition: what to wait for
    :param timeout: how long [s]
    :param check: called while waiting; what it raises ends the wait
    :returns: whether it came to be
    """
    end = time.monotonic() + timeout
    while not condition():
        if time.monotonic() >= end:
            return False
        sleep_until(min(end, time.monotonic() + POLL_PERIOD), check)
    return True
