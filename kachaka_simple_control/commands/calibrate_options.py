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
"""The options and functions that all parts of ``kachaka_calibrate`` share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
import os
from pathlib import Path
import shlex
import sys
from typing import TypeVar

from kachaka_simple_control.analysis.calibration_fit import CalibrationError
from kachaka_simple_control.analysis.plan_view import PlanView
from kachaka_simple_control.commands.cli import (
    add_drive_options,
    Options,
    split_ros_arguments,
    take_simulation,
)
from kachaka_simple_control.commands.drive_or_preview import confirm
from kachaka_simple_control.commands.settings import choose_settings, Settings
from kachaka_simple_control.control.signals import signal_dispatcher
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.exit_codes import HELP, OneLineParser
from kachaka_simple_control.files.robot_profile import calibrated_text
from kachaka_simple_control.motion.calibration import Calibration, OdometryCalibration
from kachaka_simple_control.report.output_file import write_atomically
from kachaka_simple_control.report.text_tables import Column, plan_table, terminal_columns
from kachaka_simple_control.text import escaped, escaped_lines, quoted

T = TypeVar('T')

NAME = 'kachaka_calibrate'
OUTPUT = Path('my_kachaka.yaml')
#: The header of the table of a fit.
FIT_HEAD = (Column(''), Column('value'), Column('standard error'))
#: The largest number of attempts of a drive.
MAX_ATTEMPTS = 3
#: The parts that need a tape measure.
FLOOR, UMBMARK = 'floor', 'umbmark'
EPILOG = """\
Without a word it measures by odometry alone: what the robot makes of the velocities that it is
sent.  It drives to and fro and round, for three quarters of a minute on about a metre of floor.

With a tape measure it measures odometry itself.  `floor` drives 1 m and once round, and asks what
that was on the floor.  `umbmark` drives a square to each side, asks where each ended, and finds
how unequal the wheels are and how wide the track is (after J. Borenstein and L. Feng, 1996).

"""


@dataclass(frozen=True)
class CalibrateOptions:
    """
    The options that only ``kachaka_calibrate`` has.

    :param part: the measurement: '' with odometry, ``floor`` or ``umbmark`` with a tape measure
    :param output: the profile to write; None if not given
    :param floor: a description of the floor, for the profile
    :param plot: the file for a plot of the fit; None for no plot
    :param is_confirmed: whether to drive without asking
    :param is_dry: whether to show the motion without driving
    :param measured: the answers to the questions, in order; empty to ask the user
    :param side: the side length of the squares, as text
    :param squares: the number of squares in each direction
    :param track: the track that odometry uses, as text; None for the known track of the robot
    """

    part: str
    output: Path | None
    floor: str
    plot: str | None
    is_confirmed: bool
    is_dry: bool
    measured: list[str]
    side: str | None
    squares: int | None
    track: str | None

    @property
    def file(self) -> Path:
        """Return the path of the profile to write."""
        return OUTPUT if self.output is None else self.output


def parse(arguments: Sequence[str]) -> tuple[Options, CalibrateOptions]:
    """
    Parse the arguments of the command.

    :raises SystemExit: with code 2 and one line if an argument is invalid; with 0 after ``--help``
    """
    own, ros = split_ros_arguments(arguments)
    parser = _parser()
    values = vars(parser.parse_args(own))
    values.pop('ros_args', None)
    more = CalibrateOptions(*(values.pop(name) for name in (
        'part', 'output', 'floor', 'plot', 'yes', 'dry_run', 'measured', 'side', 'squares',
        'track')))
    if more.part not in ('', FLOOR, UMBMARK):
        parser.error(f'there is no part {quoted(more.part, 60)}; it is {FLOOR} or {UMBMARK}, or '
                     'left out')
    for name in ('side', 'squares', 'track'):
        if getattr(more, name) is not None and more.part != UMBMARK:
            parser.error(f'--{name} is about {NAME} {UMBMARK}')
    if more.measured and not more.part:
        parser.error(f'--measured is about {NAME} {FLOOR} and {NAME} {UMBMARK}')
    if more.part and more.plot is not None:
        parser.error(f'--plot is not about {NAME} {more.part}')
    if more.squares is not None and not 1 <= more.squares <= 20:
        parser.error(f'--squares is {more.squares}; it must be from 1 to 20')
    simulation = take_simulation(parser, values)
    return Options(
        # This command asks for the confirmation itself.
        ros_arguments=tuple(ros), simulation=simulation, calibrates=True, yes=True,
        command=shlex.join([NAME, *arguments]), **values), more


def _parser() -> OneLineParser:
    parser = OneLineParser(
        prog=NAME, allow_abbrev=False, epilog=EPILOG.replace('\n\n', ' ') + HELP.strip(),
        description='Measure what a robot makes of the velocities that it is sent, or by a tape '
                    'what odometry is worth, and write a file of the robot with it.')
    add = parser.add_argument
    add('part', nargs='?', default='', metavar=f'{FLOOR}|{UMBMARK}',
        help='what to measure with a tape; left out, odometry alone is used')
    add('--output', type=Path, metavar='FILE',
        help=f'the file of the robot to write (default: {OUTPUT}); it must not exist, or be the '
             'one of --robot, which then gets what a tape measured')
    add('--floor', default='', metavar='TEXT', help='on which floor it drives, for people')
    add('--plot', metavar='FILE',
        help='draw what was sent, what odometry reported and the fit, as .png, .svg or .pdf')
    add('--dry-run', action='store_true', help='show what would be driven, and drive nothing')
    tape = parser.add_argument_group('with a tape measure').add_argument
    tape('--measured', action='append', default=[], metavar='WHAT',
         help="an answer instead of asking, once for each question: of floor '0.985 m' and "
              "'358 deg'; of umbmark, for each square, '-0.12 m, 0.05 m, 3 deg'")
    tape('--side', metavar='LENGTH', help="of the squares (default: '4 m')")
    tape('--squares', type=int, metavar='N', help='how many to each side (default: 1)')
    tape('--track', metavar='LENGTH',
         help='the distance of the wheels that odometry uses (default: what its file says; of a '
              "kachaka '0.2 m')")
    add_drive_options(parser)
    return parser


def require_ready(options: Options, more: CalibrateOptions) -> Settings:
    """
    Check the robot and the output file before a calibration, and return the robot's settings.

    :raises UsageError: if the robot has no odometry, or the file exists or cannot be written;
        nothing has moved
    """
    settings = choose_settings(options, None)
    file = more.file
    # A calibration that cannot be written is refused before the robot moves.
    calibrated_text(settings.robot, OdometryCalibration() if more.part else Calibration())
    if settings.profile.odometry_topic is None:
        raise UsageError(
            f'{escaped(settings.robot)} has no odometry to measure by; its file names none')
    if file.exists() and not _is_asked_to_replace(settings.robot, more):
        raise UsageError(
            f'{escaped(str(file))} is there already; name another file by --output')
    if not os.access(file.parent, os.W_OK):
        raise UsageError(f'{escaped(str(file))} cannot be written; name another file by '
                         '--output')
    return settings


def _is_asked_to_replace(robot: str, more: CalibrateOptions) -> bool:
    """Return whether ``--output`` names the profile of the robot itself."""
    return bool(more.part) and more.output is not None and (
        Path(robot).exists() and more.output.samefile(robot))


def show(views: Sequence[PlanView]) -> None:
    """Print the plans of the calibration motions."""
    print(plan_table(views, terminal_columns()), flush=True)


def ask(options: Options, more: CalibrateOptions, view: PlanView, before: str = '') -> None:
    """
    Ask whether the robot may drive, unless it is simulated or ``--yes`` was given.

    :param view: the plan of the drive
    :param before: an instruction for the user before the drive
    :raises UsageError: if there is no terminal to ask at, or the answer is no
    """
    if not (options.sim or more.is_confirmed):
        confirm(view.floor_size, before)


def drive_until_good(
        options: Options, more: CalibrateOptions, measure: Callable[[Options], T]) -> T:
    """
    Drive until a measurement is valid, at most three times, and return the measurement.

    The drive is repeated only if a user at the terminal can put the robot back and confirm the
    next drive.  A drive that ended with a fault is not repeated.

    :param measure: a function that asks, drives and returns the measurement; its argument is the
        options of this attempt, with a report directory of its own
    :raises CalibrationError: if the last drive gives no valid measurement
    """
    for attempt in range(1, MAX_ATTEMPTS + 1):
        report = options.report
        if report is not None and attempt > 1:
            report = f'{report}-{attempt}'
        try:
            return measure(replace(options, report=report))
        except CalibrationError as error:
            if (attempt == MAX_ATTEMPTS or signal_dispatcher.signum is not None
                    or (more.is_confirmed and not options.sim) or not sys.stdin.isatty()):
                raise
            print(f'\n{escaped_lines(error)}.\nThis drive does not count: put the robot back '
                  'where it began; it is driven again.', flush=True)
    raise AssertionError('the last attempt returns or raises')


def today() -> str:
    """Return today's date in ISO format, for a calibration."""
    return datetime.now().astimezone().date().isoformat()


def write_robot(
        robot: str, calibration: Calibration | OdometryCalibration, file: Path) -> None:
    """
    Write the profile of a calibrated robot, and print how to use it.

    :param robot: the name or the file of the robot's profile
    :param calibration: the result of the calibration
    :param file: the profile to write
    :raises UsageError: if the file cannot be written
    """
    try:
        write_atomically(file, calibrated_text(robot, calibration).encode())
    except OSError as error:
        raise UsageError(f'{escaped(str(file))}: {error.strerror}') from None
    print(f'{file}: written; drive with --robot {file if file.is_absolute() else f"./{file}"}')
