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
"""The time and the points of scans."""

from array import array
import math

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.control.scans import points_of, ScanClock
from kachaka_simple_control.files.cdr import Scan
from kachaka_simple_control.motion.geometry import Pose
import pytest

SECOND = 1_000_000_000


def scan(ranges, angle=0.0, increment=math.pi / 2.0):
    """Return a scan."""
    return Scan(1, angle, increment, 0.1, 8.0, array('f', ranges))


def test_points_are_in_the_frame_of_the_robot():
    # A laser that is 0.2 m ahead, turned to the left: its angle 0 is the left of the robot.
    points = points_of(scan([1.0, 2.0, 3.0]), Pose(0.2, 0.0, math.pi / 2.0))
    assert points == (
        pytest.approx((0.2, 1.0)), pytest.approx((-1.8, 0.0)), pytest.approx((0.2, -3.0)))


@pytest.mark.parametrize('ranges, expected', [
    ([], None), ([math.nan] * 4, None), ([0.0, -math.inf, 0.05, 9.0], None),
    ([math.inf] * 4, 0), ([math.nan, 0.0, 1.0, math.inf], 1)])
def test_what_says_nothing_is_no_scan(ranges, expected):
    points = points_of(scan(ranges), Pose())
    assert (points if expected is None else len(points)) == expected


@given(st.lists(st.floats(0.0, 0.25), min_size=1, max_size=30), st.floats(-1e5, 1e5))
def test_the_clock_of_the_laser_needs_not_be_right(delays, error):
    clock = ScanClock()
    for number, delay in enumerate(delays):
        taken = clock.taken(
            100.0 + 0.1 * number + delay, round((1e6 + error + 100.0 + 0.1 * number) * SECOND))
        assert taken is not None
        # The quickest scan so far is the reference, but for a drift of the clocks.
        assert -1e-6 <= taken - 100.0 - 0.1 * number <= min(delays[:number + 1]) + 0.005


def test_clocks_may_drift_for_hours():
    clock = ScanClock()
    for second in range(0, 20_000, 10):
        # The laser's clock is slow by 0.1 ms each second, 2 s in all.
        assert clock.taken(float(second), round(second * 0.9999 * SECOND) + 1) is not None


def test_old_scans_and_those_of_the_future_do_not_count():
    clock = ScanClock()
    assert clock.taken(10.0, 50 * SECOND) == pytest.approx(10.0)
    assert clock.taken(10.1, 50 * SECOND) is None  # the same once more
    assert clock.taken(10.2, 49 * SECOND) is None
    assert clock.taken(11.0, round(50.5 * SECOND)) is None  # half a second on its way
    assert clock.taken(11.1, 3600 * SECOND) is None
    assert clock.taken(11.2, round(51.2 * SECOND)) == pytest.approx(11.2)
