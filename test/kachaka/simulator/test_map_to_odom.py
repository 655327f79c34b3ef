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
"""The transform between map and odometry of the simulated robot."""

from __future__ import annotations

import math

from kachaka_simple_control.motion.geometry import ORIGIN, Pose
from optional_libraries import optional_imports
import pytest

with optional_imports():
    from kachaka_simple_control.kachaka.simulator.grpc_state import MapToOdom

pytestmark = pytest.mark.needs('kachaka_api')


def figures(pose):
    """Return a pose as a tuple."""
    return pose.x, pose.y, pose.theta


def test_map_and_odometry_are_the_same_before_a_correction():
    transform = MapToOdom()
    pose = Pose(1.0, -2.0, 0.5)
    assert transform.offset == ORIGIN
    assert transform.to_map(pose) == transform.to_odometry(pose) == pose


def test_a_correction_turns_and_shifts_odometry():
    """At x = 1 m in odometry the robot is at (2, 1) on the map and faces its y axis."""
    transform = MapToOdom()
    transform.correct(Pose(2.0, 1.0, math.pi / 2.0), Pose(1.0))
    assert figures(transform.offset) == pytest.approx((2.0, 0.0, math.pi / 2.0))
    assert figures(transform.to_map(Pose(1.5))) == pytest.approx((2.0, 1.5, math.pi / 2.0))
