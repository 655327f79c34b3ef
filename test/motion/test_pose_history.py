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
"""Paths as few poses: they begin and end where they should, and are never too long."""

from __future__ import annotations

from itertools import pairwise
import math

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.motion.geometry import ORIGIN, Pose
from kachaka_simple_control.motion.paths import PoseHistory, sample_path, SPACING, TURN
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Motion, Move, Repeat
import pytest
from strategies import MOTIONS

POSES = st.builds(
    Pose, st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-10.0, 10.0))


def path_of(*steps, **more):
    """Return the path of a motion."""
    return sample_path(plan(Motion('way', steps), KACHAKA.limits, 10.0), **more)


@given(MOTIONS, POSES, st.integers(2, 50))
def test_a_planned_path_begins_and_ends_where_the_robot_does(motion, start, most):
    drawn = plan(motion, KACHAKA.limits, 10.0)
    poses = sample_path(drawn, start, most)
    exact = drawn.path(start)
    assert len(poses) <= most
    assert poses[0] == start
    for one, other in ((poses[-1].x, exact[-1].x), (poses[-1].y, exact[-1].y)):
        assert one == pytest.approx(other, abs=1e-6)
    if len(poses) > 1:
        assert math.cos(poses[-1].theta - exact[-1].theta) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize('times', [30, 300, 3000])
def test_a_long_path_has_as_many_poses_as_allowed(times):
    side = (Move(0.2, 0.0, 1.0), Move(0.0, 1.0, 1.0))
    poses = path_of(Repeat(times, side), most=200)
    assert 60 <= len(poses) <= 200
    # Evenly from all: the end is as near as the beginning.
    assert poses[-1].theta == pytest.approx(times)
    assert poses[len(poses) // 2].theta == pytest.approx(times / 2.0, abs=0.05 * times + 1.0)


@given(st.lists(POSES, max_size=200), st.integers(2, 20))
def test_a_history_is_never_too_long_and_keeps_its_beginning(poses, most):
    history = PoseHistory(most, lambda pose: pose)
    for pose in poses:
        history.add(pose)
        assert len(history.kept) <= most
    assert history.kept[:1] == poses[:1]
    rest = iter(poses)
    assert all(pose in rest for pose in history.kept)  # in order


def test_a_history_leaves_out_changes_too_small_to_be_seen():
    history = PoseHistory(100, lambda pose: pose)
    assert history.add(ORIGIN)
    assert not history.add(Pose(SPACING / 2.0, 0.0, TURN / 2.0))
    assert not history.add(Pose(0.0, 0.0, math.tau))  # a heading may be wrapped
    assert history.add(Pose(SPACING * 1.01, 0.0, 0.0))
    assert history.add(Pose(SPACING * 1.01, 0.0, -TURN * 1.01))
    assert not history.add(Pose(math.nan, 0.0, 0.0))
    assert not history.add(Pose(5.0, 0.0, math.inf))
    assert len(history.kept) == 3


def test_a_full_history_is_thinned_from_end_to_end():
    history = PoseHistory(100, lambda pose: pose.x)
    for number in range(10_000):
        history.add(Pose(0.011 * number))
    gaps = [b - a for a, b in pairwise(history.kept)]
    assert 50 <= len(history.kept) <= 100
    assert history.kept[0] == 0.0
    assert history.kept[-1] > 109.0
    assert max(gaps) <= 2.5 * min(gaps)
