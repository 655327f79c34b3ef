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
Immutable classes for motions and plans, and functions without side effects.

A motion is a sequence of steps, such as a straight line or a turn.  A plan is the sequence of
velocities that drive a motion, each with its start time and end time.  The modules in this folder
use no ROS, files, clocks or logging.
"""
