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
"""What stands on a floor, and how near a robot is to it."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.motion.floor import Floor, MAX_PARTS, Person, Post
from kachaka_simple_control.motion.geometry import Box, Disc, Pose, relative_to
from kachaka_simple_control.motion.separation import Hull
import pytest

NUMBERS = st.floats(-2.0, 2.0)
POINTS = st.tuples(NUMBERS, NUMBERS)
POSES = st.builds(Pose, NUMBERS, NUMBERS, st.floats(-7.0, 7.0))
FOOTPRINTS = st.sampled_from([KACHAKA.footprint, Box(0.3, 0.6, -0.1), Disc(0.15)])
#: How many points of a wall are looked at.
SAMPLES = 400


def to_outline(footprint, pose, point):
    """Return the distance of a point from an outline; 0 within it."""
    seen = relative_to(pose, Pose(*point))
    if isinstance(footprint, Disc):
        return max(0.0, math.hypot(seen.x, seen.y) - footprint.radius)
    return math.hypot(max(0.0, abs(seen.x - footprint.ahead) - footprint.length / 2.0),
                      max(0.0, abs(seen.y) - footprint.width / 2.0))


@given(st.lists(POINTS, min_size=2, max_size=4, unique=True), st.lists(
    st.builds(Post, POINTS, st.floats(0.01, 0.5)), max_size=2), FOOTPRINTS, POSES)
def test_the_nearest_is_what_a_search_point_by_point_finds(wall, posts, footprint, pose):
    floor = Floor((tuple(wall),), tuple(posts))
    found = floor.nearest(Hull.of(footprint), pose, 0.0)
    walls = min(
        to_outline(footprint, pose, tuple(
            a + (b - a) * index / SAMPLES for a, b in zip(start, end)))
        for start, end in floor.segments for index in range(SAMPLES + 1))
    apart = max(math.dist(*ends) for ends in floor.segments) / SAMPLES
    discs = min((max(0.0, to_outline(footprint, pose, post.at) - post.radius)
                 for post in posts), default=math.inf)
    assert found.distance == pytest.approx(min(walls, discs), abs=apart / 2.0 + 1e-9)
    if abs(walls - discs) > apart:
        assert found.kind == ('wall' if walls < discs else 'post')


def test_an_empty_floor_has_nothing_near():
    assert Floor().nearest(Hull.of(KACHAKA.footprint), Pose(), 0.0) == (math.inf, '')


def test_a_person_comes_walks_and_goes():
    walker = Person((0.0, 0.0), 0.2, 2.0, 6.0, (4.0, -2.0))
    assert [walker.place(time) for time in (1.99, 2.0, 3.0, 6.0)] == [
        None, (0.0, 0.0), (1.0, -0.5), None]
    assert walker.speed == pytest.approx(math.sqrt(20.0) / 4.0)
    stander = Person((1.0, 1.0))
    floor = Floor(posts=(Post((3.0, 3.0), 0.1),), people=(walker, stander))
    assert [[thing.kind for thing in floor.rounds(time)] for time in (1.0, 3.0)] == [
        ['post', 'person'], ['post', 'person', 'person']]
    assert (floor.next_arrival(0.5), floor.next_arrival(2.0)) == (2.0, math.inf)
    assert floor.walking_speed == walker.speed


@pytest.mark.parametrize('make, name, words', [
    (lambda: Post((0.0, 0.0), 0.0), 'radius', 'must be above 0 m'),
    (lambda: Post((0.0, math.nan), 0.1), 'at', 'must be a finite number'),
    (lambda: Post((0.0, 101.0), 0.1), 'at', 'a floor reaches 100 m'),
    (lambda: Person((0.0, 0.0), begin=5.0, end=5.0), 'end', 'must be after 5 s'),
    (lambda: Person((0.0, 0.0), begin=-1.0), 'begin', 'must not be negative'),
    (lambda: Person((0.0, 0.0), to=(1.0, 0.0)), 'end', 'a walk needs one'),
    (lambda: Floor(walls=(((0.0, 0.0),),)), 'walls[0]', 'two or more'),
    (lambda: Floor(walls=(((0.0, 0.0), (1.0, 0.0), (1.0, 0.0)),)), 'walls[0][2]', 'once more'),
    (lambda: Floor(posts=(Post((1.0, 1.0), 0.1),) * (MAX_PARTS + 1)), None, '1000 at most')])
def test_what_no_floor_has_is_refused(make, name, words):
    with pytest.raises(InvalidMotionError) as refusal:
        make()
    assert refusal.value.name == name
    assert words in refusal.value.message
