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
"""How the simulated robot moves and what its odometry says."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
import math
import random

from kachaka_simple_control.motion.geometry import advance, ORIGIN, Pose, Velocity, ZERO


@dataclass(frozen=True)
class SimulationParameters:
    """
    What keeps a simulated robot from doing exactly as it is told.

    The maker publishes none of these figures: the defaults are those of an ideal robot, except
    for the way off the dock, which has to take some time and is chosen.

    :param lag: time constant of the drive, first order [s]
    :param linear_acceleration: largest change of the forward velocity [m/s^2]
    :param angular_acceleration: largest change of the turning velocity [rad/s^2]
    :param linear_gain: true over demanded forward velocity
    :param angular_gain: true over demanded turning velocity
    :param velocity_noise: standard deviation of either velocity, as a part of it; drawn anew
        each millisecond of motion
    :param odometry_noise: standard deviation of x and of y in odometry [m]; drawn anew every
        20 ms, and bounded: odometry does not drift
    :param heading_noise: standard deviation of the heading in odometry [rad]; likewise
    :param undock_distance: how far the robot drives straight off its dock [m]
    :param undock_velocity: how fast it does that [m/s]
    """

    lag: float = 0.0
    linear_acceleration: float = math.inf
    angular_acceleration: float = math.inf
    linear_gain: float = 1.0
    angular_gain: float = 1.0
    velocity_noise: float = 0.0
    odometry_noise: float = 0.0
    heading_noise: float = 0.0
    undock_distance: float = 0.2
    undock_velocity: float = 0.1

    def __post_init__(self) -> None:
        """
        Refuse figures that no robot has.

        :raises ValueError: if a figure is not finite (an acceleration may be infinite), is
            negative (a gain may be), or is 0 where nothing would ever move
        """
        for field in fields(self):
            _check(field.name, getattr(self, field.name))

    @property
    def is_ideal(self) -> bool:
        """Whether the velocity is constant between two commands, and equal to what was asked."""
        return (
            self.lag == 0.0 and self.velocity_noise == 0.0
            and math.isinf(self.linear_acceleration) and math.isinf(self.angular_acceleration))


def _check(name: str, value: float) -> None:
    if name.endswith('gain'):
        is_possible, demand = math.isfinite(value), 'a finite number'
    elif name.endswith('acceleration'):
        is_possible, demand = value > 0.0, 'above 0'
    elif name == 'undock_velocity':
        is_possible, demand = math.isfinite(value) and value > 0.0, 'a finite number above 0'
    else:
        is_possible, demand = math.isfinite(value) and value >= 0.0, 'a finite number, 0 or more'
    if not is_possible:
        raise ValueError(f'{name} is {value}; it must be {demand}')


IDEAL = SimulationParameters()


#: Where the velocity changes within a command, the path is put together from arcs this long [s].
#: The length of each arc is exact, only its shape is not: a circle instead of a spiral.
GRID = 0.001
#: A robot told to stand still that is slower than this [m/s, rad/s] stands still.
STANDSTILL = 1e-6


def first_order_response(
        velocity: float,
        target: float,
        duration: float,
        lag: float,
        acceleration: float) -> tuple[float, float]:
    """
    Follow a demanded velocity for a time, exactly.

    With a = acceleration and T = lag: dv/dt = (target - v) / T, but never beyond -a and a.  So
    the velocity runs along a ramp while |target - v| > a T, and along an exponential after it.

    :param velocity: velocity at the start
    :param target: velocity demanded throughout
    :param duration: how long [s]
    :param lag: time constant [s], 0 for none
    :param acceleration: largest change of the velocity per second, may be infinite
    :returns: the velocity at the end, and the way gone
    """
    way = 0.0
    if math.isfinite(acceleration):
        gap = target - velocity
        ramp = min(max(abs(gap) / acceleration - lag, 0.0), duration)
        change = math.copysign(acceleration * ramp, gap)
        way = (velocity + change / 2.0) * ramp
        velocity, duration = velocity + change, duration - ramp
        if lag == 0.0 and duration > 0.0:
            velocity = target
    elif lag == 0.0:
        velocity = target
    if lag == 0.0:
        return velocity, way + velocity * duration
    # expm1 keeps the digits of steps that are short beside the lag.
    part = -math.expm1(-duration / lag)
    gap = target - velocity
    return velocity + gap * part, way + target * duration - gap * lag * part


@dataclass(frozen=True)
class _State:
    time: float
    pose: Pose
    #: what the drive makes of the demand, before gains and noise
    velocity: Velocity


class DriveModel:
    """
    A unicycle that follows demanded velocities; told the time, never asking for it.

    Asking changes nothing: the state is kept at commands and, where the velocity changes by
    itself, on a grid of absolute times; an answer between them is worked out from there.  So
    what is answered never depends on how often it is asked.
    """

    def __init__(self, fidelity: SimulationParameters, start: float, seed: int) -> None:
        """
        Stand still at the origin.

        :param fidelity: what keeps it from doing as it is told
        :param start: the time now [s]; the grid begins here
        :param seed: of the velocity noise
        """
        self._fidelity = fidelity
        self._start = start
        self._random = random.Random(seed)
        self._state = _State(start, ORIGIN, ZERO)
        self._target = ZERO
        self._tick = 0
        self._gain = Velocity(fidelity.linear_gain, fidelity.angular_gain)

    def set_target(self, target: Velocity, now: float) -> None:
        """
        Demand a velocity from now on.

        :param target: the velocity
        :param now: the time [s], never less than before
        """
        self._advance(now)
        self._state = self._after(now)
        self._target = target

    def state_at(self, now: float) -> tuple[Pose, Velocity]:
        """
        Return where the robot truly is, and how fast.

        :param now: the time [s], never less than before
        :returns: pose and velocity
        """
        self._advance(now)
        state = self._after(now)
        velocity = Velocity(
            state.velocity.linear_x * self._gain.linear_x,
            state.velocity.angular_z * self._gain.angular_z)
        return state.pose, velocity

    @property
    def _is_resting(self) -> bool:
        return self._target.is_zero and self._state.velocity.is_zero

    def _advance(self, now: float) -> None:
        """Move the state to the last grid point that is not in the future."""
        if self._fidelity.is_ideal:
            return
        while not self._is_resting and (following := self._grid(self._tick + 1)) <= now:
            self._state = self._after(following)
            self._tick += 1
            self._settle()
            if not self._is_resting:
                self._draw()
        if self._is_resting and now > self._state.time:
            self._tick = int((now - self._start) / GRID)
            self._state = replace(self._state, time=now)

    def _grid(self, tick: int) -> float:
        # A product, not a sum: a thousand roundings a second would add up.
        return self._start + tick * GRID

    def _settle(self) -> None:
        velocity = self._state.velocity
        slowest = max(abs(velocity.linear_x), abs(velocity.angular_z))
        if self._target.is_zero and slowest < STANDSTILL:
            self._state = replace(self._state, velocity=ZERO)

    def _draw(self) -> None:
        noise = self._fidelity.velocity_noise
        if noise > 0.0:
            self._gain = Velocity(
                self._fidelity.linear_gain * self._random.gauss(1.0, noise),
                self._fidelity.angular_gain * self._random.gauss(1.0, noise))

    def _after(self, now: float) -> _State:
        duration = now - self._state.time
        fidelity, velocity = self._fidelity, self._state.velocity
        linear_x, distance = first_order_response(
            velocity.linear_x, self._target.linear_x, duration,
            fidelity.lag, fidelity.linear_acceleration)
        angular_z, angle = first_order_response(
            velocity.angular_z, self._target.angular_z, duration,
            fidelity.lag, fidelity.angular_acceleration)
        pose = advance(
            self._state.pose, distance * self._gain.linear_x, angle * self._gain.angular_z)
        return _State(now, pose, Velocity(linear_x, angular_z))


#: Odometry is as new as this [s]: the official bridge asks for it every 20 ms.
ODOMETRY_PERIOD = 0.02


class NoisyOdometry:
    """Adds noise to a pose; of the time alone, so that asking more often changes nothing."""

    def __init__(self, fidelity: SimulationParameters, start: float, seed: int) -> None:
        """
        Begin.

        :param fidelity: how much noise
        :param start: the time now [s]
        :param seed: of the noise
        """
        self._fidelity = fidelity
        self._start = start
        self._seed = seed

    def read(self, pose: Pose, now: float) -> Pose:
        """
        Return where the robot thinks it is.

        :param pose: where it truly is
        :param now: the time [s]
        :returns: the pose with noise
        """
        fidelity = self._fidelity
        if fidelity.odometry_noise == 0.0 and fidelity.heading_noise == 0.0:
            return pose
        reading = int((now - self._start) / ODOMETRY_PERIOD)
        noise = random.Random(f'{self._seed} {reading}')
        return Pose(
            pose.x + noise.gauss(0.0, fidelity.odometry_noise),
            pose.y + noise.gauss(0.0, fidelity.odometry_noise),
            pose.theta + noise.gauss(0.0, fidelity.heading_noise))
