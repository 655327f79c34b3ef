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
"""What goes on in a robot for a time."""

from __future__ import annotations

from enum import Enum


class Phase(Enum):
    """What goes on for a time and then ends by itself."""

    #: manual control is on
    MANUAL_CONTROL = 'manual control'
    #: the last velocity holds
    HOLD = 'hold'
    #: the robot drives off its dock, whatever it is told
    UNDOCKING = 'undocking'
    #: the robot drives by itself, and looks next where it is
    ERRAND = 'errand'
