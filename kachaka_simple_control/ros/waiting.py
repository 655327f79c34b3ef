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
"""Wait for something that callbacks or the graph bring."""

from __future__ import annotations

from collections.abc import Callable
import time

from kachaka_simple_control.execution.pacing import sleep_until

#: How often the condition is looked at [s].
GLANCE = 0.02


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
        sleep_until(min(end, time.monotonic() + GLANCE), check)
    return True
