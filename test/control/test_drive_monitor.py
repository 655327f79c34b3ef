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

from functools import partial
from itertools import pairwise
import math
import threading
from types import SimpleNamespace

from kachaka_simple_control.control.drive_monitor import DriveMonitor, LeaseRenewer
from kachaka_simple_control.control.guardian import NullGuardian
from kachaka_simple_control.control.speed_factor import SpeedFactor
from kachaka_simple_control.control.standstill import StandstillDetector
from kachaka_simple_control.control.timing import GRAPH_CHECK_PERIOD, GRAPH_COUNT_PERIOD
from kachaka_simple_control.errors import HELD_UP_ADVICE, RunFaultError
from kachaka_simple_control.motion.geometry import ZERO
import pytest

START = 100.0


@pytest.fixture
def begun():
    """Return a monitor whose run has begun, and its odometry."""
    odometry = StandstillDetector()
    anything = SimpleNamespace(
        check_identity=lambda: None, check_exclusive=lambda: None, has_changed=lambda: False,
        update=lambda: False)
    parameters = SimpleNamespace(odometry_timeout=0.5, pause_timeout=600.0)
    monitor = DriveMonitor(
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


#: How often the monitor of the next tests checks [s]; sums of it are exact.
STEP = 1.0 / 64.0


def questions(duration, happen):
    """
    Let a monitor check for some time; return what it asked, and when [s after the start].

    :param happen: called before each check with the time, the monitor and the answers by question
    """
    asked, answers, is_waiting, now = [], {}, False, 0.0

    def question(what, enters_dds=True):
        def ask():
            assert is_waiting == enters_dds, what
            asked.append((what, now))
            return answers.get(what)
        return ask

    def wait_for_dds(ask):
        nonlocal is_waiting
        assert not is_waiting, 'its time would count twice'
        is_waiting = True
        ask()
        is_waiting = False

    port = SimpleNamespace(**{what: question(what) for what in (
        'has_changed', 'check_identity', 'check_exclusive', 'update')})
    lease = LeaseRenewer(question('request'), 0.3)
    lease.granted(0.0)
    answers['request'] = SimpleNamespace(done=True, refusal=None)
    monitor = DriveMonitor(
        SimpleNamespace(check=question('guardian', enters_dds=False)), lease, port, port,
        StandstillDetector(), SimpleNamespace(odometry_timeout=0.0, pause_timeout=600.0),
        SpeedFactor())
    monitor.wait_for_dds = wait_for_dds
    monitor.begin(0.0, None, 0.1)
    while now < duration:
        happen(now, monitor, answers)
        monitor.check(now)
        now += STEP
    return {what: [at for one, at in asked if one == what] for what, _ in asked}


@pytest.mark.parametrize('answer', ['has_changed', 'update'])
def test_each_count_is_followed_by_the_other_questions_after_a_change_and_with_others(answer):
    """With others this node subscribes, too: the robot may leave, and no number changes."""
    asked = questions(6.0, lambda now, _, answers: answers.update({answer: 2.0 <= now < 4.0}))
    counts, looks = asked['has_changed'], asked['check_identity']
    assert max(two - one for one, two in pairwise(counts)) <= GRAPH_COUNT_PERIOD + STEP
    assert asked['check_exclusive'] == asked['update'] == looks
    within = [at for at in counts if looks[2] <= at < 4.0]
    assert [at for at in looks if looks[2] <= at < 4.0] == within
    assert len(within) > 5
    longest = GRAPH_CHECK_PERIOD + GRAPH_COUNT_PERIOD + STEP
    for rest in looks[:3], looks[-2:]:
        assert all(GRAPH_CHECK_PERIOD <= two - one <= longest for one, two in pairwise(rest))


@pytest.mark.parametrize('count', [2, 200])
def test_many_robots_ask_one_after_the_other_and_less_often(count):
    def ask(number):
        return questions(12.0, lambda now, monitor, _: (
            monitor.wait_for_dds(partial(monitor.check_graph, now)),
            monitor.share_graph(number, count)) if not now else None)

    first, middle = ask(0)['has_changed'], ask(count // 2)['has_changed']
    period = max(GRAPH_COUNT_PERIOD, 0.005 * count)
    for asked in first, middle:
        gaps = [two - one for one, two in pairwise(asked)][2:]
        assert period - 1e-6 <= min(gaps) <= max(gaps) <= period + STEP
    assert (middle[4] - first[4]) % period == pytest.approx(period / 2.0, abs=2.0 * STEP)


def test_what_was_asked_before_the_run_does_not_delay_its_first_velocity():
    def ask(now, monitor, _):
        if now == 0.0:
            monitor.wait_for_dds(partial(monitor.check_graph, now))

    asked = questions(1.0, ask)
    assert asked['check_identity'] == [0.0]
    assert asked['has_changed'][0] == 0.0 < asked['has_changed'][1]


def test_only_what_enters_dds_is_no_gap():
    def hold(now, monitor, _):
        if now == 1.0:
            monitor._speed_factor.set('obstacle', 0.0)
            monitor.on_sent(now, math.inf)
        elif now == 2.5:
            monitor._speed_factor.set('obstacle', 1.0)

    asked = questions(41.0, hold)
    assert len(asked['guardian']) == 41 * 64
    assert asked['request']
    assert len(asked['check_identity']) == len(asked['update']) + 1, 'once to end the hold'
