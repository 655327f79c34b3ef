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
"""Wait until a time, or until a condition holds, with checks meanwhile."""

from __future__ import annotations

from collections.abc import Callable
import time

from kachaka_simple_control.control.timing import POLL_PERIOD


def sleep_until(
        deadline: float,
        check: Callable[[], None],
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep) -> None:
    """
    Sleep until a deadline, and check every POLL_PERIOD.

    :param deadline: when to return [s on the clock]
    :param check: called after each sleep, and once if the deadline has passed already: a motion
        that is always late needs its heartbeats, too.  What it raises ends the wait
    :param clock: the steady clock [s]
    :param sleep: sleeps for a time [s]
    """
    left = deadline - clock()
    if left <= 0.0:
        check()
    while left > 0.0:
        sleep(min(left, POLL_PERIOD))
        check()
        left = deadline - clock()


def wait_until(
        condition: Callable[[], bool], timeout: float,
        check: Callable[[], None] = lambda: None) -> bool:
    """
    Wait until a condition holds, asked every POLL_PERIOD.

    :param timeout: how long to wait [s]
    :param check: called while waiting; what it raises ends the wait
    :returns: whether the condition held in time
    """
    end = time.monotonic() + timeout
    while not condition():
        if time.monotonic() >= end:
            return False
        sleep_until(min(end, time.monotonic() + POLL_PERIOD), check)
    return True
