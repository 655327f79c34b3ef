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
"""Look a whole motion over before any of it is planned, and find all that is wrong with it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math

from kachaka_simple_control.motion.course import Course, Driven, Held
from kachaka_simple_control.motion.errors import InvalidMotionError
from kachaka_simple_control.motion.kinematics import ZERO
from kachaka_simple_control.motion.leg import Leg, Part, Round, total
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.profile import quickest
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
from kachaka_simple_control.motion.way import along, Goal, way_of, WayLimits

#: How many steps a motion may have, all repeats counted.
MAX_STEPS = 1_000_000
#: How long a motion may take [s]: a day.
MAX_DURATION = 86_400.0
#: A speed may be this part above a limit: what rounding makes of the same number.
ROUNDING = 1e-9
#: Stands for what cannot be driven.
NOTHING = Held(ZERO, 0.0)


def find_errors(motion: Motion, limits: Limits) -> list[InvalidMotionError]:
    """
    Find all that is wrong with a motion for a robot.

    :param motion: what to do
    :param limits: what the robot can do
    :returns: the errors, in the order of the motion; none if it can be planned, at any rate that
        leaves it fewer than ``MAX_SEGMENTS`` velocities
    """
    return Survey(motion, limits).errors


class Survey:
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
            return Round(step.times, self._parts(step.steps, f'{path}.repeat.'))
        return Leg(path, step, self._course(step, f'{path}.{type(step).__name__.lower()}'))

    def _course(self, step: Move | Wait | Goal, place: str) -> Course:
        if isinstance(step, Move):
            return self._move(step, place)
        if isinstance(step, Wait):
            return self._held(Held(ZERO, float(step.duration)), place)
        return self._goal(step, place)

    def _move(self, step: Move, place: str) -> Course:
        velocity = step.velocity
        limits = self._limits
        self._try(limits.check_linear, velocity.linear_x, f'{place}.linear_x')
        self._try(limits.check_angular, velocity.angular_z, f'{place}.angular_z')
        return self._held(Held(velocity, float(step.duration)), place)

    def _try(self, check: Callable[[float], None], value: float, path: str) -> None:
        try:
            check(value)
        except InvalidMotionError as error:
            self._refuse(error.message, path)

    def _held(self, course: Held, place: str) -> Course:
        if course.duration <= MAX_DURATION:
            return course
        self._refuse(f'{course.duration} s is too long; a motion may take {MAX_DURATION:.10g} s '
                     'at most', f'{place}.duration')
        return NOTHING

    def _goal(self, goal: Goal, place: str) -> Course:
        way = way_of(goal)
        bounds = self._bounds(goal, along(way, self._limits), place)
        if bounds is None:
            return NOTHING
        # From below, and before the profile: no arithmetic meets what is out of all proportion.
        duration = way.distance / bounds.velocity
        if duration <= MAX_DURATION:
            course = Driven(way, quickest(way.distance, *bounds))
            duration = course.duration
            if duration <= MAX_DURATION:
                return course
        name, unit = ('distance', 'm') if isinstance(goal, Forward) else ('angle', 'rad')
        self._refuse(f'{getattr(goal, name)} {unit} takes {duration:.10g} s; a motion may take '
                     f'{MAX_DURATION:.10g} s at most', f'{place}.{name}')
        return NOTHING

    def _bounds(self, goal: Goal, bounds: WayLimits, place: str) -> WayLimits | None:
        unit = 'rad/s' if isinstance(goal, Turn) else 'm/s'
        if goal.speed is not None:
            speed = float(goal.speed)
            if speed > bounds.velocity * (1.0 + ROUNDING):
                self._refuse(f'{speed} {unit} is above the limit of {bounds.velocity:.10g} {unit}'
                             f'{_reason(goal)}', f'{place}.speed')
            bounds = WayLimits(min(speed, bounds.velocity), *bounds[1:])
        if min(bounds) < math.inf:
            return bounds
        self._refuse('it is not given, and the robot has no limit either; give one',
                     f'{place}.speed')
        return None


def _reason(goal: Goal) -> str:
    if isinstance(goal, Arc):
        return f' along a radius of {goal.radius} m'
    return ' backwards' if isinstance(goal, Forward) and goal.distance < 0.0 else ''
