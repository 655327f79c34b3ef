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
The diagnosis of one component: the contents of ``diagnostic_msgs``, without ROS.

Tested by test/ros/test_robot_status.py.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class Level(IntEnum):
    """The levels of a ``diagnostic_msgs/msg/DiagnosticStatus``, without the level STALE."""

    OK = 0
    WARN = 1
    ERROR = 2


class Diagnosis(NamedTuple):
    """The diagnosis of one component, for example of the connection to the robot."""

    level: Level
    message: str
    values: dict[str, str]
