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
"""The command ``kachaka_calibrate``: what it shows, asks, writes, and refuses in one line."""

import shlex
import signal
import sys

from golden import answers, compare
from kachaka_simple_control.analysis import calibration_fit
from kachaka_simple_control.analysis.calibration_fit import (
    CalibrationError,
    CalibrationFit,
    Estimate,
)
from kachaka_simple_control.commands import calibrate
from kachaka_simple_control.commands.calibrate import MAX_ATTEMPTS
from kachaka_simple_control.errors import RunFaultError
from kachaka_simple_control.files.robot_profile import calibrated_text, find_robot, KACHAKA
from kachaka_simple_control.motion.calibration import Calibration
from program import call, program
import pytest
from terminals import Typed

pytestmark = pytest.mark.needs('yaml', 'jsonschema')

FOUND = CalibrationFit(
    {'forward': Estimate(0.95, 0.0004), 'backward': Estimate(0.96, 0.0004),
     'left': Estimate(0.97, 0.0004), 'right': Estimate(0.98, 0.0004)},
    Estimate(0.035, 0.001), Estimate(0.3, 0.002), 0.003, 0.008)
COMMAND = (sys.executable, '-m', 'kachaka_simple_control.commands.calibrate')


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Return a function that runs the command, and tells its exit code, outputs and drives."""
    driven = []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(calibrate, 'drive', driven.append)
    monkeypatch.setattr(calibration_fit, 'fit_calibration', lambda log: FOUND)

    def run(*arguments):
        return *call(calibrate.main, arguments, capsys), driven

    return run


def test_it_writes_a_robot_that_can_be_read(run, tmp_path):
    code, output, errors, (options,) = run(
        '--sim', '--floor', 'oak: "old"', '--output', 'own.yaml')
    assert (code, errors) == (0, '')
    assert (options.motions, options.sim, options.calibrates) == (('calibration',), True, True)
    assert 'gain forward                 0.9500      0.0004' in output
    assert output.endswith('own.yaml: written; drive with --robot ./own.yaml\n')
    profile = find_robot(tmp_path / 'own.yaml')
    assert profile.limits == KACHAKA.limits
    calibration = profile.calibration
    assert (calibration.forward_gain, calibration.right_gain, calibration.delay) == (
        0.95, 0.98, 0.3)
    assert (calibration.veer, calibration.floor) == (0.035, 'oak: "old"')


def test_a_robot_of_a_file_keeps_all_that_its_file_says(tmp_path):
    own = tmp_path / 'own.yaml'
    own.write_text('velocity_topic: cmd_vel  # ours\ncommand_timeout: 0.4 s\n'
                   'limits: {max_linear_velocity: 0.2, max_angular_velocity: 1}')
    (tmp_path / 'calibrated.yaml').write_text(calibrated_text(str(own), Calibration(0.9)))
    profile = find_robot(tmp_path / 'calibrated.yaml')
    assert profile.calibration == Calibration(0.9)
    assert (profile.velocity_topic, profile.command_timeout) == ('cmd_vel', 0.4)
    assert '# ours' in (tmp_path / 'calibrated.yaml').read_text()


def test_a_real_robot_is_driven_only_after_somebody_has_confirmed(run, monkeypatch):
    code, _, errors, driven = run('--address', 'robot')
    assert (code, driven) == (2, [])
    assert 'a robot will move, and there is no terminal to ask at: pass --yes' in errors
    assert len(run('--address', 'robot', '--yes')[3]) == 1

    for typed, code, count in (
            ('', 2, 1), ('n\n', 2, 1), ('no\n', 2, 1), ('q\n', 2, 1), ('\n', 0, 2)):
        monkeypatch.setattr(sys, 'stdin', Typed(typed))
        ended, output, _, driven = run('--address', 'robot', '--output', 'other.yaml')
        assert (ended, len(driven)) == (code, count)
        assert 'The robot needs 1.21 m x 0.46 m of free floor.  Enter drives' in output


@pytest.mark.parametrize(('words', 'count'), [([], MAX_ATTEMPTS), (['--yes'], 1)])
def test_a_spoilt_drive_is_driven_again_only_when_somebody_is_asked(
        run, monkeypatch, words, count):
    def spoil(_):
        raise CalibrationError('the drive was paused or slowed down: begin again')

    monkeypatch.setattr(calibration_fit, 'fit_calibration', spoil)
    monkeypatch.setattr(sys, 'stdin', Typed(9 * '\n'))
    code, output, errors, driven = run('--address', 'robot', *words)
    assert (code, len(driven)) == (1, count)
    assert output.count('The robot needs') == (0 if words else count)
    assert errors.count('the drive was paused') == 1


def test_what_cannot_be_is_refused_before_anything_moves(run, tmp_path):
    (tmp_path / 'there.yaml').write_text('extends: kachaka\ncalibration: {left_gain: 0.9}')
    (tmp_path / 'worn.yaml').write_text('extends: kachaka\nodometry_calibration: {scale: 0.9}')
    (tmp_path / 'blind.yaml').write_text('extends: kachaka\nodometry_topic: null')
    cases = (
        '--sim --output there.yaml',
        '--sim --robot ./there.yaml',
        '--sim --output no/folder.yaml',
        '--yes --robot ./blind.yaml',
        '--sim --plot fit.txt',
        '--lag 0.1',
        'square --sim',
        "--sim --measured '1 m'",
        "--sim --side '1 m'",
        '--sim --robot ./worn.yaml',
        '--sim --robot ./worn.yaml --output ./worn.yaml',
        '--sim --corners 5cm',
        'floor --dry-run --corners 5cm',
        '--sim --corners 2m',
        '--sim --ros-args -p corners:=0.05',
    )

    def refusal(words: str) -> str:
        code, output, errors, driven = run(*shlex.split(words))
        assert (code, output, driven) == (2, '', [])
        (line,) = errors.splitlines()
        return line

    compare('calibrate', answers(cases, refusal))


def test_what_was_measured_is_printed_even_if_no_file_can_be_written(run, monkeypatch, tmp_path):
    def fail(path, data):
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr(calibrate, 'write_atomically', fail)
    code, output, errors, _ = run('--sim')
    assert (code, errors) == (2, 'kachaka_calibrate: my_kachaka.yaml: No space left on device\n')
    assert 'gain forward                 0.9500      0.0004' in output
    assert 'written' not in output


def test_what_was_measured_is_written_even_if_it_cannot_be_printed(run, monkeypatch, tmp_path):
    def fail(text, name):
        if name == 'the result':  # the disk has become full in the drive
            raise RunFaultError(f'{name} cannot be printed: No space left on device')

    monkeypatch.setattr(calibrate, 'print_result', fail)
    code, _, errors, _ = run('--sim')
    assert code == 1
    assert 'the result cannot be printed: No space left on device\n' in errors
    assert find_robot(tmp_path / 'my_kachaka.yaml').calibration.forward_gain == 0.95


@pytest.mark.ros
@pytest.mark.needs('rclpy')
@pytest.mark.parametrize('words', [
    [], ['floor', '--measured', '1 m', '--measured', '358 deg']])
def test_interrupted_it_stops_the_robot_and_writes_nothing(words, listener, tmp_path):
    file = tmp_path / 'own.yaml'
    with program([*COMMAND, *words, '--yes', '--output', str(file)], tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        started.send(signal.SIGINT)
        assert started.end() == 130, started.text
    assert not listener.received[-1].moves
    assert 'written' not in started.text
    assert not file.exists()
