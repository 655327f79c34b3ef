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
"""What ends a run while it drives: told the time, without a robot."""

from __future__ import annotations

import math
import threading
from types import SimpleNamespace

from kachaka_simple_control.control.guardian import NullGuardian
from kachaka_simple_control.control.run_monitor import RunMonitor
from kachaka_simple_control.control.speed_factor import SpeedFactor
from kachaka_simple_control.control.standstill import StandstillDetector
from kachaka_simple_control.errors import HELD_UP_ADVICE, RunFaultError
from kachaka_simple_control.motion.geometry import ZERO
import pytest

START = 100.0


@pytest.fixture
def begun():
    """Return a monitor whose run has begun, and its odometry."""
    odometry = StandstillDetector()
    anything = SimpleNamespace(
        check_subscribed=lambda: None, check_identity=lambda: None, check_exclusive=lambda: None,
        has_changed=lambda: False, update=lambda: None)
    parameters = SimpleNamespace(odometry_timeout=0.5, pause_timeout=600.0)
    monitor = RunMonitor(
        NullGuardian(), None, anything, anything, odometry, parameters, SpeedFactor())
    monitor.begin(START, None, 0.1)
    odometry.on_odometry(START, ZERO)
    return monitor, odometry


def test_a_hold_that_is_released_before_the_robot_rests_needs_no_question(begun, monkeypatch):
    monitor, _ = begun
    monkeypatch.setattr(monitor, 'check_resume', lambda now: pytest.fail('it asks'))
    monitor._speed_factor.set('obstacle', 0.0)
    monitor.on_sent(START, 0.0)  # it brakes
    monitor.check(START)
    assert monitor.speed_factor == 0.0
    monitor._speed_factor.set('obstacle', 1.0)
    assert monitor.speed_factor == 1.0
    monitor.check(START)
    assert monitor.speed_factor == 1.0


def test_the_questions_before_a_release_are_asked_outside_every_lock(begun, monkeypatch):
    """And not by whoever releases the hold: others set their factors meanwhile."""
    monitor, _ = begun
    factor, has_set = monitor._speed_factor, []

    def ask(*_):
        other = threading.Thread(target=factor.set, args=('other', 0.5), daemon=True)
        other.start()
        other.join(5.0)
        has_set.append(not other.is_alive())

    monkeypatch.setattr(monitor, 'check_resume', ask)
    monkeypatch.setattr(monitor.pause_pose, 'require_not_moved', ask)
    factor.set('obstacle', 0.0)
    monitor.on_sent(START, math.inf)
    factor.set('obstacle', 1.0)
    assert has_set == []
    assert monitor.speed_factor == 0.0
    monitor.check(START)
    assert has_set == [True, True]
    assert monitor.speed_factor == 0.5


def test_a_program_that_was_held_up_does_not_blame_the_robot(begun):
    """No odometry can come while the program does not run."""
    monitor, _ = begun
    monitor.check(START)
    with pytest.raises(RunFaultError) as error:
        monitor.check(START + 3.0)
    assert str(error.value) == (
        f'odometry has been silent for 3.0 s: the program was held up, {HELD_UP_ADVICE}')
