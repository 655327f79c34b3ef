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
"""What stands on a floor, seen from above: walls, posts, and people who come and go."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
import math
from typing import NamedTuple

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.geometry import Point, Pose, relative_to
from kachaka_simple_control.motion.separation import gap, Hull
from kachaka_simple_control.motion.units import LENGTH, SIZE, TIME

#: How far from its origin a floor reaches along each axis [m]: a map of it stays small.
MAX_REACH = 100.0
#: The largest number of lines of all walls, posts and people: a laser looks at each.
MAX_PARTS = 1000
WALL, POST, PERSON = 'wall', 'post', 'person'

#: A line through points [m].
Wall = tuple[Point, ...]


def require_wall(name: str, wall: Wall) -> None:
    """
    Check that a wall has two points or more, each within reach and apart from the one before it.

    :raises InvalidMotionError: if it has not
    """
    if len(wall) < 2:
        raise InvalidMotionError(f'{len(wall)} points; a wall has two or more', name=name)
    for index, point in enumerate(wall):
        _require_point(f'{name}[{index}]', point)
        if index and point == wall[index - 1]:
            raise InvalidMotionError(
                'the point before it once more; leave it out', name=f'{name}[{index}]')


@dataclass(frozen=True)
class Post:
    """
    What is round and stays: a post, a pillar, the leg of a table.

    :param at: its middle [m]
    :param radius: [m]
    :raises InvalidMotionError: if a value is out of its range
    """

    at: Point
    radius: float

    def __post_init__(self) -> None:
        """Check each value."""
        _require_point('at', self.at)
        SIZE.require('radius', self.radius)


@dataclass(frozen=True)
class Person:
    """
    Somebody who stands or walks on the floor for a time, and is gone before and after.

    :param at: where, or where from [m]
    :param radius: [m]
    :param begin: from when on [s since the floor was set up]
    :param end: until when [s since the floor was set up]; infinite: for ever
    :param to: where to, at a constant speed from ``begin`` to ``end`` [m]; None to stand still
    :raises InvalidMotionError: if a value is out of its range
    """

    at: Point
    radius: float = 0.2
    begin: float = 0.0
    end: float = math.inf
    to: Point | None = None

    def __post_init__(self) -> None:
        """Check each value."""
        _require_point('at', self.at)
        SIZE.require('radius', self.radius)
        TIME.require('begin', self.begin)
        if not self.end > self.begin:
            raise InvalidMotionError(
                f'{self.end:g} s; it must be after {self.begin:g} s, when this person comes',
                name='end')
        if self.to is not None:
            _require_point('to', self.to)
            if math.isinf(self.end):
                raise InvalidMotionError('without an end; a walk needs one', name='end')

    @property
    def speed(self) -> float:
        """Return how fast this person walks [m/s]."""
        return 0.0 if self.to is None else math.dist(self.at, self.to) / (self.end - self.begin)

    def place(self, time: float) -> Point | None:
        """Return where this person is [m]; None if nowhere on the floor."""
        if not self.begin <= time < self.end:
            return None
        if self.to is None:
            return self.at
        part = (time - self.begin) / (self.end - self.begin)
        return (self.at[0] + (self.to[0] - self.at[0]) * part,
                self.at[1] + (self.to[1] - self.at[1]) * part)


class Round(NamedTuple):
    """Something round on the floor: a post or a person, with its middle and its radius [m]."""

    kind: str
    at: Point
    radius: float


class Nearest(NamedTuple):
    """
    The part of a floor that is nearest to a robot.

    :param distance: from outline to outline [m]; 0 if they touch or overlap, infinite if there is
        nothing
    :param kind: ``wall``, ``post`` or ``person``; empty if there is nothing
    """

    distance: float
    kind: str


@dataclass(frozen=True)
class Floor:
    """
    What stands on a floor.

    :raises InvalidMotionError: if a value is out of its range, or there is too much
    """

    walls: tuple[Wall, ...] = ()
    posts: tuple[Post, ...] = ()
    people: tuple[Person, ...] = ()

    def __post_init__(self) -> None:
        """Check the walls, and how many parts there are."""
        for index, wall in enumerate(self.walls):
            require_wall(f'walls[{index}]', wall)
        count = sum(len(wall) - 1 for wall in self.walls) + len(self.posts) + len(self.people)
        if count > MAX_PARTS:
            raise InvalidMotionError(
                f'a floor with {count} lines, posts and people; it has {MAX_PARTS} at most')

    @cached_property
    def segments(self) -> tuple[tuple[Point, Point], ...]:
        """Return the lines of all walls, each by its ends [m]."""
        return tuple(ends for wall in self.walls for ends in pairwise(wall))

    def rounds(self, time: float) -> list[Round]:
        """Return the posts, and the people who are there at a time [s since it was set up]."""
        return [*self._posts, *(
            Round(PERSON, place, person.radius) for person in self.people
            if (place := person.place(time)) is not None)]

    @cached_property
    def walking_speed(self) -> float:
        """Return how fast the fastest person walks [m/s]."""
        return max((person.speed for person in self.people), default=0.0)

    def next_arrival(self, time: float) -> float:
        """Return when somebody comes next, after a time; infinite if nobody does [s]."""
        return min((person.begin for person in self.people if person.begin > time),
                   default=math.inf)

    def nearest(self, robot: Hull, pose: Pose, time: float) -> Nearest:
        """Return what is nearest to a robot at a pose and a time [s since it was set up]."""
        found = Nearest(math.inf, '')
        for kind, hull, place in self._parts(time):
            away = relative_to(pose, place)
            # The whole distance is computed only of what can be nearer than what was found.
            if _distance_to_axle(hull, away) - robot.reach - robot.radius < found.distance:
                distance = gap(robot, hull, away).distance
                if distance < found.distance:
                    found = Nearest(distance, kind)
        return found

    @cached_property
    def _posts(self) -> tuple[Round, ...]:
        return tuple(Round(POST, post.at, post.radius) for post in self.posts)

    @cached_property
    def _lines(self) -> tuple[tuple[str, Hull, Pose], ...]:
        return tuple(
            (WALL, _line(math.dist(start, end)),
             Pose(*start, math.atan2(end[1] - start[1], end[0] - start[0])))
            for start, end in self.segments)

    def _parts(self, time: float) -> Iterator[tuple[str, Hull, Pose]]:
        """Yield the kind of each part, its outline, and where this is on the floor."""
        yield from self._lines
        for kind, at, radius in self.rounds(time):
            yield kind, Hull(0.0, 0.0, 0.0, radius, ((0.0, 0.0),)), Pose(*at)


def _line(length: float) -> Hull:
    """Return a line that begins at the origin as an outline."""
    return Hull(length, 0.0, 0.0, 0.0, ((0.0, 0.0), (length, 0.0)))


def _distance_to_axle(hull: Hull, pose: Pose) -> float:
    """Return how far a line or a disc at a pose is from the origin [m]; not above 0 within it."""
    cosine, sine = math.cos(pose.theta), math.sin(pose.theta)
    along = min(max(-(pose.x * cosine + pose.y * sine), 0.0), hull.front)
    return math.hypot(pose.x + along * cosine, pose.y + along * sine) - hull.radius


def _require_point(name: str, point: Point) -> None:
    for number in point:
        LENGTH.require(name, number)
        if abs(number) > MAX_REACH:
            raise InvalidMotionError(
                f'at {number:g} m; a floor reaches {MAX_REACH:g} m from its origin', name=name)
