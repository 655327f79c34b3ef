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
The command ``kachaka_calibrate``, which calibrates a robot and writes the robot's profile.

By default it measures by odometry what the robot makes of velocities.  ``floor`` and ``umbmark``
calibrate the odometry itself: the user measures with a tape where the robot has stopped.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import contextlib
from dataclasses import replace
from datetime import datetime
from functools import partial
import math
import os
from pathlib import Path
import sys
from typing import TypeVar

from kachaka_simple_control.analysis import calibration_fit, odometry_fit
from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.analysis.plan_view import PlanView
from kachaka_simple_control.commands import calibrate_options
from kachaka_simple_control.commands.calibrate_options import CalibrateOptions
from kachaka_simple_control.commands.drive_or_preview import confirm, drive, read_answer
from kachaka_simple_control.commands.preview import plan_view
from kachaka_simple_control.commands.settings import choose_settings, Settings
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.files.library import find
from kachaka_simple_control.files.robot_profile import calibrated_text, KACHAKA_TRACK, RobotProfile
from kachaka_simple_control.motion.calibration import Calibration, OdometryCalibration
from kachaka_simple_control.motion.geometry import Pose
from kachaka_simple_control.motion.units import ANGLE, LENGTH, Quantity, SIZE, UnitError
from kachaka_simple_control.process.output import print_result
from kachaka_simple_control.process.run_command import run_command
from kachaka_simple_control.process.signals import signal_dispatcher
from kachaka_simple_control.report.drive_plots import save_calibration_plot
from kachaka_simple_control.report.output_file import check_plot_file, write_atomically
from kachaka_simple_control.report.text_tables import (
    Column,
    columns,
    plan_table,
    Row,
    terminal_columns,
)
from kachaka_simple_control.text import escaped, escaped_lines

T = TypeVar('T')

#: A calibration drive is tried at most this many times.
MAX_ATTEMPTS = 3
#: The clockwise and the counterclockwise square, in the order in which they are driven.
SQUARES = 'umbmark_cw', 'umbmark_ccw'
MARK = 'Mark where the middle between its wheels is, and which way it looks.  '


def calibrate(options: CalibrateOptions) -> None:
    """
    Measure with odometry how the robot follows velocities, and write the robot's profile.

    :raises CalibrationError: if the drive gives no valid calibration; no file is written
    :raises UsageError: if the robot's profile has a calibration already; the robot has not moved
    :raises ControlError: if the drive cannot start or is not completed; no file is written
    """
    settings = require_ready(options)
    if settings.profile.is_calibrated:
        raise UsageError(
            f'{escaped(settings.robot)} is calibrated already; name the robot without its '
            'calibration')
    plot = None if options.plot is None else check_plot_file(options.plot)
    view = plan_view(calibration_fit.MOTION, options)
    show([view])
    if options.dry_run:
        return
    log, fit = drive_until_good(
        options, view.name, view, lambda log: (log, calibration_fit.fit_calibration(log)))
    rows: list[Row] = [
        *((f'gain {name}', f'{gain.value:.4f}', f'{gain.error:.4f}')
          for name, gain in fit.gains.items()),
        ('veer', f'{math.degrees(fit.veer.value):.2f} deg/m',
         f'{math.degrees(fit.veer.error):.2f} deg/m'),
        ('delay: dead time and lag', f'{fit.delay.value:.3f} s', f'{fit.delay.error:.3f} s'),
        ('noise of odometry, position', f'{1e3 * fit.position_noise:.1f} mm', ''),
        ('noise of odometry, heading', f'{math.degrees(fit.heading_noise):.2f} deg', '')]
    write_robot(options, settings.robot, rows, fit.calibration(today(), options.floor))
    if plot is not None:
        save_calibration_plot(log, fit, plot)


def measure_floor(options: CalibrateOptions) -> None:
    """
    Calibrate odometry with 1 m and one full turn, measured on the floor; write the profile.

    :raises CalibrationError: if the drives give no valid calibration; no file is written
    :raises ControlError: if a drive cannot start or is not completed; no file is written
    """
    settings = require_ready(options)
    line, turn = (plan_view(name, options) for name in ('floor_straight', 'floor_turn'))
    answers = None if options.dry_run else _Answers(options.measured, [[LENGTH], [ANGLE]])
    show([line, turn])
    if answers is None:
        return
    path = _drive(options, line.name, line, line.name, MARK)
    length = odometry_fit.reported_displacement(path)[0]
    distance, = answers.ask(
        'How far does it stand from where it began?  Such as 0.985 m', [LENGTH])
    path = _drive(options, turn.name, turn, turn.name, 'Mark which way it looks.  ')
    turned = odometry_fit.reported_displacement(path)[1]
    angle, = answers.ask('How far has it turned, in all?  Such as 358 deg', [ANGLE])
    fit = odometry_fit.fit_floor(length, distance, turned, angle)
    rows: list[Row] = [
        ('scale', f'{fit.scale.value:.4f}', f'{fit.scale.error:.4f}'),
        ('track ratio', f'{fit.track_ratio.value:.4f}', f'{fit.track_ratio.error:.4f}'),
        ('1 m by odometry', f'{length:.4f} m', ''),
        ('a turn by odometry', f'{math.degrees(turned):.2f} deg', '')]
    known = settings.profile.odometry_calibration or OdometryCalibration()
    write_robot(options, settings.robot, rows, replace(
        known, scale=round(fit.scale.value, 5), track_ratio=round(fit.track_ratio.value, 5),
        date=today(), floor=options.floor or known.floor))


def measure_squares(options: CalibrateOptions) -> None:
    """
    Calibrate odometry with the UMBmark method (Borenstein and Feng, 1996); write the profile.

    :raises CalibrationError: if the drives give no valid calibration; no file is written
    :raises UsageError: if the profile has no odometry calibration yet (first drive
        ``kachaka_calibrate floor``); the robot has not moved
    :raises ControlError: if a drive cannot start or is not completed; no file is written
    """
    settings = require_ready(options)
    known = settings.profile.odometry_calibration
    if known is None:
        raise UsageError(
            'squares cannot tell the scale of distances: measure it before by kachaka_calibrate '
            'floor, and name the file that it writes by --robot')
    track = _track(options, settings.profile)
    # This raises an error for an invalid track before the robot moves.
    known = replace(known, track=track)
    count, kinds = options.squares or 1, [LENGTH, LENGTH, ANGLE]
    options = replace(options, values=_values(options.side))
    views = [plan_view(motion, options) for motion in SQUARES]
    answers = None if options.dry_run else _Answers(options.measured, 2 * count * [kinds])
    show(views)
    if answers is None:
        return
    squares = []
    for index in range(2 * count):
        motion, view = SQUARES[index % 2], views[index % 2]
        path = _drive(options, motion, view, f'{motion}_{index // 2 + 1}', MARK)
        squares.append(odometry_fit.Square(path, Pose(*answers.ask(
            f'Square {index + 1} of {2 * count}: where does it stand, as seen from where it '
            'began?  Ahead, to the left, turned to the left, such as -0.12 m, 0.05 m, 3 deg',
            kinds))))
    fit = odometry_fit.fit_umbmark(squares, track, known.scale)
    wheels, track_ratio = fit.closed_form
    rows: list[Row] = [
        ('wheel ratio, right over left', f'{fit.wheel_ratio.value:.5f}',
         f'{fit.wheel_ratio.error:.5f}'),
        ('track ratio', f'{fit.track_ratio.value:.4f}', f'{fit.track_ratio.error:.4f}'),
        ("by Borenstein and Feng's formulas", f'{wheels:.5f}, {track_ratio:.4f}', ''),
        ('E_max,syst before', f'{1e3 * fit.before:.0f} mm', ''),
        ('E_max,syst after', f'{1e3 * fit.after:.0f} mm', '')]
    write_robot(options, settings.robot, rows, replace(
        known, wheel_ratio=round(fit.wheel_ratio.value, 6),
        track_ratio=round(fit.track_ratio.value, 5), date=today(),
        floor=options.floor or known.floor))


def require_ready(options: CalibrateOptions) -> Settings:
    """
    Check the robot and the output file before a calibration; return the settings for the drive.

    The file must not exist, unless a calibration with a tape replaces the robot's own profile.

    :raises UsageError: if the robot has no odometry, corners are to be cut, or the file exists or
        cannot be written; the robot has not moved
    """
    settings = choose_settings(options, None)
    if settings.corners:
        raise UsageError(f'corners is {settings.corners:g} m: {calibrate_options.NEEDS_RESTS}')
    robot, file = settings.robot, options.file
    # This raises an error before the robot moves if a calibration cannot be added to the profile.
    calibrated_text(robot, OdometryCalibration() if options.part else Calibration())
    if settings.profile.odometry_topic is None:
        raise UsageError(f'{escaped(robot)} has no odometry to measure by; its file names none')
    # A tape measurement may be written to the robot's own profile, if --output names that file.
    may_replace = options.part and options.output is not None and Path(robot).exists()
    if file.exists() and not (may_replace and file.samefile(robot)):
        raise UsageError(f'{escaped(file)} is there already; name another file by --output')
    if not os.access(file.parent, os.W_OK):
        raise UsageError(f'{escaped(file)} cannot be written; name another file by --output')
    return settings


def show(views: Sequence[PlanView]) -> None:
    """Print a table of the plans of the calibration motions."""
    print_result(plan_table(views, terminal_columns()), 'the plan')


def drive_until_good(
        options: CalibrateOptions, motion: str, view: PlanView, fit: Callable[[DriveLog], T],
        before: str = '') -> T:
    """
    Drive a motion until the drive gives a valid measurement, and return the measurement.

    At most three times, with the robot put back to its start.  So the drive is not repeated
    without a terminal, or if a real robot drives with ``--yes``.  Each is asked for, as
    everywhere.

    :param fit: computes the measurement from the record; raises CalibrationError if it is not
        valid
    :param before: an instruction that is printed before each drive; empty for none
    :raises CalibrationError: if the last drive gives no valid measurement
    :raises UsageError: if the user does not allow a drive, or there is no terminal to ask at
    :raises ControlError: if a drive cannot start or is not completed; it is not repeated
    """
    for attempt in range(1, MAX_ATTEMPTS + 1):
        report = options.report  # each attempt has its own report directory
        if report is not None and attempt > 1:
            report = f'{report}-{attempt}'
        try:
            if not (options.sim or options.yes):
                confirm(view.floor_size, before)
            return fit(drive(replace(options, motions=(motion,), report=report)))
        except calibration_fit.CalibrationError as error:
            if (attempt == MAX_ATTEMPTS or signal_dispatcher.signum is not None
                    or (options.yes and not options.sim) or not sys.stdin.isatty()):
                raise
            print(f'\n{escaped_lines(error)}.\nThis drive does not count: put the robot back '
                  'where it began; it is driven again.', flush=True)
    raise AssertionError('the last attempt returns or raises')


def _drive(
        options: CalibrateOptions, motion: str, view: PlanView, report: str,
        before: str) -> list[Pose]:
    """Drive a motion until its odometry is valid, and return the path that odometry reported."""
    if options.report is not None:
        options = replace(options, report=str(Path(options.report) / report))
    return drive_until_good(options, motion, view, odometry_fit.reported_path, before)


def today() -> str:
    """Return the local date in ISO format, for example ``2026-01-31``."""
    return datetime.now().astimezone().date().isoformat()


def show_result(rows: Sequence[Row]) -> None:
    """
    Print the results of a calibration as a table: name, value and standard error of each.

    :raises RunFaultError: if it cannot be printed, such as to a full disk
    """
    table = columns((Column(''), Column('value'), Column('standard error')), rows)
    print_result('\n'.join(['', *table, '']), 'the result')


def write_robot(
        options: CalibrateOptions, robot: str, rows: Sequence[Row],
        calibration: Calibration | OdometryCalibration) -> None:
    """
    Print the results of a calibration, and write a robot's profile with it to a file.

    If one of them is not possible, the other is done all the same.

    :raises UsageError: if the file cannot be written
    """
    file = options.file
    with contextlib.ExitStack() as stack:
        stack.callback(_write_robot, file, robot, calibration)
        show_result(rows)


def _write_robot(
        file: Path, robot: str, calibration: Calibration | OdometryCalibration) -> None:
    try:
        write_atomically(file, calibrated_text(robot, calibration).encode())
    except OSError as error:
        raise UsageError(f'{escaped(file)}: {error.strerror}') from None
    print_result(
        f'{file}: written; drive with --robot {file if file.is_absolute() else f"./{file}"}',
        'the name of the file')


class _Answers:
    """The measurements with a tape: those of ``--measured``, or what the user is asked."""

    def __init__(self, given: Sequence[str], quantities: Sequence[Sequence[Quantity]]) -> None:
        """
        Check the measurements that the user gave on the command line.

        :raises UsageError: if a measurement is invalid or missing, or there is no terminal at
            which the user can be asked
        """
        if given and len(given) != len(quantities):
            raise UsageError(
                f'--measured is here {len(given)} times; {len(quantities)} answers are needed')
        if not given and not sys.stdin.isatty():
            raise UsageError(
                'there is no terminal to ask at: pass the measurements by --measured')
        try:
            self._given = [
                _parse(answer, kinds) for answer, kinds in zip(given, quantities, strict=False)]
        except UnitError as error:
            raise UsageError(f'--measured: {error}') from None

    def ask(self, question: str, kinds: Sequence[Quantity]) -> list[float]:
        """
        Return the next answer, lengths [m] and angles [rad]; ask until it is valid.

        :raises UsageError: if the user enters an empty line
        """
        if self._given:
            return self._given.pop(0)
        while True:
            print(f'\n{question}: ', end='', flush=True)
            answer = read_answer().strip()
            if not answer:
                raise UsageError('nothing was measured: no file was written')
            try:
                return _parse(answer, kinds)
            except UnitError as error:
                print(escaped(error, 300), flush=True)


def _parse(answer: str, kinds: Sequence[Quantity]) -> list[float]:
    parts = answer.split(',')
    if len(parts) != len(kinds):
        example = ', '.join(kind.example for kind in kinds)
        raise UnitError(f'{escaped(answer, 60)!r}: {len(kinds)} needed, as in {example}')
    return [kind.parse(part.strip()) for part, kind in zip(parts, kinds, strict=True)]


def _values(side: str | None) -> tuple[tuple[str, str], ...]:
    """
    Return the values of the parameters of the squares, with their names.

    :raises UsageError: if the side length is invalid
    """
    if side is None:
        return ()
    try:
        find(SQUARES[0]).parameters['side'].value(side)
    except UnitError as error:
        raise UsageError(f'--side: {error}') from None
    return (('side', side),)


def _track(options: CalibrateOptions, profile: RobotProfile) -> float:
    """
    Return the wheel separation that a robot uses to compute its odometry [m].

    :raises UsageError: if it is invalid, or neither given nor known for the robot
    """
    known = profile.odometry_calibration
    if options.track is not None:
        try:
            return SIZE.parse(options.track)
        except UnitError as error:
            raise UsageError(f'--track: {error}') from None
    if known is not None and known.track is not None:
        return known.track
    if profile.is_kachaka:
        return KACHAKA_TRACK
    raise UsageError(
        "which track does the robot's odometry use?  Say it by --track, as in --track 0.2m")


def main(args: Sequence[str] | None = None) -> int:
    """Run the command ``kachaka_calibrate``."""
    options = calibrate_options.parse(sys.argv[1:] if args is None else args)
    measure = {calibrate_options.FLOOR: measure_floor,
               calibrate_options.UMBMARK: measure_squares}.get(options.part, calibrate)
    return run_command(partial(measure, options), calibrate_options.NAME)


if __name__ == '__main__':
    sys.exit(main())
