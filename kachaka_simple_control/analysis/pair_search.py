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
Find when two robots that drive at the same time are near to each other.

No near pass is missed between two samples.  Between two moments, the distance of two outlines has
a bound from how far they can move, and the time is halved until the bound decides.

Tested by test/analysis/test_clearance.py.
"""

from __future__ import annotations

from bisect import bisect_right
from itertools import pairwise
import math
from typing import NamedTuple

from kachaka_simple_control.motion.geometry import (
    Area,
    compose,
    integrate,
    Point,
    Pose,
    relative_to,
    transform_point,
    Velocity,
    ZERO,
)
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.motion.separation import gap, Hull, Separation

#: Distances are found to this [m].  A pass that is less than twice this below the margin may be
#: left out, so robots that are exactly a margin apart are not near.
GRAIN = 1e-4
#: When a pass begins and ends is found to this motion of both robots together [m].
EDGE = 1e-3
#: The bound from the relative velocity holds while the first robot turns by less [rad].
LARGEST_TURN = 1.0


class Track:
    """
    A plan by time: the poses at the ends of its segments, seen from its start.

    :ivar times: when each velocity begins, and the end of the plan [s]
    :ivar lengths: the length of the path until then [m]
    :ivar turns: the sum of all turns until then, without their signs [rad]
    :ivar velocities: from each time on; the last one is zero
    """

    def __init__(self, plan: Plan) -> None:
        self.duration = plan.duration
        self.times = [0.0, *(segment.end for segment in plan.segments)]
        self.poses = plan.path()
        self.velocities = [*(segment.velocity for segment in plan.segments), ZERO]
        self.lengths, self.turns = [0.0], [0.0]
        xs, ys = [0.0], [0.0]
        for (begin, end), (one, two), velocity in zip(
                pairwise(self.times), pairwise(self.poses), self.velocities):
            length = abs(velocity.linear_x) * (end - begin)
            turn = abs(velocity.angular_z) * (end - begin)
            self.lengths.append(self.lengths[-1] + length)
            self.turns.append(self.turns[-1] + turn)
            # An arc is nearer to its chord than this: than its sagitta, or half its length.
            bulge = length * min(0.5, turn / 8.0)
            xs += [min(one.x, two.x) - bulge, max(one.x, two.x) + bulge]
            ys += [min(one.y, two.y) - bulge, max(one.y, two.y) + bulge]
        self._corners = [(x, y) for x in (min(xs), max(xs)) for y in (min(ys), max(ys))]

    def area(self, start: Pose, hull: Hull) -> Area:
        """Return an area of the floor that contains the outline of a robot all the time."""
        xs, ys = zip(*(transform_point(corner, start) for corner in self._corners))
        reach = hull.reach + hull.radius
        return Area(min(xs) - reach, min(ys) - reach,
                    max(xs) - min(xs) + 2.0 * reach, max(ys) - min(ys) + 2.0 * reach)

    def at(self, time: float, reach: float) -> tuple[Pose, float]:
        """
        Return the pose at a time, and how far a point of the robot can have moved until then [m].

        :param reach: how far the point is from the wheel axle [m]
        """
        index = self._index(time)
        velocity, since = self.velocities[index], time - self.times[index]
        moved = (self.lengths[index] + abs(velocity.linear_x) * since
                 + reach * (self.turns[index] + abs(velocity.angular_z) * since))
        return integrate(self.poses[index], velocity, since), moved

    def constant_velocity(self, begin: float, end: float) -> Velocity | None:
        """Return the velocity between two times; None if it changes."""
        index = self._index(begin)
        is_constant = index + 1 == len(self.times) or self.times[index + 1] >= end
        return self.velocities[index] if is_constant else None

    def changes_near(self, time: float) -> list[float]:
        """Return when the velocity changes before and after a time [s]."""
        index = self._index(time)
        return self.times[index:index + 2]

    def _index(self, time: float) -> int:
        return bisect_right(self.times, time) - 1


class Moment(NamedTuple):
    """
    Two robots at a time.

    :param pose: that of the second robot, seen from the first
    :param moved: how far a point of each can have moved since the start, added up [m]
    """

    time: float
    gap: Separation
    pose: Pose
    moved: float


class Near(NamedTuple):
    """
    A near pass of two robots, seen from the start of the first one.

    :param distance: the smallest one between their outlines [m]
    :param time: when they are so near for the first time [s]
    :param place: where, in the middle between the outlines [m]
    :param begin: when they come nearer than the margin for the first time [s]
    :param end: when they are a margin apart again, or the last robot has ended [s]
    """

    distance: float
    time: float
    place: Point
    begin: float
    end: float


class PairSearch:
    """
    The search for the near pass of two robots, which both begin at t = 0.

    :param offset: the start of the second robot, seen from that of the first
    """

    def __init__(
            self, tracks: tuple[Track, Track], hulls: tuple[Hull, Hull], offset: Pose) -> None:
        self._tracks, self._hulls, self._offset = tracks, hulls, offset
        self._reaches = hulls[0].reach, hulls[1].reach
        self._known: dict[float, Moment] = {}
        self._first = self._at(0.0)
        self._last = self._at(max(track.duration for track in tracks))

    def near(self, margin: float) -> Near | None:
        """Return how the robots come nearer than a margin [m], which is above 0, or None."""
        distance, limit = self._smallest(margin), margin - GRAIN
        if distance >= limit:
            return None
        nearest = self._first_below(min(distance + 2.0 * GRAIN, limit))
        begin = self._first_below(limit)
        pose, _ = self._tracks[0].at(nearest.time, 0.0)
        return Near(distance, nearest.time, transform_point(nearest.gap.place, pose),
                    begin.time, self._end(begin, limit).time)

    def _smallest(self, margin: float) -> float:
        """Return the smallest distance if it is below a margin, or else one that is not [m]."""
        best = min(self._first.gap.distance, self._last.gap.distance)
        open_parts = [(self._first, self._last)]
        while open_parts:
            first, last = open_parts.pop()
            if self._bounds(first, last)[0] >= min(best, margin) - GRAIN:
                continue
            if (middle := self._between(first, last)) is not None:
                best = min(best, middle.gap.distance)
                open_parts += [(middle, last), (first, middle)]
        return best

    def _first_below(self, limit: float) -> Moment:
        """Return the first moment at which the distance is below a limit; it is some time."""
        open_parts = [(self._first, self._last)]
        while open_parts:
            first, last = open_parts.pop()
            if first.gap.distance < limit:
                return first
            if self._bounds(first, last)[0] < limit:
                middle = self._between(first, last)
                if middle is None or last.moved - first.moved < EDGE:
                    return first
                open_parts += [(middle, last), (first, middle)]
        return self._last

    def _end(self, begin: Moment, limit: float) -> Moment:
        """Return the first moment after another at which the distance is not below a limit."""
        open_parts = [(begin, self._last)]
        while open_parts:
            first, last = open_parts.pop()
            if self._bounds(first, last)[1] < limit:
                continue
            middle = self._between(first, last)
            if middle is None or last.moved - first.moved < EDGE:
                if last.gap.distance >= limit:
                    return last
            else:
                open_parts += [(middle, last), (first, middle)]
        return self._last

    def _at(self, time: float) -> Moment:
        if time not in self._known:
            (one, moved), (two, other) = (
                track.at(time, reach) for track, reach in zip(self._tracks, self._reaches))
            pose = relative_to(one, compose(self._offset, two))
            self._known[time] = Moment(time, gap(*self._hulls, pose), pose, moved + other)
        return self._known[time]

    def _between(self, first: Moment, last: Moment) -> Moment | None:
        """
        Return a moment near the middle between two others; None if there is none.

        It is when a velocity changes, if one does.
        """
        middle = (first.time + last.time) / 2.0
        changes = [time for track in self._tracks for time in track.changes_near(middle)
                   if first.time < time < last.time]
        time = min(changes, key=lambda change: abs(change - middle), default=middle)
        return self._at(time) if first.time < time < last.time else None

    def _bounds(self, first: Moment, last: Moment) -> tuple[float, float]:
        """Return bounds below and above all distances between two moments [m]."""
        both = first.gap.distance + last.gap.distance
        moved = last.moved - first.moved
        lowest, highest = (both - moved) / 2.0, (both + moved) / 2.0
        one, two = (
            track.constant_velocity(first.time, last.time) for track in self._tracks)
        if one is not None and two is not None:
            span = last.time - first.time
            for moment, sign in ((first, 1.0), (last, -1.0)):
                nearer, changed = self._changes(moment, one, two, span, sign)
                lowest = max(lowest, moment.gap.distance - nearer)
                highest = min(highest, moment.gap.distance + changed)
        return max(0.0, lowest), highest

    def _changes(
            self, moment: Moment, one: Velocity, two: Velocity, span: float,
            sign: float) -> tuple[float, float]:
        """
        Return by how much the distance shrinks, and changes, at constant velocities at most [m].

        Seen from the first robot, the axle of the second one moves at a velocity g, with
        |dg/dt| <= |v2 w| + |w1 g| for w = w2 - w1, and its corners turn around the axle at w.
        To come nearer, only what is along the line between the nearest points counts: a line
        perpendicular to it separates the outlines.

        :param sign: 1 for the time after the moment, -1 for the time before it
        """
        turn = abs(one.angular_z) * span
        if turn > LARGEST_TURN:
            return math.inf, math.inf
        x, y, theta = moment.pose.x, moment.pose.y, moment.pose.theta
        forward = two.linear_x * math.cos(theta) - one.linear_x + one.angular_z * y
        sideways = two.linear_x * math.sin(theta) - one.angular_z * x
        right, up = moment.gap.direction
        closing = max(0.0, -sign * (right * forward + up * sideways))
        spin = abs(two.angular_z - one.angular_z)
        bend = abs(two.linear_x) * spin
        # By Gronwall's inequality, |g| is not larger than this.
        fastest = (math.hypot(forward, sideways) + bend * span) * math.exp(turn)
        bending = (bend + abs(one.angular_z) * fastest) * span / 2.0
        turning = spin * self._reaches[1]
        return span * (closing + bending + turning), span * (fastest + turning)
