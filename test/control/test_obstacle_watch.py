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
"""The obstacle watch: whole drives of a simulated robot on a floor, in simulated time."""

import math
import random

from example_counts import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from kachaka_simple_control.control.events import WatchState
from kachaka_simple_control.control.obstacle_watch import ObstacleWatch
from kachaka_simple_control.control.scans import points_of
from kachaka_simple_control.control.tick_scheduler import TickScheduler
from kachaka_simple_control.files.cdr import Scan
from kachaka_simple_control.files.floor_file import LaserParameters
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.motion.floor import Floor, Person, Post
from kachaka_simple_control.motion.geometry import distance_between, Pose, ZERO
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Arc, Forward, Motion, Move, Repeat, Turn, Wait
from obstacle_drive import HULL, LASER, ObstacleDrive
import pytest

SEEDS = st.integers(0, 10 ** 9)
MARGIN = LASER.margin
LEG = Motion('leg', (Forward(2.0),))
KINDS = ('leg', 'flow', 'turn', 'arc', 'square')


def some_motion(numbers, kind):
    """Return a motion of a kind, forwards."""
    def turn(least, most):
        return Turn(numbers.choice((-1.0, 1.0)) * numbers.uniform(least, most))

    match kind:
        case 'leg':
            return LEG
        case 'turn':
            return Motion(kind, (turn(1.0, 6.0),))
        case 'arc':
            return Motion(kind, (Arc(
                numbers.choice((-1.0, 1.0)) * numbers.uniform(0.2, 1.0),
                numbers.uniform(1.5, 6.0)),))
        case 'square':
            return Motion(kind, (Repeat(4, (Forward(numbers.uniform(0.5, 1.0)), turn(1.5, 1.6))),))
    steps = [step for _ in range(4) for step in (
        Forward(numbers.uniform(0.4, 1.2)), turn(0.5, 2.5))]
    return Motion(kind, tuple(steps[:-1]), corners=numbers.uniform(0.02, 0.1))


def some_drive(seed, floor_of):
    """Return a drive of a random motion on the floor that is made for it, and its kind."""
    numbers = random.Random(seed)
    kind = numbers.choice(KINDS)
    motion = some_motion(numbers, kind)
    planned = plan(motion, KACHAKA.limits, 20.0)
    delay = numbers.uniform(0.05, 0.3)
    lag = numbers.uniform(0.01, 0.5 * delay)
    return kind, ObstacleDrive(
        motion, floor_of(numbers, kind, planned.path()), delay - lag, lag,
        delay + numbers.uniform(-0.02, 0.02), seed=seed, longest=planned.duration + 3.0)


def wall_across(numbers, kind, path):
    """Return a wall across the way, which does not touch the robot at its start."""
    while True:
        pose = path[numbers.randrange(len(path) // 4, len(path))]
        angle, distance = pose.theta + numbers.uniform(-0.6, 0.6), (
            HULL.front + numbers.uniform(-0.1, 0.15))
        if kind == 'turn':
            angle, distance = numbers.uniform(-2.0, 2.0), numbers.uniform(0.19, 0.27)
        x, y = pose.x + distance * math.cos(angle), pose.y + distance * math.sin(angle)
        along, half = angle + math.pi / 2.0, numbers.uniform(0.1, 0.6)
        floor = Floor(walls=((
            (x - half * math.cos(along), y - half * math.sin(along)),
            (x + half * math.cos(along), y + half * math.sin(along))),))
        if floor.nearest(HULL, Pose(), 0.0).distance > MARGIN + 0.03:
            return floor


def post_beside(numbers, _, path):
    """Return a post that is a little more than the margin beside what the robot sweeps."""
    poses = [*path[::3], path[-1]]
    while True:
        pose, angle = numbers.choice(poses), numbers.uniform(-math.pi, math.pi)
        away = numbers.uniform(0.15, 0.55)
        floor = Floor(posts=(Post(
            (pose.x + away * math.cos(angle), pose.y + away * math.sin(angle)),
            numbers.uniform(0.01, 0.05)),))
        if MARGIN + 0.042 < min(floor.nearest(HULL, pose, 0.0).distance for pose in poses) < (
                MARGIN + 0.08):
            return floor


# Each drive takes some tenths of a second.
@pytest.mark.slow
@settings(max_examples=examples(8))
@given(SEEDS)
def test_no_wall_is_touched(seed):
    kind, drive = some_drive(seed, wall_across)
    drive.run()
    assert not drive.has_touched
    if kind in ('leg', 'square'):
        assert all(gap <= MARGIN + 0.1 for gap in drive.gaps)


@pytest.mark.slow
@settings(max_examples=examples(8))
@given(SEEDS)
def test_what_is_beside_holds_nobody(seed):
    _, drive = some_drive(seed, post_beside)
    drive.run()
    assert drive.holds == 0
    assert drive.is_complete


@pytest.mark.slow
@settings(max_examples=examples(5))
@given(SEEDS)
def test_a_robot_of_unknown_delay_is_placed_by_odometry(seed):
    _, drive = some_drive(seed, wall_across)
    drive.knows = None
    drive.run()
    assert not drive.has_touched


@pytest.mark.slow
@settings(max_examples=examples(5))
@given(st.floats(0.3, 1.4), st.just(1.0) | st.floats(0.2, 1.0), SEEDS)
def test_a_wall_that_appears_holds_soon_and_goes_on_when_it_is_gone(appears, speed, seed):
    # 0.24 m ahead of the outline, as the robot drives there; at full speed it must brake at once.
    began = appears
    planned = plan(LEG, KACHAKA.limits, 20.0)
    path = planned.path()
    place = path[min(round(began * 20.0), len(path) - 1)].x
    person = Person((place + HULL.front + 0.24 + 0.2, 0.0), 0.2, began, began + 9.0)
    drive = ObstacleDrive(LEG, Floor(people=(person,)), seed=seed, speed=speed)
    end = drive.run()
    assert not drive.has_touched
    assert drive.is_complete
    assert drive.holds == 1
    held, free = (next(event.time for event in drive.told if event.state is state)
                  for state in (WatchState.OBSTACLE, WatchState.CLEAR))
    if speed == 1.0:
        assert held - 1.0 - began <= 0.15
    # The scheduler goes on with the next message after the scan.
    assert 1.0 <= free - 1.0 - person.end <= 1.2
    assert distance_between(planned.pose, end) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert sum(tick.velocity.linear_x * (tick.deadline - tick.start)
               for tick in drive.sent) == pytest.approx(2.0, abs=1e-9)


def test_what_is_sent_without_an_obstacle_is_the_plan_to_the_last_bit():
    motion = Motion('flow', (
        Forward(0.5), Turn(1.0), Forward(0.5), Wait(0.3), Move(0.1, 0.0, 1.0)), corners=0.05)
    drive = ObstacleDrive(motion, Floor(walls=(((5.0, -1.0), (5.0, 1.0)),)))
    drive.run()
    scheduler, due, sent = TickScheduler(drive.plan), 0.0, []
    while (tick := scheduler.due(due)) is not None:
        sent.append(tick)
        due = tick.deadline
    assert drive.sent == sent


@settings(max_examples=examples(5))
@given(st.floats(0.5, 5.0), SEEDS)
def test_a_laser_that_is_silent_holds_the_robot_within_half_a_second(silent_from, seed):
    drive = ObstacleDrive(LEG, Floor(), seed=seed, silent_from=silent_from, longest=8.0)
    drive.run()
    assert drive.told[-1].state is WatchState.NO_SCAN
    braking = next(tick for tick, after in zip(drive.sent, drive.sent[1:])
                   if after.plan_time < after.start - 1e-9)
    assert braking.deadline <= silent_from + 0.5
    assert drive.sent[-1].velocity is ZERO


def test_what_the_laser_sees_of_the_robot_itself_is_no_obstacle():
    # The leg of a shelf that the robot carries, 1 cm beside the outline.
    watch = ObstacleWatch(KACHAKA.footprint, MARGIN, 0.1)
    scheduler = TickScheduler(plan(LEG, KACHAKA.limits, 20.0))
    point = scheduler.watch()
    leg, wall = (0.1, 0.13), (0.1, 0.16)
    watch.decide(watch.look(0.0, [leg]))
    assert watch.begin(plan(LEG, KACHAKA.limits, 20.0), None, point).state is WatchState.CLEAR
    scheduler.due(0.0)
    assert watch.decide(watch.look(0.1, [(0.11, 0.125)])).state is WatchState.CLEAR
    assert watch.decide(watch.look(0.2, [leg, wall])).state is WatchState.OBSTACLE


@given(st.lists(st.tuples(
    st.floats(allow_nan=True), st.floats(allow_nan=True), st.floats(allow_nan=True),
    st.lists(st.floats(width=32), max_size=20), st.integers(1, 400)), max_size=8))
def test_no_scan_raises_an_error_or_makes_the_robot_faster(scans):
    planned = plan(LEG, KACHAKA.limits, 20.0)
    watch, scheduler = ObstacleWatch(KACHAKA.footprint, MARGIN, 0.1), TickScheduler(planned)
    watch.decide(watch.look(0.0, []))
    watch.begin(planned, None, scheduler.watch())
    due, times = 0.0, 0.1
    for angle, increment, nearest, ranges, repeated in scans:
        points = points_of(
            Scan(1, angle, increment, nearest, 8.0, ranges * repeated), LASER.pose)
        if points is not None:
            watch.decide(watch.look(times, points))
        assert watch.factor in (0.0, 1.0)
        tick = scheduler.due(due, watch.factor)
        assert abs(tick.velocity.linear_x) <= KACHAKA.limits.max_linear_velocity
        assert tick.velocity.linear_x <= planned.velocity_at(tick.plan_time).linear_x + 1e-9 or (
            tick.plan_time < tick.start)
        due, times = tick.deadline, times + 0.1


def test_a_person_may_go_on_slowly_without_a_scan_for_some_time():
    watch = ObstacleWatch(KACHAKA.footprint, MARGIN, 0.1)
    planned = plan(LEG, KACHAKA.limits, 20.0)
    watch.decide(watch.look(0.0, []))
    watch.begin(planned, None)
    assert watch.go_blind(0.2) is None
    assert watch.check(0.34) is None
    assert watch.check(0.36).state is WatchState.NO_SCAN
    assert watch.go_blind(1.0).state is WatchState.BLIND
    assert (watch.factor, watch.valid_until) == (0.3, 6.0)
    assert watch.check(5.9) is None
    assert watch.check(6.1).state is WatchState.NO_SCAN
    watch.go_blind(7.0)
    assert watch.decide(watch.look(8.0, [(0.3, 0.0)])).state is WatchState.OBSTACLE


def test_scans_of_another_rate_are_taken_as_they_come():
    drive = ObstacleDrive(
        LEG, Floor(walls=(((1.0, -1.0), (1.0, 1.0)),)), laser=LaserParameters(rate=4.0),
        longest=9.0)
    drive.run()
    assert not drive.has_touched
    assert drive.holds == 1
