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
"""The lease of manual control, 60 s: it is renewed in time, in a rest if there is one."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.control.drive_monitor import LeaseRenewer
from kachaka_simple_control.errors import RunFaultError
import pytest

COMMAND_TIMEOUT = 0.3


class Robot:
    """Grants or refuses manual control after a delay."""

    def __init__(self, delay=0.0, refusal=None):
        """Set the delay [s], and why it refuses."""
        self.delay, self.refusal = delay, refusal
        self.now = 0.0
        self.asked = []

    def ask(self):
        """Record the time, and respond later."""
        self.asked.append(self.now)
        return Answer(self, self.now)


class Answer:
    """A response of the robot."""

    def __init__(self, robot, asked):
        """Record when it was requested."""
        self.robot, self.asked = robot, asked

    @property
    def done(self):
        """Return whether the delay is over."""
        return self.robot.now - self.asked >= self.robot.delay

    @property
    def refusal(self):
        """Return why the robot refuses."""
        return self.robot.refusal


def drive(robot, duration, rest_at=lambda _: 0.0, period=0.1):
    """Drive in simulated time, as a run does."""
    renewer = LeaseRenewer(robot.ask, COMMAND_TIMEOUT)
    renewer.begin(period)
    renewer.granted(0.0)
    for tick in range(round(duration / period)):
        robot.now = tick * period
        renewer.poll(robot.now)
        if renewer.is_due(robot.now, rest_at(robot.now)):
            renewer.renew(robot.now)


def test_without_a_rest_it_is_renewed_every_40_seconds():
    robot = Robot()
    drive(robot, 600.0)
    gaps = [b - a for a, b in zip([0.0, *robot.asked], robot.asked)]
    assert robot.asked
    assert all(20.0 <= gap <= 45.0 for gap in gaps)


@given(st.lists(st.tuples(st.floats(1.0, 30.0), st.floats(0.3, 5.0)), min_size=1, max_size=20))
def test_manual_control_is_never_older_than_45_seconds(stretches):
    """Whatever the pattern of motion and rest."""
    rests, now = [], 0.0
    for moving, resting in stretches:
        rests.append((now + moving, now + moving + resting))
        now += moving + resting
    robot = Robot()
    drive(robot, now, lambda t: next((end - t for begin, end in rests if begin <= t < end), 0.0))
    times = [0.0, *robot.asked, now]
    assert all(b - a <= 45.0 for a, b in pairwise(times))
    assert all(b - a >= 20.0 for a, b in pairwise(times[:-1]))


def test_it_is_renewed_in_a_rest_if_there_is_one():
    robot = Robot()
    drive(robot, 60.0, lambda now: 30.0 - now if 25.0 <= now < 30.0 else 0.0)
    assert robot.asked[0] == pytest.approx(25.0)


def test_a_rest_too_short_for_a_response_is_not_used():
    robot = Robot()
    drive(robot, 60.0, lambda now: 0.1 if 25.0 <= now < 25.1 else 0.0)
    assert robot.asked[0] == pytest.approx(40.0)


def test_before_a_run_it_is_renewed_when_a_rest_would_be_used():
    renewer = LeaseRenewer(Robot().ask, COMMAND_TIMEOUT)
    assert renewer.is_stale(0.0)
    renewer.granted(0.0)
    assert not renewer.is_stale(19.9)
    assert renewer.is_stale(20.0)


@pytest.mark.parametrize('rate', [5.5, 10.0, 50.0])
def test_a_response_and_a_period_together_never_exceed_the_command_timeout(rate):
    """The period is the one of this drive, whatever an earlier drive had."""
    robot, period = Robot(delay=1.0), 1.0 / rate
    renewer = LeaseRenewer(robot.ask, COMMAND_TIMEOUT)
    renewer.begin(0.02)
    renewer.granted(0.0)
    renewer.begin(period)
    robot.now = 50.0
    assert renewer.is_due(robot.now, 0.0)
    renewer.renew(robot.now)
    robot.now += COMMAND_TIMEOUT - period - 1e-3
    renewer.poll(robot.now)
    robot.now += 2e-3
    with pytest.raises(RunFaultError, match='not renewed'):
        renewer.poll(robot.now)
