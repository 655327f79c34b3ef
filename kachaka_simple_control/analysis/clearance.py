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
"""Find which robots on a floor come too near to each other, when and where."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import math

from kachaka_simple_control.analysis.pair_search import Near, PairSearch, Track
from kachaka_simple_control.motion.floor import Floor
from kachaka_simple_control.motion.geometry import (
    Area,
    compose,
    Footprint,
    Point,
    Pose,
    relative_to,
    transform_point,
)
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.motion.separation import Hull
from kachaka_simple_control.text import format_fixed

#: Outlines nearer than this count as touching: they are too near at any margin [m].
TOUCH = 1e-3
#: The rounds that are looked at; of more, the rest is not.
MAX_ROUNDS = 100
#: Two poses count as the same if they are equal after rounding to this many digits [m, 1].
DIGITS = 9


@dataclass(frozen=True)
class FloorRobot:
    """
    A robot on a floor: what it drives, and where it begins.

    :param start: where it stands at t = 0
    :param footprint: its outline from above; None if unknown, and then it counts as a point
    """

    name: str
    plan: Plan
    start: Pose
    footprint: Footprint | None = None


@dataclass(frozen=True)
class NearPass:
    """
    Two robots whose outlines come nearer to each other than a margin.

    :param names: in the order of the robots
    :param distance: the smallest one between their outlines [m]; 0 if they touch or overlap
    :param time: when they are so near for the first time [s since t = 0 of the round]
    :param place: where, in the middle between the outlines [m on the floor]
    :param steps: the index of the step in which each robot is then; None if it has ended
    :param begin: when they come nearer than the margin for the first time [s]
    :param end: when they are a margin apart again, or the last robot has ended [s]
    :param round_number: from 1 on
    """

    names: tuple[str, str]
    distance: float
    time: float
    place: Point
    steps: tuple[int | None, int | None]
    begin: float
    end: float
    round_number: int = 1

    @property
    def text(self) -> str:
        """Return how near the robots come, when and where, and what both do then, as text."""
        one, two = self.names
        doing = ' and '.join(
            f'{name} {"at its end" if index is None else f"in step {index + 1}"}'
            for name, index in zip(self.names, self.steps))
        how = f'come within {100.0 * self.distance:.3g} cm' if self.distance else 'touch'
        when = '' if self.round_number == 1 else f'in round {self.round_number}, '
        x, y = (format_fixed(value, 2) for value in self.place)
        return (f'{one} and {two} {how} {when}after {format_fixed(self.time, 2)} s, at x {x} m, '
                f'y {y} m, {doing}')


@dataclass(frozen=True)
class FleetView:
    """
    A fleet as plots show it.

    :param margin: how near two outlines may come [m]
    :param passes: where they come nearer
    :param obstacles: what stands on the floor; None if unknown
    """

    name: str
    robots: tuple[FloorRobot, ...]
    margin: float
    passes: tuple[NearPass, ...]
    obstacles: Floor | None = None


def near_passes(
        robots: Sequence[FloorRobot], margin: float, rounds: int = 1) -> list[NearPass]:
    """
    Return the pairs of robots whose outlines come nearer than a margin.

    All begin at t = 0; a robot that has ended stands still.  Each round begins, again for all at
    one time, where the one before has ended.  A pair is named for each round, unless the same was
    found in an earlier one.

    :param margin: [m]; robots that touch are too near at any margin
    :returns: in the order of rounds, and of the times at which they come too near
    """
    tracks = {id(robot.plan): Track(robot.plan) for robot in robots}
    hulls = [Hull.of(robot.footprint) for robot in robots]
    starts = [robot.start for robot in robots]
    #: what was found for two plans and outlines, and the start of the second seen from the first
    known: dict[tuple[object, ...], Near | None] = {}
    named: set[tuple[object, ...]] = set()
    passes = []
    for number in range(1, min(rounds, MAX_ROUNDS) + 1):
        areas = [tracks[id(robot.plan)].area(start, hull)
                 for robot, start, hull in zip(robots, starts, hulls)]
        for one, two in _neighbours(areas, max(margin, TOUCH)):
            plans = robots[one].plan, robots[two].plan
            offset = relative_to(starts[one], starts[two])
            key = (id(plans[0]), id(plans[1]), hulls[one], hulls[two], _rounded(offset))
            if (one, two, key) in named:
                continue
            named.add((one, two, key))
            if key not in known:
                search = PairSearch(
                    (tracks[key[0]], tracks[key[1]]), (hulls[one], hulls[two]), offset)
                known[key] = search.near(max(margin, TOUCH))
            if (near := known[key]) is not None:
                passes.append(NearPass(
                    (robots[one].name, robots[two].name), near.distance, near.time,
                    transform_point(near.place, starts[one]),
                    (_step_index(plans[0], near.time), _step_index(plans[1], near.time)),
                    near.begin, near.end, number))
        ends = [compose(start, robot.plan.pose) for start, robot in zip(starts, robots)]
        if [*map(_rounded, ends)] == [*map(_rounded, starts)]:
            break  # all rounds are the same
        starts = ends
    return sorted(passes, key=lambda near: (near.round_number, near.begin, near.names))


def _step_index(plan: Plan, time: float) -> int | None:
    return plan.step_index(time) if time < plan.duration else None


def _rounded(pose: Pose) -> tuple[float, ...]:
    # By sine and cosine, equal headings are equal after whole turns.  Adding 0.0 makes -0.0 0.0.
    values = pose.x, pose.y, math.cos(pose.theta), math.sin(pose.theta)
    return tuple(round(value, DIGITS) + 0.0 for value in values)


def _neighbours(areas: Sequence[Area], margin: float) -> Iterator[tuple[int, int]]:
    """Yield the pairs of areas that are nearer than a margin along x and along y."""
    bounds = [area.corners for area in areas]
    active: list[int] = []
    for index in sorted(range(len(areas)), key=lambda index: areas[index].left):
        (left, bottom), (_, top) = bounds[index]
        active = [other for other in active if bounds[other][1][0] + margin > left]
        for other in active:
            (_, below), (_, above) = bounds[other]
            if above + margin > bottom and top + margin > below:
                yield min(index, other), max(index, other)
        active.append(index)
