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
"""How the velocities sent, driven on the floor and reported by odometry differ."""

from __future__ import annotations

from dataclasses import dataclass, replace
import math
from typing import NamedTuple

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.geometry import compose, Pose, relative_to, sinc, Velocity
from kachaka_simple_control.motion.limits import ANGULAR_OF, Limits, LINEAR_OF
from kachaka_simple_control.motion.units import format_number, require_between

GAINS = ('forward_gain', 'backward_gain', 'left_gain', 'right_gain')
#: The allowed range of a gain.  A value outside it means a wrong unit or a broken robot.
MIN_GAIN, MAX_GAIN = 0.5, 2.0
#: The largest allowed veer, the unwanted turn for each metre of path [rad/m].
MAX_VEER = 1.0
#: The longest allowed delay [s].  With a longer delay, neither a plan nor a closed loop works.
MAX_DELAY = 3.0
#: The relative error that rounding may add to a velocity planned at its limit.
MARGIN = 1e-9


@dataclass(frozen=True)
class Calibration:
    """
    How the true velocities of a robot differ from the velocities that are sent to it.

    v = g_v v_sent and w = g_w w_sent + k v: g_v is the forward or backward gain, g_w the left or
    right one, by the direction of motion, and k the veer.  See formula (18) of docs/theory.md.

    :param left_gain: true angular velocity divided by sent angular velocity, to the left
    :param right_gain: the same to the right
    :param veer: the unwanted turn for each metre forwards [rad/m], positive to the left
    :param date: of the measurement, as text to show
    :param floor: on which the robot was measured, as text to show
    """

    forward_gain: float = 1.0
    backward_gain: float = 1.0
    left_gain: float = 1.0
    right_gain: float = 1.0
    veer: float = 0.0
    delay: float | None = None
    date: str = ''
    floor: str = ''

    def __post_init__(self) -> None:
        """Check each value."""
        for name in GAINS:
            require_between(name, getattr(self, name), MIN_GAIN, MAX_GAIN)
        if self.delay is not None:
            require_between('delay', self.delay, 0.0, MAX_DELAY, 's')
        require_between('veer', self.veer, -MAX_VEER, MAX_VEER, 'rad/m')

    def command(self, velocity: Velocity) -> Velocity:
        """Return the velocity to send so that the robot drives at a wanted one; zero for zero."""
        linear, angular = velocity.linear_x, velocity.angular_z
        angular -= self.veer * linear
        return Velocity(linear / self._linear_gain(linear), angular / self._angular_gain(angular))

    def response(self, command: Velocity) -> Velocity:
        """Return the true velocity that a sent velocity causes: the inverse of ``command()``."""
        linear = command.linear_x * self._linear_gain(command.linear_x)
        angular = command.angular_z * self._angular_gain(command.angular_z)
        return Velocity(linear, angular + self.veer * linear)

    def reduce(self, limits: Limits) -> Limits:
        """
        Return the lower limits to plan with, so that the sent velocities keep those of the robot.

        :raises InvalidMotionError: if the correction of the veer needs all of an angular limit
        """
        forward, backward = (min(1.0, gain) - MARGIN for gain in (
            self.forward_gain, self.backward_gain))
        linear = {
            **dict.fromkeys(ANGULAR_OF, min(forward, backward)),
            'max_linear_velocity': forward, 'max_backward_velocity': backward}
        angular = min(1.0, self.left_gain, self.right_gain) - MARGIN
        reduced = replace(limits, **{
            name: limits.bound(name) * gain for name, gain in linear.items()})
        return replace(reduced, **{
            name: _remaining(
                limits, name, angular, self.veer * max(map(reduced.bound, coupled)),
                'veer', f'{self.veer} rad/m')
            for name, coupled in LINEAR_OF.items()})

    def describe(self) -> str:
        """Return all values of the robot's calibration as one line of text, for reports."""
        gains = ', '.join(
            f"{name.removesuffix('_gain')} {format_number(getattr(self, name))}" for name in GAINS)
        veer = f'veer {format_number(math.degrees(self.veer))} deg/m'
        delay = '' if self.delay is None else f'delay {format_number(self.delay)} s'
        return ', '.join([gains, veer, *filter(None, (delay, self.date, self.floor))])

    def _linear_gain(self, linear: float) -> float:
        return self.forward_gain if linear >= 0.0 else self.backward_gain

    def _angular_gain(self, angular: float) -> float:
        return self.left_gain if angular >= 0.0 else self.right_gain


def _remaining(
        limits: Limits, name: str, share: float, lost: float, cause: str, value: str) -> float:
    """
    Return the part of a limit that a plan can use if a correction needs the other part.

    :raises InvalidMotionError: if it is not above zero
    """
    # ``lost`` is infinite or NaN if it depends on a velocity, acceleration or jerk of the other
    # axis that has no limit.  Without a limit, the velocity of the other axis jumps, and so does
    # the correction on this axis.  No limit can prevent this jump.
    lost = abs(lost) if math.isfinite(lost) else 0.0
    bound = limits.bound(name)
    if bound * share <= lost:
        raise InvalidMotionError(f'{value}, which needs all of {name}, {bound:g}', name=cause)
    return bound * share - lost


#: The allowed range of the ratio of the diameters of two wheels of the same type.
MIN_WHEEL_RATIO, MAX_WHEEL_RATIO = 0.9, 1.1
#: The allowed range of a track, the distance between the two wheels [m].
MIN_TRACK, MAX_TRACK = 0.01, 10.0


class _Matrix(NamedTuple):
    """A matrix: v, w become ``linear * v + across * w``, ``turn * v + spin * w``."""

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
    How motion on the floor differs from reported odometry; see formula (19) of docs/theory.md.

    A robot with two driven wheels computes its odometry from their radii and the track, the
    distance between them.  All three corrections are measured with a tape measure.

    :param scale: true distance divided by reported distance on a straight line; for the mean
        radius
    :param wheel_ratio: true diameter of the right wheel divided by that of the left one
    :param track: the track that odometry uses [m]; needed unless ``wheel_ratio`` is 1
    :param date: of the measurement, as text to show
    :param floor: on which the robot was measured, as text to show
    """

    scale: float = 1.0
    wheel_ratio: float = 1.0
    track_ratio: float = 1.0
    track: float | None = None
    date: str = ''
    floor: str = ''

    def __post_init__(self) -> None:
        """Check each value; unequal wheels need the track."""
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
        """Return the true velocity, or movement, for one that odometry reports."""
        return self._floor_matrix().apply(velocity)

    def advance_on_floor(self, pose: Pose, before: Pose, after: Pose) -> Pose:
        """
        Return the true pose on the floor after a movement that odometry reports.

        A sideways movement, which is noise, is multiplied by ``scale``.

        :param after: less than half a turn from ``before``
        """
        change = relative_to(before, after)
        angle = math.remainder(change.theta, math.tau)
        # Relative to the heading at the middle of the arc, the chord has no lateral part.
        reported = relative_to(Pose(theta=angle / 2.0), change)
        moved = self.to_floor(Velocity(reported.x / sinc(angle / 2.0), angle))
        half = moved.angular_z / 2.0
        end = compose(Pose(theta=half), Pose(
            moved.linear_x * sinc(half), self.scale * reported.y, half))
        return compose(pose, end)

    def to_odometry(self, velocity: Velocity) -> Velocity:
        """Return what odometry reports for a true velocity: the inverse of ``to_floor()``."""
        return self._odometry_matrix().apply(velocity)

    def reduce(self, limits: Limits) -> Limits:
        """
        Return lower limits for true velocities, with which odometry keeps the given ones, too.

        :raises InvalidMotionError: if the correction of unequal wheels needs all of a limit
        """
        inverse = self._odometry_matrix()
        own, spin = max(1.0, inverse.linear), max(1.0, inverse.spin)

        def remaining(name: str, lost: float, own: float) -> float:
            left = _remaining(limits, name, 1.0, lost, 'wheel_ratio', str(self.wheel_ratio))
            return left / own * (1.0 - MARGIN)

        reduced = replace(limits, **{
            name: remaining(name, inverse.across * (max(map(limits.bound, coupled)) / spin), own)
            for name, coupled in ANGULAR_OF.items()})
        return replace(reduced, **{
            name: remaining(name, inverse.turn * max(map(reduced.bound, coupled)), spin)
            for name, coupled in LINEAR_OF.items()})

    def describe(self) -> str:
        """Return all values of the odometry calibration as one line of text, for reports."""
        figures = (f'scale {self.scale:.6g}, wheel ratio {self.wheel_ratio:.6g}, '
                   f'track ratio {self.track_ratio:.6g}')
        track = '' if self.track is None else f'track {format_number(self.track)} m'
        return ', '.join([figures, *filter(None, (track, self.date, self.floor))])

    @property
    def _offset(self) -> float:
        """Return half of: true right radius minus true left one, divided by that in odometry."""
        return self.scale * (self.wheel_ratio - 1.0) / (self.wheel_ratio + 1.0)

    def _floor_matrix(self) -> _Matrix:
        # Without a track the wheels are equal, and the offset that multiplies the track is 0.
        nominal = self.track or 1.0
        return _Matrix(
            self.scale, self._offset * nominal / 2.0,
            2.0 * self._offset / (self.track_ratio * nominal), self.scale / self.track_ratio)

    def _odometry_matrix(self) -> _Matrix:
        matrix = self._floor_matrix()
        determinant = matrix.linear * matrix.spin - matrix.across * matrix.turn
        return _Matrix(matrix.spin / determinant, -matrix.across / determinant,
                       -matrix.turn / determinant, matrix.linear / determinant)
