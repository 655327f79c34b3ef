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
A velocity that is due.

Tested by test/control/test_tick_scheduler.py.
"""

from __future__ import annotations

from typing import NamedTuple

from kachaka_simple_control.motion.geometry import Velocity


class Tick(NamedTuple):
    """
    A velocity to send, and the time when it is due.

    Times are counted from t = 0, when the first velocity is due [s].

    :param start: when the velocity is due
    :param deadline: when the next velocity is due
    :param rest: how long the robot stays at rest from ``start`` on; 0 while it moves, infinite
        while a speed factor of 0 holds it
    :param plan_time: the point in the plan; ``start`` unless a speed factor has delayed the plan;
        None without a plan
    """

    velocity: Velocity
    start: float
    deadline: float
    rest: float
    plan_time: float | None = None
