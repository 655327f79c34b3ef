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
"""Drive a square, 20 cm a side, and say so when it cannot be done."""

import math

from kachaka_simple_control import KachakaSimpleControl
import rclpy

SIDE = 0.2  # m
FORWARD = 0.2  # m/s
TURN = 1.0  # rad/s, to the left

rclpy.init()
robot = KachakaSimpleControl()
for _ in range(4):
    robot.move_robot(FORWARD, 0.0, SIDE / FORWARD)
    robot.move_robot(0.0, TURN, math.pi / 2.0 / TURN)
