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
"""Compare where motions were planned to end with where odometry sees the robot at rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import math

from kachaka_simple_control.motion.calibration import OdometryCalibration
from kachaka_simple_control.motion.geometry import (
    compose,
    Displacement,
    distance_between,
    Pose,
)
from kachaka_simple_control.motion.units import ANGLE_TOLERANCE, TOLERANCE, UnitError
from kachaka_simple_control.text import quoted


@dataclass(frozen=True)
class EndTolerance:
    """How far from the plan a motion may end, by odometry: distance [m] and angle [rad]."""

    distance: float = 0.02
    angle: float = math.radians(3.0)

    @classmethod
    def parse(cls, text: str) -> EndTolerance:
        """
        Return the tolerance that a text says, as in ``2cm`` or ``2cm,3deg``.

        :raises UnitError: if the text is something else
        """
        length, has_angle, angle = (part.strip() for part in text.partition(','))
        try:
            distance = TOLERANCE.parse(length)
            return cls(distance, ANGLE_TOLERANCE.parse(angle)) if has_angle else cls(distance)
        except UnitError as error:
            raise UnitError(
                f'{quoted(text, 60)}: {error}; for example 2cm or 2cm,3deg') from None

    def __str__(self) -> str:
        """Return the tolerance as text, as in ``2 cm or 3 deg``."""
        return f'{self.distance * 100.0:g} cm or {math.degrees(self.angle):g} deg'


#: The problem of an end that could not be measured.
UNSEEN = (
    'the end cannot be compared with the plan, for odometry does not show the robot at rest; '
    'leave out within, or see that odometry arrives')


class EndCheck:
    """
    Measures how far from the plan a robot came to rest, by odometry.

    Motions that follow each other without a rest count as one.  The thread that drives calls
    ``begin`` and ``on_complete``; any thread may call the others.
    """

    def __init__(self, odometry: OdometryCalibration | None) -> None:
        self._odometry = odometry
        self._reported: Pose | None = None
        self._floor: Pose | None = None
        self._goal: Pose | None = None
        self._is_complete = False

    def on_odometry(self, pose: Pose) -> None:
        """Take the newest pose that odometry reports."""
        if self._odometry is None or self._floor is None or self._reported is None:
            self._floor = pose
        else:
            self._floor = self._odometry.advance_on_floor(self._floor, self._reported, pose)
        self._reported = pose

    def begin(self) -> None:
        """Begin a motion: from the goal of the one before, or from where the robot rests."""
        if not self._is_complete:
            self._goal = self._floor
        self._is_complete = False

    def on_complete(self, way: Pose) -> None:
        """Move the goal on by the way of a plan that was driven to its end."""
        if self._goal is not None:
            self._goal, self._is_complete = compose(self._goal, way), True

    def at_rest(self) -> Displacement | None:
        """
        Return how far from the goal the robot rests, and forget the goal.

        :returns: None if the last motion was not driven to its end, or without odometry
        """
        is_complete, self._is_complete = self._is_complete, False
        if not is_complete or self._goal is None or self._floor is None:
            return None
        return Displacement(*distance_between(self._goal, self._floor))


def describe_end(error: Displacement, tolerance: EndTolerance) -> str | None:
    """Return a sentence about an end that is too far from the plan; None if it is near enough."""
    if error.distance <= tolerance.distance and abs(error.angle) <= tolerance.angle:
        return None
    return (
        f'the robot came to rest {error.distance * 100.0:.1f} cm and '
        f'{abs(math.degrees(error.angle)):.1f} deg from the planned end, by odometry, more than '
        f'{tolerance}')


class EndJudge:
    """
    Says of a robot that was stopped whether it rests near enough to the planned end.

    :param within: the tolerance, as text; a drive that misses it fails.  Empty: it only warns
    :param is_still: whether odometry shows the robot at rest
    """

    def __init__(
            self, check: EndCheck, within: str, is_still: Callable[[], bool],
            warn: Callable[[str], object]) -> None:
        self._check, self._is_still, self._warn = check, is_still, warn
        self._within = EndTolerance.parse(within) if within else None
        #: why the last end is not within the tolerance
        self.problem: str | None = None

    @property
    def is_strict(self) -> bool:
        """Return whether an end outside of the tolerance is a fault."""
        return self._within is not None

    def on_stopped(self) -> None:
        """Judge the end; called when the stop is complete."""
        error = self._check.at_rest()
        if error is None or not self._is_still():
            return
        self.problem = describe_end(error, self._within or EndTolerance())
        if self.problem is not None and not self.is_strict:
            self._warn(f'{self.problem}; --report shows where it left the plan, and --within lets '
                       'such a drive fail')
