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

import math

from kachaka_simple_control.kachaka.robot_status import (
    ERROR_NO_MANUAL_CONTROL,
    ERROR_NOT_A_VELOCITY,
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


def test_a_velocity_lasts_for_the_command_timeout(robot):
    """0.3 s."""
    assert robot.enable().success
    assert robot.velocity(0.5).success
    robot.pass_time(0.2)
    assert robot.x() == pytest.approx(0.03, abs=1e-9)
    robot.pass_time(5.0)
    assert robot.x() == pytest.approx(0.045, abs=1e-9)


@pytest.mark.parametrize('part', [1.0, 1.67, 99.0])
def test_velocities_are_clipped(robot, part):
    """As the maker's own demos need: they send 0.5 m/s."""
    robot.enable()
    assert robot.velocity(part).success
    robot.pass_time(5.0)
    assert robot.x() == pytest.approx(0.09, abs=1e-9)


@pytest.mark.parametrize('part', [math.nan, math.inf])
def test_velocities_that_are_not_finite_are_refused(robot, part):
    """Whether manual control is on or not."""
    assert robot.velocity(part).error_code == ERROR_NOT_A_VELOCITY
    robot.enable()
    assert robot.velocity(0.0, part).error_code == ERROR_NOT_A_VELOCITY


def test_manual_control_goes_off_after_60_s(robot):
    """Velocities do not renew it; a long poll returns at once."""
    robot.enable()
    first = robot.get('GetManualControlEnabled')
    assert first.enabled is True
    off = robot.later('GetManualControlEnabled', first.metadata.cursor)
    for _ in range(599):
        robot.clock.time += 0.1
        assert robot.velocity(0.1).success
    assert not off.done()
    robot.pass_time(0.11)
    assert off.result().enabled is False
    assert robot.velocity(0.1).error_code == ERROR_NO_MANUAL_CONTROL


def test_enabling_again_renews_manual_control(robot):
    """For 60 s more; a long poll does not return."""
    robot.enable()
    cursor = robot.get('GetManualControlEnabled').metadata.cursor
    robot.pass_time(59.0)
    robot.enable()
    robot.pass_time(59.0)
    assert robot.is_silent('GetManualControlEnabled', cursor)
    assert robot.velocity(0.1).success


def test_disabling_stops_at_once(robot):
    """Before the command timeout."""
    robot.enable()
    robot.velocity(1.0)
    robot.pass_time(0.1)
    assert robot.enable(False).success
    robot.pass_time(5.0)
    assert robot.x() == pytest.approx(0.03, abs=1e-9)
    assert robot.get('GetManualControlEnabled').enabled is False


def test_enabling_on_the_dock_undocks():
    """From then on its battery is not charged."""
    with bench(docked=True) as robot:
        battery = robot.get('GetBatteryInfo')
        assert battery.power_supply_status == 1
        charging = robot.later('GetBatteryInfo', battery.metadata.cursor)
        robot.enable()
        assert charging.result().power_supply_status == 2
        robot.pass_time(5.0)
        assert robot.x() == pytest.approx(0.2, abs=1e-9)


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
