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
"""What the obstacle watch says is done: speed factors, events, and the laser that runs."""

from types import SimpleNamespace

from kachaka_simple_control.control.events import WatchState
from kachaka_simple_control.control.obstacle_watch import ObstacleWatch
from kachaka_simple_control.control.scan_watch import ScanWatch
from kachaka_simple_control.control.speed_factor import SpeedFactor
from kachaka_simple_control.control.tick_scheduler import TickScheduler
from kachaka_simple_control.errors import RobotNotFoundError
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Forward, Motion
import pytest

PLAN = plan(Motion('leg', (Forward(1.0),)), KACHAKA.limits, 20.0)
WALL = [(0.4, 0.0)]


class Watched:
    """A robot with a watch, and another one of its fleet."""

    def __init__(self):
        self.now, self.events, self.lines, self.activated = 0.0, [], [], 0
        self.factor = SpeedFactor(lambda: self.now)
        self.other = SpeedFactor(lambda: self.now)
        self.watch = ScanWatch(
            ObstacleWatch(KACHAKA.footprint, 0.05, 0.1), self.factor, 'r1', self.events.append,
            self.lines.append)
        self.watch.activate = self.activate

    def activate(self):
        """Count how often the laser is asked to run on."""
        self.activated += 1

    def prepare(self, plan=PLAN):
        """Return the steps before a drive."""
        self.watch.others = [self.other]
        self.moment = SimpleNamespace(now=self.now)
        return self.watch.prepare(
            self.moment, '/scan', plan, lambda: None, TickScheduler(plan))

    def begin(self, points=()):
        """Begin a drive with a scan."""
        self.scan(points)
        assert not [*self.prepare()]

    def scan(self, points=()):
        """Let a scan come now."""
        self.watch.on_scan(self.now, self.now, points)

    def later(self, seconds, points=None):
        """Let time pass; without points no scan comes."""
        for _ in range(round(seconds * 10.0)):
            self.now += 0.1
            if points is not None:
                self.scan(points)
            self.watch.poll(self.now, is_at_rest=True)

    @property
    def states(self):
        """Return the states that were published, without distances that follow."""
        states = [event.state for event in self.events]
        return [state for state, before in zip(states, [None, *states]) if state is not before]


@pytest.fixture
def watched():
    """Return a robot with a watch."""
    return Watched()


def test_all_robots_of_a_drive_are_held_and_go_on(watched):
    watched.begin()
    assert (watched.factor.value, watched.other.value) == (1.0, 1.0)
    watched.later(0.1, WALL)
    assert watched.factor.factors == {'obstacle': 0.0}
    assert watched.other.factors == {'obstacle of r1': 0.0}
    assert watched.lines == ['Held: obstacle 0.16 m ahead, goes on by itself']
    watched.later(0.9, [])
    assert watched.factor.is_hold
    watched.later(0.2, [])
    assert (watched.factor.value, watched.other.value) == (1.0, 1.0)
    assert watched.states == [WatchState.OBSTACLE, WatchState.CLEAR]


def test_a_thread_that_dies_holds_the_robots(watched):
    watched.begin()
    watched.now = 0.34
    assert watched.factor.value == 1.0
    watched.now = 0.36  # and nobody has called the watch
    assert (watched.factor.value, watched.other.value) == (0.0, 0.0)


def test_without_a_scan_it_is_held_and_a_person_may_go_on_slowly(watched):
    watched.begin()
    watched.later(0.5)
    assert watched.states == [WatchState.NO_SCAN]
    assert watched.factor.is_hold
    assert watched.watch.go_blind(watched.now)
    assert watched.factor.value == 0.3
    assert not watched.watch.go_blind(watched.now)
    watched.later(6.0)
    assert watched.factor.is_hold
    watched.later(1.2, [])
    assert watched.factor.value == 1.0
    assert watched.states == [
        WatchState.NO_SCAN, WatchState.BLIND, WatchState.NO_SCAN, WatchState.CLEAR]


def test_no_drive_begins_without_a_scan(watched):
    steps = watched.prepare()

    def wait():
        for _ in steps:
            watched.moment.now += 0.1

    with pytest.raises(RobotNotFoundError, match='on /scan'):
        wait()
    # Meanwhile the laser is asked to run, once a second.
    assert 3 <= watched.activated <= 4


def test_a_laser_runs_on_while_the_robot_rests(watched):
    watched.begin(WALL)
    watched.later(5.0, WALL)
    assert 5 <= watched.activated <= 6


def test_after_a_drive_nothing_holds(watched):
    watched.begin(WALL)
    assert watched.factor.is_hold
    watched.watch.end()
    watched.later(2.0, WALL)
    assert (watched.factor.value, watched.other.value) == (1.0, 1.0)
    assert watched.states == [WatchState.OBSTACLE]


def test_a_long_hold_is_said_once(watched):
    watched.begin(WALL)
    watched.later(130.0, WALL)
    assert [line for line in watched.lines if line.startswith('Held for 60 s: obstacle')] == (
        watched.lines[1:])
    assert len(watched.lines) == 2
