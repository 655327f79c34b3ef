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
"""Calibrates odometry by squares in both directions, after UMBmark of Borenstein and Feng."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
import math
from typing import NamedTuple

from kachaka_simple_control.analysis.calibration_fit import CalibrationError, Estimate
from kachaka_simple_control.analysis.odometry_fit import reported_displacement
from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.geometry import ORIGIN, Pose, relative_to
from kachaka_simple_control.motion.odometry_calibration import (
    MAX_WHEEL_RATIO,
    MIN_WHEEL_RATIO,
    OdometryCalibration,
)

#: Standard errors of what is measured at the end of a square: of the position along each axis,
#: and of the heading.
POSITION_ERROR = 0.02
HEADING_ERROR = math.radians(0.6)
#: How far from what odometry reported a square may end, as a part of its length, and how turned.
MAX_END_ERROR = 0.25
MAX_END_TURN = math.radians(120.0)
#: How many times their standard errors the measurements may lie beside the fit, root mean square.
MAX_MISFIT = 4.0
#: The largest standard errors of how much a straight line bends [rad/m], and of the track ratio.
MAX_BEND_ERROR = 0.005
MAX_TRACK_RATIO_ERROR = 0.01
#: How often the fit is bettered at most; a handful of times is enough.
MAX_ITERATIONS = 50


class Square(NamedTuple):
    """
    One square that was driven.

    :param path: the poses that odometry reported, at rest at both ends
    :param measured: where it ended on the floor, as seen from its start: x ahead, y to the left
    """

    path: Sequence[Pose]
    measured: Pose


@dataclass(frozen=True)
class UmbmarkFit:
    """
    The fit of squares in both directions.

    :param wheel_ratio: true diameter of the right wheel over that of the left one
    :param track_ratio: true track over the one that odometry uses
    :param before: the worst systematic error of the position, E_max,syst of UMBmark [m]
    :param after: the same with what was found
    :param closed_form: wheel and track ratio by the formulas of Borenstein and Feng
    """

    wheel_ratio: Estimate
    track_ratio: Estimate
    before: float
    after: float
    closed_form: tuple[float, float]


def closed_form(
        squares: Sequence[Square], track: float, scale: float = 1.0) -> tuple[float, float]:
    """
    Return wheel and track ratio by the formulas of Borenstein and Feng (1996).

    They are of first order.  Their errors of second order have opposite signs in the formulas of
    the two axes, so this is the mean of both.

    :param squares: at least one in each direction
    :param track: the one that odometry uses [m]
    :param scale: true over reported distance, from a straight line
    """
    side = scale * math.fsum(_length(square.path) for square in squares) / (4.0 * len(squares))
    right, left = (
        _mean_error(OdometryCalibration(scale), group) for group in _by_direction(squares))
    wheel, width = [], []
    for both, difference in ((right.x + left.x, right.x - left.x),
                             (right.y - left.y, right.y + left.y)):
        alpha, beta = both / (-4.0 * side), difference / (-4.0 * side)
        # b / R, which is 0 of a straight line
        bend = track * math.sin(beta / 2.0) / (side / 2.0)
        wheel.append((1.0 + bend / 2.0) / (1.0 - bend / 2.0))
        width.append(math.pi / 2.0 / (math.pi / 2.0 - alpha))
    return sum(wheel) / 2.0, sum(width) / 2.0


def fit_umbmark(
        squares: Sequence[Square], track: float, scale: float = 1.0) -> UmbmarkFit:
    """
    Fit squares in both directions: least squares over positions and headings.

    The model is exact: each increment of odometry as it is on the floor, from the start to the
    end.  A scale cannot be told from squares, which end where they began whatever it is.

    :param squares: what was driven; at least one to each side
    :param track: the one that odometry uses [m]
    :param scale: true over reported distance, from a straight line
    :raises CalibrationError: if they cannot tell
    """
    for square in squares:
        _check(square)
    if not all(_by_direction(squares)):
        raise CalibrationError(
            'squares in one direction cannot tell unequal wheels from a wrong track: drive both')

    def residuals(wheel_ratio: float, track_ratio: float) -> list[float]:
        calibration = OdometryCalibration(scale, wheel_ratio, track_ratio, track)
        return [value for square in squares for value in _residual(calibration, square)]

    start = closed_form(squares, track, scale)
    try:
        found, (wheel_error, track_error) = _least_squares(residuals, (
            _within(start[0], MIN_WHEEL_RATIO, MAX_WHEEL_RATIO), _within(start[1], 0.8, 1.25)))
    except InvalidMotionError as error:
        raise CalibrationError(f'the best fit is beyond what wheels may be: {error}') from None
    left = residuals(*found)
    misfit = math.sqrt(sum(value * value for value in left) / (len(left) - 2))
    if misfit > MAX_MISFIT:
        raise CalibrationError(
            f'what was measured lies {misfit:.0f} times further beside the best fit than '
            'measuring explains: is a sign wrong, was the robot moved, or do wheels slip?')
    wheel_error, track_error = (
        error * max(1.0, misfit) for error in (wheel_error, track_error))
    if wheel_error / track > MAX_BEND_ERROR or track_error > MAX_TRACK_RATIO_ERROR:
        raise CalibrationError(
            f'the wheel ratio is {found[0]:.4f}, give or take {wheel_error:.4f}, and the track '
            f'ratio {found[1]:.3f}, give or take {track_error:.3f}: drive larger squares, or more')
    calibration = OdometryCalibration(scale, *found, track)
    return UmbmarkFit(
        Estimate(found[0], wheel_error), Estimate(found[1], track_error),
        worst_systematic_error(squares, OdometryCalibration(scale)),
        worst_systematic_error(squares, calibration), start)


def worst_systematic_error(
        squares: Sequence[Square], calibration: OdometryCalibration) -> float:
    """
    Return E_max,syst of UMBmark: the larger mean error of the position of both directions [m].

    :param squares: what was driven; at least one to each side
    :param calibration: what odometry is corrected by
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
    """Return those to the right and those to the left."""
    turns = [reported_displacement(square.path)[1] for square in squares]
    return ([square for square, turn in zip(squares, turns, strict=True) if turn < -math.pi],
            [square for square, turn in zip(squares, turns, strict=True) if turn > math.pi])


def _length(path: Sequence[Pose]) -> float:
    """Return the length of a path [m]; noise across it adds nothing."""
    return math.fsum(
        abs(moved.x) for before, after in pairwise(path)
        for moved in [relative_to(before, after)])


def _error(calibration: OdometryCalibration, square: Square) -> Pose:
    """Return where a square ended less where it did by odometry, as seen from its start."""
    pose = ORIGIN
    for before, after in pairwise(square.path):
        pose = calibration.advance_on_floor(pose, before, after)
    measured = square.measured
    return Pose(measured.x - pose.x, measured.y - pose.y,
                math.remainder(measured.theta - pose.theta, math.tau))


def _mean_error(calibration: OdometryCalibration, squares: Sequence[Square]) -> Pose:
    errors = [_error(calibration, square) for square in squares]
    return Pose(*(math.fsum(getattr(error, axis) for error in errors) / len(errors)
                  for axis in ('x', 'y', 'theta')))


def _residual(calibration: OdometryCalibration, square: Square) -> tuple[float, float, float]:
    error = _error(calibration, square)
    return error.x / POSITION_ERROR, error.y / POSITION_ERROR, error.theta / HEADING_ERROR


def _within(value: float, least: float, most: float) -> float:
    return min(max(value, least), most)


def _least_squares(
        residuals: Callable[[float, float], Sequence[float]], start: tuple[float, float],
) -> tuple[tuple[float, float], tuple[float, float]]:
    """
    Return the two values with the least sum of squares, and their standard errors.

    Gauss-Newton; a step that does not lessen the sum is halved.

    :param residuals: of two values, each over its standard error
    :raises CalibrationError: if there are no such values in reach
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


def _descend(
        residuals: Callable[[float, float], Sequence[float]], found: tuple[float, float],
        change: tuple[float, float], least: float,
) -> tuple[tuple[float, float], Sequence[float]] | None:
    """Return the values after a step that lessens the sum, with their residuals; None if none."""
    factor = 1.0
    while factor * max(map(abs, change)) > 1e-9:
        tried = found[0] + factor * change[0], found[1] + factor * change[1]
        try:
            left = residuals(*tried)
        except InvalidMotionError:  # out of range
            pass
        else:
            if _dot(left, left) < least:
                return tried, left
        factor /= 2.0
    return None


def _dot(one: Sequence[float], two: Sequence[float]) -> float:
    return math.fsum(x * y for x, y in zip(one, two, strict=True))
