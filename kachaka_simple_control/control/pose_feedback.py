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
"""The closed loop: it uses odometry to correct each velocity of a plan by a limited amount."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
import math
from typing import NamedTuple

from kachaka_simple_control.control.tick import Tick
from kachaka_simple_control.control.timing import (
    FEEDBACK_MAX_AGE,
    MAX_HEADING_ERROR,
    MAX_MOVED_ANGLE,
    MAX_MOVED_DISTANCE,
    MAX_POSITION_ERROR,
)
from kachaka_simple_control.errors import RunFaultError
from kachaka_simple_control.motion.calibration import OdometryCalibration
from kachaka_simple_control.motion.geometry import (
    distance_between,
    integrate,
    ORIGIN,
    Pose,
    relative_to,
    Velocity,
    ZERO,
)
from kachaka_simple_control.motion.limits import CLOSED_LOOP_SHARE, Limits
from kachaka_simple_control.motion.plan import Plan, PlannedStep

#: The largest correction while the robot drives at its largest velocity, as a fraction of this
#: velocity.  At a lower velocity, the largest correction is smaller in proportion.
MAX_CORRECTION = 0.2
#: The largest gain [1/s]: a higher gain would amplify the noise of odometry.
MAX_LOOP_GAIN = 1.5
#: The start pose is the mean of the newest samples at rest, at most this number.  A Kachaka sends
#: this number in half a second.
START_SAMPLES = 25
#: A pose with larger coordinates is ignored [m], [rad].
MAX_COORDINATE = 1e9


class PoseSample(NamedTuple):
    """A pose from odometry, corrected by the odometry calibration."""

    arrived: float
    pose: Pose


class _Sent(NamedTuple):
    """A planned velocity, when it was sent [s], and the planned pose then."""

    time: float
    pose: Pose
    velocity: Velocity


def loop_gain(delay: float) -> float:
    """
    Return the gain of the closed loop [1/s], by formula (21) of docs/theory.md.

    The gain times the delay is at most 1/e, so that the loop does not overshoot.

    :param delay: from a command to its effect in odometry: dead time plus lag [s]
    """
    return min(MAX_LOOP_GAIN, 1.0 / (math.e * delay)) if delay else MAX_LOOP_GAIN


class PoseFeedback:
    """
    A closed loop: it corrects each planned velocity, so that the robot follows its plan.

    The newest pose from odometry is compared with the planned pose at its arrival minus the delay,
    so the delay itself causes no error: formulas (20) and (21) of docs/theory.md.  One thread
    calls all methods but ``on_odometry``.

    :param delay: from a command to its effect in odometry: dead time plus lag [s]
    """

    def __init__(self, delay: float, odometry: OdometryCalibration | None = None) -> None:
        self._delay = delay
        self._odometry = odometry or OdometryCalibration()
        #: the newest pose as odometry reports it (None before the first), and the calibrated pose
        #: on the floor
        self._reported: Pose | None = None
        self._floor = ORIGIN
        #: the samples since the robot came to rest, at most START_SAMPLES; only the newest sample
        #: while the robot moves
        self._samples: tuple[PoseSample, ...] = ()
        #: number of samples that were accepted
        self.sample_count = 0
        self._sent: deque[_Sent] = deque()

    def on_odometry(self, arrived: float, pose: Pose, is_moving: bool) -> None:
        """Process a pose from odometry, unless it is not newer, NaN, infinite or too large."""
        if not (math.isfinite(arrived)
                and abs(pose.x) + abs(pose.y) + abs(pose.theta) < MAX_COORDINATE):
            return
        samples = self._samples
        if samples and arrived <= samples[-1].arrived:
            return
        self._floor = pose if self._reported is None else self._odometry.advance_on_floor(
            self._floor, self._reported, pose)
        self._reported = pose
        self.sample_count += 1
        sample = PoseSample(arrived, self._floor)
        is_one_rest = not is_moving and samples and _are_near(samples[-1], sample)
        self._samples = (*samples, sample)[-START_SAMPLES:] if is_one_rest else (sample,)

    def age(self, now: float) -> float:
        """Return how long ago the newest accepted pose arrived [s]; infinite if none has."""
        return now - self._samples[-1].arrived if self._samples else math.inf

    def begin(self, plan: Plan, limits: Limits) -> None:
        """
        Begin to correct the velocities of a new plan; at least one pose must have arrived.

        :param plan: its velocities use only the fraction ``CLOSED_LOOP_SHARE`` of the limits
        """
        self._limits = limits
        self._gain = loop_gain(self._delay)
        self._plan = plan
        # If a velocity has no limit, use the plan's largest velocity instead.
        self._top = Velocity(
            *(limit if limit < math.inf else planned for limit, planned in (
                (self._limits.max_linear_velocity, plan.max_linear_velocity),
                (self._limits.max_angular_velocity, plan.max_angular_velocity))))
        self._sent.clear()
        self._start = ORIGIN
        self._last = ZERO
        self._last_tick: Tick | None = None
        #: the angle by which the current correction of the heading at rest (a settle) has turned
        #: the robot so far [rad]
        self._settled = 0.0

    def correct(self, tick: Tick, now: float) -> Velocity:
        """
        Return the velocity to send: the planned one plus a correction from odometry.

        :raises RunFaultError: if the robot is too far from its planned pose
        """
        planned = tick.velocity
        self._check_settle(tick)
        if not self._sent:
            self._start = _mean([sample.pose for sample in self._samples])
            self._sent.append(_Sent(now, ORIGIN, planned))
        else:
            newest = self._sent[-1]
            self._sent.append(_Sent(
                now, integrate(newest.pose, newest.velocity, now - newest.time), planned))
        wanted = self._correction(tick, self._error(now))
        velocity = self._limited(tick, Velocity(
            planned.linear_x + wanted.linear_x, planned.angular_z + wanted.angular_z))
        self._last, self._last_tick = velocity, tick
        return velocity

    def _error(self, now: float) -> Pose | None:
        """
        Return the planned pose, seen from the pose that odometry shows.

        :returns: None if the newest odometry is too old, or if the drive has just begun
        :raises RunFaultError: if it is larger than MAX_POSITION_ERROR or MAX_HEADING_ERROR
        """
        arrived, pose = self._samples[-1]
        then = arrived - self._delay
        if now - arrived > FEEDBACK_MAX_AGE or then < self._sent[0].time:
            return None
        while len(self._sent) > 1 and self._sent[1].time <= then:
            self._sent.popleft()
        reference = self._sent[0]
        error = relative_to(
            relative_to(self._start, pose),
            integrate(reference.pose, reference.velocity, then - reference.time))
        distance, angle = math.hypot(error.x, error.y), abs(error.theta)
        if distance > MAX_POSITION_ERROR or angle > MAX_HEADING_ERROR:
            raise RunFaultError(
                f'odometry shows the robot {distance * 100.0:.0f} cm and '
                f'{math.degrees(angle):.0f} deg from where it should be, more than '
                f'{MAX_POSITION_ERROR * 100.0:.0f} cm or {math.degrees(MAX_HEADING_ERROR):.0f} '
                'deg: wheels slip, or something holds or moves it')
        return error

    def _correction(self, tick: Tick, error: Pose | None) -> Velocity:
        """Return the correction, within its bounds; zero if the error is None."""
        planned, gain, top = tick.velocity, self._gain, self._top
        if error is None:
            return ZERO
        if planned.is_zero:
            left = self._settle_time(tick)
            rate = _rate(self._limits.max_angular_acceleration,
                         self._limits.angular_deceleration, left)
            return Velocity(0.0, _clip(
                gain * error.theta, min(top.angular_z * MAX_CORRECTION, rate)))
        # The bound is proportional to the planned velocity, so a correction ends with its step.
        pace = MAX_CORRECTION * max(_ratio(abs(planned.linear_x), top.linear_x),
                                    _ratio(abs(planned.angular_z), top.angular_z))
        fastest = max(abs(planned.linear_x), top.linear_x * CLOSED_LOOP_SHARE)
        sideways = gain * gain * error.y * _ratio(planned.linear_x, fastest * fastest)
        return Velocity(
            _clip(gain * error.x, top.linear_x * pace),
            _clip(gain * error.theta + sideways, top.angular_z * pace))

    def _check_settle(self, tick: Tick) -> None:
        """
        Check that the corrections in a settle do not turn the robot too far.

        If odometry drifts, it shows a turn of a robot at rest, and the corrections turn it.

        :raises RunFaultError: if they add up to more than MAX_HEADING_ERROR
        """
        before = self._last_tick
        # If a speed factor of 0 holds the robot during a settle, the settle has not ended.
        if before is None or not self._is_settling(tick):
            self._settled = 0.0
            return
        self._settled += self._last.angular_z * (tick.start - before.start)
        if abs(self._settled) > MAX_HEADING_ERROR:
            raise RunFaultError(
                f'a settle has turned the robot by {math.degrees(abs(self._settled)):.0f} deg, '
                f'more than {math.degrees(MAX_HEADING_ERROR):.0f} deg: odometry drifts, or '
                'something turns the robot')

    def _is_settling(self, tick: Tick) -> bool:
        """Return whether a planned velocity belongs to a settle."""
        return self._step(tick).step.settles

    def _settle_time(self, tick: Tick) -> float:
        """
        Return how long the heading may still be corrected at rest [s], as only a settle allows.

        :returns: 0 if there is no settle now, or if a speed factor of 0 holds the robot
        """
        if tick.rest == math.inf or not self._is_settling(tick):
            return 0.0
        return self._step(tick).end - (tick.plan_time or 0.0)

    def _step(self, tick: Tick) -> PlannedStep:
        """Return the step of the plan to which a velocity belongs."""
        return self._plan.steps[self._plan.step_index(tick.plan_time or 0.0)]

    def _limited(self, tick: Tick, wanted: Velocity) -> Velocity:
        """Return the velocity that keeps all limits and is nearest to a wanted velocity."""
        before, limits = self._last_tick, self._limits
        duration = tick.start - before.start if before else 0.0
        planned = before.velocity if before else ZERO
        return Velocity(
            _reachable(
                wanted.linear_x, self._last.linear_x, tick.velocity.linear_x - planned.linear_x,
                _rate(limits.max_linear_acceleration, limits.linear_deceleration, duration),
                (-limits.backward_velocity, limits.max_linear_velocity)),
            _reachable(
                wanted.angular_z, self._last.angular_z,
                tick.velocity.angular_z - planned.angular_z,
                _rate(limits.max_angular_acceleration, limits.angular_deceleration, duration),
                (-limits.max_angular_velocity, limits.max_angular_velocity)))


def _reachable(
        wanted: float, last: float, planned_change: float, largest_change: float,
        bounds: tuple[float, float]) -> float:
    """
    Return the velocity that is nearest to a wanted velocity and keeps the limits.

    :param planned_change: by which the planned velocity changes now: so much is always allowed
    :param largest_change: the largest other change from ``last``
    """
    low = last + min(planned_change, -largest_change)
    high = last + max(planned_change, largest_change)
    return min(max(min(max(wanted, low), high), bounds[0]), bounds[1])


def _rate(acceleration: float, deceleration: float, duration: float) -> float:
    """Return how much a velocity may change in a time: by the smaller of its two limits."""
    return min(acceleration, deceleration) * duration if duration else 0.0


def _are_near(one: PoseSample, two: PoseSample) -> bool:
    """
    Return whether two samples of a robot at rest are close in time and in pose.

    If not, odometry was interrupted or has jumped, and they must not be averaged.
    """
    distance, angle = distance_between(one.pose, two.pose)
    return (two.arrived - one.arrived <= FEEDBACK_MAX_AGE
            and distance <= MAX_MOVED_DISTANCE and abs(angle) <= MAX_MOVED_ANGLE)


def _clip(value: float, bound: float) -> float:
    return min(max(value, -bound), bound)


def _ratio(value: float, bound: float) -> float:
    return value / bound if bound else 0.0


def _mean(poses: Sequence[Pose]) -> Pose:
    count = len(poses)
    return Pose(
        math.fsum(pose.x for pose in poses) / count, math.fsum(pose.y for pose in poses) / count,
        math.fsum(pose.theta for pose in poses) / count)
