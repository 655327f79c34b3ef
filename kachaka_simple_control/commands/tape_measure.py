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
"""Calibrate a robot's odometry with a tape measure: two parts of ``kachaka_calibrate``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import contextlib
from dataclasses import replace
import math
from pathlib import Path
import sys
import tempfile

from kachaka_simple_control.analysis.odometry_fit import (
    fit_floor,
    fit_umbmark,
    reported_displacement,
    reported_path,
    Square,
    UmbmarkFit,
)
from kachaka_simple_control.analysis.plan_view import PlanView
from kachaka_simple_control.commands.calibrate_options import (
    ask,
    CalibrateOptions,
    drive_until_good,
    FIT_HEAD,
    require_ready,
    show,
    today,
    write_robot,
)
from kachaka_simple_control.commands.cli import Options
from kachaka_simple_control.commands.drive_or_preview import drive
from kachaka_simple_control.commands.preview import plan_view
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.files.library import find
from kachaka_simple_control.files.robot_profile import KACHAKA_TRACK, RobotProfile
from kachaka_simple_control.motion.calibration import OdometryCalibration
from kachaka_simple_control.motion.geometry import Pose
from kachaka_simple_control.motion.units import ANGLE, LENGTH, Quantity, SIZE, UnitError
from kachaka_simple_control.report.text_tables import columns
from kachaka_simple_control.text import escaped

#: The side length of the squares in the library, and the range of other side lengths [m].
SIDE, MIN_SIDE, MAX_SIDE = '4 m', 0.5, 10.0
MARK = 'Mark where the middle between its wheels is, and which way it looks.  '


class _Answers:
    """The tape measurements, from ``--measured`` or from questions to the user."""

    def __init__(self, given: Sequence[str], quantities: Sequence[Sequence[Quantity]]) -> None:
        """
        Check the given answers.

        :param given: the answers from ``--measured``, as text; empty to ask the user
        :param quantities: the quantities of each answer
        :raises UsageError: if an answer is invalid, or there is no terminal to ask at
        """
        if given and len(given) != len(quantities):
            raise UsageError(
                f'--measured is here {len(given)} times; {len(quantities)} answers are needed')
        if not given and not sys.stdin.isatty():
            raise UsageError(
                'pass the measurements by --measured, for there is no terminal to ask at')
        try:
            self._given = [
                _parse(answer, kinds) for answer, kinds in zip(given, quantities, strict=False)]
        except UnitError as error:
            raise UsageError(f'--measured: {error}') from None

    def ask(self, question: str, kinds: Sequence[Quantity]) -> list[float]:
        """
        Return the next given answer, or ask the user for it.

        :param question: the question to the user
        :param kinds: the quantities of the answer
        :returns: the measured values
        :raises UsageError: if the user gives no answer
        """
        if self._given:
            return self._given.pop(0)
        while True:
            print(f'\n{question}: ', end='', flush=True)
            answer = sys.stdin.readline().strip()
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


def measure_floor(options: Options, more: CalibrateOptions) -> None:
    """
    Calibrate odometry with a straight line and a turn, and write the robot's profile.

    The robot drives 1 m and makes one full turn, and the user measures both on the floor.

    :raises CalibrationError: if the drives give no valid calibration; no file is written
    :raises ControlError: if a drive cannot start or is not completed; no file is written
    """
    settings = require_ready(options, more)
    motions = 'floor_straight', 'floor_turn'
    views = [plan_view(name, options) for name in motions]
    answers = None if more.is_dry else _Answers(more.measured, [[LENGTH], [ANGLE]])
    show(views)
    if answers is None:
        return
    line = reported_displacement(
        _drive(options, more, views[0], motions[0], motions[0], MARK))[0]
    distance, = answers.ask(
        'How far does it stand from where it began?  Such as 0.985 m', [LENGTH])
    turn = reported_displacement(_drive(
        options, more, views[1], motions[1], motions[1], 'Mark which way it looks.  '))[1]
    angle, = answers.ask('How far has it turned, in all?  Such as 358 deg', [ANGLE])
    fit = fit_floor(line, distance, turn, angle)
    # Printed first, so that the result is not lost if the file cannot be written.
    print('\n'.join(['', *columns(FIT_HEAD, [
        ('scale', f'{fit.scale.value:.4f}', f'{fit.scale.error:.4f}'),
        ('track ratio', f'{fit.track_ratio.value:.4f}', f'{fit.track_ratio.error:.4f}'),
        ('1 m by odometry', f'{line:.4f} m', ''),
        ('a turn by odometry', f'{math.degrees(turn):.2f} deg', '')]), '']), flush=True)
    known = settings.profile.odometry_calibration or OdometryCalibration()
    write_robot(settings.robot, replace(
        known, scale=round(fit.scale.value, 5), track_ratio=round(fit.track_ratio.value, 5),
        date=today(), floor=more.floor or known.floor), more.file)


def measure_squares(options: Options, more: CalibrateOptions) -> None:
    """
    Calibrate odometry with squares in both directions (UMBmark), and write the robot's profile.

    The user measures the end pose of each square on the floor.

    :raises CalibrationError: if the drives give no valid calibration; no file is written
    :raises ControlError: if a drive cannot start or is not completed; no file is written
    """
    settings = require_ready(options, more)
    known = settings.profile.odometry_calibration
    if known is None:
        raise UsageError(
            'squares cannot tell the scale of distances: measure it before by kachaka_calibrate '
            'floor, and name the file that it writes by --robot')
    track = _known_track(settings.profile) if more.track is None else _size('track', more.track)
    if track is None:
        raise UsageError(
            "which track does the robot's odometry use?  Say it by --track, as in --track 0.2m")
    # An invalid track is refused before the robot moves.
    known = replace(known, track=track)
    count, kinds = more.squares or 1, [LENGTH, LENGTH, ANGLE]
    with _motions(more.side or SIDE) as motions:
        views = [plan_view(motion, options) for motion in motions]
        answers = None if more.is_dry else _Answers(more.measured, 2 * count * [kinds])
        show(views)
        if answers is None:
            return
        squares = []
        for index in range(2 * count):
            motion, view = motions[index % 2], views[index % 2]
            path = _drive(
                options, more, view, motion, f'{view.name}_{index // 2 + 1}', MARK)
            squares.append(Square(path, Pose(*answers.ask(
                f'Square {index + 1} of {2 * count}: where does it stand, as seen from where it '
                'began?  Ahead, to the left, turned to the left, such as -0.12 m, 0.05 m, 3 deg',
                kinds))))
    fit = fit_umbmark(squares, track, known.scale)
    print('\n'.join(['', *_table(fit), '']), flush=True)
    write_robot(settings.robot, replace(
        known, wheel_ratio=round(fit.wheel_ratio.value, 6),
        track_ratio=round(fit.track_ratio.value, 5), date=today(),
        floor=more.floor or known.floor), more.file)


def _drive(
        options: Options, more: CalibrateOptions, view: PlanView, motion: str, report: str,
        before: str) -> list[Pose]:
    """
    Drive a motion after the user's confirmation, and return the path from odometry.

    :param view: the plan of the motion
    :param motion: the name of a motion in the library, or the path of a file
    :param report: the name of a folder within the directory of ``--report``
    :param before: an instruction for the user before the drive
    """
    def measure(options: Options) -> list[Pose]:
        ask(options, more, view, before)
        return reported_path(drive(options))

    return drive_until_good(replace(
        options, motions=(motion,),
        report=None if options.report is None else str(Path(options.report) / report)),
        more, measure)


@contextlib.contextmanager
def _motions(side: str) -> Iterator[tuple[str, str]]:
    """Yield the clockwise and the counterclockwise square, as library names or as files."""
    names = 'umbmark_cw', 'umbmark_ccw'
    length = _size('side', side)
    if not MIN_SIDE <= length <= MAX_SIDE:
        raise UsageError(f'--side is {length:g} m; it must be from {MIN_SIDE:g} to {MAX_SIDE:g} m')
    if side == SIDE:
        yield names
        return
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / f'{name}.yaml' for name in names]
        for name, file in zip(names, files, strict=True):
            text = find(name).text
            assert text is not None
            file.write_text(text.replace(SIDE, f'{length:g} m'), encoding='utf-8')
        yield str(files[0]), str(files[1])


def _known_track(profile: RobotProfile) -> float | None:
    """Return the track that a robot's odometry uses [m]; None if it is not known."""
    known = profile.odometry_calibration
    if known is not None and known.track is not None:
        return known.track
    return KACHAKA_TRACK if profile.is_kachaka else None


def _size(option: str, text: str) -> float:
    try:
        return SIZE.parse(text)
    except UnitError as error:
        raise UsageError(f'--{option}: {error}') from None


def _table(fit: UmbmarkFit) -> list[str]:
    wheels, track = fit.closed_form
    return columns(FIT_HEAD, [
        ('wheel ratio, right over left', f'{fit.wheel_ratio.value:.5f}',
         f'{fit.wheel_ratio.error:.5f}'),
        ('track ratio', f'{fit.track_ratio.value:.4f}', f'{fit.track_ratio.error:.4f}'),
        ("by Borenstein and Feng's formulas", f'{wheels:.5f}, {track:.4f}', ''),
        ('E_max,syst before', f'{1e3 * fit.before:.0f} mm', ''),
        ('E_max,syst after', f'{1e3 * fit.after:.0f} mm', '')])
