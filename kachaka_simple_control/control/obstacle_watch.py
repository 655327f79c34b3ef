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
The obstacle watch: whether a robot goes on, or is held before what its laser has seen.

It is no safety device: it sees only what the laser sees, in one plane, ten times a second.

Tested by test/control/test_obstacle_watch.py.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
import math
from operator import itemgetter
import statistics
from typing import NamedTuple

from kachaka_simple_control.control.events import WatchState
from kachaka_simple_control.control.hand_cut import cut
from kachaka_simple_control.control.speed_factor import is_hold
from kachaka_simple_control.control.tick_scheduler import PlanPoint
from kachaka_simple_control.control.timing import (
    BLIND_SPEED,
    BLIND_TIME,
    CLEAR_TIME,
    HAND_PERIOD,
    SCAN_TIMEOUT,
    UNKNOWN_DELAY,
)
from kachaka_simple_control.motion.geometry import (
    distance_between,
    Footprint,
    Point,
    Pose,
    relative_to,
    Velocity,
    ZERO,
)
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.motion.swept_path import Outline, PlannedWay, PointMap, WayPoint

#: A held robot goes on when this way is free [m], [rad]: enough for a start and a stop.
FREE_LENGTH, FREE_ANGLE = 0.3, math.radians(30.0)
#: What a scan sees so near to the outline at the start belongs to the robot [m].
OWN_DISTANCE = 0.02
#: How much a point of the robot itself may be elsewhere in a later scan [m], at least.
OWN_CELL = 0.02
#: How far behind an obstacle the way is searched for the place where the robot would touch it.
CONTACT_LENGTH, CONTACT_ANGLE = 0.3, math.radians(60.0)
#: Of how many scans the period is the median, and what it is before there are two [s].
PERIOD_SCANS, FIRST_PERIOD = 10, 0.1
#: The shortest step with which the next rest is computed [s]: a finer one is slower only.
REST_STEP = 0.05
#: How often the time of a plan is noted [s], and how many of these notes are kept.
NOTE_PERIOD, NOTES = 0.01, 200
#: How many plan times are tried to find that of a pose of odometry.
TRIES = 11
#: A turn of 1 rad is as far as this way, to find the planned pose that is nearest [m].
TURN_WEIGHT = 0.3


class Verdict(NamedTuple):
    """
    What the watch says of a scan.

    :param distance: how far the robot can still drive before it touches what was seen [m]; None if
        nothing is in its way
    :param angle: how far it can still turn on this way [rad]; None if nothing is in its way
    """

    state: WatchState
    distance: float | None = None
    angle: float | None = None


class Sight(NamedTuple):
    """
    A scan that was compared with the planned path.

    :param way: the path; None if velocities are commanded directly
    :param left: how far [m] and how much [rad] the robot can still drive and turn on it before it
        touches what was seen; None if nothing holds it
    """

    taken: float
    points: Sequence[Point]
    way: PlannedWay | None
    left: tuple[float, float] | None


class ObstacleWatch:
    """
    Compares each scan with the planned path, and decides whether the robot goes on.

    ``look`` takes some ms and changes nothing, so that no thread waits for it.  One thread at a
    time may call ``begin``, ``decide``, ``check`` and ``go_blind``; any may call the others.
    Times are on the steady clock [s].

    :param margin: what stays free around the outline [m]
    :param delay: from a velocity to its effect [s]; None if it was not measured: then odometry
        tells how far the robot is
    """

    def __init__(self, footprint: Footprint, margin: float, delay: float | None) -> None:
        self._wide, self._outline = Outline(footprint, margin), Outline(footprint)
        self._own_outline = Outline(footprint, OWN_DISTANCE)
        self._delay = delay
        self._way: PlannedWay | None = None
        self._point: Callable[[], PlanPoint | None] = lambda: None
        #: squares in which points of the robot itself were seen before the drive
        self._own: frozenset[tuple[int, int]] = frozenset()
        #: when which plan time was sent
        self._notes: deque[tuple[float, float]] = deque(maxlen=NOTES)
        self._odometry: deque[tuple[float, Pose]] = deque(maxlen=NOTES)
        self._start: Pose | None = None
        self._periods: deque[float] = deque(maxlen=PERIOD_SCANS)
        #: the newest scan: when it was taken, and what it has seen
        self.taken = -math.inf
        self.points: Sequence[Point] = ()
        #: since when all scans show a free way; None if the newest does not
        self._clear_since: float | None = None
        self.state = WatchState.NO_SCAN
        #: until when a person has allowed to drive without a scan
        self._blind_until = -math.inf

    @property
    def period(self) -> float:
        """Return the time between two scans [s]."""
        return statistics.median(self._periods) if self._periods else FIRST_PERIOD

    @property
    def factor(self) -> float:
        """Return the speed factor that the watch wants."""
        return {WatchState.CLEAR: 1.0, WatchState.BLIND: BLIND_SPEED}.get(self.state, 0.0)

    def begin(
            self, plan: Plan | None, start: Pose | None,
            point: Callable[[], PlanPoint | None] = lambda: None) -> Verdict:
        """
        Begin to watch a new drive; what the newest scan sees near the robot belongs to it.

        :param plan: None if velocities are commanded directly: see ``cut``
        :param start: the pose by odometry at the start; None if unknown
        :param point: returns how far the plan is; None before the first velocity
        """
        self._way = None if plan is None else PlannedWay(plan)
        self._start, self._point = start, point
        self._notes.clear()
        self._own = frozenset(
            cell for x, y in self.points if self._own_outline.contains(x, y)
            for cell in _cells_around(x, y))
        self._clear_since = None
        self.state = WatchState.CLEAR
        return self.decide(self.look(self.taken, self.points))

    def on_sent(self, now: float, plan_time: float | None) -> None:
        """Note which plan time was sent; for the thread that drives."""
        if plan_time is not None and (
                not self._notes or now - self._notes[-1][0] >= NOTE_PERIOD):
            self._notes.append((now, plan_time))

    def on_odometry(self, now: float, pose: Pose) -> None:
        """Note a pose of odometry, which arrives in order of time."""
        self._odometry.append((now, pose))

    def look(self, taken: float, points: Sequence[Point]) -> Sight:
        """
        Compare a scan with the planned path.

        :param points: in the frame of the robot
        """
        way = self._way
        return Sight(taken, points, way, None if way is None else self._search(
            way, taken, points))

    def decide(self, sight: Sight) -> Verdict:
        """Decide by the newest scan whether the robot goes on."""
        if 0.0 < sight.taken - self.taken < SCAN_TIMEOUT:
            self._periods.append(sight.taken - self.taken)
        elif sight.taken != self.taken:
            self._clear_since = None
        self.taken, self.points = sight.taken, sight.points
        if sight.way is not self._way:  # a drive has begun meanwhile
            return Verdict(self.state)
        self._blind_until = -math.inf
        if sight.left is not None:
            self._clear_since, self.state = None, WatchState.OBSTACLE
            return Verdict(self.state, *sight.left)
        if self._clear_since is None:
            self._clear_since = self.taken
        is_held = self._way is not None and self.state in (
            WatchState.OBSTACLE, WatchState.NO_SCAN)
        # A part of a period less: scans do not come to the millisecond.
        if not is_held or self.taken - self._clear_since >= CLEAR_TIME - 0.2 * self.period:
            self.state = WatchState.CLEAR
        return Verdict(self.state)

    def check(self, now: float) -> Verdict | None:
        """Return NO_SCAN if the last scan is too old by now, once; None otherwise."""
        if now < self._blind_until:
            return None
        if now - self.taken <= SCAN_TIMEOUT or self.state is WatchState.NO_SCAN:
            return None
        self.state, self._clear_since = WatchState.NO_SCAN, None
        return Verdict(self.state)

    def go_blind(self, now: float) -> Verdict | None:
        """Go on slowly for some time without a scan, as a person wants; None if scans come."""
        if self.state is not WatchState.NO_SCAN:
            return None
        self._blind_until, self.state = now + BLIND_TIME, WatchState.BLIND
        return Verdict(self.state)

    def cut(self, wanted: Velocity, limits: Limits, now: float) -> Velocity:
        """
        Return the part of a velocity by hand with which the robot still stops before all points.

        :returns: zero without a scan
        """
        if now - self.taken > SCAN_TIMEOUT:
            return ZERO
        # Until the next scan is compared and has an effect.
        lag = now - self.taken + self.period + HAND_PERIOD + (
            UNKNOWN_DELAY if self._delay is None else self._delay)
        return cut(
            wanted, self._foreign(self.points), self._wide, self._outline, limits, lag)

    @property
    def valid_until(self) -> float:
        """Return until when the newest answer is valid, if no other follows [s]."""
        return max(self._blind_until, self.taken + SCAN_TIMEOUT)

    def _foreign(self, points: Sequence[Point]) -> Sequence[Point]:
        """Return what a scan has seen, without the robot itself."""
        own = self._own
        return points if not own else [point for point in points if _cell(*point) not in own]

    def _search(
            self, way: PlannedWay, taken: float,
            points: Sequence[Point]) -> tuple[float, float] | None:
        """Return the way to the contact with what must hold the robot; None if it is free."""
        point = self._point()
        start = self._place(way, taken)
        # The next scan can hold it with the message after it.
        since = max(0.0, taken - self._notes[-1][0]) if self._notes else 0.0
        rest = 0.0 if point is None else point.rest(
            self.period + way.plan.period + min(since, way.plan.period),
            max(REST_STEP, way.plan.period))
        if point is None or self.state is not WatchState.CLEAR or is_hold(point.factor):
            rest = way.time_after(rest, FREE_LENGTH, FREE_ANGLE)
        ahead = [*way.between(start, max(start, rest))]
        seen = PointMap(_placed(
            self._foreign(points), ahead[0].pose,
            self._wide.reach + ahead[-1].length + CONTACT_LENGTH))
        for here in ahead:
            if seen.touches(self._wide, here.pose):
                return self._contact(way, seen, here)
        return None

    def _contact(
            self, way: PlannedWay, points: PointMap, first: WayPoint) -> tuple[float, float]:
        """Return the way to where the outline itself touches a point; if never, to its margin."""
        free = 0.0, 0.0
        for here in way.between(first.time, way.plan.duration):
            if points.touches(self._outline, here.pose):
                return first.length + free[0], first.angle + free[1]
            free = here.length, here.angle
            if here.length > CONTACT_LENGTH or here.angle > CONTACT_ANGLE:
                break
        return first.length, first.angle

    def _place(self, way: PlannedWay, time: float) -> float:
        """Return the plan time at which the robot was at a time, by its delay or by odometry."""
        if self._delay is not None:
            return self._noted(time - self._delay)
        earliest, latest = self._noted(time - UNKNOWN_DELAY), self._noted(time)
        pose = self._pose_at(time)
        if pose is None or self._start is None or earliest == latest:
            return earliest
        driven, tried = relative_to(self._start, pose), [
            earliest + (latest - earliest) * number / (TRIES - 1) for number in range(TRIES)]

        def away(plan_time: float) -> float:
            distance, angle = distance_between(way.pose_at(plan_time), driven)
            return math.hypot(distance, TURN_WEIGHT * angle)

        return min(tried, key=away)

    def _pose_at(self, time: float) -> Pose | None:
        """Return the pose of odometry that is nearest to a time; None without any."""
        poses = [*self._odometry]
        index = bisect_right(poses, time, key=itemgetter(0))
        near = poses[max(0, index - 1):index + 1]
        return min(near, key=lambda one: abs(one[0] - time))[1] if near else None

    def _noted(self, time: float) -> float:
        """Return the plan time that was sent at a time, between two notes in proportion."""
        notes = [*self._notes]
        index = bisect_right(notes, time, key=itemgetter(0))
        if index in (0, len(notes)):
            return notes[min(index, len(notes) - 1)][1] if notes else 0.0
        (before, one), (after, two) = notes[index - 1:index + 1]
        return one + (two - one) * (time - before) / (after - before)


def _placed(points: Iterable[Point], pose: Pose, reach: float) -> Iterator[Point]:
    """
    Yield points that were seen from a pose, in the frame of the pose.

    :param reach: those that are farther away are left out [m]
    """
    cosine, sine = math.cos(pose.theta), math.sin(pose.theta)
    return ((pose.x + x * cosine - y * sine, pose.y + x * sine + y * cosine)
            for x, y in points if -reach <= x <= reach and -reach <= y <= reach)


def _cell(x: float, y: float) -> tuple[int, int]:
    return int(x // OWN_CELL), int(y // OWN_CELL)


def _cells_around(x: float, y: float) -> list[tuple[int, int]]:
    column, row = _cell(x, y)
    return [(column + right, row + up) for right in (-1, 0, 1) for up in (-1, 0, 1)]
