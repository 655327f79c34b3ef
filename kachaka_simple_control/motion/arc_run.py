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
Plan a run of arcs within a flow: how much smaller each circle becomes, and the transitions.

A smaller circle leaves a wider gap to its neighbours, and a transition over a wider gap can be
faster.  But it is also longer, so less is left of its neighbours to change the speed.

Tested by test/motion/test_transition.py.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise
import math
from typing import NamedTuple

from kachaka_simple_control.motion.arc_group import ArcGroup, circle_of, is_same, RunArc
from kachaka_simple_control.motion.chain import Axis
from kachaka_simple_control.motion.flow_leg import FlowLeg
from kachaka_simple_control.motion.leg_speeds import Leg, length_left, limit_speeds, Passed
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.transition import Circle, plan_transition, Transition
from kachaka_simple_control.motion.velocity_profile import PathLimits

#: A leg beside a transition or a corner lasts at least this fraction of a period.  A much shorter
#: message between two others would be a jump of the acceleration on the wire.
LEG_SHARE = 0.25
#: A circle becomes smaller by at most this part of its radius.  Then the gap to a line is so
#: narrow that a transition can bridge it with an angle below ``LARGEST_ANGLE``.
LARGEST_SHARE = 0.25
#: How often the offsets of a run are made smaller until its transitions have room.
ROUNDS = 60
#: Offsets are made smaller if less than this part of them would do.
SPARE = 0.95
#: A transition whose offsets have become smaller than this part of the allowed ones is a stop.
SMALLEST = 1e-6
#: The offsets are halved at most this often to find the fastest ones.
HALVINGS = 10
#: The search ends where the time is above the least one by this factor.
WORSE = 1.1
#: While offsets are searched, transitions are estimated with at most this number of arcs.
ESTIMATE = 12
#: How many different transitions are remembered.
REMEMBERED = 4096
#: In a run of at most this number of circles, it is tried whether more stops are faster.
MOST_TRIED = 6


class RunEnd(NamedTuple):
    """
    The straight leg at an end of a run.

    :param room: the length of the leg that the transition may replace [m]
    :param speed: the linear velocity at its other end [m/s]
    """

    room: float
    leg: Leg
    speed: float


class ArcRun(NamedTuple):
    """
    Arcs that follow each other in a flow, with the legs before and after them.

    :param before: the leg before the first arc; None if the robot is at rest there
    :param after: the leg after the last arc; None if the robot is at rest there
    """

    arcs: tuple[RunArc, ...]
    before: RunEnd | None
    after: RunEnd | None
    limits: Limits
    rate: float

    @property
    def turning(self) -> Axis:
        """Return the limits of the angular acceleration."""
        return Axis(self.limits.max_angular_acceleration, self.limits.angular_deceleration)


class RunPlan(NamedTuple):
    """
    The plan of a run of arcs.

    :param transitions: the transition before each arc, and the one after the last arc; None for a
        stop, and where an arc goes on with the same curvature
    """

    legs: tuple[Leg, ...]
    transitions: tuple[Transition | None, ...]


def plan_run(run: ArcRun) -> RunPlan:
    """Return the fastest plan of a run of arcs, within the tolerances."""
    return _Solver(run).fastest()


@dataclass
class _Pass:
    """The speed at which the robot passes a transition of a run, to find the time of the run."""

    speed: float
    before: float = 0.0
    after: float = 0.0
    length: float = 0.0

    def passed(self, speed: float) -> Passed:
        """Return how the transition is passed with at most a speed [m/s]."""
        return Passed(speed, self.before, self.after)

    def slow_down(self, speed: float) -> None:
        """Take a lower speed [m/s]."""
        self.speed = speed


class _Candidate(NamedTuple):
    """A possible plan of a run."""

    stops: tuple[bool, ...]
    offsets: tuple[float, ...]
    time: float
    is_slowed: bool


@dataclass
class _Solver:
    """The search for the plan of a run."""

    run: ArcRun
    groups: list[ArcGroup] = field(init=False)
    #: transitions by all that they depend on: most offsets stay as they are in a round
    _known: dict[tuple[object, ...], Transition | None] = field(init=False, default_factory=dict)
    _crossing: list[bool] = field(init=False)

    def __post_init__(self) -> None:
        self.groups = []
        for arc in self.run.arcs:
            if self.groups and is_same(self.groups[-1].arcs[-1].segment, arc.segment):
                self.groups[-1].arcs.append(arc)
            else:
                self.groups.append(ArcGroup([arc]))
        self._crossing = [
            any(one.sign != group.sign for one in self.groups[max(0, index - 1):index + 2])
            for index, group in enumerate(self.groups)]

    def fastest(self) -> RunPlan:
        """Return the fastest plan that is found."""
        rest = [True] * (len(self.groups) + 1)
        best = _Candidate(tuple(rest), (0.0,) * len(self.groups), self._timed(
            [None] * len(rest))[0], True)
        ends = [self.run.before is None, *[False] * (len(self.groups) - 1),
                self.run.after is None]
        chosen = self._fastest_with(ends, best)
        # A stop more may be faster: the circle beside it may be nearer to the path.
        while (chosen.is_slowed or len(self.groups) > 1) and len(self.groups) <= MOST_TRIED:
            best = chosen
            for index, stop in enumerate(ends):
                if not stop:
                    more = [*ends[:index], True, *ends[index + 1:]]
                    chosen = self._fastest_with(more, chosen)
            if chosen is best or chosen.stops == best.stops:
                break
            ends = list(chosen.stops)
        return self._exact(chosen)

    def _fastest_with(self, stops: Sequence[bool], best: _Candidate) -> _Candidate:
        """Return the fastest candidate with some stops, or another one if that is faster."""
        if all(stops):
            return best
        scale, least = 1.0, math.inf
        for _ in range(HALVINGS):
            transitions, ends = self._transitions(stops, scale)
            if not any(transitions):
                scale /= 2.0
                continue
            # Half of the offsets for which there was room are tried next.
            scale = 0.5 * min(scale, max(
                group.offset / (self._allowed(index, ends) or math.inf)
                for index, group in enumerate(self.groups)))
            time, is_slowed = self._timed(transitions)
            if time < best.time:
                best = _Candidate(
                    tuple(ends), tuple(group.offset for group in self.groups), time, is_slowed)
            if not is_slowed or time > WORSE * least:
                break
            least = min(least, time)
        return best

    def _exact(self, chosen: _Candidate) -> RunPlan:
        """Return the exact plan of a candidate, of which the transitions were only estimated."""
        for group, offset in zip(self.groups, chosen.offsets):
            group.offset = offset
        for _ in range(ROUNDS):
            transitions = [None if stop else self._transition(index, chosen.stops, None)
                           for index, stop in enumerate(chosen.stops)]
            if [transition is None for transition in transitions] != list(chosen.stops):
                break
            # An exact transition can be longer than its estimate.
            shares = self._room_shares(transitions)
            if all(share >= 1.0 for share in shares):
                return self._plan(transitions)
            self._shrink(shares)
            self._balance(chosen.stops)
        return self._plan([None] * len(chosen.stops))

    def _transitions(
            self, stops: Sequence[bool],
            scale: float) -> tuple[list[Transition | None], list[bool]]:
        """Return the transitions for a part of the allowed offsets, if they have room."""
        ends = list(stops)
        while True:
            allowed = [self._allowed(index, ends) for index in range(len(self.groups))]
            for group, offset in zip(self.groups, allowed):
                group.offset = scale * offset
            transitions, found = self._fitted(ends, allowed)
            if found == ends:
                return transitions, ends
            ends = found

    def _allowed(self, index: int, stops: Sequence[bool]) -> float:
        """Return the largest offset that the tolerance allows [m]."""
        group = self.groups[index]
        if stops[index] and stops[index + 1]:
            return 0.0
        tolerance = min(arc.tolerance for arc in group.arcs)
        largest = LARGEST_SHARE * group.radius
        if stops[index] or stops[index + 1]:
            # The circle touches the path at a stop, and is farthest away half a turn later.
            half = math.sin(min(group.angle, math.pi) / 2.0)
            return min(largest, tolerance / max(2.0 * half * half, 1e-300))
        return min(largest, tolerance)

    def _reach(self, index: int, stops: Sequence[bool]) -> float:
        """Return how far inside a circle is at its transition, for each metre of its offset."""
        if stops[index] or stops[index + 1]:
            return 1.0 - math.cos(self.groups[index].angle)
        return 1.0

    def _balance(self, stops: Sequence[bool]) -> None:
        """Make offsets smaller so that a larger circle leaves a gap to a smaller one in it."""
        order = list(range(len(self.groups) - 1))
        for index in [*order, *reversed(order)]:
            if stops[index + 1]:
                continue
            pair = sorted((index, index + 1), key=lambda one: self.groups[one].radius)
            small, large = (self.groups[one] for one in pair)
            if small.sign != large.sign:
                continue
            inside = small.offset * self._reach(pair[0], stops)
            reach = self._reach(pair[1], stops)
            if large.offset * reach > inside * small.radius / large.radius:
                large.offset = inside * small.radius / large.radius / reach

    def _fitted(
            self, stops: Sequence[bool],
            allowed: Sequence[float]) -> tuple[list[Transition | None], list[bool]]:
        """
        Make offsets smaller until the transitions have room, and return the transitions.

        :returns: the transitions, and at which junctions the robot stops now
        """
        for _ in range(ROUNDS):
            self._balance(stops)
            transitions = [
                None if stop or self._is_tiny(index, allowed) else self._transition(index, stops)
                for index, stop in enumerate(stops)]
            found = [transition is None for transition in transitions]
            if found != list(stops):
                return transitions, found
            shares = self._shares(transitions)
            if all(share >= 1.0 for share in shares):
                return transitions, found
            self._shrink(shares)
        return [None] * len(stops), [True] * len(stops)

    def _shrink(self, shares: Sequence[float]) -> None:
        """Make the offset of each circle smaller by a little more than its factor below 1."""
        for group, share in zip(self.groups, shares):
            if share < 1.0:
                group.offset *= max(0.25, 0.98 * share)

    def _is_tiny(self, index: int, allowed: Sequence[float]) -> bool:
        """Return whether the offsets of the circles at a transition have become too small."""
        return all(self.groups[one].offset <= SMALLEST * allowed[one]
                   for one in range(max(0, index - 1), min(len(self.groups), index + 1)))

    def _transition(
            self, index: int, stops: Sequence[bool], most: int | None = ESTIMATE,
    ) -> Transition | None:
        """
        Return the transition before a circle, or after the last one; None if it is impossible.

        :param most: the number of arcs to estimate it with; None for the exact transition
        """
        beside = range(max(0, index - 1), min(len(self.groups), index + 1))
        known = (index, most, *((self.groups[place].offset, stops[place], stops[place + 1])
                                for place in beside))
        if known not in self._known:
            self._known[known] = self._new_transition(index, stops, most)
        return self._known[known]

    def _new_transition(
            self, index: int, stops: Sequence[bool], most: int | None) -> Transition | None:
        one, two = Circle(0.0), Circle(0.0)
        speeds = []
        if index:
            group = self.groups[index - 1]
            one = circle_of(group, stops[index - 1], -1.0)
            speeds.append(self._limits(index - 1, -1).velocity)
        elif self.run.before:
            speeds.append(self.run.before.leg.limits.velocity)
        if index < len(self.groups):
            group = self.groups[index]
            two = circle_of(group, stops[index + 1], 1.0)
            speeds.append(self._limits(index, 0).velocity)
        elif self.run.after:
            speeds.append(self.run.after.leg.limits.velocity)
        return _plan_transition(
            one, two, min(speeds), self.run.turning, self.run.limits.max_angular_jerk,
            self.run.rate, most)

    def _limits(self, index: int, arc: int) -> PathLimits:
        """Return the limits along the first arc (0) or the last arc (-1) of a circle."""
        group = self.groups[index]
        return group.limits(group.arcs[arc], self.run.limits, self._crossing[index])

    def _shares(self, transitions: Sequence[Transition | None]) -> list[float]:
        """
        Return by which factor the offset of each circle may be multiplied.

        :returns: for each circle a factor; below 1 its transitions have not enough room, or are
            wider than the speed limits need
        """
        shares = self._room_shares(transitions)
        for index in range(len(self.groups)):
            sides = [transition for transition in transitions[index:index + 2] if transition]
            # An offset that no transition of the circle needs is not used.
            needed = max((1.0 / transition.spare ** 2 for transition in sides), default=1.0)
            if needed < SPARE:
                shares[index] = min(shares[index], needed)
        return shares

    def _room_shares(self, transitions: Sequence[Transition | None]) -> list[float]:
        """Return by which factor the offset of each circle may be multiplied for its room."""
        shares = [1.0] * len(self.groups)
        for first, last, needed, room in self._rooms(transitions):
            if needed > max(0.0, room):
                # The replaced length grows with the square root of the offsets.
                share = (max(0.0, room) / needed) ** 2
                for index in range(max(0, first), min(len(self.groups), last + 1)):
                    shares[index] = min(shares[index], share)
        return shares

    def _rooms(
            self,
            transitions: Sequence[Transition | None]) -> Iterator[tuple[int, int, float, float]]:
        """
        Yield how much of each leg transitions replace, and how much they may replace.

        :returns: the indices of the first and the last circle whose offsets matter, how much the
            transitions replace [m], and how much they may replace [m]
        """
        for index, end in ((0, self.run.before), (len(self.groups), self.run.after)):
            transition = transitions[index]
            if transition and end:
                yield (index - 1, index, transition.after if index else transition.before,
                       end.room - self._least(transition.speed))
        for index, group in enumerate(self.groups):
            one, two = transitions[index:index + 2]
            lost = (one.after if one else 0.0, two.before if two else 0.0)
            least = self._least(max(side.speed if side else 0.0 for side in (one, two)))
            lengths = [(group.radius - group.offset) * arc.angle - least for arc in group.arcs]
            if len(lengths) == 1:
                yield index - 1, index + 1, math.fsum(lost), lengths[0]
            else:
                yield index - 1, index, lost[0], lengths[0]
                yield index, index + 1, lost[1], lengths[-1]

    def _least(self, speed: float) -> float:
        """Return the least length of a leg beside a transition with a speed [m]."""
        return LEG_SHARE / self.run.rate * speed

    def _plan(self, transitions: Sequence[Transition | None]) -> RunPlan:
        """Return the plan for transitions; without any transition the circles keep their radii."""
        if not any(transitions):
            for group in self.groups:
                group.offset = 0.0
        legs: list[Leg] = []
        between: list[Transition | None] = []
        for index, group in enumerate(self.groups):
            crosses = self._crossing[index] and any(transitions)
            between += [transitions[index], *[None] * (len(group.arcs) - 1)]
            legs += [Leg(group.segment(arc), group.limits(arc, self.run.limits, crosses))
                     for arc in group.arcs]
        return RunPlan(tuple(legs), (*between, transitions[-1]))

    def _timed(self, transitions: Sequence[Transition | None]) -> tuple[float, bool]:
        """Return how long the run takes with the legs before and after it [s]."""
        plan = self._plan(transitions)
        legs = list(plan.legs)
        passes: list[_Pass | None] = [
            one and _Pass(one.speed, one.before, one.after, one.length)
            for one in plan.transitions]
        for index, (one, two) in enumerate(pairwise(legs), 1):
            if is_same(one.segment, two.segment):
                passes[index] = _Pass(min(one.limits.velocity, two.limits.velocity))
        first = last = 0.0
        if self.run.before:
            first = self.run.before.speed
            legs.insert(0, _shortened(self.run.before))
            passes.insert(0, None)
        if self.run.after:
            last = self.run.after.speed
            legs.append(_shortened(self.run.after))
            passes.append(None)
        wanted = [one.speed if one else 0.0 for one in passes]
        limit_speeds(legs, passes, first, last)
        speeds = [one.speed if one else 0.0 for one in passes]
        speeds[0], speeds[-1] = first or speeds[0], last or speeds[-1]
        time = math.fsum(one.length / one.speed for one in passes if one and one.speed)
        for index, leg in enumerate(legs):
            left = max(0.0, length_left(leg, *passes[index:index + 2]))
            time += FlowLeg.between(
                leg.segment._replace(distance=left), leg.limits, *speeds[index:index + 2]).duration
        return time, any(one < two for one, two in zip(speeds[1:-1], wanted[1:-1]))


_plan_transition = lru_cache(REMEMBERED)(plan_transition)


def _shortened(end: RunEnd) -> Leg:
    return end.leg._replace(segment=end.leg.segment._replace(distance=end.room))
