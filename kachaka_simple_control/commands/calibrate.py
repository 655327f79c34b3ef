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
"""The command ``kachaka_calibrate``: calibrate a robot, and write its profile."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
import math
import sys

from kachaka_simple_control.analysis.calibration_fit import CalibrationFit, fit_calibration, MOTION
from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.commands.calibrate_options import (
    ask,
    CalibrateOptions,
    drive_until_good,
    FIT_HEAD,
    FLOOR,
    NAME,
    parse,
    require_ready,
    show,
    today,
    UMBMARK,
    write_robot,
)
from kachaka_simple_control.commands.cli import Options
from kachaka_simple_control.commands.drive_or_preview import drive
from kachaka_simple_control.commands.preview import plan_view
from kachaka_simple_control.commands.tape_measure import measure_floor, measure_squares
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.report.drive_plots import save_calibration_plot
from kachaka_simple_control.report.output_file import check_plot_file
from kachaka_simple_control.report.text_tables import columns
from kachaka_simple_control.run_command import run_command
from kachaka_simple_control.text import escaped


def calibrate(options: Options, more: CalibrateOptions) -> None:
    """
    Drive a calibration motion after the user's confirmation, and write the robot's profile.

    :raises CalibrationError: if the drive gives no valid calibration; no file is written
    :raises ControlError: if the drive cannot start or is not completed; no file is written
    """
    settings = require_ready(options, more)
    if settings.profile.is_calibrated:
        raise UsageError(
            f'{escaped(settings.robot)} is calibrated already; name the robot without its '
            'calibration')
    plot = None if more.plot is None else check_plot_file(more.plot)
    view = plan_view(MOTION, options)
    show([view])
    if more.is_dry:
        return

    def measure(options: Options) -> tuple[DriveLog, CalibrationFit]:
        ask(options, more, view)
        log = drive(replace(options, motions=(MOTION,)))
        return log, fit_calibration(log)

    log, fit = drive_until_good(options, more, measure)
    # Printed first, so that the result is not lost if the file cannot be written.
    print('\n'.join(['', *_table(fit), '']), flush=True)
    write_robot(settings.robot, fit.calibration(today(), more.floor), more.file)
    if plot is not None:
        save_calibration_plot(log, fit, plot)


def _table(fit: CalibrationFit) -> list[str]:
    rows = [(f'gain {name}', f'{gain.value:.4f}', f'{gain.error:.4f}')
            for name, gain in fit.gains.items()]
    rows += [
        ('veer', f'{math.degrees(fit.veer.value):.2f} deg/m',
         f'{math.degrees(fit.veer.error):.2f} deg/m'),
        ('delay: dead time and lag', f'{fit.delay.value:.3f} s', f'{fit.delay.error:.3f} s'),
        ('noise of odometry, position', f'{1e3 * fit.position_noise:.1f} mm', ''),
        ('noise of odometry, heading', f'{math.degrees(fit.heading_noise):.2f} deg', '')]
    return columns(FIT_HEAD, rows)


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the command.

    :param args: the arguments without the program's name; None for the process's arguments
    :returns: the exit code
    """
    options, more = parse(sys.argv[1:] if args is None else args)
    measure = {FLOOR: measure_floor, UMBMARK: measure_squares}.get(more.part, calibrate)
    return run_command(partial(measure, options, more), NAME)


if __name__ == '__main__':
    sys.exit(main())
