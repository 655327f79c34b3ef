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
"""Velocities and manual control over gRPC: what the maker documents, in simulated time."""

from __future__ import annotations

from kachaka_simple_control.kachaka.robot_status import (
    ERROR_NO_MANUAL_CONTROL,
    ERROR_PAUSED,
)
from optional_libraries import optional_imports
import pytest

with optional_imports():
    from grpc_support import bench, StillClock

pytestmark = pytest.mark.needs('grpc', 'kachaka_api')


@pytest.fixture
def robot():
    """Yield a robot whose manual control is off."""
    with bench() as started:
        yield started


def test_a_velocity_without_manual_control_is_error_13151(robot):
    """And the robot stays where it is."""
    result = robot.velocity(1.0)
    assert (result.success, result.error_code) == (False, ERROR_NO_MANUAL_CONTROL)
    robot.pass_time(1.0)
    assert robot.x() == 0.0


def test_emergency_stop_is_reported_and_lasts(robot):
    """Until the power button is pressed."""
    robot.enable()
    robot.velocity(1.0)
    none = robot.get('GetError')
    assert list(none.error_codes) == []
    paused = robot.later('GetError', none.metadata.cursor)
    robot.pass_time(0.1)
    assert robot.call('SetEmergencyStop').result.success
    assert list(paused.result().error_codes) == [ERROR_PAUSED]
    assert robot.velocity(1.0).error_code == ERROR_PAUSED
    assert robot.enable().error_code == ERROR_PAUSED
    robot.pass_time(5.0)
    assert robot.x() == pytest.approx(0.03, abs=1e-9)
    robot.server.call(lambda sim, now: sim.press_power_button(now))
    assert list(robot.get('GetError').error_codes) == []
    assert robot.velocity(1.0).error_code == ERROR_NO_MANUAL_CONTROL


def test_the_robot_advances_without_queries():
    """A robot with a lag has nothing to catch up on at the next query."""
    clock = StillClock()
    with bench(clock) as robot:
        robot.enable()
        robot.velocity(1.0)
        robot.pass_time(0.3)
        assert robot.server.call(lambda sim, now: sim.next_change(now)) == clock.time + 59.7
