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
"""What a simulated robot refuses, by number."""

from __future__ import annotations

SUCCESS = 0
#: The robot's own codes, in pf-robotics/kachaka-api: error_code.hpp of the bridge for the first,
#: docs/api/ERROR_HANDLING.md for the others.
ERROR_NO_MANUAL_CONTROL = 13151
ERROR_NO_FURNITURE = 14606
ERROR_PAUSED = 21051
#: Ours, chosen: below 0 there are none of the robot's, whose full list is not published.
ERROR_NOT_A_VELOCITY = -1
ERROR_CANCELLED = -2
ERROR_STUCK = -3
ERROR_UNKNOWN_NAME = -4
ERROR_OUT_OF_RANGE = -5
ERROR_NOTHING_TO_DO = -6

#: Code, kind (one of the robot's), and what it says, in our words.
TEXTS = (
    (ERROR_NO_MANUAL_CONTROL, 'Error', 'A velocity came while manual control is off'),
    (ERROR_NO_FURNITURE, 'Error', 'The robot carries no furniture'),
    (ERROR_PAUSED, 'Warn', 'The robot is paused; its power button ends that'),
    (ERROR_NOT_A_VELOCITY, 'Error', 'A figure is not a finite number'),
    (ERROR_CANCELLED, 'Ignore', 'The command was cancelled'),
    (ERROR_STUCK, 'Error', 'The robot did not come where it should'),
    (ERROR_UNKNOWN_NAME, 'Error', 'There is no furniture, place or shortcut of that name'),
    (ERROR_OUT_OF_RANGE, 'Error', 'A figure is out of its range'),
    (ERROR_NOTHING_TO_DO, 'Ignore', 'There is nothing to cancel or to go on with'),
)
