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
"""The stop matrix finds violations, and its faults can be injected."""

from dataclasses import asdict, replace
import json
import re
import struct
from types import SimpleNamespace

from benchmarks.run import updated
from benchmarks.stop_matrix import __main__ as program
from benchmarks.stop_matrix.__main__ import (
    BEGIN,
    END,
    merged,
    PAGE,
    REFERENCE,
    second_try,
    trials_of,
    violations,
)
from benchmarks.stop_matrix.expectation import (
    Expectation,
    find_late_stops,
    find_violations,
    HEAD,
    matrix,
    row,
    Trial,
    Zero,
)
from benchmarks.stop_matrix.lasers import message, Mode
from benchmarks.stop_matrix.obstacles import check_braked, check_goes_on
from benchmarks.stop_matrix.rows import ROWS
from benchmarks.stop_matrix.trial_setup import from_burst_on, last_message
from kachaka_simple_control.control.scans import points_of
from kachaka_simple_control.files.cdr import read_laser_scan
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.motion.geometry import Pose
import pytest
from stall_observer import Stall

EXPECTATION = Expectation('SIGTERM', 'the node', (143,), limit=0.02)
GOOD = Trial(zero=0.001, zeros=20, late=0, metres=0.002, code=143, message='ended')


def test_trials_as_expected_have_no_violations():
    assert find_violations(EXPECTATION, [GOOD] * 20) == []
    assert find_late_stops(EXPECTATION, [GOOD] * 20) == []


@pytest.mark.parametrize('change, text', [
    ({'late': 1}, 'a velocity followed the first zero'),
    ({'zero': None, 'zeros': 0}, 'no zero came'),
    ({'code': 0}, 'exit code 0, not 143'),
    ({'code': None}, 'it did not end, not 143'),
    ({'zero': -0.1}, 'it stopped before anything had happened'),
    ({'message': 'Traceback: ValueError'}, 'a traceback'),
    ({'broken': ('its guardian outlived it',)}, 'its guardian outlived it'),
])
def test_one_violation_among_many_trials_is_found(change, text):
    trials = [GOOD] * 19 + [replace(GOOD, **change)]
    assert find_violations(EXPECTATION, trials) == [f'SIGTERM: {text} (1 of 20)']


def test_a_subscriber_may_lose_zeros_but_not_in_every_trial():
    few = replace(GOOD, zeros=9)
    assert find_violations(EXPECTATION, [few] * 19 + [GOOD]) == []
    assert find_violations(EXPECTATION, [few] * 20) == [
        'SIGTERM: fewer than 10 zeros came (20 of 20)']


def test_a_row_that_was_not_tried_is_a_violation():
    assert find_violations(EXPECTATION, []) == ['SIGTERM: it was not tried']


def test_the_worst_time_counts_and_limits_are_wider_under_load():
    trials = [GOOD] * 19 + [replace(GOOD, zero=0.15)]
    assert find_late_stops(EXPECTATION, trials) == [
        'SIGTERM: 150.0 ms to the first zero, more than its limit of 20 ms']
    assert find_late_stops(EXPECTATION, trials, under_load=True) == []
    assert find_late_stops(EXPECTATION, [replace(GOOD, zero=0.21)], under_load=True) != []
    assert find_late_stops(replace(EXPECTATION, limit=None), trials) == []


@pytest.mark.parametrize('zero, kind, kept', [
    (0.001, Zero.AT_END, True), (-0.3, Zero.AT_END, False), (-0.3, Zero.ANY_TIME, True),
    (None, Zero.ANY_TIME, False), (None, Zero.NONE, True)])
def test_a_zero_is_required_as_expected(zero, kind, kept):
    trial = replace(GOOD, zero=zero)
    assert (find_violations(replace(EXPECTATION, zero=kind), [trial]) == []) == kept


def test_motion_after_the_fault_is_a_violation_even_if_no_zero_is_expected():
    expectation = replace(EXPECTATION, zero=Zero.NONE)
    assert find_violations(expectation, [replace(GOOD, zero=None, zeros=0, late=1)]) != []


def test_the_table_shows_the_worst():
    trials = [GOOD, replace(GOOD, zero=0.0045, zeros=12, metres=0.031), replace(GOOD, code=None)]
    cells = dict(zip(HEAD, row(EXPECTATION, trials)))
    assert cells['to the first zero [ms], median / worst'] == '1.00 / 4.50'
    assert (cells['zeros, least'], cells['driven [m], worst']) == ('12', '0.031')
    assert cells['exit code'] == 'none, 143'
    assert cells['motion after'] == '0'


def test_a_matrix_can_be_saved_and_measured_in_parts():
    data = {'rows': {'SIGTERM': [asdict(GOOD)]}}
    kept = json.loads(json.dumps(merged({'rows': {'other': []}}, data)))
    assert trials_of(kept) == {'other': [], 'SIGTERM': [GOOD]}


@pytest.fixture
def tried_again(monkeypatch):
    """Have rows go as expected when they are tried again; return their names."""
    names = []

    def measure(rows, over_grpc):
        names.extend(row.expectation.what for row, _ in rows)
        return {'rows': {name: [asdict(GOOD)] for name in names}}

    monkeypatch.setattr(program, 'measure', measure)
    return names


def rows_and_results(**trials):
    """Return rows of these names, and what was measured."""
    rows = [SimpleNamespace(expectation=replace(EXPECTATION, what=name), quick=len(tried))
            for name, tried in trials.items()]
    return rows, {'rows': {name: [*map(asdict, tried)] for name, tried in trials.items()}}


def test_only_rows_whose_bad_trials_met_a_stall_are_tried_again(tried_again, capsys):
    late = replace(GOOD, zero=0.21)
    rows, data = rows_and_results(
        good=[replace(GOOD, began=4.0, ended=6.0)],
        before=[replace(late, began=3.0, ended=4.9)],
        during=[replace(late, began=4.0, ended=6.0), replace(GOOD, began=7.0, ended=8.0)],
        both=[replace(late, began=4.0, ended=6.0), replace(late, began=7.0, ended=8.0)])
    data, excess = second_try(rows, data, [Stall(5.0, 5.1, 1)])
    assert (tried_again, excess) == (['during'], [])
    assert trials_of(data)['during'] == [GOOD]
    assert violations(rows, trials_of(data), under_load=True) == [
        f'{name}: 210.0 ms to the first zero, more than its limit of 200 ms'
        for name in ('before', 'both')]
    assert capsys.readouterr().out == (
        'REPEATED during: 210.0 ms to the first zero, more than its limit of 200 ms: core 1 stood '
        'still for 100 ms\nrows: 4, repeated because the machine stood still: 1\n')


def test_a_matrix_with_too_many_rows_tried_again_fails(tried_again):
    bad = replace(GOOD, late=1, began=4.0, ended=6.0)
    rows, data = rows_and_results(one=[bad], two=[bad])
    data, excess = second_try(rows, data, [Stall(5.0, 5.1, 1)])
    assert tried_again == ['one', 'two']
    assert violations(rows, trials_of(data), under_load=True) == []
    assert excess == ['more than 5% of the rows were repeated']


def test_the_last_line_that_is_no_routine_log_is_the_message():
    text = """[INFO] [1763.5] [kachaka_simple_control]: Robot control node has started
\x1b[0m[INFO] [1763.9] [kachaka_simple_control]: Robot has stopped\x1b[0m
kachaka_simple_control: the robot left: nobody subscribes to /stop_3/manual_control/cmd_vel
"""
    said = 'the robot left: nobody subscribes to /kachaka/manual_control/cmd_vel'
    assert last_message(text, 'stop_3', False) == said
    trace = f'Traceback (most recent call last):\n  File "a"\n{text}'
    assert last_message(trace, 'stop_3', True) == said
    assert last_message(trace, 'stop_3', False).startswith('Traceback: ')
    own = '/tmp/stop_matrix_8/script.py:26: the robot left'
    assert last_message(own, 'stop_3', False) == 'script.py:26: the robot left'


def test_the_stop_of_a_paused_program_begins_where_zeros_come_at_once():
    pause, burst = [0.0, 0.1, 0.2], [0.23, 0.2301, 0.2302, 0.27]
    assert from_burst_on(pause + burst) == burst
    assert from_burst_on(burst) == burst
    assert from_burst_on(pause) == []
    assert from_burst_on([]) == []


def test_a_laser_shows_an_obstacle_8_cm_ahead_of_the_robot_or_a_free_way_or_nothing():
    laser = Pose(KACHAKA.laser.ahead, 0.0, 0.0)
    front = max(x for x, _ in KACHAKA.footprint.corners())
    seen = points_of(read_laser_scan(message(Mode.OBSTACLE, 1.0)), laser)
    assert min(x for x, _ in seen) == pytest.approx(front + 0.08, abs=0.005)
    assert points_of(read_laser_scan(message(Mode.CLEAR, 1.0)), laser) == ()
    with pytest.raises((ValueError, struct.error)):
        read_laser_scan(message(Mode.BROKEN, 1.0))


def sent_every_tenth(*velocities):
    """Return the context of a trial in which these were sent, the first at 0.1 s."""
    sent = [SimpleNamespace(time=0.1 * number, linear_x=velocity, moves=velocity != 0.0)
            for number, velocity in enumerate(velocities, 1)]
    recorder = SimpleNamespace(sent_since=lambda since: [one for one in sent if one.time > since])
    return SimpleNamespace(
        recorder=recorder, recorders=[recorder], first=0.1, changed=0.0,
        stop_zeros=lambda recorder: [sent[-1].time])


def test_a_robot_without_scans_must_begin_to_brake_in_time():
    assert check_braked(sent_every_tenth(*[0.3] * 4, 0.2, 0.1, 0.0), 0.05) == []
    assert check_braked(sent_every_tenth(*[0.3] * 7, 0.2), 0.05) == [
        'it braked only 0.75 s after the last scan']


def test_a_held_robot_must_go_on_when_the_way_was_free_for_a_second():
    assert check_goes_on(sent_every_tenth(*[0.0] * 10, 0.1, 0.0), 0.0) == []
    assert check_goes_on(sent_every_tenth(*[0.0] * 4, 0.1, 0.0), 0.0) == [
        'it went on 0.50 s after the way was free']
    assert check_goes_on(sent_every_tenth(*[0.0] * 19, 0.1, 0.0), 0.0) == [
        'it went on only 2.00 s after the way was free']


def test_rows_have_unique_names_and_are_tried():
    names = [row.expectation.what for row in ROWS]
    assert len(set(names)) == len(names) > 35
    assert all(row.full or row.quick for row in ROWS)


def test_the_page_shows_the_reference_results():
    page = PAGE.read_text()
    assert 'new' in updated(page, 'new', BEGIN, END)
    run = json.loads(REFERENCE.read_text())
    table = matrix([row.expectation for row in ROWS], trials_of(run)).markdown()
    assert table.strip() in page
    full = [row for row in ROWS if row.full]
    assert len(re.findall(r'^\| [^|]+ \| [^|]+ \| \d+ \|', table, re.MULTILINE)) == len(full)
    assert violations(full, trials_of(run), under_load=False) == []


@pytest.mark.ros
def test_a_robot_over_grpc_is_stopped_too():
    """Three processes: the robot, the bridge, and the node that is ended or killed."""
    pytest.importorskip('rclpy', reason='needs ROS 2')
    pytest.importorskip('nav_msgs', reason='needs nav_msgs')
    pytest.importorskip('kachaka_api.generated', reason="needs the robot's SDK")
    from benchmarks.stop_matrix.runner import run
    rows = [row for row in ROWS if row.expectation.what in ('SIGTERM', 'SIGKILL')]
    seen = run([(row, 1) for row in rows], over_grpc=True)
    assert violations(rows, seen, under_load=True) == []
    for (trial,) in seen.values():
        assert trial.metres is not None
        assert trial.metres < 0.03
        assert 0.0 < trial.began < trial.ended
