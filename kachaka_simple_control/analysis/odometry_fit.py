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
"""Calibrates odometry by 1 m and a turn: a tape's measurements against odometry's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
import math

from kachaka_simple_control.analysis.calibration_fit import (
    CalibrationError,
    completed_steps,
    Estimate,
    find_rest,
)
from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.analysis.odometry_alignment import is_plausible
from kachaka_simple_control.motion.calibration import MAX_GAIN, MIN_GAIN
from kachaka_simple_control.motion.geometry import Pose

#: Standard errors of what is measured of 1 m and of a whole turn: two marks, each read to 1 mm,
#: and an angle read to 1 deg.
TAPE_ERROR = 0.0015
ANGLE_ERROR = math.radians(1.0)
#: The shortest time between two poses of a path [s].
PATH_PERIOD = 0.1


@dataclass(frozen=True)
class FloorFit:
    """
    The fit of 1 m and a whole turn.

    :param scale: true over reported distance
    :param track_ratio: true track over the one that odometry uses
    """

    scale: Estimate
    track_ratio: Estimate


def reported_path(log: DriveLog) -> list[Pose]:
    """
    Return the poses that odometry reported in a drive that begins and ends with a rest.

    :raises CalibrationError: if the drive was not completed, or odometry does not cover it
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
    """Return how far apart the ends of a path are [m], and the heading change [rad]."""
    start, end = path[0], path[-1]
    return math.hypot(end.x - start.x, end.y - start.y), math.fsum(
        math.remainder(after.theta - before.theta, math.tau) for before, after in pairwise(path))


def fit_floor(
        reported_distance: float, measured_distance: float, reported_angle: float,
        measured_angle: float) -> FloorFit:
    """
    Fit scale and track to a straight line and a turn on the spot.

    The first is the scale s; with the true track b and the one of odometry b_0, a reported turn
    is s b_0 / b times as large on the floor.

    :param reported_distance: by odometry [m]
    :param measured_distance: by the tape [m]
    :param reported_angle: by odometry [rad]
    :param measured_angle: on the floor, in all, of the same sign [rad]
    :raises CalibrationError: if that cannot be
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
