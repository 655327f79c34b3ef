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
"""Check the steps of a motion against limits, and make trajectories of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import math
from typing import NamedTuple, Protocol

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.steps import (
    Arc,
    Forward,
    Motion,
    Move,
    Repeat,
    Step,
    Turn,
    Wait,
)
from kachaka_simple_control.motion.velocity_profile import time_optimal_profile, VelocityProfile

#: A step that says where to be.
Goal = Forward | Turn | Arc


class PathSegment(NamedTuple):
    """
    A path with a constant curvature, in its own unit u: metres, or radians for a turn in place.

    :param distance: how long it is [u], not negative
    :param linear: metres forward for each u: 1, 0 or -1
    :param angular: radians to the left for each u
    """

    distance: float
    linear: float
    angular: float

    @property
    def length(self) -> float:
        """Return how far it goes [m], negative backwards."""
        return self.linear * self.distance

    @property
    def angle(self) -> float:
        """Return how far it turns [rad], positive to the left."""
        return self.angular * self.distance


class PathLimits(NamedTuple):
    """
    The limits along a path; each is positive or infinite.

    :param velocity: largest velocity [u/s]
    :param acceleration: largest acceleration [u/s^2]
    :param deceleration: largest deceleration [u/s^2]
    :param jerk: largest jerk [u/s^3]
    """

    velocity: float
    acceleration: float
    deceleration: float
    jerk: float


def path_segment(goal: Goal) -> PathSegment:
    """
    Return the path of a goal.

    :param goal: the goal
    :returns: its path
    """
    if isinstance(goal, Forward):
        distance = float(goal.distance)
        return PathSegment(abs(distance), math.copysign(1.0, distance), 0.0)
    angle = float(goal.angle)
    sign = math.copysign(1.0, angle)
    if isinstance(goal, Turn):
        return PathSegment(abs(angle), 0.0, sign)
    radius = float(goal.radius)
    return PathSegment(abs(radius * angle), sign, sign / radius)


def limits_along(way: PathSegment, limits: Limits) -> PathLimits:
    """
    Return what a robot's limits are along a path: the tighter of the linear and the angular ones.

    :param way: the path
    :param limits: what the robot can do
    :returns: the limits in the path's unit, (13) in docs/theory.md
    """
    forward = limits.backward_velocity if way.linear < 0.0 else limits.max_linear_velocity
    return PathLimits(
        _tighter(way, forward, limits.max_angular_velocity),
        _tighter(way, limits.max_linear_acceleration, limits.max_angular_acceleration),
        _tighter(way, limits.linear_deceleration, limits.angular_deceleration),
        _tighter(way, limits.max_linear_jerk, limits.max_angular_jerk))


def _tighter(way: PathSegment, linear: float, angular: float) -> float:
    if not way.linear:
        return angular
    if not way.angular:
        return linear
    bend = abs(way.angular)
    limit = angular / bend
    # A velocity that rounding took beyond the limit would be refused in mid-motion.
    return min(linear, limit if limit * bend <= angular else math.nextafter(limit, 0.0))


#: A last tick shorter than this part of a period is rounding, not a tick.
TIME_TOLERANCE = 1e-9


class StepTrajectory(Protocol):
    """What the planner needs of a step."""

    @property
    def duration(self) -> float:
        """Return how long it takes [s]."""

    @property
    def length(self) -> float:
        """Return how far it goes [m], negative backwards."""

    @property
    def angle(self) -> float:
        """Return how far it turns [rad], positive to the left."""

    def ticks(self, rate: float) -> int:
        """
        Return in how many parts of equal length it is sent, each with its own velocity.

        :param rate: how often a velocity is sent [Hz]
        :returns: the number of parts; 0 if it takes no time
        """

    def velocities(self, rate: float) -> list[Velocity]:
        """
        Return what is sent.

        :param rate: how often a velocity is sent [Hz]
        :returns: a velocity for each part
        """


@dataclass(frozen=True)
class ConstantVelocity:
    """
    One velocity, held for a time.

    :param velocity: the velocity
    :param duration: how long it is held [s]
    """

    velocity: Velocity
    duration: float

    @property
    def length(self) -> float:
        """Return how far it goes [m], negative backwards."""
        return self.velocity.linear_x * self.duration

    @property
    def angle(self) -> float:
        """Return how far it turns [rad], positive to the left."""
        return self.velocity.angular_z * self.duration

    def ticks(self, rate: float) -> int:  # noqa: ARG002
        """
        Return 1, or 0 if it takes no time: whoever plays it repeats the velocity at the rate.

        :param rate: how often a velocity is sent [Hz]
        :returns: the number of parts
        """
        return 1 if self.duration else 0

    def velocities(self, rate: float) -> list[Velocity]:
        """
        Return the velocity, once.

        :param rate: how often a velocity is sent [Hz]
        :returns: a velocity for each part
        """
        return [self.velocity] * self.ticks(rate)


@dataclass(frozen=True)
class ProfiledPath:
    """
    A path, from rest to rest, along a profile.

    :param way: the path
    :param profile: how it is driven
    """

    way: PathSegment
    profile: VelocityProfile

    @property
    def duration(self) -> float:
        """Return how long it takes [s]."""
        return self.profile.duration

    @property
    def length(self) -> float:
        """Return how far it goes [m], negative backwards."""
        return self.way.length

    @property
    def angle(self) -> float:
        """Return how far it turns [rad], positive to the left."""
        return self.way.angle

    def ticks(self, rate: float) -> int:
        """
        Return in how many parts of equal length it is sent: none longer than a period.

        :param rate: how often a velocity is sent [Hz]
        :returns: the number of parts; 0 if it takes no time
        """
        if not self.duration:
            return 0
        return max(1, math.ceil(self.duration * rate * (1.0 - TIME_TOLERANCE)))

    def velocities(self, rate: float) -> list[Velocity]:
        """
        Return what is sent: in each part the mean of the profile over it.

        :param rate: how often a velocity is sent [Hz]
        :returns: a velocity for each part
        """
        count = self.ticks(rate)
        if not count:
            return []
        linear, angular, top = self.way.linear, self.way.angular, self.profile.velocity
        # A cruise is one velocity many times over, and one object.
        cruising = Velocity(linear * top, angular * top)
        return [
            cruising if mean == top else Velocity(linear * mean, angular * mean)
            for mean in self.profile.means(count)]


# Compared by identity: whatever is repeated is one object.
@dataclass(frozen=True, eq=False)
class PlannedItem:
    """
    A step at its place in a motion, under limits.

    :param path: its place, as in ``steps[3].repeat.steps[0]``
    :param step: the step; never a repeat
    :param course: what it comes to
    """

    path: str
    step: Step
    course: StepTrajectory


@dataclass(frozen=True, eq=False)
class RepeatBlock:
    """
    Some legs that are driven several times.

    :param times: how often
    :param parts: what is driven each time
    """

    times: int
    parts: Sequence[Part]


#: What a motion is driven as.
Part = PlannedItem | RepeatBlock


def total(parts: Sequence[Part], measure: Callable[[PlannedItem], float]) -> float:
    """
    Add something up over all legs, looking at each but once.

    :param parts: what is driven
    :param measure: what to add
    :returns: the sum, all repeats counted
    """
    return sum(
        measure(part) if isinstance(part, PlannedItem) else part.times * total(part.parts, measure)
        for part in parts)


def expand(parts: Sequence[Part]) -> list[PlannedItem]:
    """
    Return the legs one after the other.

    :param parts: what is driven
    :returns: every leg as often as it is driven
    """
    legs: list[PlannedItem] = []
    for part in parts:
        if isinstance(part, PlannedItem):
            legs.append(part)
        else:
            legs += expand(part.parts) * part.times
    return legs


#: How many steps a motion may have, all repeats counted.
MAX_STEPS = 1_000_000
#: How long a motion may take [s]: a day.
MAX_DURATION = 86_400.0
#: A speed may be this part above a limit: what rounding makes of the same number.
ROUNDING = 1e-9
#: Stands for what cannot be driven.
NOTHING = ConstantVelocity(ZERO, 0.0)


def find_errors(motion: Motion, limits: Limits) -> list[InvalidMotionError]:
    """
    Find all that is wrong with a motion for a robot.

    :param motion: what to do
    :param limits: what the robot can do
    :returns: the errors, in the order of the motion; none if it can be planned, at any rate that
        leaves it fewer than ``MAX_SEGMENTS`` velocities
    """
    return MotionValidator(motion, limits).errors


class MotionValidator:
    """
    A motion held against limits; each step is looked at once, however often it is repeated.

    :ivar parts: what there is to drive, if nothing is wrong
    :ivar errors: all that is wrong, in the order of the motion
    """

    def __init__(self, motion: Motion, limits: Limits) -> None:
        """
        Look at each step.

        :param motion: what to do
        :param limits: what the robot can do
        """
        self._limits = limits
        self.errors: list[InvalidMotionError] = []
        self.parts = self._parts(motion.steps, '')
        count = total(self.parts, lambda _: 1)
        if count > MAX_STEPS:
            self._refuse(f'the motion has {count:.10g} steps, its repeats counted; it may have '
                         f'{MAX_STEPS} at most')
        duration = total(self.parts, lambda leg: leg.course.duration)
        if duration > MAX_DURATION:
            self._refuse(f'the motion takes {duration:.10g} s, its repeats counted; it may take '
                         f'{MAX_DURATION:.10g} s at most')

    def _refuse(self, message: str, path: str | None = None) -> None:
        self.errors.append(InvalidMotionError(message, path))

    def _parts(self, steps: Sequence[Step], prefix: str) -> list[Part]:
        return [self._part(step, f'{prefix}steps[{index}]') for index, step in enumerate(steps)]

    def _part(self, step: Step, path: str) -> Part:
        if isinstance(step, Repeat):
            return RepeatBlock(step.times, self._parts(step.steps, f'{path}.repeat.'))
        return PlannedItem(path, step, self._course(step, f'{path}.{type(step).__name__.lower()}'))

    def _course(self, step: Move | Wait | Goal, place: str) -> StepTrajectory:
        if isinstance(step, Move):
            return self._move(step, place)
        if isinstance(step, Wait):
            return self._held(ConstantVelocity(ZERO, float(step.duration)), place)
        return self._goal(step, place)

    def _move(self, step: Move, place: str) -> StepTrajectory:
        velocity = step.velocity
        limits = self._limits
        self._try(limits.check_linear, velocity.linear_x, f'{place}.linear_x')
        self._try(limits.check_angular, velocity.angular_z, f'{place}.angular_z')
        return self._held(ConstantVelocity(velocity, float(step.duration)), place)

    def _try(self, check: Callable[[float], None], value: float, path: str) -> None:
        try:
            check(value)
        except InvalidMotionError as error:
            self._refuse(error.message, path)

    def _held(self, course: ConstantVelocity, place: str) -> StepTrajectory:
        if course.duration <= MAX_DURATION:
            return course
        self._refuse(f'{course.duration} s is too long; a motion may take {MAX_DURATION:.10g} s '
                     'at most', f'{place}.duration')
        return NOTHING

    def _goal(self, goal: Goal, place: str) -> StepTrajectory:
        way = path_segment(goal)
        bounds = self._bounds(goal, limits_along(way, self._limits), place)
        if bounds is None:
            return NOTHING
        # From below, and before the profile: no arithmetic meets what is out of all proportion.
        duration = way.distance / bounds.velocity
        if duration <= MAX_DURATION:
            course = ProfiledPath(way, time_optimal_profile(way.distance, *bounds))
            duration = course.duration
            if duration <= MAX_DURATION:
                return course
        name, unit = ('distance', 'm') if isinstance(goal, Forward) else ('angle', 'rad')
        self._refuse(f'{getattr(goal, name)} {unit} takes {duration:.10g} s; a motion may take '
                     f'{MAX_DURATION:.10g} s at most', f'{place}.{name}')
        return NOTHING

    def _bounds(self, goal: Goal, bounds: PathLimits, place: str) -> PathLimits | None:
        unit = 'rad/s' if isinstance(goal, Turn) else 'm/s'
        if goal.speed is not None:
            speed = float(goal.speed)
            if speed > bounds.velocity * (1.0 + ROUNDING):
                self._refuse(f'{speed} {unit} is above the limit of {bounds.velocity:.10g} {unit}'
                             f'{_reason(goal)}', f'{place}.speed')
            bounds = PathLimits(min(speed, bounds.velocity), *bounds[1:])
        if min(bounds) < math.inf:
            return bounds
        self._refuse('it is not given, and the robot has no limit either; give one',
                     f'{place}.speed')
        return None


def _reason(goal: Goal) -> str:
    if isinstance(goal, Arc):
        return f' along a radius of {goal.radius} m'
    return ' backwards' if isinstance(goal, Forward) and goal.distance < 0.0 else ''
