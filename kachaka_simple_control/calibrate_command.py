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
"""The command ``kachaka_calibrate``: drives a robot to and fro, and writes what it makes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
import math
import os
from pathlib import Path
import shlex
import sys

from kachaka_simple_control.__main__ import drive
from kachaka_simple_control.cli import (
    add_drive_options,
    exit_code,
    Options,
    split_ros_arguments,
    take_simulation,
)
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.escaping import escaped
from kachaka_simple_control.exit_codes import HELP, OneLineParser
from kachaka_simple_control.files.robot_profile import calibrated_text
from kachaka_simple_control.preview_command import plan_view
from kachaka_simple_control.report.calibration_fit import CalibrationFit, fit_calibration, MOTION
from kachaka_simple_control.report.calibration_plot import save_calibration_plot
from kachaka_simple_control.report.plan_plot import check_plot_file
from kachaka_simple_control.report.plan_view import PlanView
from kachaka_simple_control.report.report_directory import write_atomically
from kachaka_simple_control.report.text_tables import columns, plan_table, terminal_columns
from kachaka_simple_control.settings import choose_settings

NAME = 'kachaka_calibrate'
HEAD = (('', ''), ('value', ''), ('standard error', ''))


@dataclass(frozen=True)
class CalibrateOptions:
    """
    The options of the command that other commands do not have.

    :param output: the file of the robot to write
    :param floor: on which floor the robot drives, for people
    :param plot: the file to plot the fit to; None for none
    :param is_confirmed: whether to drive without asking
    :param is_dry: whether to show what would be driven, and drive nothing
    """

    output: Path
    floor: str
    plot: str | None
    is_confirmed: bool
    is_dry: bool


def parse(arguments: Sequence[str]) -> tuple[Options, CalibrateOptions]:
    """
    Parse the arguments of the command.

    :raises SystemExit: with code 2 and one line if they are invalid; with 0 after ``--help``
    """
    own, ros = split_ros_arguments(arguments)
    parser = OneLineParser(
        prog=NAME, allow_abbrev=False, epilog=HELP.strip(),
        description='Measure what a robot makes of the velocities that it is sent, by its '
                    'odometry: drive it to and fro and round, for three quarters of a minute on '
                    'about a metre of floor, and write a file with its calibration.')
    add = parser.add_argument
    add('--output', type=Path, default=Path('my_kachaka.yaml'), metavar='FILE',
        help='the file of the robot to write, which must not exist (default: %(default)s)')
    add('--floor', default='', metavar='TEXT', help='on which floor it drives, for people')
    add('--plot', metavar='FILE',
        help='draw what was sent, seen and fitted, as .png, .svg or .pdf')
    add('--yes', action='store_true', help='drive without asking; needed without a terminal')
    add('--dry-run', action='store_true', help='show what would be driven, and drive nothing')
    add_drive_options(parser)
    values = vars(parser.parse_args(own))
    values.pop('ros_args', None)
    more = CalibrateOptions(
        *(values.pop(name) for name in ('output', 'floor', 'plot', 'yes', 'dry_run')))
    simulation = take_simulation(parser, values)
    return Options(
        motions=(MOTION,), ros_arguments=tuple(ros), simulation=simulation, calibrates=True,
        command=shlex.join([NAME, *arguments]), **values), more


def calibrate(options: Options, more: CalibrateOptions) -> None:
    """
    Show the drive, let somebody confirm it, drive, and write the file of the robot.

    :raises CalibrationError: if the drive cannot tell; nothing is written
    :raises ControlError: if the drive could not be completed, or something is wrong before it;
        nothing is written then either
    """
    settings = choose_settings(options, None)
    if settings.profile.calibration is not None:
        raise UsageError(
            f'{escaped(settings.robot)} is calibrated already; name the robot without its '
            'calibration')
    if settings.profile.odometry_topic is None:
        raise UsageError(
            f'{escaped(settings.robot)} has no odometry to measure by; its file names none')
    if more.output.exists():
        raise UsageError(
            f'{escaped(str(more.output))} is there already; name another file by --output')
    if not os.access(more.output.parent, os.W_OK):
        raise UsageError(f'{escaped(str(more.output))} cannot be written; name another file by '
                         '--output')
    plot = None if more.plot is None else check_plot_file(more.plot)
    view = plan_view(MOTION, options)
    print(plan_table([view], terminal_columns()), flush=True)
    if more.is_dry:
        return
    _confirm(options, more, view)
    log = drive(options)
    fit = fit_calibration(log)
    # First of all: what was measured is not lost if a file cannot be written.
    print('\n'.join(['', *_table(fit), '']), flush=True)
    calibration = fit.calibration(datetime.now().astimezone().date().isoformat(), more.floor)
    try:
        write_atomically(
            more.output, calibrated_text(settings.robot, calibration).encode())
    except OSError as error:
        raise UsageError(f'{escaped(str(more.output))}: {error.strerror}') from None
    if plot is not None:
        save_calibration_plot(log, fit, plot)
    print(f'{more.output}: written; drive with --robot '
          f'{more.output if more.output.is_absolute() else f"./{more.output}"}')


def _confirm(options: Options, more: CalibrateOptions, view: PlanView) -> None:
    if options.sim or more.is_confirmed:
        return
    if not sys.stdin.isatty():
        raise UsageError('a robot will move: say --yes, for nobody can be asked here')
    print(f'\nThe robot needs {view.floor_size} of free floor.  Enter drives, Ctrl+C ends.')
    if not sys.stdin.readline():
        raise UsageError('not confirmed: nothing was driven')


def _table(fit: CalibrationFit) -> list[str]:
    rows = [(f'gain {name}', f'{gain.value:.4f}', f'{gain.error:.4f}')
            for name, gain in fit.gains.items()]
    rows += [
        ('veer', f'{math.degrees(fit.veer.value):.2f} deg/m',
         f'{math.degrees(fit.veer.error):.2f} deg/m'),
        ('delay: dead time and lag', f'{fit.delay.value:.3f} s', f'{fit.delay.error:.3f} s'),
        ('noise of odometry, position', f'{1e3 * fit.position_noise:.1f} mm', ''),
        ('noise of odometry, heading', f'{math.degrees(fit.heading_noise):.2f} deg', '')]
    return columns(HEAD, rows)


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the command.

    :param args: arguments without the program's name; None for those of the process
    :returns: the exit code
    """
    options, more = parse(sys.argv[1:] if args is None else args)
    return exit_code(lambda: calibrate(options, more), NAME)


if __name__ == '__main__':
    sys.exit(main())
