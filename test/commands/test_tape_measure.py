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
"""``kachaka_calibrate floor`` and ``umbmark``: what they show, ask, write, and refuse."""

import io
import math
import re
import sys

from kachaka_simple_control.analysis import odometry_fit
from kachaka_simple_control.analysis.calibration_fit import CalibrationError
from kachaka_simple_control.commands import calibrate
from kachaka_simple_control.commands.calibrate import MAX_ATTEMPTS
from kachaka_simple_control.errors import MotionStoppedError, RunFaultError
from kachaka_simple_control.files.library import find
from kachaka_simple_control.files.robot_profile import find_robot
from kachaka_simple_control.motion.calibration import Calibration, OdometryCalibration
from kachaka_simple_control.motion.geometry import advance, ORIGIN
from kachaka_simple_control.motion.plan import plan
from program import call
import pytest
from terminals import Typed

pytestmark = pytest.mark.needs('yaml', 'jsonschema')

WORN = OdometryCalibration(0.98, 1.004, 1.02, 0.2)
KNOWN = ('extends: kachaka  # mine\ncalibration: {left_gain: 0.9}\n'
         'odometry_calibration: {scale: 0.98, track_ratio: 1.01, floor: oak}\n')


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Return a function that runs the command, and tells its exit code, outputs and drives."""
    driven = []
    monkeypatch.chdir(tmp_path)

    def drive(options):
        # The log is the motion: what odometry reports is what was planned.
        driven.append(options)
        return find(options.motions[0], **dict(options.values)).motion

    def path(motion):
        limits = find_robot('kachaka').limits
        poses = [ORIGIN]
        for step in plan(motion, limits, 20.0).steps:
            way = step.step.displacement
            parts = 4 if abs(way.angle) > 3.0 else 1
            for _ in range(parts):
                poses.append(advance(poses[-1], way.distance / parts, way.angle / parts))
        return poses

    monkeypatch.setattr(calibrate, 'drive', drive)
    monkeypatch.setattr(odometry_fit, 'reported_path', path)

    def run(*arguments, typed=None):
        monkeypatch.setattr(sys, 'stdin', io.StringIO() if typed is None else Typed(typed))
        return *call(calibrate.main, arguments, capsys), driven

    return run


def ends(side, count=1):
    """Return where squares end on the floor, as people write it."""
    answers = []
    for sign in count * [-1.0, 1.0]:
        floor = seen = ORIGIN
        for _ in range(4):
            for way in ((side, 0.0), (0.0, sign * math.pi / 2.0)):
                after = advance(seen, *way)
                floor, seen = WORN.advance_on_floor(floor, seen, after), after
        answers.append(f'{floor.x:.4f} m, {100 * floor.y:.2f} cm, '
                       f'{math.degrees(floor.theta - seen.theta):.3f} deg')
    return answers


def options(name, answers):
    """Return an option that is said once for each answer."""
    return [word for answer in answers for word in (name, answer)]


def test_1_m_and_a_turn_are_measured_and_written(run, tmp_path):
    code, output, errors, driven = run(
        'floor', '--sim', '--measured', '98 cm', '--measured', '345.88 deg', '--floor', 'oak')
    assert (code, errors) == (0, '')
    assert [each.motions for each in driven] == [('floor_straight',), ('floor_turn',)]
    assert all(each.calibrates and each.sim for each in driven)
    assert 'scale               0.9800      0.0015' in output
    assert 'track ratio         1.0200      0.0033' in output
    assert output.endswith('my_kachaka.yaml: written; drive with --robot ./my_kachaka.yaml\n')
    found = find_robot(tmp_path / 'my_kachaka.yaml').odometry_calibration
    assert (found.scale, found.track_ratio, found.wheel_ratio) == (0.98, 1.02001, 1.0)
    assert (found.floor, found.track) == ('oak', None)
    assert re.fullmatch('[0-9]{4}-[0-9]{2}-[0-9]{2}', found.date)


def test_squares_are_measured_and_what_is_known_stays(run, tmp_path):
    (tmp_path / 'own.yaml').write_text(KNOWN)
    code, output, errors, driven = run(
        'umbmark', '--sim', '--robot', './own.yaml', '--output', 'own.yaml', '--squares', '2',
        '--report', 'all', *options('--measured', ends(4.0, 2)))
    assert (code, errors) == (0, '')
    assert [each.motions for each in driven] == 2 * [('umbmark_cw',), ('umbmark_ccw',)]
    assert [each.report for each in driven] == [
        'all/umbmark_cw_1', 'all/umbmark_ccw_1', 'all/umbmark_cw_2', 'all/umbmark_ccw_2']
    assert 'wheel ratio, right over left' in output
    assert "by Borenstein and Feng's formulas" in output
    profile = find_robot(tmp_path / 'own.yaml')
    found = profile.odometry_calibration
    assert (found.scale, found.track, found.floor) == (0.98, 0.2, 'oak')
    assert found.wheel_ratio == pytest.approx(1.004, abs=1e-5)
    assert found.track_ratio == pytest.approx(1.02, abs=1e-4)
    assert profile.calibration == Calibration(left_gain=0.9)
    assert '# mine' in (tmp_path / 'own.yaml').read_text()


def test_smaller_squares_are_those_of_the_library_with_another_side(run, tmp_path):
    (tmp_path / 'own.yaml').write_text(KNOWN)
    code, output, _, driven = run(
        'umbmark', '--sim', '--robot', './own.yaml', '--side', '100 cm', '--track', '30 cm',
        *options('--measured', ends(1.0)))
    assert code == 0
    assert 'forward 1 m' in output
    found = find_robot(tmp_path / 'my_kachaka.yaml').odometry_calibration
    assert found.track == 0.3
    assert found.wheel_ratio - 1.0 == pytest.approx(0.006, rel=0.02)
    assert [(each.motions, each.values) for each in driven] == [
        (('umbmark_cw',), (('side', '100 cm'),)), (('umbmark_ccw',), (('side', '100 cm'),))]


def test_somebody_confirms_measures_and_may_mistype(run, tmp_path):
    typed = '\n0.98\n98 %\n98 cm, 2 cm\n0.98 m\n\n345.9 deg\n'
    code, output, _, driven = run('floor', '--address', 'robot', typed=typed)
    assert (code, len(driven)) == (0, 2)
    assert 'The robot needs' in output
    assert 'Mark where the middle between its wheels is, and which way it looks.' in output
    assert 'How far does it stand from where it began?  Such as 0.985 m: ' in output
    assert '0.98 has no unit; a length needs one: write 0.98 cm or 0.98 m\n' in output
    assert "'98 %'; it must be a length, as in 0.5 m (in m, cm or mm)\n" in output
    assert "'98 cm, 2 cm': 1 needed, as in 0.5 m\n" in output
    assert 'How far has it turned, in all?  Such as 358 deg: ' in output
    assert find_robot(tmp_path / 'my_kachaka.yaml').odometry_calibration.scale == 0.98


def test_a_drive_that_was_spoilt_is_driven_again(run, tmp_path, monkeypatch):
    """With a report of its own; what was measured before stays."""
    path, calls = odometry_fit.reported_path, []

    def spoil_the_second(motion):
        calls.append(motion)
        if len(calls) == 2:
            raise CalibrationError('the drive was paused or slowed down: begin again')
        return path(motion)

    monkeypatch.setattr(odometry_fit, 'reported_path', spoil_the_second)
    typed = '\n0.98 m\n\n\n345.9 deg\n'
    code, output, _, driven = run(
        'floor', '--address', 'robot', '--report', 'all', typed=typed)
    assert code == 0
    assert [options.report for options in driven] == [
        'all/floor_straight', 'all/floor_turn', 'all/floor_turn-2']
    assert 'the drive was paused or slowed down: begin again.\nThis drive does not count' in output
    assert find_robot(tmp_path / 'my_kachaka.yaml').odometry_calibration.scale == 0.98


@pytest.mark.parametrize('error', [
    RunFaultError('the guardian stopped the robot: the node sent no heartbeat'),
    RunFaultError('another program sends velocities, so the motion was ended'),
    MotionStoppedError('the movement was ended by ~/stop')], ids=str)
def test_a_drive_that_a_fault_or_a_stop_ended_is_not_driven_again(run, monkeypatch, error):
    driven = []

    def drive(options):
        driven.append(options)
        raise error

    monkeypatch.setattr(calibrate, 'drive', drive)
    code, output, errors, _ = run('floor', '--address', 'robot', typed=9 * '\n')
    assert (code, errors, len(driven)) == (1, f'kachaka_calibrate: {error}\n', 1)
    assert 'driven again' not in output


@pytest.mark.parametrize(('words', 'count'), [
    (['--address', 'robot', '--yes'], 1), (['--yes'], 1),
    (['--sim', '--yes'], MAX_ATTEMPTS), (['--sim'], MAX_ATTEMPTS)])
def test_without_a_question_only_a_simulated_robot_is_driven_again(
        run, monkeypatch, words, count):
    def spoil(_):
        raise CalibrationError('spoilt')

    monkeypatch.setattr(odometry_fit, 'reported_path', spoil)
    code, _, errors, driven = run('floor', *words, typed='')
    assert (code, errors, len(driven)) == (1, 'kachaka_calibrate: spoilt\n', count)


@pytest.mark.parametrize('typed, count', [('', 0), ('\n', 1), ('\n\n', 1), ('\n1 m\n', 1)])
def test_without_an_answer_it_ends_and_writes_nothing(run, tmp_path, typed, count):
    code, _, errors, driven = run('floor', '--address', 'robot', typed=typed)
    assert (code, len(driven)) == (2, count)
    assert errors in ('kachaka_calibrate: not confirmed: nothing was driven\n',
                      'kachaka_calibrate: nothing was measured: no file was written\n')
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize('words, line', [
    (['floor', '--sim'],
     'there is no terminal to ask at: pass the measurements by --measured'),
    (['floor', '--sim', '--measured', '1 m'],
     '--measured is here 1 times; 2 answers are needed'),
    (['floor', '--sim', '--measured', '1', '--measured', '6 rad'],
     '--measured: 1 has no unit; a length needs one: write 1 cm or 1 m'),
    (['floor', '--sim', '--measured', '1 m', '--measured', '358'],
     '--measured: 358 has no unit; an angle needs one: write 358 deg or 358 rad'),
    (['floor', '--address', 'robot', '--measured', '1 m', '--measured', '358 deg'],
     'a robot will move, and there is no terminal to ask at: pass --yes'),
    (['floor', '--sim', '--plot', 'fit.svg'], '--plot is not about kachaka_calibrate floor'),
    (['floor', '--sim', '--track', '1 m'], '--track is about kachaka_calibrate umbmark'),
    (['floor', '--sim', '--robot', './blind.yaml'],
     './blind.yaml has no odometry to measure by; its file names none'),
    (['floor', '--sim', '--output', 'own.yaml'],
     'own.yaml is there already; name another file by --output'),
    (['floor', '--sim', '--robot', './own.yaml', '--output', 'blind.yaml'],
     'blind.yaml is there already; name another file by --output'),
    (['umbmark', '--sim'],
     ('squares cannot tell the scale of distances: measure it before by kachaka_calibrate floor, '
      'and name the file that it writes by --robot')),
    (['umbmark', '--robot', './other.yaml'],
     ("which track does the robot's odometry use?  Say it by --track, as in --track 0.2m")),
    (['umbmark', '--sim', '--robot', './own.yaml', '--track', '0.2'],
     '--track: 0.2 has no unit; a size needs one: write 0.2 cm or 0.2 m'),
    (['umbmark', '--sim', '--robot', './own.yaml', '--track', '20 m'],
     'track is 20.0 m; it must be from 0.01 to 10 m'),
    (['umbmark', '--sim', '--robot', './own.yaml', '--side', '20 m'],
     '--side: 20 m is above its largest, 10 m'),
    (['umbmark', '--sim', '--robot', './own.yaml', '--squares', '0'],
     '--squares is 0; it must be from 1 to 20'),
    (['umbmark', '--sim', '--robot', './own.yaml', '--measured', '1 m, 1 m',
      '--measured', '1 m, 1 m'],
     "--measured: '1 m, 1 m': 3 needed, as in 0.5 m, 0.5 m, 90 deg"),
])
def test_what_cannot_be_is_refused_before_anything_moves(run, tmp_path, words, line):
    (tmp_path / 'own.yaml').write_text(KNOWN)
    (tmp_path / 'blind.yaml').write_text('extends: kachaka\nodometry_topic: null')
    (tmp_path / 'other.yaml').write_text(
        'extends: turtlebot3\nodometry_calibration: {scale: 0.98}')
    code, output, errors, driven = run(*words)
    assert (code, errors, driven) == (2, f'kachaka_calibrate: {line}\n', [])
    # What would be driven may have been shown.
    assert output == '' or '--yes' in line
