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
"""Compute the calibration of a robot from the odometry of a known motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import math
from statistics import fmean
from typing import NamedTuple

from kachaka_simple_control.analysis.drive_log import DriveLog, StepLog
from kachaka_simple_control.analysis.odometry_alignment import DeadReckoning, is_plausible
from kachaka_simple_control.control.events import OdometryReceived
from kachaka_simple_control.errors import RunFaultError
from kachaka_simple_control.motion.calibration import Calibration, MAX_GAIN, MIN_GAIN
from kachaka_simple_control.motion.geometry import Displacement, Pose

#: The name of the library motion that the robot drives for the calibration.
MOTION = 'calibration'
#: The length of the last part of a rest, in which the robot must stand still [s].
REST = 1.0
#: The smallest number of odometry samples in this part of a rest.
MIN_SAMPLES = 10
#: The largest standard errors that a calibration may have: of a gain, and of the delay [s].
MAX_GAIN_ERROR = 0.0025
MAX_DELAY_ERROR = 0.01
#: The largest difference between the gains of two equal steps.  A larger difference means that the
#: wheels slip or that the floor is uneven.
MAX_SPREAD = 0.01
#: A deviation up to this value can be random noise [standard errors].
CHANCE = 4.0


class CalibrationError(RunFaultError):
    """Raised if measurements give no valid calibration; the text of the error says why."""


class Estimate(NamedTuple):
    """An estimated value and its standard error, in the same unit."""

    value: float
    error: float


@dataclass(frozen=True)
class CalibrationFit:
    """
    A calibration that was computed from the odometry of a drive.

    :param gains: for each direction: forward, backward, left, right
    :param veer: [rad/m], positive to the left
    :param position_noise: the standard deviation of odometry's position along one axis at rest [m]
    :param heading_noise: the standard deviation of odometry's heading at rest [rad]
    """

    gains: dict[str, Estimate]
    veer: Estimate
    delay: Estimate
    position_noise: float
    heading_noise: float

    def calibration(self, date: str, floor: str) -> Calibration:
        """
        Return the fitted values, rounded; a negative delay, from noise, becomes 0.

        :param date: of the measurement, as text
        :param floor: on which the robot drove, as text
        """
        gains = {f'{name}_gain': round(gain.value, 5) for name, gain in self.gains.items()}
        return Calibration(
            **gains, veer=round(self.veer.value, 5),
            delay=round(max(0.0, self.delay.value), 4), date=date, floor=floor)


class Rest(NamedTuple):
    """
    The mean odometry pose of a robot that stands still, and the noise of this odometry.

    :param position_noise: the standard deviation of the samples' positions along one axis [m]
    :param heading_noise: the standard deviation of the samples' headings [rad]
    """

    pose: Pose
    samples: int
    position_noise: float
    heading_noise: float


class _Drive(NamedTuple):
    """The gain, the veer [rad/m] (None for a turn in place) and the delay in one step."""

    direction: str
    gain: Estimate
    veer: Estimate | None
    delay: Estimate


def fit_calibration(log: DriveLog) -> CalibrationFit:
    """
    Compute a calibration from the log of a robot that drove the motion ``calibration``.

    A displacement is measured between the mean poses of the rests before and after a movement.
    The delay is the dead time plus the time constants of the filter.

    :raises CalibrationError: if the drive was not completed at the planned speed, or a result is
        out of range or too uncertain
    """
    steps = completed_steps(log)
    sent = DeadReckoning(log.sent, log.command_timeout)
    odometry = [sample for sample in log.odometry if is_plausible(sample)]
    rests = [find_rest(odometry, step) if step.step.is_rest else None for step in steps]
    drives = []
    for index, step in enumerate(steps):
        before, after = rests[max(0, index - 1)], rests[min(index + 1, len(rests) - 1)]
        if before is not None and after is not None and not step.step.is_rest:
            end = steps[index + 1].began + steps[index + 1].planned.duration
            drives.append(_drive(odometry, sent, step, before, after, end))
    by_direction: dict[str, list[Estimate]] = {}
    for drive in drives:
        by_direction.setdefault(drive.direction, []).append(drive.gain)
    gains = {direction: _gain(direction, found) for direction, found in by_direction.items()}
    known = [rest for rest in rests if rest is not None]
    delay = _mean([drive.delay for drive in drives])
    if delay.error > MAX_DELAY_ERROR:
        raise CalibrationError(
            f'the delay is {delay.value:.3f} s, give or take {delay.error:.3f} s: odometry has '
            'too much noise, or the robot follows too irregularly')
    return CalibrationFit(
        gains, _mean([drive.veer for drive in drives if drive.veer is not None]), delay,
        math.sqrt(sum(rest.position_noise ** 2 for rest in known) / len(known)),
        math.sqrt(sum(rest.heading_noise ** 2 for rest in known) / len(known)))


def completed_steps(log: DriveLog) -> list[StepLog]:
    """
    Return the steps of a drive if it was completed at the planned speed; else raise an error.

    :raises CalibrationError: if the drive was not completed, or was paused or slowed down
    """
    steps = log.steps
    if not steps or not all(step.is_complete for step in steps):
        raise CalibrationError('the drive was not completed: begin again')
    if any(step.is_delayed for step in steps):
        raise CalibrationError('the drive was paused or slowed down: begin again')
    return steps


def find_rest(odometry: Sequence[OdometryReceived], step: StepLog) -> Rest:
    """
    Return the mean pose and the noise of odometry in the last second of a rest.

    :raises CalibrationError: if there are too few samples, or the robot did not stand still
    """
    end = step.began + step.planned.duration
    poses = [sample.pose for sample in odometry if end - REST <= sample.time <= end]
    if len(poses) < MIN_SAMPLES:
        raise CalibrationError(
            f'odometry reported where the robot stood {len(poses)} times in {REST:g} s; at least '
            f'{MIN_SAMPLES} are needed: is its odometry there, at 10 Hz or more?')
    first = poses[0].theta
    turned = [math.remainder(pose.theta - first, math.tau) for pose in poses]
    count, half = len(poses), len(poses) // 2
    x, y, turn = fmean(pose.x for pose in poses), fmean(pose.y for pose in poses), fmean(turned)
    position = math.sqrt(
        fmean(((pose.x - x) ** 2 + (pose.y - y) ** 2) / 2.0 for pose in poses))
    heading = math.sqrt(fmean((angle - turn) ** 2 for angle in turned))
    moved = math.hypot(*(
        fmean(getattr(pose, axis) for pose in poses[half:])
        - fmean(getattr(pose, axis) for pose in poses[:half]) for axis in 'xy'))
    if moved > 2.0 * CHANCE * position / math.sqrt(half) + 0.001:
        raise CalibrationError(
            f'the robot still moved, by {1e3 * moved:.1f} mm, when it should have stood still: '
            'does something push it, or does it follow too slowly?')
    return Rest(Pose(x, y, first + turn), count, position, heading)


def _drive(
        odometry: Sequence[OdometryReceived], sent: DeadReckoning, step: StepLog, before: Rest,
        after: Rest, end: float) -> _Drive:
    """
    Compute the gain, the veer and the delay of a moving step between two rests.

    :raises CalibrationError: if the gain is out of range
    """
    is_straight = step.step.displacement.distance != 0.0
    extent = (_straight if is_straight else _turn)(
        step.step.displacement, before, after, sent.at(step.began))
    gain = extent.reported / extent.requested
    if not MIN_GAIN <= gain <= MAX_GAIN:
        unit = 'm' if is_straight else 'rad'
        raise CalibrationError(
            f'{step.step.describe()}: odometry reported {extent.reported:.3f} {unit}: is the '
            'robot held, or is its odometry wrong?')
    # There are two curves over time: the displacement according to the sent velocities, and the
    # displacement in odometry divided by the gain.  The delay is the area between them, divided by
    # the requested displacement.
    area, time, height, theta = 0.0, step.began, 0.0, before.pose.theta
    for sample in odometry:
        if time < sample.time <= end:
            theta += math.remainder(sample.pose.theta - theta, math.tau)
            behind = extent.sent_distance(sent.at(sample.time)) - extent.reported_distance(
                Pose(sample.pose.x, sample.pose.y, theta)) / gain
            area += 0.5 * (height + behind) * (sample.time - time)
            time, height = sample.time, behind
    # An error of the pose before the step changes all values of ``height`` equally.
    return _Drive(
        extent.direction, Estimate(gain, extent.error / extent.requested), extent.veer,
        Estimate(area / extent.requested,
                 extent.error / gain * (end - step.began) / extent.requested))


class _StepExtent(NamedTuple):
    """
    The displacement of one moving step, as requested and as reported by odometry.

    It is a distance [m], or an angle [rad] for a turn in place, positive in the requested
    direction.

    :param veer: in odometry [rad/m]; None for a turn in place
    """

    direction: str
    requested: float
    reported: float
    error: float
    veer: Estimate | None
    sent_distance: Callable[[Pose], float]
    reported_distance: Callable[[Pose], float]


def _straight(requested: Displacement, before: Rest, after: Rest, origin: Pose) -> _StepExtent:
    start, end = before.pose, after.pose
    sign = math.copysign(1.0, requested.distance)
    x, y = end.x - start.x, end.y - start.y
    length = math.hypot(x, y)
    ahead = sign * (x * math.cos(start.theta) + y * math.sin(start.theta))
    # The veer bends the path slightly, so the path is longer by a few parts in 100 000.
    reported = math.copysign(length, ahead)
    along = (x / length, y / length) if length else (0.0, 0.0)
    heading_error = _error(before, after, 'heading_noise')
    turned = sign * math.remainder(end.theta - start.theta, math.tau)
    return _StepExtent(
        'forward' if sign > 0.0 else 'backward', abs(requested.distance), reported,
        _error(before, after, 'position_noise'),
        Estimate(turned / reported, heading_error / length) if length else None,
        lambda pose: sign * ((pose.x - origin.x) * math.cos(origin.theta)
                             + (pose.y - origin.y) * math.sin(origin.theta)),
        lambda pose: (pose.x - start.x) * along[0] + (pose.y - start.y) * along[1])


def _turn(requested: Displacement, before: Rest, after: Rest, origin: Pose) -> _StepExtent:
    start, total = before.pose.theta, abs(requested.angle)
    sign = math.copysign(1.0, requested.angle)
    # Add whole turns so that the reported angle is as near as possible to the requested one.
    reported = total + math.remainder(sign * (after.pose.theta - start) - total, math.tau)
    return _StepExtent(
        'left' if sign > 0.0 else 'right', total, reported, _error(before, after, 'heading_noise'),
        None, lambda pose: sign * (pose.theta - origin.theta),
        lambda pose: sign * (pose.theta - start))


def _error(before: Rest, after: Rest, noise: str) -> float:
    """
    Return the standard error of the difference between the mean poses of two rests.

    :returns: the standard error of the position along one axis [m], or of the heading [rad]
    """
    return math.hypot(*(
        float(getattr(rest, noise)) / math.sqrt(rest.samples) for rest in (before, after)))


def _gain(direction: str, gains: Sequence[Estimate]) -> Estimate:
    mean = _mean(gains)
    values = [gain.value for gain in gains]
    spread = max(values) - min(values)
    if spread > MAX_SPREAD + CHANCE * max(gain.error for gain in gains):
        raise CalibrationError(
            f'two drives {direction} differ by {1e2 * spread:.1f} %: do the wheels slip, or is '
            'the floor uneven?')
    if mean.error > MAX_GAIN_ERROR:
        raise CalibrationError(
            f'the gain {direction} is {mean.value:.4f}, give or take {mean.error:.4f}: odometry '
            'has too much noise, or no two drives are alike')
    return mean


def _mean(estimates: Sequence[Estimate]) -> Estimate:
    """
    Return the mean of several estimates, with its standard error.

    That is the larger one of two: from the errors of the estimates, and from their differences.
    """
    count = len(estimates)
    value = fmean([estimate.value for estimate in estimates])
    chance = math.sqrt(sum(estimate.error ** 2 for estimate in estimates)) / count
    if count < 2:
        return Estimate(value, chance)
    spread = math.sqrt(sum((estimate.value - value) ** 2 for estimate in estimates)
                       / (count - 1) / count)
    return Estimate(value, max(chance, spread))
