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
"""The console matrix finds violations, and its proxy reads the commands of a page."""

from dataclasses import replace
import json
from unittest.mock import Mock

from benchmarks.console_matrix.proxy import frame, FrameReader, PassedCommand, PING, TEXT
from benchmarks.console_matrix.trial import (
    excess,
    Expectation,
    find_violations,
    hand_trial,
    SpoiltError,
    Trial,
)
from benchmarks.run import updated
import pytest

ROW = Expectation('something', 'somebody')
GOOD = Trial(zero=0.2, since_fault=0.21, zeros=10)


def sent(*entries):
    return [PassedCommand(time, velocity, 0.0) for time, velocity in entries]


@pytest.mark.parametrize('size', [0, 5, 125, 126, 65535, 65536])
def test_frames_are_read_as_they_were_made_whatever_arrives_at_once(size):
    payload = bytes(range(256)) * (size // 256) + bytes(size % 256)
    data = frame(payload) + frame(b'here?', PING)
    for step in (1, 1000, len(data)) if size < 1000 else (1000, len(data)):
        reader = FrameReader()
        found = [one for start in range(0, len(data), step)
                 for one in reader.feed(data[start:start + step])]
        assert found == [(TEXT, payload), (PING, b'here?')]


def test_the_time_begins_at_the_last_motion_that_was_passed_on_before_the_zero():
    trial = hand_trial(
        sent((1.0, 0.1), (2.0, 0.1), (2.3, 0.0), (2.4, 0.0)),
        sent((0.9, 0.1), (2.1, 0.1), (2.2, 0.0), (3.0, 0.1)), 2.05)
    assert trial.zero == pytest.approx(0.2)
    assert trial.since_fault == pytest.approx(0.25)
    assert (trial.zeros, trial.late, trial.offered) == (2, 0, 1)


def test_what_a_console_got_after_its_fault_is_no_good_command():
    trial = hand_trial(
        sent((1.0, 0.1), (2.3, 0.0)), sent((1.9, 0.1), (2.2, 0.1)), 2.0, effect=2.0)
    assert trial.zero == pytest.approx(0.4)


def test_a_motion_after_the_zero_is_counted():
    trial = hand_trial(sent((1.0, 0.1), (2.3, 0.0), (3.0, 0.1)), sent((1.9, 0.1)), 2.0)
    assert trial.late == 1
    assert find_violations(ROW, [trial]) == [
        'something: motion followed the first zero (1 of 1)',
        'something: a zero came later than 350 ms after the last good command (1 of 1)']


def test_a_robot_that_stopped_before_the_fault_says_nothing():
    with pytest.raises(SpoiltError):
        hand_trial(sent((1.0, 0.1), (1.5, 0.0)), sent((0.9, 0.1)), 2.0)


def test_violations_are_found():
    assert find_violations(ROW, [GOOD]) == []
    assert find_violations(ROW, []) == ['something: it was not tried']
    assert find_violations(ROW, [GOOD, Trial()]) == ['something: no zero came (1 of 2)']
    assert find_violations(ROW, [replace(GOOD, broken=('bad',))]) == ['something: bad (1 of 1)']
    slow = replace(GOOD, zero=0.4)
    assert find_violations(ROW, [slow])
    assert find_violations(ROW, [slow], under_load=True) == []
    assert find_violations(ROW, [replace(GOOD, since_fault=1.1)]) == [
        'something: a zero came later than 1000 ms after the fault (1 of 1)']


def test_only_a_late_zero_may_be_the_fault_of_the_machine():
    assert excess(ROW, GOOD) is None
    late = replace(GOOD, zero=0.4)
    assert excess(ROW, late) == pytest.approx(0.05)
    assert excess(ROW, replace(late, since_fault=1.2)) == pytest.approx(0.2)
    assert excess(ROW, late, 1.5) is None
    for changes in ({'late': 1}, {'broken': ('bad',)}, {'zero': None, 'since_fault': None}):
        assert excess(ROW, replace(late, **changes)) is None


def test_nothing_may_move_where_no_zero_is_due():
    nothing = Expectation('stranger', 'the console', None, None)
    assert find_violations(nothing, [Trial()]) == []
    assert find_violations(nothing, [Trial(late=1)]) == ['stranger: something moved (1 of 1)']


@pytest.mark.needs('rclpy', 'nav_msgs', 'selenium')
def test_a_record_ends_where_its_plan_does():
    from benchmarks.console_matrix.replay import recorded_and_planned
    recorded, planned = recorded_and_planned(
        'steps: [{move: {linear_x: 0.1, angular_z: 0.5, duration: 1.5}}]')
    assert planned.x == pytest.approx(recorded.x, abs=1e-12)
    assert planned.theta == pytest.approx(0.75)


@pytest.mark.needs('rclpy', 'nav_msgs', 'selenium')
def test_an_error_in_one_row_is_a_violation_of_that_row_alone():
    from benchmarks.console_matrix.runner import Runner

    def fail():
        raise TypeError('no pose\nat all')

    stage = Mock()
    runner = Runner(stage, None, under_load=False)
    for what, run in (('bad', fail), ('good', lambda: GOOD)):
        row = Mock(expectation=Expectation(what, 'somebody'), run=lambda _, run=run: run())
        runner.run(row, 1)
    assert runner.results.trials == {
        'bad': [Trial(broken=('TypeError: no pose',))], 'good': [GOOD]}
    stage.restart.assert_called_once_with()


@pytest.mark.needs('rclpy', 'nav_msgs', 'selenium')
def test_the_page_shows_the_reference_results():
    from benchmarks.console_matrix.__main__ import BEGIN, END, measured, PAGE, REFERENCE
    from benchmarks.console_matrix.rows import ROWS
    page, run = PAGE.read_text(), json.loads(REFERENCE.read_text())
    assert updated(page, measured(run), BEGIN, END) == page
    for row in ROWS:
        trials = [*map(Trial.from_json, run['rows'][row.expectation.what])]
        assert len(trials) == row.full
        assert find_violations(row.expectation, trials) == []
