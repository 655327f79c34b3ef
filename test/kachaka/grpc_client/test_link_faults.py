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
"""A connection that breaks, hangs, is slow or comes back: no motion follows a stop."""

from __future__ import annotations

from link_fault_cases import run_scenario, SCENARIOS, SPEED
import pytest

pytestmark = [
    pytest.mark.ros, pytest.mark.slow,
    pytest.mark.needs('rclpy', 'nav_msgs', 'diagnostic_msgs', 'kachaka_api.generated')]

NAMES = list(SCENARIOS)
#: Distance of one command timeout, and of a velocity and a zero under way on a busy machine [m].
TIMEOUT_DISTANCE = SPEED * (0.3 + 0.15)


@pytest.mark.parametrize('name', [NAMES[0], NAMES[1], NAMES[2], NAMES[5], NAMES[6]])
def test_broken_link_costs_one_command_timeout_and_no_motion_follows(probe, name):
    result = run_scenario(probe, name, f'/fault{NAMES.index(name)}')
    assert result.drift < TIMEOUT_DISTANCE
    assert result.after_stop == 0


def test_slow_link_drives_and_stops_within_one_call(probe):
    result = run_scenario(probe, NAMES[3], '/slow')
    assert result.after_stop == 0
    assert result.late < 0.25 + 0.1
    assert result.drift < TIMEOUT_DISTANCE + SPEED * 0.25


def test_link_slower_than_the_command_timeout_is_refused(probe):
    """The robot stands still between two of its velocities anyway."""
    result = run_scenario(probe, NAMES[4], '/slower')
    assert result.after_stop == 0
    assert 'the robot did not answer a velocity: no answer within 0.3 s' in result.said
    assert result.drift < TIMEOUT_DISTANCE
