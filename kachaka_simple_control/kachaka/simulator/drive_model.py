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
"""A model of how the simulated robot follows commanded velocities, and of its odometry."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
import math
import random
from typing import Any

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.robot_profile import KACHAKA_TRACK
from kachaka_simple_control.kachaka.simulator.contact import Contact, ContactFinder
from kachaka_simple_control.motion.calibration import OdometryCalibration
from kachaka_simple_control.motion.geometry import advance, ORIGIN, Pose, Velocity, ZERO

#: A rule for a simulation parameter: the text for error messages, with ``{}`` for the unit, and a
#: function that returns whether a value follows the rule.
Rule = tuple[str, Callable[[float], bool]]
FINITE: Rule = 'a finite number', math.isfinite
ABOVE_0: Rule = 'above 0{}', lambda value: value > 0.0
FINITE_ABOVE_0: Rule = 'above 0{}, and finite', lambda value: 0.0 < value < math.inf
FINITE_FROM_0: Rule = '0{} or more, and finite', lambda value: 0.0 <= value < math.inf


def _figure(default: float, unit: str, text: str, rule: Rule = FINITE_FROM_0) -> Any:
    """Return a field of ``SimulationParameters``, which is also a command line option."""
    return field(default=default, metadata={'unit': unit, 'help': text, 'rule': rule})


@dataclass(frozen=True)
class SimulationParameters:
    """
    The deviations of a simulated robot from an ideal robot, and the motion off its dock.

    The manufacturer publishes none of them: the defaults are ideal, those of the dock assumed.

    :param dead_time: from a command until the drive begins to follow it [s]
    :param lag: time constant of the drive, which is a first-order system [s]
    :param linear_acceleration: largest forward acceleration [m/s^2]
    :param angular_acceleration: largest turning acceleration [rad/s^2]
    :param linear_gain: the forward velocity in odometry divided by the commanded one
    :param right_gain: a turn to the right has ``angular_gain`` times this
    :param veer: the unwanted turn to the left for each metre forwards, in odometry [rad/m]
    :param odometry_scale: true distance divided by that in odometry, on a straight line
    :param wheel_ratio: true diameter of the right wheel divided by that of the left one
    :param velocity_noise: standard deviation of both velocities, each divided by the velocity; new
        values each millisecond of motion
    :param odometry_noise: standard deviation of x and of y in odometry [m], new values each 20 ms,
        which do not add up
    :param heading_noise: standard deviation of the heading in odometry [rad], likewise
    :param undock_distance: the distance that the robot drives straight off its dock [m]
    :param undock_velocity: the velocity of this motion [m/s]
    :raises InvalidMotionError: if a value is out of its range: only accelerations may be infinite,
        only gains and the veer negative, accelerations and ``undock_velocity`` not 0; the rest as
        for ``OdometryCalibration``
    """

    dead_time: float = _figure(0.0, 's', 'how long after a command the drive begins to follow it')
    lag: float = _figure(0.0, 's', 'time constant of the drive')
    linear_acceleration: float = _figure(
        math.inf, 'm/s^2', 'largest change of the forward velocity', ABOVE_0)
    angular_acceleration: float = _figure(
        math.inf, 'rad/s^2', 'largest change of the turning velocity', ABOVE_0)
    linear_gain: float = _figure(
        1.0, '', 'forward velocity, by odometry, over the demanded one', FINITE)
    backward_gain: float = _figure(1.0, '', 'that gain backwards, over the one forwards', FINITE)
    angular_gain: float = _figure(
        1.0, '', 'turning velocity, by odometry, over the demanded one', FINITE)
    right_gain: float = _figure(
        1.0, '', 'that gain to the right, over the one to the left', FINITE)
    veer: float = _figure(
        0.0, 'rad/m', 'how much the robot turns to the left on each metre forwards', FINITE)
    odometry_scale: float = _figure(1.0, '', 'true distance over the one that odometry reports')
    wheel_ratio: float = _figure(
        1.0, '', 'true diameter of the right wheel over that of the left one')
    track_ratio: float = _figure(1.0, '', 'true track over the one that odometry uses')
    velocity_noise: float = _figure(
        0.0, '', 'standard deviation of the velocity, as a part of it')
    odometry_noise: float = _figure(0.0, 'm', 'standard deviation of the position in odometry')
    heading_noise: float = _figure(0.0, 'rad', 'standard deviation of the heading in odometry')
    undock_distance: float = _figure(0.2, 'm', 'how far the robot drives off its dock')
    undock_velocity: float = _figure(0.1, 'm/s', 'how fast it does that', FINITE_ABOVE_0)

    def __post_init__(self) -> None:
        """Check each value."""
        for figure in fields(self):
            value, (rule, is_valid) = getattr(self, figure.name), figure.metadata['rule']
            if not is_valid(value):
                unit = figure.metadata['unit'] and f" {figure.metadata['unit']}"
                raise InvalidMotionError(
                    f'{value}{unit}; it must be {rule.format(unit)}', name=figure.name)
        try:
            self.floor  # noqa: B018
        except InvalidMotionError as error:
            name = 'odometry_scale' if error.name == 'scale' else error.name
            raise InvalidMotionError(error.message, name=name) from None

    @property
    def floor(self) -> OdometryCalibration | None:
        """Return the calibration that converts odometry to the true motion; None if they agree."""
        ratios = self.odometry_scale, self.wheel_ratio, self.track_ratio
        return None if ratios == (1.0, 1.0, 1.0) else OdometryCalibration(
            *ratios, KACHAKA_TRACK)

    @property
    def is_ideal(self) -> bool:
        """Return whether the drive has no lag, no limit of acceleration and no noise."""
        return (
            self.lag == 0.0 and self.velocity_noise == 0.0
            and math.isinf(self.linear_acceleration) and math.isinf(self.angular_acceleration))


IDEAL = SimulationParameters()


#: The period of odometry [s]: the official bridge requests odometry every 20 ms.
ODOMETRY_PERIOD = 0.02
#: The frames of odometry (REP-105), with the names of the official bridge.
ODOMETRY_FRAME = 'odom'
ROBOT_FRAME = 'base_footprint'
#: While the velocity changes, the path is a sequence of arcs of this duration [s].  The length of
#: each arc is exact.  Its shape is approximate, a circular arc instead of a spiral.
GRID_PERIOD = 0.001
#: If the commanded velocity is zero, the model sets a velocity below this [m/s, rad/s] to zero.
STANDSTILL = 1e-6


def first_order_response(
        velocity: float, target: float, duration: float, lag: float,
        acceleration: float) -> tuple[float, float]:
    """
    Return velocity and way after a time of a constant commanded velocity, exactly.

    dv/dt = (target - v) / lag, limited to [-acceleration, acceleration]: v changes on a ramp while
    |target - v| > acceleration * lag, and then exponentially.

    :param velocity: velocity at the start [m/s or rad/s]
    :param lag: time constant of the drive [s]; 0 for a drive without a lag
    :param acceleration: largest acceleration [m/s^2 or rad/s^2]; may be infinite
    :returns: the velocity at the end, and the distance [m] or angle [rad] covered
    """
    covered = 0.0
    if math.isfinite(acceleration):
        gap = target - velocity
        ramp = min(max(abs(gap) / acceleration - lag, 0.0), duration)
        change = math.copysign(acceleration * ramp, gap)
        covered = (velocity + change / 2.0) * ramp
        velocity, duration = velocity + change, duration - ramp
        if lag == 0.0 and duration > 0.0:
            velocity = target
    elif lag == 0.0:
        velocity = target
    if lag == 0.0:
        return velocity, covered + velocity * duration
    # The part of the velocity difference that is closed during the exponential, 0 to 1.  expm1()
    # is accurate even if the duration is much shorter than the lag.
    closed = -math.expm1(-duration / lag)
    gap = target - velocity
    return velocity + gap * closed, covered + target * duration - gap * lag * closed


@dataclass(frozen=True)
class _State:
    time: float
    #: the pose on the floor, and the odometry pose without noise
    pose: Pose
    reported: Pose
    #: the velocity before gains and noise are applied
    velocity: Velocity


class DriveModel:
    """
    A model of a robot that follows commanded velocities (unicycle model), and of its odometry.

    It starts at rest at the origin.  ``now`` must not decrease from call to call.  The results
    depend only on the commands and the time, not on how often a method is called.

    :param contacts: finds where it touches something: it stands still from then on; None for an
        empty floor
    :ivar contact: None before one
    """

    def __init__(
            self, parameters: SimulationParameters, start: float, seed: int,
            contacts: ContactFinder | None = None) -> None:
        self._parameters = parameters
        self._floor = parameters.floor
        self._contacts = contacts
        self.contact: Contact | None = None
        self._start = start
        self._seed = seed
        self._random = random.Random(seed)
        # The state is stored each time the drive begins to follow a command, and, unless the drive
        # is ideal on an empty floor, once per millisecond of motion.  All later values are
        # computed from the last stored state, so the number of calls does not change the results.
        self._state = _State(start, ORIGIN, ORIGIN, ZERO)
        self._target = ZERO
        #: the commands that the drive does not follow yet, each with the time [s] at which the
        #: drive begins to follow it
        self._commands: deque[tuple[float, Velocity]] = deque()
        self._tick = 0
        self._noise = Velocity(1.0, 1.0)
        #: when it came to rest last [s]; minus infinity: it has not moved yet
        self._rest_since = -math.inf

    def set_target(self, target: Velocity, now: float) -> None:
        """Command a velocity, which the drive begins to follow after its dead time."""
        if self.contact is not None:
            return
        self._commands.append((now + self._parameters.dead_time, target))
        self._follow(now)

    def state_at(self, now: float) -> tuple[Pose, Velocity]:
        """Return the true pose and the true velocity of the robot on the floor."""
        state, velocity = self._query(now)
        return state.pose, velocity if self._floor is None else self._floor.to_floor(velocity)

    def reported_at(self, now: float) -> tuple[Pose, Velocity]:
        """Return the pose and the velocity in odometry, without random noise of the pose."""
        state, velocity = self._query(now)
        return state.reported, velocity

    def odometry_at(self, now: float) -> tuple[Pose, Velocity]:
        """Return the pose and the velocity in odometry, with random noise of the pose."""
        parameters, (pose, velocity) = self._parameters, self.reported_at(now)
        if parameters.odometry_noise == 0.0 and parameters.heading_noise == 0.0:
            return pose, velocity
        # The noise depends only on the time and the seed.
        sample = int((now - self._start) / ODOMETRY_PERIOD)
        noise = random.Random(f'{self._seed} {sample}')
        return Pose(
            pose.x + noise.gauss(0.0, parameters.odometry_noise),
            pose.y + noise.gauss(0.0, parameters.odometry_noise),
            pose.theta + noise.gauss(0.0, parameters.heading_noise)), velocity

    def last_motion(self, now: float) -> float:
        """Return when it moved last: now, or when it came to rest [s]; minus infinity: not yet."""
        self._follow(now)
        self._advance(now)
        return now if self._moves else self._rest_since

    def _query(self, now: float) -> tuple[_State, Velocity]:
        """Return the state of the model at a time, and the velocity in odometry."""
        self._follow(now)
        self._advance(now)
        state = self._state_at(now)
        return state, self._reported(state.velocity.linear_x, state.velocity.angular_z)

    def _follow(self, now: float) -> None:
        """Make the drive follow each command that was given at least one dead time ago."""
        while self._commands and self._commands[0][0] <= now:
            time, target = self._commands.popleft()
            self._advance(time)
            self._state = self._state_at(time)
            was_moving = self._moves
            self._target = target if self.contact is None else ZERO
            if was_moving and not self._moves:
                self._rest_since = time

    def _reported(self, linear: float, angular: float) -> Velocity:
        """Convert a velocity or a way of the drive to that in odometry: gains, noise, veer."""
        parameters = self._parameters
        reported_linear = linear * (parameters.linear_gain * self._noise.linear_x)
        reported_angular = angular * (parameters.angular_gain * self._noise.angular_z)
        if linear < 0.0:
            reported_linear *= parameters.backward_gain
        if angular < 0.0:
            reported_angular *= parameters.right_gain
        return Velocity(reported_linear, reported_angular + parameters.veer * reported_linear)

    @property
    def _is_at_rest(self) -> bool:
        return self._target.is_zero and self._state.velocity.is_zero

    @property
    def _moves(self) -> bool:
        # The stored velocity of an ideal drive is that before its last command.
        return not (self._target.is_zero if self._parameters.is_ideal else self._is_at_rest)

    def _advance(self, now: float) -> None:
        """
        Compute the state in whole steps of 1 ms, up to less than 1 ms before the current time.

        Nothing is computed for an ideal drive on an empty floor; at rest, only the time is stored.
        """
        if self._parameters.is_ideal and self._contacts is None:
            return
        while not self._is_at_rest and (next_time := self._grid_time(self._tick + 1)) <= now:
            self._state = self._state_at(next_time)
            self._tick += 1
            self._settle()
            self._find_contact()
            if self._is_at_rest:
                self._rest_since = self._state.time
            else:
                self._draw_noise()
        if self._is_at_rest and now > self._state.time:
            self._tick = int((now - self._start) / GRID_PERIOD)
            self._state = replace(self._state, time=now)

    def _grid_time(self, tick: int) -> float:
        # Use a product, because the rounding errors of a sum would accumulate.
        return self._start + tick * GRID_PERIOD

    def _settle(self) -> None:
        velocity = self._state.velocity
        fastest = max(abs(velocity.linear_x), abs(velocity.angular_z))
        if self._target.is_zero and fastest < STANDSTILL:
            self._state = replace(self._state, velocity=ZERO)

    def _find_contact(self) -> None:
        if self._contacts is not None:
            self.contact = self._contacts.find(self._state.pose, self._state.time)
            if self.contact is not None:
                self._state, self._target = replace(self._state, velocity=ZERO), ZERO

    def _draw_noise(self) -> None:
        noise = self._parameters.velocity_noise
        if noise > 0.0:
            self._noise = Velocity(self._random.gauss(1.0, noise), self._random.gauss(1.0, noise))

    def _state_at(self, now: float) -> _State:
        duration = now - self._state.time
        parameters, velocity = self._parameters, self._state.velocity
        linear_x, distance = first_order_response(
            velocity.linear_x, self._target.linear_x, duration,
            parameters.lag, parameters.linear_acceleration)
        angular_z, angle = first_order_response(
            velocity.angular_z, self._target.angular_z, duration,
            parameters.lag, parameters.angular_acceleration)
        way = self._reported(distance, angle)
        pose = reported = advance(self._state.reported, way.linear_x, way.angular_z)
        if self._floor is not None:
            way = self._floor.to_floor(way)
            pose = advance(self._state.pose, way.linear_x, way.angular_z)
        return _State(now, pose, reported, Velocity(linear_x, angular_z))
