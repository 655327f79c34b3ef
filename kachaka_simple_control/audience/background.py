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
"""How programs that only look on keep out of the way of the one that drives."""

from __future__ import annotations

import contextlib
import os

#: How much lower than others the priority is.
NICENESS = 10


def step_back() -> None:
    """Let others go first."""
    with contextlib.suppress(OSError):
        os.nice(NICENESS)


def step_aside() -> None:
    """
    Run only when nobody else wants to.

    With a mere low priority Linux still lets somebody who wakes up wait for a moment.
    """
    step_back()
    with contextlib.suppress(AttributeError, OSError):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
