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
"""Velocities by hand: the lease, a zero first after a lapse, and changes within the limits."""

import contextlib
from dataclasses import astuple

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.control.hand_source import HandSource
from kachaka_simple_control.control.timing import HAND_LEASE_TIME, HAND_PERIOD
from kachaka_simple_control.errors import InvalidMotionError, MotionRefusedError
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
import pytest

LIMITS = Limits(
    0.3, 1.5, 0.5, 2.5, max_linear_deceleration=0.8, max_angular_deceleration=4.0,
    max_linear_jerk=2.0, max_angular_jerk=10.0)
FORWARD = Velocity(0.2, 0.5)


class Hand:
    """A hand, its clock, and the loop that sends what it wants."""

    def __init__(self):
        """Begin a run, in which nothing is wanted yet."""
        self.now, self.t0 = 1000.0, 990.0
        self.source = HandSource(LIMITS, self.on_change, lambda: self.now)
        self.sequence, self.sent, self.changes = 0, [], 0
        self.due = self.now

    def on_change(self):
        """Make the loop ask at once."""
        self.changes += 1
        self.due = self.now

    def want(self, velocity, age=0.0):
        """Command a velocity with a stamp of an age [s]."""
        self.now -= age
        stamp = self.source.stamp()
        self.now += age
        self.sequence += 1
        self.source.command(velocity, self.sequence, stamp)

    def run(self, duration, factor=1.0):
        """Let time pass [s]; the loop asks the source when it is due."""
        end = self.now + duration
        while self.due <= end + 1e-9:
            self.now = max(self.now, self.due)
            tick = self.source.due(self.now - self.t0, factor)
            if tick is None:
                return None
            self.sent.append((self.now, tick.velocity))
            self.due = self.now + (tick.deadline - tick.start)
        self.now = end
        return self.sent[-1][1]

    def hold(self, velocity, duration, factor=1.0):
        """Command a velocity 20 times a second, as a sender does."""
        for _ in range(round(duration / 0.05)):
            self.want(velocity)
            self.run(0.05, factor)
        return self.sent[-1][1]


@pytest.fixture
def hand():
    """Return a hand that has sent a zero, so that it may move the robot."""
    hand = Hand()
    hand.want(ZERO)
    hand.run(0.05)
    return hand


def test_nothing_moves_before_a_zero_was_commanded():
    hand = Hand()
    with pytest.raises(MotionRefusedError, match='release the controls first'):
        hand.want(FORWARD)
    assert hand.run(0.2) == ZERO
    hand.want(ZERO)
    assert hand.hold(FORWARD, 1.0) == FORWARD


def test_a_command_is_valid_for_its_lease_and_then_a_zero_is_sent_at_once(hand):
    hand.hold(FORWARD, 1.0)
    last = hand.now - 0.05
    hand.run(1.0)
    lapse, velocity = next((at, sent) for at, sent in hand.sent if at > last and sent.is_zero)
    assert lapse == pytest.approx(last + HAND_LEASE_TIME)
    assert velocity == ZERO
    with pytest.raises(MotionRefusedError, match='release the controls first'):
        hand.want(FORWARD)
    hand.want(ZERO)
    hand.want(FORWARD)


@pytest.mark.parametrize('age', [HAND_LEASE_TIME, 0.3, 5.0])
def test_a_command_that_was_under_way_for_too_long_is_refused(hand, age):
    hand.run(6.0)
    with pytest.raises(MotionRefusedError, match='too long ago'):
        hand.want(FORWARD, age)
    assert hand.run(0.3) == ZERO


def test_the_lease_counts_from_the_stamp_not_from_the_arrival(hand):
    hand.run(1.0)
    hand.want(ZERO)
    hand.run(0.2)
    hand.want(FORWARD, age=0.15)
    began = hand.now
    hand.run(0.5)
    moving = [at for at, velocity in hand.sent if not velocity.is_zero]
    assert began <= max(moving) < began + 0.1
    assert hand.sent[-1][1] == ZERO


def test_of_a_burst_after_a_lag_nothing_is_obeyed(hand):
    """The link kept a second of commands back, and delivers them all at once."""
    stamps = []
    for _ in range(20):
        stamps.append(hand.source.stamp())
        hand.run(0.05)
    hand.run(0.3)
    for number, stamp in enumerate(stamps):
        with pytest.raises(MotionRefusedError):
            hand.source.command(FORWARD, 100 + number, stamp)
    assert hand.run(0.5) == ZERO


@pytest.mark.parametrize('stamp', [2000.0, float('inf'), float('nan')])
def test_a_stamp_that_was_never_issued_is_refused(hand, stamp):
    with pytest.raises(MotionRefusedError):
        hand.source.command(FORWARD, 10, stamp)


@pytest.mark.parametrize('velocity', [
    Velocity(0.31, 0.0), Velocity(0.0, -1.6), Velocity(float('nan'), 0.0)])
def test_a_velocity_beyond_the_limits_is_refused(hand, velocity):
    with pytest.raises(InvalidMotionError):
        hand.want(velocity)


def test_a_zero_is_sent_at_once_and_without_a_ramp(hand):
    hand.hold(FORWARD, 1.0)
    hand.run(0.02)
    changes, now = hand.changes, hand.now
    hand.want(ZERO)
    assert hand.changes == changes + 1
    hand.run(0.0)
    assert hand.sent[-1] == (now, ZERO)


def test_a_stop_needs_a_zero_before_the_next_motion(hand):
    hand.hold(FORWARD, 1.0)
    hand.source.stop()
    assert hand.run(0.0) == ZERO
    with pytest.raises(MotionRefusedError, match='release the controls first'):
        hand.want(FORWARD)


def test_a_pause_brakes_and_needs_a_zero_before_the_next_motion(hand):
    hand.hold(FORWARD, 1.0)
    for _ in range(20):
        with contextlib.suppress(MotionRefusedError):
            hand.want(FORWARD)
        hand.run(0.05, factor=0.0)
    assert hand.sent[-1][1] == ZERO
    with pytest.raises(MotionRefusedError, match='release the controls first'):
        hand.want(FORWARD)
    assert hand.run(0.5) == ZERO


@given(st.lists(st.tuples(
    st.floats(-0.3, 0.3), st.floats(-1.5, 1.5), st.integers(1, 20), st.floats(0.01, 1.0)),
    min_size=1, max_size=12))
def test_all_changes_but_a_zero_keep_the_limits(wishes):
    hand = Hand()
    hand.want(ZERO)
    for linear, angular, count, factor in wishes:
        hand.hold(Velocity(linear, angular), 0.05 * count, factor)
    before, rates = ZERO, [{0.0}, {0.0}]
    for _, velocity in hand.sent:
        LIMITS.check(velocity)
        for axis, (up, down, jerk) in enumerate(((0.5, 0.8, 2.0), (2.5, 4.0, 10.0))):
            old, new = astuple(before)[axis], astuple(velocity)[axis]
            assert old * new >= 0.0
            rate = (new - old) / HAND_PERIOD
            if velocity.is_zero:  # at once, or on its way through zero
                rates[axis] = {0.0, rate}
                continue
            assert abs(rate) <= (up if abs(new) > abs(old) else down) + 1e-9
            assert min(abs(rate - one) for one in rates[axis]) <= jerk * HAND_PERIOD + 1e-9
            rates[axis] = {rate}
        before = velocity


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.integers(1, 12))
def test_a_wish_is_reached_without_passing_it(first, second, count):
    hand = Hand()
    hand.want(ZERO)
    for linear, wishes in ((first, count), (second, 40)):
        hand.hold(Velocity(linear, 0.0), 0.05 * wishes)
    assert hand.sent[-1][1].linear_x == pytest.approx(second, abs=1e-12)
    if count == 12 or first * second <= 0.0:
        values = [velocity.linear_x for _, velocity in hand.sent]
        assert min(0.0, first, second) - 1e-9 <= min(values)
        assert max(values) <= max(0.0, first, second) + 1e-9
