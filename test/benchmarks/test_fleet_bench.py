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
"""The fleet benchmark: how far robots were in step, what it calculates, its bars and its page."""

from dataclasses import replace
import json
import math
from pathlib import Path

from benchmarks.fleet import in_step
from benchmarks.fleet.__main__ import (
    BEGIN,
    main,
    PAGE,
    page_text,
    PARTS,
    REFERENCE,
    stalled_parts,
)
from benchmarks.fleet.calculation import costs, discovery, on_line
from benchmarks.fleet.drives import timing
from benchmarks.fleet.figures import COST, GOING_ON, results, THRESHOLDS, TWO_FLEETS
from benchmarks.fleet.fleet_files import (
    names_of,
    write_fleet,
    write_long,
    write_moves,
    write_profiles,
)
from benchmarks.fleet.in_step import departure, lateness, planned_ticks, PlannedTick, Sent, spreads
from benchmarks.fleet.pauses import judged
from benchmarks.fleet.scale import FULL, QUICK
from benchmarks.fleet.stops import stopped
from benchmarks.fleet.tables import tables
from benchmarks.process_usage import participants, Traffic, traffic
from benchmarks.run import updated
from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.files.fleet_file import find_fleet, MAX_ROBOTS
from kachaka_simple_control.fleet.fleet_plan import plan_fleet, require_clear
from kachaka_simple_control.motion.geometry import Pose, Velocity
import pytest
from stall_observer import Stall

#: Times of some 1e9 s, in double precision, are known to a quarter of a microsecond.
CLOCK, KNOWN = 1e9, 1e-6
DUE = [0.0, 0.05, 0.1, 0.12, 0.17]
PLANNED = [PlannedTick(due, Velocity(velocity, 0.0))
           for due, velocity in zip(DUE, (0.1, 0.2, 0.2, 0.2, 0.1))]


def sent(late, ticks=range(5)):
    """Return velocities after their ticks, and the zero after them."""
    return [*(message(PLANNED[tick].due + late[tick], PLANNED[tick].velocity) for tick in ticks),
            Sent(CLOCK + 0.22, 0.0, 0.0)]


def message(at, velocity):
    """Return a message with a velocity of a plan."""
    return Sent(CLOCK + at, velocity.linear_x, velocity.angular_z)


#: A first message is often later than others.
LATE = st.tuples(st.floats(0.0, 0.02), *[st.floats(0.0, 0.005)] * 4)


@given(st.lists(LATE, min_size=2, max_size=4))
def test_lateness_is_that_after_the_most_punctual_message(robots):
    records = {str(number): sent(robot)
               for number, robot in enumerate(robots)}
    late = lateness(records, PLANNED)
    least = min(map(min, robots))
    for robot, found in zip(robots, late.values()):
        assert found == pytest.approx([one - least for one in robot], abs=KNOWN)
    assert spreads(late) == pytest.approx(
        [max(column) - min(column) for column in zip(*robots)], abs=KNOWN)


@given(st.integers(0, 4))
def test_a_message_that_is_missing_is_lost_and_shifts_no_other(tick):
    others = [number for number in range(5) if number != tick]
    late = lateness({'r1': sent([0.0] * 5), 'r2': sent([0.0] * 5, others)}, PLANNED)
    assert late['r2'] == [None if number == tick else pytest.approx(0.0, abs=KNOWN)
                          for number in range(5)]
    assert in_step.lost(late) == 1
    assert max(spreads(late)) < KNOWN


def test_robots_that_got_nothing_are_never_in_step():
    assert spreads(lateness({'r1': [], 'r2': []}, PLANNED)) == [math.inf] * 5
    assert in_step.p99([]) == math.inf


def test_the_last_first_zero_counts_and_motion_after_a_robots_own():
    records = {
        'r1': [Sent(1.0, 0.1, 0.0), Sent(2.0, 0.0, 0.0), Sent(2.1, 0.1, 0.0)],
        'r2': [Sent(1.0, 0.1, 0.0), Sent(1.5, 0.0, 0.0), Sent(1.9, 0.1, 0.0),
               Sent(2.5, 0.0, 0.0)]}
    assert stopped(records, 1.8) == {'zero': 0.7, 'seen': 0.2, 'moved_after': 1}
    assert stopped({**records, 'r3': [Sent(1.9, 0.1, 0.0)]}, 1.8)['zero'] is None


def test_of_a_killed_bridge_the_others_count_from_the_first_zero():
    records = {'r1': [Sent(3.0, 0.0, 0.0)], 'r2': [Sent(3.02, 0.0, 0.0)]}
    assert stopped(records, 2.0, killed='r1') == {'zero': 0.02, 'seen': 1.0, 'moved_after': 0}


@pytest.fixture
def square(tmp_path):
    """Return the plan of a fleet whose robots drive a square with limits of their own."""
    names = names_of(3)
    file = write_fleet(tmp_path / 'fleet.yaml', names, 'square', 10.0,
                       profiles=write_profiles(tmp_path, names))
    return plan_fleet(find_fleet(file))


def driven(robot, pause_at, late, more=0.0):
    """Return what a robot is sent that pauses in a step, and drives on as planned later."""
    ticks, rests = planned_ticks(robot.plan), [step.start for step in robot.plan.steps]
    step = next(start for start in rests if start > pause_at)
    before = [message(tick.due, tick.velocity) for tick in ticks if tick.due < pause_at]
    replanned = [Sent(CLOCK + pause_at + 2.0, 0.01, 0.0)]
    after = [message(tick.due + late + more, tick.velocity)
             for tick in ticks if tick.due >= step]
    return [*before, *replanned, *after, Sent(CLOCK + 100.0, 0.0, 0.0)]


def test_a_pause_is_judged_by_the_next_step_as_planned(square):
    """Each robot rests where its own step ends, and all are equally late after it."""
    records = {robot.name: driven(robot, 2.5, 3.4, 0.005 * number)
               for number, robot in enumerate(square.robots)}
    found = judged(square, records, CLOCK + 4.0, [robot.plan.pose for robot in square.robots])
    assert found == {'late': pytest.approx(3.41, abs=KNOWN),
                     'apart': pytest.approx(0.01, abs=KNOWN), 'distance': 0.0, 'angle': 0.0}
    off = [Pose(pose.x + 0.002, pose.y, pose.theta + math.radians(0.2))
           for pose in (robot.plan.pose for robot in square.robots)]
    found = judged(square, records, CLOCK + 4.0, off)
    assert (found['distance'], found['angle']) == (0.002, 0.2)


def test_a_robot_that_was_at_rest_anyway_counts_from_after_the_pause(square):
    robot = square.robots[0]
    ticks, rests = planned_ticks(robot.plan), [step.start for step in robot.plan.steps]
    sent = [message(tick.due + 3.0 * (tick.due >= rests[1]), tick.velocity) for tick in ticks]
    found = departure(sent, ticks, rests, CLOCK + rests[1] + 2.9)
    assert found == pytest.approx(CLOCK + 3.0, abs=KNOWN)


def test_a_robot_that_never_drove_as_planned_again_is_found(square):
    robot = square.robots[0]
    ticks, rests = planned_ticks(robot.plan), [step.start for step in robot.plan.steps]
    wrong = [one._replace(linear_x=one.linear_x + 0.001) for one in driven(robot, 2.5, 3.4)]
    assert departure(wrong, ticks, rests, CLOCK + 4.0) is None
    records = {robot.name: driven(robot, 2.5, 3.4) for robot in square.robots}
    records[robot.name] = wrong
    planned = [robot.plan.pose for robot in square.robots]
    assert judged(square, records, CLOCK + 4.0, planned)['apart'] is None


@pytest.mark.parametrize('count', [1, 10, 50])
def test_the_fleets_that_are_measured_are_valid_and_far_apart(count, tmp_path):
    names = names_of(count)
    for motion in (write_moves(tmp_path, 4), write_long(tmp_path), 'square'):
        plan = plan_fleet(find_fleet(write_fleet(
            tmp_path / 'fleet.yaml', names, motion, 20.0, 'go_on')))
        assert [robot.name for robot in plan.robots] == names
        assert plan.file.goes_on
        require_clear(plan)


def test_a_drive_on_time_is_exact(tmp_path):
    file = write_fleet(tmp_path / 'fleet.yaml', names_of(2), write_moves(tmp_path, 3), 10.0)
    plan = plan_fleet(find_fleet(file)).robots[0].plan
    robot = [*(message(tick.due, tick.velocity) for tick in planned_ticks(plan)),
             Sent(CLOCK + plan.duration, 0.0, 0.0)]
    found = timing(file, dict.fromkeys(names_of(2), robot), None)
    assert (found['ticks'], found['lost'], found['first_apart']) == (30, 0, 0.0)
    assert found['errors'] == pytest.approx([0.0, 0.0], abs=1e-5)
    assert found['late']['worst'] < KNOWN
    cut = timing(file, dict.fromkeys(names_of(2), robot), 1.55)
    assert (cut['ticks'], cut['lost']) == (13, 0)


DEVICES = """\
Inter-|   Receive                    |  Transmit
 face |bytes packets errs drop fifo frame compressed multicast|bytes packets errs drop
    lo: {0} {1} 0 0 0 0 0 0 {0} {1} 0 0 0 0 0 0
 veth0: 7 1 0 0 0 0 0 0 {2} {3} 0 0 0 0 0 0
"""


UDP = """\
  sl  local_address rem_address   st tx_queue rx_queue
  100: 0100007F:{:04X} 00000000:0000 07 00000000:00000000
  101: 00000000:{:04X} 00000000:0000 07 00000000:00000000
  102: 00000000:{:04X} 00000000:0000 07 00000000:00000000
  103: 00000000:{:04X} 00000000:0000 07 00000000:00000000
  104: 00000000:{:04X} 00000000:0000 07 00000000:00000000
"""


def test_participants_are_counted_by_their_ports():
    first = 7400 + 250 * 7
    text = UDP.format(first, first + 1, first + 10, first + 11, first + 12)
    assert (participants(text, 7), participants(text, 6), participants(text, 8)) == (2, 0, 0)


def test_traffic_is_what_all_interfaces_sent():
    before = traffic(DEVICES.format(1000, 10, 500, 1))
    assert traffic(DEVICES.format(3000, 14, 700, 2)).since(before) == Traffic(5, 2200)


def test_costs_lie_on_a_line_between_those_that_are_known():
    assert on_line(100, [(50, 10.0), (200, 25.0)]) == pytest.approx(15.0)
    assert on_line(50, [(50, 10.0), (200, 25.0)]) == pytest.approx(10.0)
    assert on_line(1000, [(1, 5.0), (50, 10.0), (200, 25.0)]) == pytest.approx(105.0)


DRIVES = [{'robots': count, 'cpu': 1.0 + 0.1 * count, 'guardian_cpu': 0.5,
           'memory': 100.0 + count} for count in (1, 10, 50, 200)]


def test_beyond_the_most_robots_of_a_program_several_share_them():
    found = {cost.robots: cost for cost in costs(DRIVES, [])}
    assert found[200].is_measured
    assert not found[100].is_measured
    assert found[100].cpu == pytest.approx(11.5)
    assert (found[MAX_ROBOTS].programs, found[MAX_ROBOTS].participants) == (1, MAX_ROBOTS + 2)
    thousand = found[1000]
    assert (thousand.programs, thousand.participants) == (4, 1008)
    assert thousand.memory == pytest.approx(4 * 100.0 + 1000)
    assert thousand.cpu == pytest.approx(4 * 1.5 + 100.0)
    assert costs(DRIVES[:1], []) == []


def test_discovery_grows_with_the_square_of_the_participants():
    known = [{'participants': 3, 'found_size': 1.0, 'size': 1.0},
             {'participants': 10, 'found_size': 2e6, 'size': 3e3}]
    assert discovery(20, known) == pytest.approx((8.0, 12.0))
    assert discovery(20, []) == (None, None)


GOOD = {
    'date': '2026-01-31', 'machine': {'processor': 'fast', 'cores': '2'},
    'in_step': [{
        'robots': 50, 'odometry': 10.0, 'rate': 20.0, 'code': 0, 'start': 4.0, 'found': 2.0,
        'ticks': 400, 'lost': 0, 'first_apart': 0.001, 'errors': [],
        'apart': {'median': 0.001, 'p99': 0.002, 'worst': 0.01}, 'late': {},
        'cpu': 10.0, 'guardian_cpu': 2.0, 'memory': 150.0, 'threads': 30, 'python_threads': 10}],
    'fleets': [{
        'robots': count, 'ticks': 40, 'lost': 0, 'errors': [0.0001, 0.001], 'apart': {},
        'late': {'median': 0.001, 'p99': 0.004, 'worst': 0.01}, 'cpu': 5.0 + 0.1 * count,
        'guardian_cpu': 1.0, 'memory': 100.0 + 0.5 * count} for count in (1, 200)],
    'stops': [
        *({'what': what, 'zero': zero, 'seen': zero, 'moved_after': 0, 'code': code, 'said': ''}
          for what, zero, code in (
              ('SIGINT', 0.01, 130), ('SIGKILL', 0.05, 137), ('SIGSTOP', 0.1, None),
              ('guardian killed', 0.1, 1), ('bridge killed', 0.03, 1))),
        {'what': 'bridge killed, go_on', 'zero': 1.1, 'seen': 1.1, 'moved_after': 0, 'code': 1,
         'said': '', 'lost': 0, 'error': 0.001},
        {'what': 'robot missing', 'zero': None, 'seen': None, 'moved_after': 0, 'code': 3,
         'said': 'kachaka_fleet: ghost: nobody subscribes'}],
    'pauses': [{'ended': True, 'arrived_apart': 0.3, 'late': 3.4, 'apart': 0.01,
                'distance': 0.0005, 'angle': 0.05}],
    'two_fleets': {
        'robots': 6, 'code': 0, 'said': '', 'after_kill': 4.0, 'errors': [],
        'ticks': 80, 'lost': 0,
        'first_apart': 0.004, 'apart': {'median': 0.003, 'p99': 0.005, 'worst': 0.01},
        'late': {}, 'foreign_code': 1, 'foreign_said': 'a001: somebody',
        'foreign_seen': True},
    'programs': [{'robots': 1, 'lost': 0, 'cpu': 5.0, 'guardian_cpu': 1.0, 'memory': 100.0}],
    'standing_by': [{'robots': 1, 'programs': 1, 'participants': 3, 'bridges': 1,
                     'memory': 90.0, 'found_size': 1000, 'packets': 10.0, 'size': 5000.0}]}


def changed(part, number, **change):
    """Return the good run with another figure."""
    entries = GOOD[part]
    if number is None:
        return {**GOOD, part: {**entries, **change}}
    return {**GOOD, part: [
        {**entry, **change} if index == number else entry for index, entry in enumerate(entries)]}


def missed(run):
    """Return what was missed."""
    return [result.threshold.what for result in results(run) if not result.is_met]


def test_a_good_run_misses_no_bar():
    assert missed(GOOD) == []
    assert missed({**GOOD, 'two_fleets': {'reason': 'only root may make them'}}) == []


@pytest.mark.parametrize('part, number, change, what', [
    ('in_step', 0, {'first_apart': 0.006}, 'in step: first velocities apart'),
    ('in_step', 0, {'apart': {'p99': 0.006}}, 'in step: later boundaries apart, p99'),
    ('in_step', 0, {'cpu': 23.1}, 'fleet and guardian, odometry at 10 Hz: CPU'),
    ('in_step', 0, {'memory': 251.0}, 'fleet and guardian, odometry at 10 Hz: memory'),
    ('in_step', 0, {'python_threads': 15}, 'fleet: Python threads'),
    ('in_step', 0, {'found': 6.1}, 'from the robots found to t = 0'),
    ('fleets', 1, {'late': {'p99': 0.011}}, 'many: lateness, p99'),
    ('fleets', 1, {'errors': [0.0011, 0.001]}, 'many: displacement error, median'),
    ('fleets', 1, {'errors': [0.0001, 0.006]}, 'many: displacement error, worst'),
    ('fleets', 1, {'cpu': 1300.0}, 'cost a robot, the largest fleet over one robot: CPU'),
    ('stops', 0, {'zero': 0.021}, 'SIGINT to the last first zero, worst'),
    ('stops', 1, {'zero': None}, 'SIGKILL to the last first zero, worst'),
    ('stops', 2, {'zero': 0.201}, 'SIGSTOP to the last first zero, worst'),
    ('stops', 3, {'zero': None}, 'guardian killed: fleets not stopped'),
    ('stops', 4, {'zero': 0.051}, 'bridge killed: fault seen to the last first zero, worst'),
    ('stops', 4, {'moved_after': 1}, 'stopped fleets: velocities after the first zero'),
    ('stops', 0, {'code': 1}, 'stopped fleets: wrong exit codes'),
    ('stops', 5, {'lost': 1}, 'go_on: robots or ticks that were lost'),
    ('stops', 5, {'error': 0.1}, 'go_on: robots or ticks that were lost'),
    ('stops', 6, {'moved_after': 1}, 'robot missing: who moved, or what was not said'),
    ('stops', 6, {'said': 'a robot'}, 'robot missing: who moved, or what was not said'),
    ('pauses', 0, {'distance': 0.0011}, 'pause: distance from the planned end, worst'),
    ('pauses', 0, {'angle': 0.11}, 'pause: angle from the planned end, worst'),
    ('pauses', 0, {'apart': None}, 'pause: apart at the next rest, worst'),
    ('two_fleets', None, {'first_apart': 0.009}, 'two fleets: first velocities apart'),
    ('two_fleets', None, {'apart': {'p99': 0.009}}, 'two fleets: later boundaries apart, p99'),
    ('two_fleets', None, {'code': 1}, 'two fleets, server killed: drives that ended'),
    ('two_fleets', None, {'after_kill': 0.5}, 'two fleets, server killed: drives that ended'),
    ('two_fleets', None, {'foreign_seen': False}, 'two fleets: foreign senders not seen'),
])
def test_each_bar_is_judged(part, number, change, what):
    assert missed(changed(part, number, **change)) == [what]


def test_a_quick_run_forgives_a_busy_machine_but_no_fault():
    late = {**changed('in_step', 0, first_apart=0.04), 'is_quick': True}
    assert missed(late) == []
    assert missed({**late, 'in_step': [{**GOOD['in_step'][0], 'first_apart': 0.06}]}) == [
        'in step: first velocities apart']
    assert missed({**changed('stops', 4, moved_after=1), 'is_quick': True}) == [
        'stopped fleets: velocities after the first zero']


def test_only_a_part_in_whose_time_the_machine_stood_still_is_measured_again():
    run = {**changed('in_step', 0, first_apart=0.06), 'is_quick': True}
    spans = {'in_step': (1.0, 2.0), 'stops': (2.0, 3.0)}
    assert stalled_parts(run, spans, [Stall(1.5, 1.6, 0)]) == ['in_step']
    assert stalled_parts(run, spans, [Stall(2.5, 2.6, 0)]) == []
    assert stalled_parts(GOOD, spans, [Stall(1.5, 1.6, 0)]) == []


def test_a_fleet_that_did_not_end_its_paused_drive_misses_its_bars():
    assert missed(changed('pauses', 0, ended=False)) == [
        'pause: distance from the planned end, worst', 'pause: angle from the planned end, worst']


def test_what_was_not_measured_is_missed():
    nothing = {**GOOD, **PARTS}
    everything = THRESHOLDS + COST + GOING_ON
    assert missed(nothing) == [threshold.what for threshold in everything]
    (judged, *_) = tables(nothing, is_partial=True)
    assert judged.rows == ()
    assert len({one.what for one in everything + TWO_FLEETS}) == len(everything + TWO_FLEETS)
    few = {**GOOD, 'fleets': GOOD['fleets'][1:], 'stops': [
        entry for entry in GOOD['stops'] if entry['what'] != 'bridge killed, go_on']}
    assert missed(few) == []


def test_a_run_can_be_shown_again(tmp_path, capsys):
    file = tmp_path / 'run.json'
    for run, code in ((GOOD, 0), (changed('stops', 0, zero=0.5), 1)):
        file.write_text(json.dumps(run))
        assert main(['--of', str(file)]) == code
    printed = capsys.readouterr().out
    assert 'Every bar is kept' in printed
    assert 'Missed: SIGINT to the last first zero, worst' in printed


def test_the_page_has_all_tables_and_says_how_it_calculates():
    text = page_text(tables(GOOD), GOOD)
    for table in tables(GOOD):
        assert table.rows
        assert all(len(row) == len(table.head) for row in table.rows)
        assert table.title in text
    assert 'grows with the square of the participants' in text.replace('\n', ' ')
    assert 'new' in updated(PAGE.read_text(), 'new', BEGIN)


def test_both_scales_measure_what_has_a_bar():
    for scale in (FULL, QUICK):
        assert 10.0 in scale.odometry
        assert min(scale.signals, scale.guardians, scale.bridges, scale.pauses) > 0
    assert (FULL.in_step, FULL.fleets, FULL.signals) == (50, (1, 10, 50, 200), 20)
    assert FULL.go_on > 0
    assert replace(QUICK, cut=None) != FULL


def test_the_page_shows_the_reference_results():
    if not REFERENCE.exists():
        pytest.skip('nothing was measured yet')
    run = json.loads(REFERENCE.read_text())
    assert page_text(tables(run), run).strip() in Path(PAGE).read_text()
    # A machine may be too slow for the others.
    never = {bar.what for bar in THRESHOLDS + GOING_ON + TWO_FLEETS if not bar.limit}
    assert not never & {*missed(run)}
