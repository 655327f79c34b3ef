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
"""What a fleet drives, who comes too near, and the table of both."""

from __future__ import annotations

from dataclasses import replace
import math

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.fleet_file import find_fleet, FleetFileError, read_fleet
from kachaka_simple_control.files.library import find
from kachaka_simple_control.files.motion_file import MotionFile
from kachaka_simple_control.fleet.fleet_plan import fleet_of, plan_fleet, require_clear
from kachaka_simple_control.fleet.fleet_table import fleet_table
from kachaka_simple_control.kachaka.simulator.drive_model import IDEAL, SimulationParameters
from kachaka_simple_control.motion.geometry import ORIGIN, Pose
from kachaka_simple_control.motion.steps import Forward, Motion, Move, SETTLE_TIME, Wait
import pytest

pytestmark = pytest.mark.needs('yaml', 'jsonschema')

ROBOTS = """\
extends: kachaka
calibration: {delay: 150 ms}
"""
PAIR = """\
robots:
  r1: {motion: square}
  r2: {motion: straight, start: {x: 0.6 m, y: 0.3 m, heading: -90 deg}}
"""


def fleet(text, speed=1.0, **changes):
    """Return the plan of a fleet, with some values of its file changed."""
    return plan_fleet(replace(read_fleet(text, 'fleet.yaml'), **changes), speed)


def grid(count, motion='spin'):
    """Return the text of a fleet of many robots."""
    return 'robots:\n' + ''.join(
        f'  robot_{number}: {{motion: {motion}, start: {{x: {number % 16} m, '
        f'y: {number // 16} m}}}}\n' for number in range(count))


def test_each_robot_drives_its_motion_at_its_rate_under_its_limits(tmp_path):
    (tmp_path / 'slow.yaml').write_text(
        'rate: 25 Hz\nlimits: {max_linear_velocity: 0.1 m/s}\nsteps: [{forward: 1 m}]\n')
    (tmp_path / 'robot2.yaml').write_text(ROBOTS)
    file = tmp_path / 'fleet.yaml'
    file.write_text(
        'robots:\n  a: {motion: square}\n  b: {motion: ./slow.yaml, robot: ./robot2.yaml,\n'
        '      simulation: {lag: 0.1 s}}\n  c: {motion: ./slow.yaml, rate: 50 Hz}\n')
    plan = plan_fleet(find_fleet(file))
    first, second, _ = plan.robots
    assert [robot.name for robot in plan.robots] == ['a', 'b', 'c']
    assert [robot.order.rate for robot in plan.robots] == [10.0, 25.0, 50.0]
    assert second.order.limits.max_linear_velocity == 0.1
    assert first.order.plan.max_linear_velocity == pytest.approx(0.3)
    assert plan.duration == first.plan.duration > second.plan.duration > 10.0
    assert [robot.profile.delay for robot in plan.robots] == [0.0, 0.15, 0.0]
    assert (first.simulation, second.simulation) == (IDEAL, SimulationParameters(lag=0.1))
    assert plan.simulated['b'] == (ORIGIN, SimulationParameters(lag=0.1))
    assert second.parameters == {
        'robot': f'{tmp_path}/robot2.yaml', 'rate': 25.0, 'closed_loop': False,
        'watch': False}


def test_robots_that_drive_the_same_share_one_plan():
    plan = fleet(PAIR.replace('straight', 'square') + '  r3: {motion: square, rate: 20 Hz}\n')
    one, two, three = (robot.order for robot in plan.robots)
    assert one is two
    assert one.plan is two.plan
    assert three is not one


def test_robots_with_the_same_values_share_one_plan():
    plan = fleet('robots:\n' + ''.join(
        f'  r{number}: {{motion: square, with: {{{values}}}, start: {{x: {9 * number} m}}}}\n'
        for number, values in enumerate(['side: 1 m', 'side: 1 m', 'side: 2 m', ''])))
    orders = [robot.order for robot in plan.robots]
    assert orders[0] is orders[1]
    assert [order.plan.length for order in orders] == pytest.approx([4.0, 4.0, 8.0, 2.0])


def test_the_end_is_on_the_floor_of_all():
    _, straight = fleet(PAIR).robots
    assert straight.end.x == pytest.approx(0.6)
    assert straight.end.y == pytest.approx(-0.7)
    assert straight.end.theta == pytest.approx(-math.pi / 2.0)


@pytest.mark.parametrize('speed', [0.01, 0.5, 0.75])
def test_a_speed_is_a_time_scale_for_all(speed):
    fast, slow = fleet(PAIR), fleet(PAIR, speed)
    assert slow.speed == speed
    assert slow.duration == pytest.approx(fast.duration / speed, rel=1e-9)
    for one, two in zip(fast.robots, slow.robots):
        assert two.plan.duration == pytest.approx(one.plan.duration / speed, rel=1e-9)
        assert two.order.allowed == one.order.allowed
    [near], [later] = fast.nearest, slow.nearest
    assert later.distance == pytest.approx(near.distance, abs=5e-3)
    assert later.begin == pytest.approx(near.begin / speed, rel=0.02)


@pytest.mark.parametrize('speed', [0.0, 0.005, 1.5, math.nan])
def test_a_speed_out_of_range_is_refused(speed):
    with pytest.raises(InvalidMotionError, match='^speed is .*; it must be '):
        fleet(PAIR, speed)


def test_a_motion_that_is_too_long_when_slow_is_refused_with_its_line(tmp_path):
    (tmp_path / 'wait.yaml').write_text('steps:\n  - wait: 1000 s\n  - wait: 2000 s\n')
    text = f'robots:\n  a: {{motion: {tmp_path}/wait.yaml}}\n'
    assert fleet(text, 0.1).duration == 30_000.0
    with pytest.raises(FleetFileError) as refusal:
        fleet(text, 0.01)
    assert str(refusal.value) == (
        f'fleet.yaml:2: robots.a.motion: {tmp_path}/wait.yaml:2: step 1: wait.duration: 100000.0 '
        's is too long; a motion may take 86400 s at most, at 1 % of its speed')


def test_a_closed_loop_leaves_a_share_for_corrections_and_settles(tmp_path):
    (tmp_path / 'robot.yaml').write_text('extends: kachaka\ncalibration: {delay: 0.2 s}\n')
    (tmp_path / 'closed.yaml').write_text('closed_loop: true\nsteps: [{forward: 0.5 m}]\n')
    [robot] = fleet(f'robots:\n  a: {{motion: {tmp_path}/closed.yaml, '
                    f'robot: {tmp_path}/robot.yaml}}\n', 0.5).robots
    assert robot.parameters['closed_loop'] is True
    assert robot.order.limits == robot.profile.planning_limits.slowed(0.5).scaled(0.9)
    assert robot.plan.steps[-1].duration == 2.0 * SETTLE_TIME


def test_robots_are_watched_as_their_motions_say_or_all(tmp_path):
    (tmp_path / 'watched.yaml').write_text('watch: true\nsteps: [{forward: 0.5 m}]\n')
    file = read_fleet(
        f'robots:\n  a: {{motion: {tmp_path}/watched.yaml}}\n'
        '  b: {motion: straight, start: {y: 2 m}}\n', 'fleet.yaml')
    for watch, watched in ((None, [True, False]), (True, [True, True]), (False, [False, False])):
        plan = plan_fleet(file, watch=watch)
        assert [robot.parameters['watch'] for robot in plan.robots] == watched
        table = fleet_table(plan)
        assert ('Watched: the laser sees 270 deg' in table) == any(watched)
        assert ('safety device: a' in table.replace('\n', ' ')) == (watched == [True, False])


def test_what_cannot_be_watched_is_refused_with_its_line(tmp_path):
    (tmp_path / 'back.yaml').write_text('watch: true\nsteps:\n  - forward: -0.5 m\n')
    with pytest.raises(FleetFileError) as refusal:
        fleet(f'robots:\n  a: {{motion: {tmp_path}/back.yaml}}\n'
              f'  b: {{motion: {tmp_path}/back.yaml, robot: generic}}\n')
    first, second = str(refusal.value).split('\n')
    assert first.startswith(
        f'fleet.yaml:2: robots.a.motion: {tmp_path}/back.yaml:3: step 1: forward: driven back')
    assert second.startswith(
        f'fleet.yaml:3: robots.b.motion: {tmp_path}/back.yaml:1: watch: watch needs a laser')


def test_near_passes_are_refused_at_the_second_robot_with_what_to_do():
    plan = fleet(PAIR)
    [near] = plan.nearest
    assert near.names == ('r1', 'r2')
    assert near.distance == 0.0
    assert near.begin < near.time < near.end
    with pytest.raises(FleetFileError) as refusal:
        require_clear(plan)
    assert str(refusal.value) == (
        f'fleet.yaml:3: robots.r2: {near.text}; the margin is 10 cm: let one of them start '
        'elsewhere, take a smaller margin, or pass --allow-near')
    assert plan.nearest is plan.nearest


def test_each_near_pair_has_a_line():
    plan = fleet('robots:\n  a: {motion: spin}\n  b: {motion: spin}\n  c: {motion: spin}\n')
    with pytest.raises(FleetFileError) as refusal:
        require_clear(plan)
    assert [line.partition(' touch')[0] for line in str(refusal.value).split('\n')] == [
        'fleet.yaml:3: robots.b: a and b', 'fleet.yaml:4: robots.c: a and c',
        'fleet.yaml:4: robots.c: b and c']


def test_a_fleet_with_enough_room_is_not_refused():
    plan = fleet(PAIR.replace('x: 0.6 m', 'x: 1.5 m'))
    assert plan.nearest == ()
    require_clear(plan)


def test_the_margin_is_that_of_the_file():
    text = PAIR.replace('x: 0.6 m', 'x: 1 m')
    assert len(fleet(text + 'margin: 30 cm\n').nearest) == 1
    assert fleet(text + 'margin: 5 cm\n').nearest == ()


def test_a_fleet_that_drifts_is_looked_at_in_each_round():
    text = """\
    robots:
      a: {motion: straight}
      b: {motion: spin, start: {x: 2.3 m}}
    """
    assert fleet(text).nearest == ()
    assert [near.round_number for near in fleet(text, repeat=2).nearest] == [2]
    assert not fleet(text, repeat=1000).are_all_rounds_checked
    assert fleet(grid(2), repeat=1000).are_all_rounds_checked


def test_a_fleet_without_a_file_starts_at_the_origin():
    plan = plan_fleet(fleet_of({
        'r1': find('square'), 'r2': MotionFile(Motion([Forward(0.5)], 'ahead'), 'ahead')}))
    assert [robot.fleet_robot.start for robot in plan.robots] == [Pose(), Pose()]
    assert [robot.order.motion.name for robot in plan.robots] == ['square', 'ahead']
    assert [robot.parameters['robot'] for robot in plan.robots] == ['kachaka', 'kachaka']


@pytest.mark.parametrize('names, words', [
    ((), 'fleet: robots: 0 robots; a fleet has from 1 to 255'),
    (('r-1',), 'fleet: robots.r-1: this is no ROS namespace'),
    ([f'r{number}' for number in range(256)], 'fleet: robots: 256 robots'),
])
def test_a_fleet_without_a_file_has_the_same_bounds(names, words):
    with pytest.raises(FleetFileError) as refusal:
        fleet_of({name: find('spin') for name in names})
    assert str(refusal.value).startswith(words)


def test_a_motion_without_a_file_is_refused_by_its_name():
    file = MotionFile(Motion('fast', [Move(5.0, 0.0, 1.0)]), 'fast')
    with pytest.raises(FleetFileError) as refusal:
        plan_fleet(fleet_of({'r1': file}))
    assert str(refusal.value).startswith(
        'fleet: robots.r1.motion: fast: step 1: move.linear_x: 5.0 m/s, outside')


# The table.


def test_a_table_has_a_row_a_robot():
    lines = fleet_table(fleet(PAIR)).splitlines()
    assert lines[0] == 'fleet: 2 robots, kachaka, 10 Hz'
    assert lines[2].split() == [
        'robot', 'motion', 'from', 'x', 'y', 'heading', 'takes', 'length', 'to', 'x', 'y',
        'heading']
    square = fleet(PAIR).robots[0].plan
    assert lines[5].split() == [
        'r1', 'square', '0.00', '0.00', '0.0', f'{square.duration:.2f}', '2.00', '0.00', '0.00',
        '0.0']
    assert lines[6].split()[:5] == ['r2', 'straight', '0.60', '0.30', '-90.0']
    assert lines[6].split()[6:] == ['1.00', '0.60', '-0.70', '-90.0']


def test_what_differs_has_a_column(tmp_path):
    (tmp_path / 'robot.yaml').write_text(ROBOTS + 'name: robot\n')
    text = PAIR + f'  r3: {{motion: spin, robot: {tmp_path}/robot.yaml, rate: 20 Hz}}\n'
    lines = fleet_table(fleet(text), 120).splitlines()
    assert lines[0] == 'fleet: 3 robots'
    assert lines[2].split()[-2:] == ['rate', 'delay']
    assert lines[3].split()[-2:] == ['[Hz]', '[ms]']
    assert lines[5].split()[-1] == '10'
    assert lines[7].split()[-2:] == ['20', '150']
    assert lines[7].split()[2] == 'robot'


def test_the_lines_below_say_what_comes_near_and_what_is_trusted():
    text = fleet_table(fleet(PAIR, 0.5, repeat=3)).replace('\n        ', ' ')
    assert f'Near: {fleet(PAIR, 0.5).nearest[0].text}' in text
    assert 'Margin: 10 cm; the start is refused without --allow-near.' in text
    assert 'Start poses are taken on trust' in text
    assert f'Takes: 3 rounds of {fleet(PAIR, 0.5).duration:.2f} s each, at 50 % of' in text
    clear = fleet_table(fleet(PAIR.replace('x: 0.6 m', 'x: 2 m')))
    assert 'Margin: no two outlines come nearer than 10 cm.' in clear
    assert 'Near:' not in clear
    assert 'not known' not in clear


def test_an_outline_that_is_not_known_is_named():
    assert 'Outline not known, so taken as a point: r2.' in fleet_table(
        fleet(PAIR.replace('motion: straight,', 'motion: straight, robot: turtlesim,')))


def test_rounds_that_are_left_out_are_told():
    text = 'robots:\n  a: {motion: straight}\n'
    assert 'Only the first 100 rounds' in fleet_table(fleet(text, repeat=101))
    assert 'Only the first' not in fleet_table(fleet(text, repeat=100))


@pytest.mark.parametrize('count', [1, 2, 255])
@pytest.mark.parametrize('motion', ['spin', 'square'])
def test_a_table_fits_into_80_columns(count, motion):
    plan = fleet(grid(count, motion))
    for width in (80, None):
        lines = fleet_table(plan, width).splitlines()
        assert max(map(len, lines)) <= (width or 99)
        assert sum('robot_' in line and 'Near' not in line for line in lines) >= count
        assert len(lines) <= count + 40


def test_a_table_has_the_values_of_parameters_beside_the_motion():
    text = PAIR.replace('motion: square', 'motion: square, with: {side: 1 m, laps: 2}')
    [line] = [line for line in fleet_table(fleet(text)).splitlines() if line.startswith('r1 ')]
    assert line.removeprefix('r1').strip().startswith('square (side 1 m, laps 2)  ')
    alike = text.replace('motion: straight', 'motion: square, with: {side: 1 m, laps: 2}')
    assert fleet_table(fleet(alike)).startswith(
        'fleet: 2 robots, square (side 1 m, laps 2), kachaka, 10 Hz\n')


def test_long_names_do_not_make_a_table_wide():
    name = 'a' * 200
    plan = fleet(f'name: {name}\nrobots:\n  {name}: {{motion: square}}\n')
    assert max(map(len, fleet_table(plan, 80).splitlines())) <= 80


def test_a_motion_without_steps_stays_where_it_starts():
    plan = plan_fleet(fleet_of({'r1': MotionFile(Motion('none', []), 'none')}))
    assert plan.duration == 0.0
    assert plan.robots[0].end == ORIGIN
    assert fleet_table(plan)
    assert plan_fleet(fleet_of({
        'r1': MotionFile(Motion('wait', [Wait(1.0)]), 'wait')})).duration == 1.0
