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
"""Paths and curves of few points that show as much as all of them."""

from itertools import pairwise
import math

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.motion.paths import simplify
from kachaka_simple_control.report.plot_style import min_max_decimate
import pytest

POINTS = st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=1, max_size=60)


@given(POINTS, st.floats(0.01, 1.0))
def test_a_straightened_path_passes_all_its_points(points, grain):
    kept = simplify(points, grain, 1000)
    assert kept[0] == points[0]
    assert kept[-1] == points[-1]
    for point in points:
        away = min((beside(point, one, two) for one, two in pairwise(kept)),
                   default=math.dist(point, kept[0]))
        assert away <= 2.0 * grain + 1e-9


def beside(point, one, two):
    """Return how far a point is from the line between two others."""
    length = math.dist(one, two)
    along = 0.0 if length ** 2 == 0.0 else sum(
        (p - a) * (b - a) for p, a, b in zip(point, one, two)) / length ** 2
    along = min(1.0, max(0.0, along))
    return math.dist(point, [a + along * (b - a) for a, b in zip(one, two)])


def test_a_straight_path_keeps_its_ends_and_turning_points():
    there = [(0.01 * number, 0.0) for number in range(101)]
    assert simplify(there + there[::-1], 0.001, 1000) == [
        (0.0, 0.0), (pytest.approx(1.0), 0.0), (0.0, 0.0)]
    assert len(simplify([(math.cos(a), math.sin(a)) for a in range(999)], 1e-6, 100)) <= 100


@given(st.lists(st.tuples(st.floats(0, 10), st.floats(-1, 1)), min_size=1, max_size=80))
def test_bands_hold_every_value(corners):
    corners.sort()
    found = min_max_decimate(corners, 10.1, 7)
    for moment, value in corners:
        (band,) = (band for band in found if band.begin <= moment < band.begin + 10.1 / 7 - 1e-12
                   or math.isclose(band.begin, moment)) if len(found) == 1 else (
            max((band for band in found if band.begin <= moment), key=lambda band: band.begin),)
        assert band.lowest <= value <= band.highest
