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
Wait until a condition is true, where nothing can wake the thread.

Tested by test/ros/test_robot_discovery.py.
"""

from __future__ import annotations

from collections.abc import Callable
import time

#: How often a wait checks its condition [s].  Chosen.
POLL_PERIOD = 0.02


def wait_until(condition: Callable[[], bool], timeout: float) -> bool:
    """Wait until a condition is true, at most for a time [s]; return whether it is."""
    end = time.monotonic() + timeout
    while not condition():
        left = end - time.monotonic()
        if left <= 0.0:
            return False
        time.sleep(min(left, POLL_PERIOD))
    return True
