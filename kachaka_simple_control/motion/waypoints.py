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
"""The steps that drive to points: ``Goto`` and ``Waypoints``."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
import math

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion import units
from kachaka_simple_control.motion.geometry import ORIGIN, Point, Pose, shorter_turn
from kachaka_simple_control.motion.path_segment import PathSegment
from kachaka_simple_control.motion.step_base import (
    as_point,
    as_points,
    in_file,
    PlacedStep,
    PointField,
    PointList,
    Refuse,
    Step,
)
from kachaka_simple_control.motion.steps import Forward, Turn
from kachaka_simple_control.motion.units import format_number
from kachaka_simple_control.text import pluralize

#: A point must be at least this far from where the robot is before it drives there [m].
MIN_LEG = 1e-3
#: A turn before or after a leg that is smaller than this is rounding, and is left out [rad].
MIN_TURN = 1e-10
#: How the fields ``heading`` and ``speed`` are written in a file.
HEADING = in_file(
    units.ANGLE, 'Where to look then, seen from where the motion began.  Left out: as it came.',
    '0 deg')
SPEED = in_file(
    units.POSITIVE_LINEAR_VELOCITY,
    'Drive no faster than this.  Left out: as fast as the limits allow.', '0.2 m/s')


@dataclass(frozen=True)
class Goto(Step):
    """
    Turn to a point the shorter way, and drive there; then turn to a heading, if it is given.

    The point and the heading are seen from where the motion began.

    :param point: x and y of the point [m]: x ahead and y to the left of where the motion began
    :param heading: the heading at the end [rad]: 0 as at the start of the motion, positive to the
        left; None to keep that of the way
    :param speed: drive no faster than this [m/s], positive; None: as fast as the limits allow
    """

    is_placed = True
    synonyms = ('goal', 'drive_to', 'move_to', 'go_to', 'position')
    point: Point = field(metadata=in_file(
        PointField(), 'Where to: x is ahead and y is to the left of where the motion began.',
        ['1 m', '0.5 m']))
    heading: float | None = field(default=None, metadata=HEADING)
    speed: float | None = field(default=None, metadata=SPEED)

    def __post_init__(self) -> None:
        """Check each value, and keep the point as a pair of floats."""
        super().__post_init__()
        object.__setattr__(self, 'point', as_point('point', self.point))

    def placed(self, pose: Pose, refuse: Refuse) -> tuple[list[PlacedStep], Pose]:
        """Return the turns and the leg to the point; refuse if the robot is there already."""
        return _to_points((('point', self.point),), self.heading, self.speed, pose, refuse)

    def path(self) -> tuple[PathSegment, ...]:
        """Return the segments of the path of a motion that begins with this step."""
        return _path(self)

    def describe(self) -> str:
        """Return the point as text."""
        return f'goto {_text(self.point)}'


@dataclass(frozen=True)
class Waypoints(Step):
    """
    Drive from point to point; then turn to a heading, if it is given.

    The robot turns to each point the shorter way.  The points and the heading are seen from where
    the motion began.

    :param points: x and y of each point [m]: x ahead and y to the left of where the motion began;
        a list is converted to a tuple
    :param heading: the heading at the end [rad]: 0 as at the start of the motion, positive to the
        left; None to keep that of the last leg
    :param speed: drive no faster than this [m/s], positive; None: as fast as the limits allow
    :param corners: how far the robot may pass the points between the first and the last one, to
        drive through them without a stop [m]; None: as the motion says
    """

    is_placed = True
    synonyms = ('waypoint', 'points', 'route', 'path', 'follow')
    points: tuple[Point, ...] = field(metadata=in_file(
        PointList(), 'Where to, in order: x is ahead and y is to the left of where the motion '
        'began.', [['1 m', '0 m'], ['1 m', '1 m']]))
    heading: float | None = field(default=None, metadata=HEADING)
    speed: float | None = field(default=None, metadata=SPEED)
    corners: float | None = field(default=None, metadata=in_file(
        units.TOLERANCE, 'How far it may pass the points between, to drive through them without '
        'a stop.  Left out: as the motion says.', '10 cm'))

    def __post_init__(self) -> None:
        """Check each value, and keep the points as pairs of floats."""
        object.__setattr__(self, 'points', as_points('points', self.points))
        super().__post_init__()

    def placed(self, pose: Pose, refuse: Refuse) -> tuple[list[PlacedStep], Pose]:
        """Return the turns and legs to the points; refuse one where the robot is already."""
        points = tuple((f'points[{index}]', point) for index, point in enumerate(self.points))
        return _to_points(points, self.heading, self.speed, pose, refuse)

    def with_stops(self) -> Waypoints:
        """Return this step without a tolerance of corners of its own."""
        return replace(self, corners=None)

    def path(self) -> tuple[PathSegment, ...]:
        """Return the segments of the path of a motion that begins with this step."""
        return _path(self)

    def describe(self) -> str:
        """Return how many points there are, and the last of them, as text."""
        return f'{pluralize(len(self.points), "waypoint")} to {_text(self.points[-1])}'


def _to_points(
        points: tuple[tuple[str, Point], ...], heading: float | None, speed: float | None,
        pose: Pose, refuse: Refuse) -> tuple[list[PlacedStep], Pose]:
    """Return the turns and legs that drive to points, and the pose at their end."""
    steps: list[PlacedStep] = []

    def turn(name: str, end: float) -> None:
        angle = shorter_turn(pose.theta, end)
        if abs(angle) >= MIN_TURN:
            steps.append(PlacedStep(name, Turn(angle)))

    for name, (x, y) in points:
        distance = math.hypot(x - pose.x, y - pose.y)
        prefix = '' if name == 'point' else f'{name}.'
        if MIN_LEG <= distance < math.inf:
            bearing = math.atan2(y - pose.y, x - pose.x)
            turn(f'{prefix}turn', bearing)
            steps.append(PlacedStep(f'{prefix}forward', Forward(distance, speed)))
            pose = Pose(x, y, bearing)
        else:
            text = 'is there already, within 1 mm' if distance < MIN_LEG else 'is too far from it'
            refuse(name, InvalidMotionError(
                f'[{format_number(x)} m, {format_number(y)} m]; the robot {text}: drive '
                'somewhere else, or leave it out'))
            pose = Pose(x, y, pose.theta)
    if heading is not None:
        turn('heading', heading)
        pose = Pose(pose.x, pose.y, math.remainder(heading, math.tau))
    return steps, pose


def _path(step: Step) -> tuple[PathSegment, ...]:
    steps, _ = step.placed(ORIGIN, _accept)
    return tuple(segment for part in steps for segment in part.step.path())


def _text(point: Point) -> str:
    return f'{format_number(point[0])} m, {format_number(point[1])} m'


def _accept(name: str, error: InvalidMotionError) -> None:
    """Leave out a point that the robot cannot drive to."""
