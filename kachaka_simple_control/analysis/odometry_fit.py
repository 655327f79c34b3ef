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
"""
Calibrate odometry with measurements of the robot's movement on the floor.

Either from a straight line of 1 m and a turn of 360 degrees, or from squares driven both ways
round: UMBmark by Borenstein and Feng.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
import math
from statistics import fmean
from typing import NamedTuple

from kachaka_simple_control.analysis.calibration_fit import (
    CalibrationError,
    completed_steps,
    Estimate,
    find_rest,
)
from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.analysis.odometry_alignment import is_plausible
from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.calibration import (
    MAX_GAIN,
    MAX_WHEEL_RATIO,
    MIN_GAIN,
    MIN_WHEEL_RATIO,
    OdometryCalibration,
)
from kachaka_simple_control.motion.geometry import ORIGIN, Pose, relative_to

#: The wheel ratio and the track ratio, or their standard errors.
Pair = tuple[float, float]
#: A function that returns the residuals of a fit for two parameters.
Residuals = Callable[[float, float], Sequence[float]]

#: The standard errors of the distance measured with the tape [m], from two marks that are read to
#: 1 mm each, and of the measured angle [rad], which is read to 1 degree.
TAPE_ERROR = 0.0015
ANGLE_ERROR = math.radians(1.0)
#: The shortest time between two poses of a path [s].
PATH_PERIOD = 0.1


@dataclass(frozen=True)
class FloorFit:
    """The calibration of odometry from a straight line of 1 m and a turn of 360 degrees."""

    scale: Estimate
    track_ratio: Estimate


def reported_path(log: DriveLog) -> list[Pose]:
    """
    Return the odometry poses of a drive that starts and ends with a rest.

    :raises CalibrationError: if the drive was not completed at the planned speed, if it does not
        start and end with a rest, or if odometry does not show standstill in these rests
    """
    steps = completed_steps(log)
    odometry = [sample for sample in log.odometry if is_plausible(sample)]
    if not (steps[0].step.is_rest and steps[-1].step.is_rest):
        raise CalibrationError('the motion must begin and end with a wait')
    start, end = find_rest(odometry, steps[0]).pose, find_rest(odometry, steps[-1]).pose
    path, time = [start], steps[1].began
    for sample in odometry:
        if time + PATH_PERIOD <= sample.time < steps[-1].began:
            path.append(sample.pose)
            time = sample.time
    return [*path, end]


def reported_displacement(path: Sequence[Pose]) -> tuple[float, float]:
    """
    Return the straight distance of first and last pose [m], and the total heading change [rad].

    :param path: the heading must change by less than half a turn between consecutive poses
    """
    start, end = path[0], path[-1]
    return math.hypot(end.x - start.x, end.y - start.y), math.fsum(
        math.remainder(after.theta - before.theta, math.tau) for before, after in pairwise(path))


def fit_floor(reported_distance: float, measured_distance: float, reported_angle: float,
              measured_angle: float) -> FloorFit:
    """
    Compute the scale and the track ratio of odometry from a straight line and a turn in place.

    The track ratio is ``scale * reported_angle / measured_angle``.

    :param measured_angle: the total angle [rad], with the sign of that in odometry
    :raises CalibrationError: if a value is not finite, or measured and reported differ too much
    """
    scale = _ratio('distance', reported_distance, measured_distance, 'm')
    turn = _ratio('angle', reported_angle, measured_angle, 'rad')
    distance_error = TAPE_ERROR / abs(measured_distance)
    angle_error = ANGLE_ERROR / abs(measured_angle)
    ratio = scale / turn
    if not MIN_GAIN <= ratio <= MAX_GAIN:
        raise CalibrationError(
            f'the track would be {ratio:.3g} times what odometry uses: was all measured rightly?')
    return FloorFit(Estimate(scale, scale * distance_error),
                    Estimate(ratio, ratio * math.hypot(distance_error, angle_error)))


def _ratio(name: str, reported: float, measured: float, unit: str) -> float:
    if not (math.isfinite(reported) and math.isfinite(measured)):
        raise CalibrationError(f'the {name} is no finite number')
    if reported == 0.0 or not MIN_GAIN <= measured / reported <= MAX_GAIN:
        raise CalibrationError(
            f'the {name} is {measured:.4g} {unit} by the tape and {reported:.4g} {unit} by '
            'odometry: which of them is wrong?')
    return measured / reported


#: The standard errors of the measurement at the end of a square: of the position along each axis
#: [m], and of the heading [rad].
POSITION_ERROR = 0.02
HEADING_ERROR = math.radians(0.6)
#: The largest difference between the measured and the reported end of a square: the distance
#: divided by the path length, and the heading difference [rad].
MAX_END_ERROR = 0.25
MAX_END_TURN = math.radians(120.0)
#: The largest root mean square residual of the fit [standard errors].
MAX_MISFIT = 4.0
#: The largest standard errors of the curvature of a path that should be straight [rad/m], and of
#: the track ratio.
MAX_BEND_ERROR = 0.005
MAX_TRACK_RATIO_ERROR = 0.01
#: The largest number of iterations of the fit; usually about five are enough.
MAX_ITERATIONS = 50


class Square(NamedTuple):
    """
    The odometry poses and the measured end pose of one driven square.

    :param path: the odometry poses; the robot stands still at the first and at the last one
    :param measured: the end pose measured on the floor, relative to the start pose: x ahead, y to
        the left
    """

    path: Sequence[Pose]
    measured: Pose


@dataclass(frozen=True)
class UmbmarkFit:
    """
    The calibration of odometry from squares driven both ways round.

    :param before: the largest systematic position error without a correction by the two ratios
        [m]; UMBmark calls it E_max,syst
    :param after: the same error with the correction [m]
    :param closed_form: both ratios by the formulas of Borenstein and Feng, for comparison
    """

    wheel_ratio: Estimate
    track_ratio: Estimate
    before: float
    after: float
    closed_form: tuple[float, float]


def closed_form(
        squares: Sequence[Square], track: float, scale: float = 1.0) -> tuple[float, float]:
    """
    Compute the wheel ratio and the track ratio with the formulas of Borenstein and Feng (1996).

    They are approximate, and give two values of each, from the errors along x and y: the mean
    counts.

    :param squares: at least one with left turns and one with right turns
    :param track: the wheel separation that odometry uses [m]
    """
    side = scale * math.fsum(_length(square.path) for square in squares) / (4.0 * len(squares))
    right, left = (
        _mean_error(OdometryCalibration(scale), group) for group in _by_direction(squares))
    wheel, width = [], []
    for both, difference in ((right.x + left.x, right.x - left.x),
                             (right.y - left.y, right.y + left.y)):
        alpha, beta = both / (-4.0 * side), difference / (-4.0 * side)
        # track divided by curve radius; 0 for a straight line
        bend = track * math.sin(beta / 2.0) / (side / 2.0)
        wheel.append((1.0 + bend / 2.0) / (1.0 - bend / 2.0))
        width.append(math.pi / 2.0 / (math.pi / 2.0 - alpha))
    # The second-order errors of the two values have opposite signs, so the mean is more accurate.
    return sum(wheel) / 2.0, sum(width) / 2.0


def fit_umbmark(squares: Sequence[Square], track: float, scale: float = 1.0) -> UmbmarkFit:
    """
    Fit the wheel ratio and the track ratio to the measured end poses of driven squares.

    Least squares of the end poses from odometry, corrected exactly, movement by movement.  The
    scale does not change the end pose of an ideal square, so it is not fitted.

    :param squares: at least one with left turns and one with right turns
    :param track: the wheel separation that odometry uses [m]
    :raises CalibrationError: if the squares give no valid calibration
    """
    for square in squares:
        _check(square)
    if not all(_by_direction(squares)):
        raise CalibrationError(
            'squares in one direction cannot tell unequal wheels from a wrong track: drive both')

    def residuals(wheel_ratio: float, track_ratio: float) -> list[float]:
        calibration = OdometryCalibration(scale, wheel_ratio, track_ratio, track)
        errors = [_error(calibration, square) for square in squares]
        return [value for error in errors for value in (
            error.x / POSITION_ERROR, error.y / POSITION_ERROR, error.theta / HEADING_ERROR)]

    start = closed_form(squares, track, scale)
    try:
        found, (wheel_error, track_error) = _least_squares(residuals, (
            min(max(start[0], MIN_WHEEL_RATIO), MAX_WHEEL_RATIO), min(max(start[1], 0.8), 1.25)))
    except InvalidMotionError as error:
        raise CalibrationError(f'the best fit is beyond what wheels may be: {error}') from None
    left = residuals(*found)
    misfit = math.sqrt(sum(value * value for value in left) / (len(left) - 2))
    if misfit > MAX_MISFIT:
        raise CalibrationError(
            f'what was measured lies {misfit:.0f} times further beside the best fit than '
            'measuring explains: is a sign wrong, was the robot moved, or do wheels slip?')
    wheel_error, track_error = (error * max(1.0, misfit) for error in (wheel_error, track_error))
    if wheel_error / track > MAX_BEND_ERROR or track_error > MAX_TRACK_RATIO_ERROR:
        raise CalibrationError(
            f'the wheel ratio is {found[0]:.4f}, give or take {wheel_error:.4f}, and the track '
            f'ratio {found[1]:.3f}, give or take {track_error:.3f}: drive larger squares, or more')
    calibration = OdometryCalibration(scale, *found, track)
    return UmbmarkFit(
        Estimate(found[0], wheel_error), Estimate(found[1], track_error),
        worst_systematic_error(squares, OdometryCalibration(scale)),
        worst_systematic_error(squares, calibration), start)


def worst_systematic_error(squares: Sequence[Square], calibration: OdometryCalibration) -> float:
    """
    Return the largest systematic position error [m], which UMBmark calls E_max,syst.

    It is the longer one of the mean error vectors, of left turns and of right turns.

    :param squares: at least one with left turns and one with right turns
    """
    means = [_mean_error(calibration, group) for group in _by_direction(squares)]
    return max(math.hypot(mean.x, mean.y) for mean in means)


def _check(square: Square) -> None:
    measured, length = square.measured, _length(square.path)
    if not all(map(math.isfinite, (measured.x, measured.y, measured.theta))):
        raise CalibrationError('what was measured has a value that is no finite number')
    error = _error(OdometryCalibration(), square)
    if math.hypot(error.x, error.y) > MAX_END_ERROR * length:
        raise CalibrationError(
            f'a square ended {math.hypot(error.x, error.y):.3g} m from where odometry reported '
            f'it, after {length:.3g} m: is that in metres, and from where it began?')
    if abs(error.theta) > MAX_END_TURN:
        raise CalibrationError(
            f'a square ended turned {math.degrees(error.theta):.0f} deg from what odometry '
            'reported: is that the heading as seen from its start?')


def _by_direction(squares: Sequence[Square]) -> tuple[list[Square], list[Square]]:
    """Return the squares with turns to the right, and the squares with turns to the left."""
    turns = [reported_displacement(square.path)[1] for square in squares]
    return ([square for square, turn in zip(squares, turns, strict=True) if turn < -math.pi],
            [square for square, turn in zip(squares, turns, strict=True) if turn > math.pi])


def _length(path: Sequence[Pose]) -> float:
    """Return the length of a path of odometry poses [m]; what is sideways is noise."""
    return math.fsum(abs(relative_to(before, after).x) for before, after in pairwise(path))


def _error(calibration: OdometryCalibration, square: Square) -> Pose:
    """
    Return the measured end pose of a square minus the end pose from corrected odometry.

    :returns: the difference of each component; the heading difference is from -pi to pi
    """
    pose = ORIGIN
    for before, after in pairwise(square.path):
        pose = calibration.advance_on_floor(pose, before, after)
    measured = square.measured
    return Pose(measured.x - pose.x, measured.y - pose.y,
                math.remainder(measured.theta - pose.theta, math.tau))


def _mean_error(calibration: OdometryCalibration, squares: Sequence[Square]) -> Pose:
    errors = [_error(calibration, square) for square in squares]
    return Pose(*(fmean(getattr(error, axis) for error in errors) for axis in ('x', 'y', 'theta')))


def _least_squares(residuals: Residuals, start: Pair) -> tuple[Pair, Pair]:
    """
    Find the two parameters with the least sum of squared residuals, and their standard errors.

    Gauss-Newton; a change that does not reduce the sum is halved.

    :raises CalibrationError: if the data do not determine the parameters, or it does not converge
    """
    found, step = start, 1e-6
    left = residuals(*found)
    for _ in range(MAX_ITERATIONS):
        columns = [
            [(more - less) / (2.0 * step) for more, less in zip(
                residuals(found[0] + step * dx, found[1] + step * dy),
                residuals(found[0] - step * dx, found[1] - step * dy), strict=True)]
            for dx, dy in ((1.0, 0.0), (0.0, 1.0))]
        a, b, c = _dot(columns[0], columns[0]), _dot(*columns), _dot(columns[1], columns[1])
        determinant = a * c - b * b
        if determinant <= 1e-9 * a * c:
            raise CalibrationError(
                'the squares cannot tell unequal wheels from a wrong track: were they driven?')
        p, q = _dot(columns[0], left), _dot(columns[1], left)
        change = (b * q - c * p) / determinant, (b * p - a * q) / determinant
        better = _descend(residuals, found, change, _dot(left, left))
        if better is None:
            return found, (math.sqrt(c / determinant), math.sqrt(a / determinant))
        found, left = better
    raise CalibrationError('no wheels and no track explain what was measured')


def _descend(residuals: Residuals, found: Pair, change: Pair,
             least: float) -> tuple[Pair, Sequence[float]] | None:
    """Return parameters with a smaller sum of squares, and the residuals; or None."""
    factor = 1.0
    while factor * max(map(abs, change)) > 1e-9:
        tried = found[0] + factor * change[0], found[1] + factor * change[1]
        try:
            left = residuals(*tried)
        except InvalidMotionError:  # a parameter is out of range
            pass
        else:
            if _dot(left, left) < least:
                return tried, left
        factor /= 2.0
    return None


def _dot(one: Sequence[float], two: Sequence[float]) -> float:
    return math.fsum(x * y for x, y in zip(one, two, strict=True))
