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
"""How a robot's odometry differs from the floor, and velocities by the one and on the other."""

from __future__ import annotations

from dataclasses import dataclass, replace
import math
from typing import NamedTuple

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.calibration import MARGIN, MAX_GAIN, MIN_GAIN
from kachaka_simple_control.motion.geometry import compose, Pose, relative_to, sinc, Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.units import format_number, require_between

#: The range of the ratio of two wheels that were made alike.
MIN_WHEEL_RATIO, MAX_WHEEL_RATIO = 0.9, 1.1
#: The range of a track [m].
MIN_TRACK, MAX_TRACK = 0.01, 10.0


class _Matrix(NamedTuple):
    """Takes (v, w) to (linear v + across w, turn v + spin w)."""

    linear: float
    across: float
    turn: float
    spin: float

    def apply(self, velocity: Velocity) -> Velocity:
        linear, angular = velocity.linear_x, velocity.angular_z
        return Velocity(self.linear * linear + self.across * angular,
                        self.turn * linear + self.spin * angular)


@dataclass(frozen=True)
class OdometryCalibration:
    """
    How motion on the floor differs from what odometry reports; formula (19) of docs/theory.md.

    A robot with two driven wheels computes its odometry from their radii and its track.  These
    are what a tape measure tells of the errors of the three.

    :param scale: true over reported distance on a straight line: of the mean wheel radius
    :param wheel_ratio: true diameter of the right wheel over that of the left one
    :param track_ratio: true track over the one that odometry uses
    :param track: the track that odometry uses [m]; needed unless ``wheel_ratio`` is 1
    :param date: when that was measured, as shown
    :param floor: on which floor that was measured, as shown
    """

    scale: float = 1.0
    wheel_ratio: float = 1.0
    track_ratio: float = 1.0
    track: float | None = None
    date: str = ''
    floor: str = ''

    def __post_init__(self) -> None:
        """
        Check the figures.

        :raises InvalidMotionError: if a figure is out of range, or the track is missing
        """
        require_between('scale', self.scale, MIN_GAIN, MAX_GAIN)
        require_between('wheel_ratio', self.wheel_ratio, MIN_WHEEL_RATIO, MAX_WHEEL_RATIO)
        require_between('track_ratio', self.track_ratio, MIN_GAIN, MAX_GAIN)
        if self.track is not None:
            require_between('track', self.track, MIN_TRACK, MAX_TRACK, 'm')
        elif self.wheel_ratio != 1.0:
            raise InvalidMotionError(
                f'{self.wheel_ratio}, which needs track, the one that odometry uses, such as '
                '0.2 m', name='wheel_ratio')

    def to_floor(self, velocity: Velocity) -> Velocity:
        """
        Return what a velocity by odometry is on the floor.

        It is linear, so it also holds for an increment: a distance [m] and an angle [rad].
        """
        return self._floor_matrix().apply(velocity)

    def advance_on_floor(self, pose: Pose, before: Pose, after: Pose) -> Pose:
        """
        Return the pose on the floor after odometry went from one pose to the next.

        A lateral part of an increment, which is noise, is multiplied by the scale.

        :param pose: on the floor, where odometry was at ``before``
        :param before: by odometry
        :param after: by odometry, less than half a turn later
        """
        change = relative_to(before, after)
        angle = math.remainder(change.theta, math.tau)
        # In the direction half-way an arc is its chord, and nothing across.
        reported = relative_to(Pose(theta=angle / 2.0), change)
        moved = self.to_floor(Velocity(reported.x / sinc(angle / 2.0), angle))
        half = moved.angular_z / 2.0
        end = compose(Pose(theta=half), Pose(
            moved.linear_x * sinc(half), self.scale * reported.y, half))
        return compose(pose, end)

    def to_odometry(self, velocity: Velocity) -> Velocity:
        """Return what odometry shows of a velocity on the floor; the inverse of ``to_floor``."""
        return self._odometry_matrix().apply(velocity)

    def reduce(self, limits: Limits) -> Limits:
        """
        Return the limits of motion on the floor, so that neither that nor odometry exceeds some.

        :param limits: of velocities by odometry
        :raises InvalidMotionError: if what the unequal wheels need leaves nothing
        """
        inverse = self._odometry_matrix()
        own, spin = max(1.0, inverse.linear), max(1.0, inverse.spin)

        def remaining(name: str, bound: float, other: float, cross: float, own: float) -> float:
            # An unlimited axis steps, so the coupled axis steps too; no limit can prevent that.
            lost = abs(cross) * other if math.isfinite(other) else 0.0
            if bound <= lost:
                raise InvalidMotionError(
                    f'{self.wheel_ratio}, which needs all of {name}, {bound:g}',
                    name='wheel_ratio')
            return (bound - lost) / own * (1.0 - MARGIN)

        def linear(name: str, bound: float, *angular: float) -> float:
            return remaining(name, bound, max(angular) / spin, inverse.across, own)

        def angular(name: str, bound: float, *linear: float) -> float:
            return remaining(name, bound, max(linear), inverse.turn, spin)

        changes = limits.max_angular_acceleration, limits.angular_deceleration
        reduced = replace(
            limits,
            max_linear_velocity=linear(
                'max_linear_velocity', limits.max_linear_velocity, limits.max_angular_velocity),
            max_backward_velocity=linear(
                'max_backward_velocity', limits.backward_velocity, limits.max_angular_velocity),
            max_linear_acceleration=linear(
                'max_linear_acceleration', limits.max_linear_acceleration, *changes),
            max_linear_deceleration=linear(
                'max_linear_deceleration', limits.linear_deceleration, *changes),
            max_linear_jerk=linear(
                'max_linear_jerk', limits.max_linear_jerk, limits.max_angular_jerk))
        changes = reduced.max_linear_acceleration, reduced.linear_deceleration
        return replace(
            reduced,
            max_angular_velocity=angular(
                'max_angular_velocity', limits.max_angular_velocity,
                reduced.max_linear_velocity, reduced.backward_velocity),
            max_angular_acceleration=angular(
                'max_angular_acceleration', limits.max_angular_acceleration, *changes),
            max_angular_deceleration=angular(
                'max_angular_deceleration', limits.angular_deceleration, *changes),
            max_angular_jerk=angular(
                'max_angular_jerk', limits.max_angular_jerk, reduced.max_linear_jerk))

    def describe(self) -> str:
        """Return it in words, for reports."""
        figures = ', '.join(
            f'{name} {value:.6g}' for name, value in (
                ('scale', self.scale), ('wheel ratio', self.wheel_ratio),
                ('track ratio', self.track_ratio)))
        track = '' if self.track is None else f'track {format_number(self.track)} m'
        return ', '.join([figures, *filter(None, (track, self.date, self.floor))])

    @property
    def _offset(self) -> float:
        """Return half the difference of the true wheel radii, over the nominal radius."""
        return self.scale * (self.wheel_ratio - 1.0) / (self.wheel_ratio + 1.0)

    def _floor_matrix(self) -> _Matrix:
        # Without a track the wheels are alike, and what it would be multiplied by is 0.
        nominal = self.track or 1.0
        return _Matrix(
            self.scale, self._offset * nominal / 2.0,
            2.0 * self._offset / (self.track_ratio * nominal), self.scale / self.track_ratio)

    def _odometry_matrix(self) -> _Matrix:
        matrix = self._floor_matrix()
        determinant = matrix.linear * matrix.spin - matrix.across * matrix.turn
        return _Matrix(matrix.spin / determinant, -matrix.across / determinant,
                       -matrix.turn / determinant, matrix.linear / determinant)
