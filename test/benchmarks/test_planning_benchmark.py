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
"""The computations of the planning benchmark: they must be right, and fair."""

import math

from benchmarks import planning
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.steps import Forward, Turn
import pytest

SQUARE = Limits(0.3, 1.57)
EVEN = Limits(0.3, 1.57, 0.3, 1.57)


def test_a_tour_has_its_duration_and_no_two_equal_steps():
    motion = planning.tour(300.0)
    planned = planning.plan(motion, planning.LIMITS, 10.0)
    assert 300.0 <= planned.duration < 330.0
    assert len(set(motion.steps)) == len(motion.steps) > 50


def test_every_length_is_measured_and_memory_grows_with_it():
    entries = planning.measure_planning((60, 240), tries=1)
    assert [entry['length'] for entry in entries] == [60, 240]
    for entry in entries:
        assert entry['segments'] == pytest.approx(50.0 * entry['duration'], rel=0.02)
        assert entry['time'] > 0.0
    less, more = entries
    assert more['memory'] / less['memory'] == pytest.approx(
        more['segments'] / less['segments'], rel=0.2)


def test_every_goal_is_computed_by_every_method():
    entries = planning.measure_exactness((5, 50))
    assert len(entries) == 3 * 2 * 2 * 3
    for entry in entries:
        assert entry['least'] <= entry['most']
        if entry['way'] == 'ours':
            assert entry['least'] == pytest.approx(entry['asked'], rel=1e-12)
            assert entry['most'] == entry['least']


@pytest.mark.parametrize('rate', [5.0, 10.0, 100.0])
def test_a_smoother_without_acceleration_limits_sends_the_pulse_it_receives(rate):
    """0.3 m at 0.3 m/s is one second: every phase has a whole number of periods."""
    assert planning.smoothed(Forward(0.3), SQUARE, rate) == pytest.approx(
        [0.3] * len(planning.PHASES))


def test_a_smoother_loses_distance_while_accelerating_and_gains_it_while_braking():
    """0.1, 0.2, 0.3 up and 0.2, 0.1 down at 3 Hz: a second of 0.9 m/s in all."""
    driven = planning.smoothed(Forward(0.3), Limits(0.3, 1.57, 0.3, math.inf), 3.0)
    assert driven[0] == pytest.approx((0.1 + 0.2 + 0.3 + 0.2 + 0.1) / 3.0)


def test_a_pulse_shorter_than_the_ramp_never_reaches_its_velocity():
    driven = planning.smoothed(Forward(0.09), Limits(0.3, 1.57, 0.3, math.inf), 3.0)
    assert driven[0] == pytest.approx(0.1 / 3.0)


def test_samples_of_a_rectangle_are_exact_and_those_of_a_triangle_its_staircase():
    assert planning.sampled(Forward(0.3), SQUARE, 10.0) == pytest.approx([0.3])
    # Up for 1 s and down for 1 s, sampled at 0, 0.5, 1 and 1.5 s.
    assert planning.sampled(Turn(1.57), EVEN, 2.0) == pytest.approx(
        [(0.0 + 0.785 + 1.57 + 0.785) / 2.0])


def test_flows_are_faster_than_constant_speed_in_corners():
    for entry in planning.measure_flows():
        assert entry['flow'] < entry['constant'] < entry['stops']
