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
"""``Goto`` and ``Waypoints`` are the turns and legs to points, from where the robot is then."""

from __future__ import annotations

import math
import time

from hypothesis import assume, given, settings
from hypothesis import strategies as st
from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.document import MotionFileError
from kachaka_simple_control.files.motion_reader import loads
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.motion.plan import find_errors, MAX_STEPS, Plan, plan
from kachaka_simple_control.motion.steps import Arc, Forward, Motion, Repeat, Turn, Wait
from kachaka_simple_control.motion.waypoints import Goto, Waypoints
import pytest
from strategies import closed_form, GOALS

LIMITS = KACHAKA.limits
POINTS = st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
HEADINGS = st.none() | st.floats(-7.0, 7.0)


def planned(*steps, corners=0.0, rate=20.0) -> Plan:
    """Return the plan of steps."""
    return plan(Motion('points', steps, corners=corners), LIMITS, rate)


def rows(found: Plan) -> list[tuple[str, str]]:
    """Return the path and the description of each step of a plan."""
    return [(step.path, step.step.describe()) for step in found.steps]


def refusals(*steps) -> list[str]:
    """Return the errors of steps."""
    return [str(error) for error in find_errors(Motion('bad', steps), LIMITS)]


def assert_at(pose, x, y, heading):
    """Assert that a pose is at a point and looks in a direction."""
    assert (pose.x, pose.y) == pytest.approx((x, y), abs=1e-9)
    assert math.remainder(pose.theta - heading, math.tau) == pytest.approx(0.0, abs=1e-9)


def test_a_plan_equals_that_of_its_turns_and_legs():
    by_hand = planned(Turn(math.pi / 2), Forward(0.5, 0.1), Turn(-math.pi / 2))
    assert planned(Goto((0.0, 0.5), 0.0, 0.1)).segments == by_hand.segments
    assert planned(Waypoints([(0.0, 0.5)], 0.0, 0.1)).segments == by_hand.segments


@pytest.mark.parametrize('heading, point, angle', [
    (0.0, (-1.0, 0.0), 180.0), (0.0, (-1.0, -0.0), 180.0), (0.0, (0.0, -1.0), -90.0),
    (0.75 * math.tau, (0.0, 1.0), 180.0), (-math.pi, (1.0, 0.0), 180.0),
    (3.0 * math.tau, (0.0, 1.0), 90.0), (math.radians(170.0), (0.0, -1.0), 100.0)])
def test_it_turns_the_shorter_way_and_half_a_turn_to_the_left(heading, point, angle):
    turn = planned(Turn(heading), Goto(point)).steps[1].step
    assert isinstance(turn, Turn)
    assert math.degrees(turn.angle) == pytest.approx(angle)


@given(st.lists(GOALS, max_size=4), POINTS, HEADINGS)
@settings(max_examples=100)
def test_it_ends_at_its_point_from_everywhere(steps, point, heading):
    start = closed_form(steps)
    assume(math.dist((start.x, start.y), point) > 0.002)
    found = planned(*steps, Goto(point, heading))
    bearing = math.atan2(point[1] - start.y, point[0] - start.x)
    assert_at(found.pose, *point, bearing if heading is None else heading)
    first = found.steps[len(found.steps) - len(rows(found)) + len(steps)].step
    assert not isinstance(first, Turn) or abs(first.angle) <= math.pi + 1e-9
    assert math.dist((found.path()[-1].x, found.path()[-1].y), point) < 1e-9


@given(st.lists(POINTS, min_size=1, max_size=6), HEADINGS, st.sampled_from([0.0, 0.02, 0.3]))
@settings(max_examples=60)
def test_waypoints_end_as_turns_and_legs_by_hand(points, heading, corners):
    assume(all(math.dist(one, two) > 0.002 for one, two in zip([(0.0, 0.0), *points], points)))
    by_hand, x, y, theta = [], 0.0, 0.0, 0.0
    for point in points:
        bearing = math.atan2(point[1] - y, point[0] - x)
        by_hand += [Turn(math.remainder(bearing - theta, math.tau)),
                    Forward(math.dist((x, y), point))]
        (x, y), theta = point, bearing
    if heading is not None:
        by_hand.append(Turn(math.remainder(heading - theta, math.tau)))
    end, found = planned(*by_hand).pose, planned(
        Waypoints(points, heading, corners=corners), rate=20.0)
    assert_at(found.pose, end.x, end.y, end.theta)
    sent = found.path()[-1]
    assert_at(sent, end.x, end.y, end.theta)


def test_each_repetition_is_planned_from_where_it_is():
    found = planned(Repeat(3, [Goto((1.0, 0.0)), Goto((1.0, 1.0)), Goto((0.0, 0.0), 0.0)]))
    names = [path for path, _ in rows(found)]
    assert names.count('steps[0].repeat.steps[0].goto.forward') == 3
    assert 'steps[0].repeat.steps[0].goto.turn' not in names
    assert_at(found.pose, 0.0, 0.0, 0.0)
    # Where it begins elsewhere, a pass is another one.
    found = planned(Repeat(3, [Goto((1.0, 0.0)), Forward(0.5)]))
    legs = [step.step.distance for step in found.steps
            if step.path == 'steps[0].repeat.steps[0].goto.forward']
    assert legs == pytest.approx([1.0, 0.5, 0.5])


@given(st.integers(0, 9), st.integers(0, 3), st.lists(
    st.one_of(GOALS, st.builds(Goto, POINTS, HEADINGS)), max_size=3))
@settings(max_examples=60)
def test_a_repeat_is_the_same_as_its_steps_written_out(times, inner, steps):
    nested = [*steps, Repeat(inner, [Goto((0.5, 0.5)), Forward(0.3), Arc(0.3, 1.0)])]
    motions = [Motion('any', part) for part in (
        [Repeat(times, nested)],
        times * [*steps, *inner * [Goto((0.5, 0.5)), Forward(0.3), Arc(0.3, 1.0)]])]
    errors = [find_errors(motion, LIMITS) for motion in motions]
    assert bool(errors[0]) == bool(errors[1])
    assume(not errors[0])
    one, two = (plan(motion, LIMITS, 10.0) for motion in motions)
    assert len(one.steps) == len(two.steps)
    for left, right in zip(one.steps, two.steps):
        assert left.step.displacement.distance == pytest.approx(
            right.step.displacement.distance, abs=1e-9)
    assert_at(one.pose, two.pose.x, two.pose.y, two.pose.theta)


def test_a_block_without_points_is_followed_as_a_whole():
    blocks = [Repeat(3, [Repeat(5, [Forward(0.3), Turn(0.7)]), Arc(0.2, 1.0)])]
    start = closed_form(blocks)
    found = planned(*blocks, Goto((0.1, 0.2), 1.0))
    assert len(found.steps) == 3 * 11 + 3
    assert found.steps[32].pose.x == pytest.approx(start.x, abs=1e-12)
    assert_at(found.pose, 0.1, 0.2, 1.0)


def test_corners_hold_inside_and_the_smaller_where_steps_meet():
    route = Waypoints([(0.6, 0.0), (0.6, 0.6)], corners=0.1)
    found = planned(route, Goto((0.0, 0.6)), corners=0.03)
    assert [step.cut and step.cut.tolerance for step in found.steps] == [
        None, 0.1, None, 0.03, None]
    assert 0.03 < found.steps[1].cut.deviation <= 0.1
    assert 0.0 < found.steps[3].cut.deviation <= 0.03 * (1.0 + 1e-6)
    assert_at(found.pose, 0.0, 0.6, math.pi)
    alone = planned(route, Goto((0.0, 0.6)))
    assert [bool(step.cut) for step in alone.steps] == [False, True, False, False, False]
    assert alone.saved_time > 0.5


@pytest.mark.parametrize('steps, error', [
    ([Goto((0.0, 0.0))], ('steps[0].goto.point: [0 m, 0 m]; the robot is there already, within '
                          '1 mm: drive somewhere else, or leave it out')),
    ([Wait(1.0), Goto((0.0005, 0.0005))],
     ('steps[1].goto.point: [0.0005 m, 0.0005 m]; the robot is there already, within 1 mm: drive '
      'somewhere else, or leave it out')),
    ([Waypoints([(1.0, 0.0), (1.0, 0.0)])],
     ('steps[0].waypoints.points[1]: [1 m, 0 m]; the robot is there already, within 1 mm: drive '
      'somewhere else, or leave it out')),
    ([Repeat(2, [Goto((1.0, 0.0))])],
     ('steps[0].repeat.steps[0].goto.point: [1 m, 0 m]; the robot is there already, within 1 mm: '
      'drive somewhere else, or leave it out')),
    ([Goto((1.0, 0.0), speed=5.0)], 'steps[0].goto.speed: 5.0 m/s is above the limit of 0.3 m/s'),
    ([Repeat(5, [Waypoints([(1.0, 0.0), (0.0, 0.0)], speed=5.0)])],
     'steps[0].repeat.steps[0].waypoints.speed: 5.0 m/s is above the limit of 0.3 m/s'),
    ([Goto((1e6, 0.0))],
     ('steps[0].goto.forward.distance: 1000000.0 m takes 3333333.333 s; a motion may take 86400 s '
      'at most')),
    ([Goto((1.7e308, 1.7e308))],
     ('steps[0].goto.point: [1.7e+308 m, 1.7e+308 m]; the robot is too far from it: drive '
      'somewhere else, or leave it out')),
])
def test_what_cannot_be_driven_is_refused_once(steps, error):
    assert refusals(*steps) == [error]


@pytest.mark.parametrize('make, error', [
    (lambda: Goto(1.0), 'point is 1.0; it must be a point: two numbers, x and y [m]'),
    (lambda: Goto('ab'), "point is 'ab'; it must be a point: two numbers, x and y [m]"),
    (lambda: Goto((1.0,)), 'point is (1.0,); it must be a point: two numbers, x and y [m]'),
    (lambda: Goto((1.0, 2.0, 3.0)),
     'point is (1.0, 2.0, 3.0); it must be a point: two numbers, x and y [m]'),
    (lambda: Goto((1.0, math.nan)), 'point is nan m; it must be a finite number'),
    (lambda: Goto((1.0, '2 m')), "point is '2 m'; it must be a number [m]"),
    (lambda: Goto((1.0, 2.0), math.inf), 'heading is inf rad; it must be a finite number'),
    (lambda: Goto((1.0, 2.0), speed=0.0), 'speed is 0.0 m/s; it must be above 0 m/s'),
    (lambda: Waypoints([]), 'points is empty; it must have at least one point'),
    (lambda: Waypoints(5), 'points is 5; it must be a list of points'),
    (lambda: Waypoints((1.0, 2.0)),
     'points[0] is 1.0; it must be a point: two numbers, x and y [m]'),
    (lambda: Waypoints([(1.0, 2.0), (math.inf, 0.0)]),
     'points[1] is inf m; it must be a finite number'),
    (lambda: Waypoints([(1.0, 2.0)], corners=-0.05),
     'corners is -0.05 m; it must not be negative'),
    (lambda: Waypoints([(1.0, 2.0)], corners=1.5), 'corners is 1.5 m; it must be at most 1 m'),
    (lambda: Waypoints([(1.0, 2.0)], corners=math.nan),
     'corners is nan m; it must be a finite number'),
])
def test_wrong_values_are_refused(make, error):
    with pytest.raises(InvalidMotionError) as caught:
        make()
    assert str(caught.value) == error


@pytest.mark.parametrize('steps', [
    [Goto((1.0, 0.0)), Repeat(MAX_STEPS // 2, [Goto((0.0, 0.0)), Goto((1.0, 0.0))])],
    [Repeat(1000, [Repeat(1000, [Goto((0.0, 1.0)), Goto((1.0, 0.0))])])],
])
def test_too_many_steps_are_refused_before_they_are_listed(steps):
    begin = time.process_time()
    *_, error = refusals(*steps)
    assert error.startswith('the motion takes ') or 'steps, its repeats counted' in error
    assert any(f'it may have {MAX_STEPS} at most' in text for text in refusals(*steps))
    assert time.process_time() - begin < 2.0


def test_different_repetitions_are_not_followed_for_longer_than_a_day():
    begin = time.process_time()
    assert refusals(Repeat(250_000, [Goto((1.0, 0.0)), Turn(1.0), Forward(0.1)])) == [
        'the motion has more than 1000000 steps or takes more than 86400 s, its repeats counted']
    assert time.process_time() - begin < 3.0


FILE = """\
steps:
  - goto: [1 m, 0 m]
  - repeat:
      times: 2
      steps:
        - waypoints:
            points:
              - [1 m, 1 m]
              - [1 m, 1 m]
            speed: 9 m/s
  - goto: {point: [1 m, 1 m],
      speed: 8 m/s}
"""


@pytest.mark.needs('yaml', 'jsonschema')
def test_an_error_in_a_file_has_its_line():
    with pytest.raises(MotionFileError) as caught:
        loads(FILE, 'bad.yaml').check(LIMITS, 'kachaka')
    already = 'the robot is there already, within 1 mm: drive somewhere else, or leave it out'
    assert str(caught.value).splitlines() == [
        f'bad.yaml:8: step 2: repeat: step 1: waypoints.points[0]: [1 m, 1 m]; {already}',
        f'bad.yaml:9: step 2: repeat: step 1: waypoints.points[1]: [1 m, 1 m]; {already}',
        ("bad.yaml:10: step 2: repeat: step 1: waypoints.speed: 9.0 m/s is above kachaka's limit "
         'of 0.3 m/s'),
        f'bad.yaml:11: step 3: goto.point: [1 m, 1 m]; {already}']


@pytest.mark.needs('yaml', 'jsonschema')
def test_a_row_of_a_plan_has_its_line():
    file = loads(FILE, 'good.yaml')
    assert file.where('steps[1].repeat.steps[0].waypoints.points[1].forward') == 'good.yaml:9'
    assert file.where('steps[0].goto.turn') == 'good.yaml:2'
