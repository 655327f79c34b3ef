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
"""
The laser of the simulated robot: what it sees of a floor, and when it turns.

Tested by test/kachaka/simulator/test_laser.py.
"""

from __future__ import annotations

from functools import lru_cache
import math
import random
from typing import NamedTuple

from kachaka_simple_control.files.cdr import Scan
from kachaka_simple_control.files.floor_file import LaserParameters
from kachaka_simple_control.motion.floor import Floor
from kachaka_simple_control.motion.geometry import (
    compose,
    ORIGIN,
    Point,
    Pose,
    relative_to,
    transform_point,
)

#: Nearer than this it sees nothing [m]; assumed.
NEAREST = 0.05
#: What a hole of a scan has instead of a range; which of them a real one has is not known.
HOLES = (0.0, math.inf, math.nan)
FIRST_ANGLE = -math.pi


class Rays(NamedTuple):
    """
    The directions of the ranges of a scan, in the frame of the laser.

    :param increment: between two [rad]
    :param cosines: of their angles, as ``sines``
    """

    increment: float
    cosines: tuple[float, ...]
    sines: tuple[float, ...]


@lru_cache(maxsize=8)
def rays(count: int) -> Rays:
    """Return the directions of a number of ranges, from -pi to pi: the last is the first again."""
    increment = math.tau / (count - 1)
    angles = [FIRST_ANGLE + index * increment for index in range(count)]
    return Rays(increment, tuple(map(math.cos, angles)), tuple(map(math.sin, angles)))


def seen(floor: Floor, laser: Pose, time: float, count: int) -> list[float]:
    """
    Return how far the floor is in each direction, exactly [m]; infinite where nothing is.

    :param laser: the pose of the laser on the floor
    :param count: of ranges, from -pi to pi in the frame of the laser
    """
    found = [math.inf] * count
    directions = rays(count)
    inverse = relative_to(laser, ORIGIN)
    for start, end in floor.segments:
        _see_line(
            transform_point(start, inverse), transform_point(end, inverse), directions, found)
    for _, at, radius in floor.rounds(time):
        _see_disc(transform_point(at, inverse), radius, directions, found)
    return found


def _see_line(start: Point, end: Point, directions: Rays, found: list[float]) -> None:
    area = start[0] * end[1] - end[0] * start[1]
    if area < 0.0:
        start, end, area = end, start, -area
    # Counter-clockwise, as the laser sees it, from its start to its end: less than half a turn.
    first = math.atan2(start[1], start[0])
    span = (math.atan2(end[1], end[0]) - first) % math.tau
    if area == 0.0 or span > math.pi:
        return  # it is seen edge on
    across, along = end[0] - start[0], end[1] - start[1]
    cosines, sines = directions.cosines, directions.sines
    for index in _within(first, span, directions.increment, len(found)):
        closing = along * cosines[index] - across * sines[index]
        # Without a division first: closing is 0 where rounding makes a ray parallel to the line.
        if area < found[index] * closing:
            found[index] = area / closing


def _see_disc(at: Point, radius: float, directions: Rays, found: list[float]) -> None:
    square = at[0] * at[0] + at[1] * at[1] - radius * radius
    if square <= 0.0:
        found[:] = [0.0] * len(found)  # the laser is within it
        return
    half = math.asin(radius / math.sqrt(square + radius * radius))
    first = math.atan2(at[1], at[0]) - half
    cosines, sines = directions.cosines, directions.sines
    for index in _within(first, 2.0 * half, directions.increment, len(found)):
        ahead = at[0] * cosines[index] + at[1] * sines[index]
        distance = ahead - math.sqrt(max(0.0, ahead * ahead - square))
        found[index] = min(found[index], distance)


def _within(first: float, span: float, increment: float, count: int) -> list[int]:
    """Return the numbers of the rays from an angle on, over a span below one turn [rad]."""
    begin = (first - FIRST_ANGLE) % math.tau / increment
    turn = count - 1
    numbers = [number % turn for number in range(
        math.ceil(begin), math.floor(begin + span / increment) + 1)]
    # The last ray is the first one again.
    return [*numbers, turn] if 0 in numbers else numbers


class SimulatedLaser:
    """
    The laser of a simulated Kachaka.

    It turns while the robot moves and for a time after it, and when it is asked to.  Each scan is
    taken at one time, ``now``, and is told at once.

    :param mount: its pose on the robot
    :param start: when the floor was set up [s]
    """

    def __init__(
            self, parameters: LaserParameters, mount: Pose, floor: Floor, start: float,
            seed: int) -> None:
        self._parameters = parameters
        self._mount = mount
        self._floor = floor
        self._start = start
        self._seed = seed
        self._index = -1
        self._on_until = -math.inf

    def activate(self, duration: float, now: float) -> None:
        """Turn for a time from now on [s], if it does not turn for longer."""
        self._on_until = max(self._on_until, now + duration)

    def is_on(self, last_motion: float, now: float) -> bool:
        """
        Return whether it turns.

        :param last_motion: when the robot moved last [s]; minus infinity: not yet
        """
        return now < max(self._on_until, last_motion + self._parameters.off_after)

    def is_due(self, now: float) -> bool:
        """Return whether a scan can be taken: there is one in each period."""
        return self._number(now) > self._index

    def scan(self, robot: Pose, now: float) -> Scan:
        """
        Take a scan; its stamp is the time [ns].

        :param robot: its true pose on the floor
        """
        self._index = self._number(now)
        parameters = self._parameters
        noise = random.Random(f'{self._seed} laser {self._index}')
        count = parameters.points - noise.randrange(2)
        exact = seen(
            self._floor, compose(robot, self._mount), now - self._start, count)
        is_hidden = _hidden(count, parameters.view, self._mount.theta)
        return Scan(
            round(now * 1e9), FIRST_ANGLE, rays(count).increment, NEAREST, parameters.range,
            [math.inf if hidden else self._measured(distance, noise)
             for distance, hidden in zip(exact, is_hidden)])

    def _number(self, now: float) -> int:
        # Rounding must not make it one less at the begin of a period.
        return int((now - self._start) * self._parameters.rate + 1e-6)

    def _measured(self, distance: float, noise: random.Random) -> float:
        parameters = self._parameters
        if parameters.holes and noise.random() < parameters.holes:
            return noise.choice(HOLES)
        if distance > parameters.range:
            return math.inf
        if parameters.noise:
            distance += noise.gauss(0.0, parameters.noise)
        # A real laser reports 0 for what is too near.
        return 0.0 if distance < NEAREST else distance


@lru_cache(maxsize=8)
def _hidden(count: int, view: float, yaw: float) -> tuple[bool, ...]:
    """Return of each range whether the robot itself hides what is there: behind."""
    increment = rays(count).increment
    return tuple(
        abs(math.remainder(FIRST_ANGLE + index * increment + yaw, math.tau)) > view / 2.0
        for index in range(count))
