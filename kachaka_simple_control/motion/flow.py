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
Join steps into flows, which the robot drives without a stop.

Between two lines there may be one turn; it becomes a corner.  Where an arc meets a line or another
arc, a transition connects them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import pairwise
import math
from typing import NamedTuple

from kachaka_simple_control.motion.arc_group import is_same, RunArc
from kachaka_simple_control.motion.arc_run import ArcRun, LEG_SHARE, plan_run, RunEnd
from kachaka_simple_control.motion.corner import corner_path, CornerTurn, MAX_ANGLE
from kachaka_simple_control.motion.flow_leg import FlowLeg
from kachaka_simple_control.motion.junctions import (
    ArcJunction,
    corner_of,
    CornerJunction,
    Junction,
    REMEMBERED,
    stretch_corners,
)
from kachaka_simple_control.motion.leg_speeds import Leg, LegJunction, length_left, limit_speeds
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.trajectory import ProfiledPath, Trajectory
from kachaka_simple_control.motion.transition import Replaced, transition_path
from kachaka_simple_control.motion.velocity_profile import PathLimits, time_optimal_profile

#: A flow saves at least this part of the time from rest to rest.
LEAST_SAVED = 1e-12
#: How often all legs of a flow are checked for their length.
PASSES = 3
#: A rest of a leg of at most this fraction of the leg comes from the grid of the corners.
GRID_REST = 4e-6
#: An arc with less curvature [rad/m] is driven from rest to rest: so far from the centre of its
#: circle, rounding would move the end of a transition by more than a nanometre.
LEAST_CURVATURE = 1e-5
#: A corner counts as shrunk if its tangent is shorter by more than this fraction.
SHRINKAGE = 1e-6

_plan_run = lru_cache(REMEMBERED)(plan_run)
_path = lru_cache(REMEMBERED)(corner_path)
_transition_path = lru_cache(REMEMBERED)(transition_path)
_leg_between = lru_cache(REMEMBERED)(FlowLeg.between)


class FlowPart(NamedTuple):
    """
    A step that may be part of a flow.

    :param path: its trajectory from rest to rest; None for a step that is always a stop
    :param tolerance: the largest distance of a corner at this step from the legs [m]; 0 for none
    """

    path: ProfiledPath | None
    tolerance: float

    @property
    def is_leg(self) -> bool:
        """Return whether it is a leg: a line or an arc."""
        return bool(self.path and self.tolerance and self.path.duration
                    and self.path.segment.linear
                    and not 0.0 < abs(self.path.segment.angular) < LEAST_CURVATURE)

    @property
    def is_arc(self) -> bool:
        """Return whether it is an arc."""
        return bool(self.path and self.is_leg and self.path.segment.angular)

    @property
    def is_turn(self) -> bool:
        """Return whether it is a turn in place that can become a corner."""
        return bool(self.path and self.tolerance and self.path.duration
                    and not self.path.segment.linear and self.path.segment.distance < MAX_ANGLE)


class Cut(NamedTuple):
    """
    How much a corner is cut.

    :param tolerance: the largest deviation allowed [m]
    :param deviation: the deviation: how far the path passes the corner [m]; 0 for a stop
    :param is_shrunk: whether it is less than the tolerance and the speed limits allow, because a
        leg is short
    """

    tolerance: float
    deviation: float
    is_shrunk: bool


class FlowStep(NamedTuple):
    """
    A planned step of a flow.

    :param trajectories: in driving order.  A transition belongs to its arc, or to the first one
    :param cut: for a turn, how much its corner is cut; None for a leg
    :param joins_next: whether the robot goes on into the next step without a stop
    """

    trajectories: tuple[Trajectory, ...]
    cut: Cut | None
    joins_next: bool

    @property
    def duration(self) -> float:
        """Return the duration [s]."""
        return math.fsum(trajectory.duration for trajectory in self.trajectories)


def find_flows(parts: Sequence[FlowPart]) -> Iterator[range]:
    """
    Yield the indices of the parts of each flow, which begins and ends with a leg.

    :param parts: the steps of a motion in driving order
    """
    begin = 0
    while begin < len(parts):
        end = begin
        while end < len(parts) and (following := _following(parts, end)):
            end = following
        if end > begin:
            yield range(begin, end + 1)
        begin = end + 1


def _following(parts: Sequence[FlowPart], index: int) -> int | None:
    """Return the index of the leg that follows a leg without a stop; None if there is none."""
    following = index + 1
    if not parts[index].is_leg or following == len(parts):
        return None
    if parts[following].is_turn:
        following += 1
        if parts[index].is_arc or (following < len(parts) and parts[following].is_arc):
            return None
    if following == len(parts) or not parts[following].is_leg:
        return None
    one, two = parts[index].path, parts[following].path
    return following if one and two and one.segment.linear == two.segment.linear else None


def plan_flow(parts: Sequence[FlowPart], limits: Limits, rate: float) -> list[FlowStep]:
    """Return the planned steps of a flow, never slower than the steps from rest to rest."""
    at_rest = [FlowStep((part.path,), None, joins_next=False)
               for part in parts if part.path is not None]
    # Less is rounding: the times of a plan are added up one by one.
    longest = math.fsum(step.duration for step in at_rest) * (1.0 - LEAST_SAVED)
    has_arcs = any(part.is_arc for part in parts)
    # If joined arcs cost time somewhere, the corners alone may still save some.
    for joins_arcs in (True, False) if has_arcs else (False,):
        planned = _Flow(parts, limits, rate, joins_arcs).planned()
        if math.fsum(step.duration for step in planned) < longest:
            return planned
    return at_rest


def _finite(limits: PathLimits, length: float) -> PathLimits:
    """Return limits along a leg with a finite velocity."""
    if limits.velocity < math.inf:
        return limits
    return limits._replace(velocity=time_optimal_profile(length, *limits).velocity)


def is_grid_rest(leg: Leg, one: Junction, two: Junction) -> bool:
    """Return whether the rest of a leg comes only from the grid of the corners at its ends."""
    return one.speed == two.speed and (
        length_left(leg, one, two) <= GRID_REST * leg.segment.distance)


class _Flow:
    """A flow while it is planned."""

    def __init__(
            self, parts: Sequence[FlowPart], limits: Limits, rate: float,
            joins_arcs: bool) -> None:
        paths = [part.path for part in parts if part.path is not None]
        places = [index for index, part in enumerate(parts) if part.is_leg]
        self.limits, self.rate, self.joins_arcs = limits, rate, joins_arcs
        #: the legs from rest to rest, as the motion has them
        self.asked = [paths[index] for index in places]
        #: the legs, with arcs on smaller circles
        length = math.fsum(path.segment.distance for path in self.asked)
        self.legs = [Leg(path.segment, _finite(path.limits, length)) for path in self.asked]
        #: the largest velocity along each leg of the motion [m/s]
        self.tops = [leg.limits.velocity for leg in self.legs]
        #: the turn after each leg
        self.turns = [paths[one + 1] if two > one + 1 else None for one, two in pairwise(places)]
        #: the tolerance of the junction after each leg
        self.tolerances = [min(part.tolerance for part in parts[one:two + 1])
                           for one, two in pairwise(places)]
        #: the junction after each leg
        self.junctions: list[Junction] = [
            self._first_junction(index) for index in range(len(self.turns))]
        #: the runs of arcs, as the indices of their legs
        self.runs = list(self._find_runs())
        for run in self.runs:
            self._plan_run(run, *(leg.segment.distance if leg else 0.0
                                  for leg in (self._line(run, -1), self._line(run, 1))))
        #: how much of the legs each junction replaces with unlimited room [m]
        self.wanted = [Replaced(junction.before, junction.after) for junction in self.junctions]

    def planned(self) -> list[FlowStep]:
        """Return the plan of each part."""
        self._share_room()
        # Each of the two only slows corners down, and may make the other necessary once more.
        for _ in range(PASSES):
            self._keep_legs()
            junctions: list[LegJunction | None] = [None, *self.junctions, None]
            limit_speeds(self.legs, junctions)
        self._remove_grid_rests()
        return self._build()

    def _first_junction(self, index: int) -> Junction:
        """Return the junction after a leg, with all the room of the legs; arcs stop here."""
        one, two = self.legs[index:index + 2]
        speed = min(one.limits.velocity, two.limits.velocity)
        if one.segment.angular or two.segment.angular:
            return ArcJunction(None, speed if is_same(one.segment, two.segment) else 0.0)
        turn = self.turns[index]
        return CornerJunction(
            None if turn is None else CornerTurn(
                turn.segment, turn.limits, one.limits._replace(velocity=speed),
                one.segment.linear, self.rate),
            speed, self.tolerances[index],
            min(one.segment.distance, two.segment.distance))

    def _find_runs(self) -> Iterator[range]:
        """Yield the indices of the legs of each run of arcs."""
        begin = 0
        while begin < len(self.legs):
            end = begin
            while end < len(self.legs) and self.legs[end].segment.angular:
                end += 1
            if end > begin and self.joins_arcs:
                yield range(begin, end)
            begin = max(end, begin + 1)

    def _line(self, run: range, side: int) -> Leg | None:
        """Return the line before a run of arcs (-1) or after it (1); None at a rest."""
        index = run.start - 1 if side < 0 else run.stop
        return self.legs[index] if 0 <= index < len(self.legs) else None

    def _shortest(self, leg: Leg) -> float:
        """Return the least length of a leg between two junctions [m]."""
        return LEG_SHARE / self.rate * leg.limits.velocity

    def _plan_run(self, run: range, *rooms: float) -> None:
        """Plan a run of arcs."""
        ends = []
        for side, room, far in zip((-1, 1), rooms, (run.start - 2, run.stop)):
            speed, line = 0.0, self._line(run, side)
            if line and 0 <= far < len(self.junctions):
                junction = self.junctions[far]
                speed = (junction.speed if isinstance(junction, CornerJunction)
                         else line.limits.velocity)
            ends.append(line and RunEnd(room, line, min(speed, line.limits.velocity)))
        arcs = []
        for index in run:
            around = self.tolerances[max(0, index - 1):index + 1]
            arcs.append(RunArc(self.asked[index].segment, self.tops[index], min(around)))
        planned = _plan_run(ArcRun(tuple(arcs), ends[0], ends[1], self.limits, self.rate))
        self.legs[run.start:run.stop] = planned.legs
        for index, found in enumerate(planned.transitions, run.start - 1):
            if not 0 <= index < len(self.junctions):
                continue
            one, two = self.legs[index:index + 2]
            if found:
                self.junctions[index] = ArcJunction(found, found.speed)
            elif is_same(one.segment, two.segment):
                self.junctions[index] = ArcJunction(
                    None, min(one.limits.velocity, two.limits.velocity))
            else:
                self.junctions[index] = ArcJunction(None, 0.0)

    def _room(self, junction: int, leg: int) -> float:
        """Return how much of a leg a junction may replace [m]."""
        length = self.legs[leg].segment.distance
        other = junction - 1 if leg == junction else junction + 1
        if not 0 <= other < len(self.junctions):
            return length
        wanted = self.wanted[other].after if leg == junction else self.wanted[other].before
        at = self.junctions[other]
        if isinstance(at, ArcJunction) and at.transition:
            wanted = max(0.0, wanted + self._shortest(self.legs[leg]))
        return max(length / 2.0, length - wanted)

    def _share_room(self) -> None:
        """Plan a junction again if its leg is too short because of the other junction."""
        rooms = [Replaced(self._room(index, index), self._room(index, index + 1))
                 for index in range(len(self.junctions))]
        for junction, room in zip(self.junctions, rooms):
            if isinstance(junction, CornerJunction) and min(room) < junction.before:
                junction.room = min(room)
                junction.slow_down(junction.speed)
        for run in self.runs:
            granted, is_short = [0.0, 0.0], False
            for side, index in enumerate((run.start - 1, run.stop - 1)):
                line = self._line(run, 2 * side - 1)
                if line is None:
                    continue
                wanted = max(0.0, self.wanted[index][side] + self._shortest(line))
                granted[side] = min(rooms[index][side], wanted)
                is_short = is_short or granted[side] < wanted
            if is_short:
                self._plan_run(run, *granted)

    def _keep_legs(self) -> None:
        """Shrink corners until each leg between two junctions lasts long enough."""
        for leg, one, two in zip(self.legs[1:], self.junctions, self.junctions[1:]):
            left = length_left(leg, one, two)
            missing = LEG_SHARE / self.rate * max(one.speed, two.speed) - left
            junction = corner_of(one, two)
            # A rest that comes from the grid of the corners is removed later.
            if missing > 0.0 and junction and not is_grid_rest(leg, one, two):
                junction.room = max(0.0, junction.tangent - missing)
                junction.slow_down(junction.speed)

    def _remove_grid_rests(self) -> None:
        """Stretch corners over what is left of legs only because of the grid of the corners."""
        chain, rests = self.junctions[:1], list[float]()
        for leg, one, two in zip(self.legs[1:], self.junctions, self.junctions[1:]):
            if is_grid_rest(leg, one, two):
                chain.append(two)
                rests.append(max(0.0, length_left(leg, one, two)))
            else:
                stretch_corners(chain, rests)
                chain, rests = [two], []
        stretch_corners(chain, rests)

    def _build(self) -> list[FlowStep]:
        """Return the planned steps for the speeds at the junctions."""
        chains = [self._chain(index) for index in range(len(self.junctions))]
        nothing = Replaced(0.0, 0.0)
        lost = [nothing, *(replaced for _, replaced in chains), nothing]
        speeds = [0.0, *(junction.speed for junction in self.junctions), 0.0]
        steps = []
        for index, leg in enumerate(self.legs):
            trajectories = [self._leg(index, lost[index:index + 2], speeds[index:index + 2])]
            if leg.segment.angular:
                if index and not self.legs[index - 1].segment.angular and (
                        before := chains[index - 1][0]):
                    trajectories.insert(0, before)
                if index < len(chains) and (after := chains[index][0]):
                    trajectories.append(after)
            steps.append(FlowStep(
                tuple(trajectories), None, joins_next=speeds[index + 1] > 0.0))
            if index < len(chains) and (turn := self.turns[index]) is not None:
                junction = self.junctions[index]
                assert isinstance(junction, CornerJunction)
                deviation = junction.corner.deviation if junction.corner else 0.0
                cut = Cut(junction.tolerance, deviation,
                          junction.before < self.wanted[index].before * (1.0 - SHRINKAGE))
                steps.append(FlowStep(
                    (chains[index][0] or turn,), cut, joins_next=junction.speed > 0.0))
        return steps

    def _leg(
            self, index: int, lost: Sequence[Replaced], speeds: Sequence[float]) -> Trajectory:
        """Return the trajectory of what the junctions leave of a leg."""
        leg, asked = self.legs[index], self.asked[index]
        if not any(speeds) and leg.segment == asked.segment:
            return asked
        left = max(0.0, leg.segment.distance - lost[0].after - lost[1].before)
        return _leg_between(leg.segment._replace(distance=left), leg.limits, *speeds)

    def _chain(self, index: int) -> tuple[Trajectory | None, Replaced]:
        """Return the path of a junction, if it has one, and what it replaces of both legs [m]."""
        junction = self.junctions[index]
        if isinstance(junction, CornerJunction):
            path = None if junction.corner is None else _path(
                junction.corner, self.limits, junction.stretching)
            return path, Replaced(junction.tangent, junction.tangent)
        if junction.transition is None:
            return None, Replaced(0.0, 0.0)
        one, two = (leg.segment for leg in self.legs[index:index + 2])
        chain, lost = _transition_path(
            junction.transition.bend, junction.speed, one.linear, self.limits)
        return chain, Replaced(lost.before / (abs(one.angular) or 1.0),
                               lost.after / (abs(two.angular) or 1.0))
