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
"""The calibration of a robot: how it drives a velocity, and what to send for a planned one."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
import math

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.units import format_number, require_between

#: The range of a gain: what is beyond is no calibration but a wrong unit or a broken robot.
MIN_GAIN, MAX_GAIN = 0.5, 2.0
#: The largest veer [rad/m].
MAX_VEER = 1.0
#: The longest delay [s]: beyond it neither a plan nor a closed loop is of use.
MAX_DELAY = 3.0
#: The part that rounding may add to a velocity that was planned at its limit.
MARGIN = 1e-9


@dataclass(frozen=True)
class Calibration:
    """
    How a robot's velocities differ from those that it is sent; formula (18) of docs/theory.md.

    With a gain g of the direction and the veer k: v = g_v v_sent, w = g_w w_sent + k v.

    :param forward_gain: true over sent linear velocity
    :param backward_gain: the same backwards
    :param left_gain: true over sent angular velocity, to the left
    :param right_gain: the same to the right
    :param veer: how much it turns to the left on each metre forwards [rad/m]
    :param delay: how late it follows, dead time and lag together [s]; a closed loop needs it
    :param date: when that was measured, as shown
    :param floor: on which floor that was measured, as shown
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
        """
        Check the figures.

        :raises InvalidMotionError: if a gain, the veer or the delay is out of range
        """
        for item in fields(self):
            value = getattr(self, item.name)
            if item.name.endswith('gain'):
                require_between(item.name, value, MIN_GAIN, MAX_GAIN)
        if self.delay is not None:
            require_between('delay', self.delay, 0.0, MAX_DELAY, 's')
        require_between('veer', self.veer, -MAX_VEER, MAX_VEER, 'rad/m')

    def command(self, velocity: Velocity) -> Velocity:
        """Return what to send for a velocity; a zero is a zero."""
        linear, angular = velocity.linear_x, velocity.angular_z
        angular -= self.veer * linear
        return Velocity(linear / self._linear_gain(linear), angular / self._angular_gain(angular))

    def response(self, command: Velocity) -> Velocity:
        """Return what becomes of a velocity that is sent; the inverse of ``command``."""
        linear = command.linear_x * self._linear_gain(command.linear_x)
        angular = command.angular_z * self._angular_gain(command.angular_z)
        return Velocity(linear, angular + self.veer * linear)

    def reduce(self, limits: Limits) -> Limits:
        """
        Return the limits to plan with, so that neither plan nor commands exceed a robot's limits.

        :param limits: of the robot
        :raises InvalidMotionError: if nothing is left to turn with beside the veer
        """
        forward, backward = (min(1.0, gain) - MARGIN for gain in (
            self.forward_gain, self.backward_gain))
        linear = min(forward, backward)
        angular = min(1.0, self.left_gain, self.right_gain) - MARGIN
        reduced = replace(
            limits,
            max_linear_velocity=limits.max_linear_velocity * forward,
            max_backward_velocity=limits.backward_velocity * backward,
            max_linear_acceleration=limits.max_linear_acceleration * linear,
            max_linear_deceleration=limits.linear_deceleration * linear,
            max_linear_jerk=limits.max_linear_jerk * linear)

        def remaining(name: str, bound: float, drive: float) -> float:
            # An unlimited drive steps, so the turn that it causes steps too; no limit can prevent
            # that.
            veer = abs(self.veer) * drive if math.isfinite(drive) else 0.0
            if bound * angular <= veer:
                raise InvalidMotionError(
                    f'{self.veer} rad/m, which needs all of {name}, {bound:g}', name='veer')
            return bound * angular - veer

        return replace(
            reduced,
            max_angular_velocity=remaining(
                'max_angular_velocity', limits.max_angular_velocity,
                max(reduced.max_linear_velocity, reduced.backward_velocity)),
            max_angular_acceleration=remaining(
                'max_angular_acceleration', limits.max_angular_acceleration,
                max(reduced.max_linear_acceleration, reduced.linear_deceleration)),
            max_angular_deceleration=remaining(
                'max_angular_deceleration', limits.angular_deceleration,
                max(reduced.max_linear_acceleration, reduced.linear_deceleration)),
            max_angular_jerk=remaining(
                'max_angular_jerk', limits.max_angular_jerk, reduced.max_linear_jerk))

    def describe(self) -> str:
        """Return it in words, for reports."""
        gains = ', '.join(
            f"{item.name.removesuffix('_gain')} {format_number(getattr(self, item.name))}"
            for item in fields(self) if item.name.endswith('gain'))
        veer = f'veer {format_number(math.degrees(self.veer))} deg/m'
        delay = '' if self.delay is None else f'delay {format_number(self.delay)} s'
        return ', '.join([gains, veer, *filter(None, (delay, self.date, self.floor))])

    def _linear_gain(self, linear: float) -> float:
        return self.forward_gain if linear >= 0.0 else self.backward_gain

    def _angular_gain(self, angular: float) -> float:
        return self.left_gain if angular >= 0.0 else self.right_gain
