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
"""Plot a calibration: the commands, the odometry, and the fitted model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import math
from pathlib import Path
from typing import TYPE_CHECKING

from kachaka_simple_control.analysis.calibration_fit import CalibrationFit
from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.analysis.odometry_alignment import AlignedDrive, DeadReckoning
from kachaka_simple_control.motion.geometry import Pose
from kachaka_simple_control.report.output_file import save_figure
from kachaka_simple_control.report.plot_style import (
    add_axes,
    default_style,
    ODOMETRY,
    PLANNED,
    SENT,
    style_axes,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Sizes and positions [inch].
WIDTH, ROW, GAP = 7.5, 1.9, 0.2
LEFT, RIGHT, BOTTOM, TOP = 0.78, 0.14, 0.85, 0.1
#: The label and the value of each plot over time, from top to bottom.
AXES: tuple[tuple[str, Callable[[Pose], float]], ...] = (
    ('x [m]', lambda pose: pose.x), ('heading [°]', lambda pose: math.degrees(pose.theta)))


def save_calibration_plot(log: DriveLog, fit: CalibrationFit, path: Path) -> None:
    """
    Plot a calibration: with a good fit, the odometry line lies on the fitted line.

    :param path: the file, as ``check_plot_file`` returned it
    :raises UsageError: if matplotlib is missing, or the file cannot be written
    """
    with default_style():
        from matplotlib.figure import Figure
        figure = Figure(figsize=(WIDTH, BOTTOM + 2.0 * ROW + GAP + TOP))
        _draw(figure, log, fit)
    save_figure(figure, path)


def _draw(figure: Figure, log: DriveLog, fit: CalibrationFit) -> None:
    drive, calibration = AlignedDrive(log), fit.calibration('', '')
    # A lag is drawn as a dead time of the same length: the average delay is equal.
    fitted = DeadReckoning([
        replace(message, time=message.time + fit.delay.value,
                velocity=calibration.response(message.velocity))
        for message in drive.sent], log.command_timeout)
    times = [sample.time for sample in drive.odometry]
    poses = {
        'sent': [drive.dead_reckoning.at(sample.received.time) for sample in drive.odometry],
        'fit': [fitted.at(sample.received.time) for sample in drive.odometry],
        'odometry': [sample.pose for sample in drive.odometry]}
    for row, (label, value) in enumerate(reversed(AXES)):
        axes = add_axes(
            figure, LEFT, BOTTOM + row * (ROW + GAP), WIDTH - LEFT - RIGHT, ROW)
        style_axes(axes, WIDTH - LEFT - RIGHT)
        axes.set(ylabel=label, xlim=(0.0, times[-1]))
        axes.tick_params(labelbottom=row == 0)
        for (name, line), look in zip(poses.items(), (SENT, PLANNED, ODOMETRY)):
            axes.plot(times, [value(pose) for pose in line], **look, label=name, gid=name)
        if row == 0:
            axes.set_xlabel('time [s]')
            figure.legend(
                *axes.get_legend_handles_labels(), loc='lower left', ncol=3, frameon=False,
                bbox_to_anchor=(LEFT / WIDTH, 0.0))
