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
"""How the error that ends a command becomes one line and an exit code."""

import signal

from kachaka_simple_control.commands.drive_or_preview import main as drive_or_preview
from kachaka_simple_control.errors import (
    InvalidMotionError,
    RobotNotFoundError,
    RunFaultError,
    UsageError,
)
from kachaka_simple_control.files import library
from kachaka_simple_control.process.run_command import run_command
from kachaka_simple_control.process.signals import SignalDispatcher
import pytest


@pytest.mark.parametrize('error, code', [
    (InvalidMotionError('linear_x is 3 m/s'), 2),
    (UsageError('rate is 0'), 2),
    (RobotNotFoundError('no robot'), 3),
    (RunFaultError('late'), 1),
    (RunFaultError('the robot says \x1b[2J' + 'no' * 50_000), 1),
    (KeyError('oops'), 1),
    (KeyboardInterrupt(), 130),
])
def test_each_error_has_its_exit_code_and_no_traceback(error, code, capsys):
    def body():
        raise error

    assert run_command(body) == code
    printed = capsys.readouterr().err
    assert 'Traceback' not in printed
    assert printed.replace('\n', '').isprintable()
    assert len(printed) < 1200
    assert len(printed.splitlines()) <= 1


@pytest.fixture
def lesson(tmp_path, monkeypatch):
    """Return a file that takes the place of the lesson."""
    file = tmp_path / 'edited.py'
    monkeypatch.setattr(library, 'LESSON_FILE', file)
    return file


@pytest.mark.parametrize('duration, shown', [
    ('-1.0', '-1.0 s; it must not be negative'), ("'0.1'", "'0.1'; it must be a number [s]"),
    ('None', 'None; it must be a number [s]')])
def test_the_line_of_an_edited_lesson_is_named(duration, shown, lesson, capsys):
    lesson.write_text(
        f'def play_lesson(robot):\n    pass\n    robot.move_robot(0.1, 0.0, {duration})\n')
    assert run_command(library.lesson_motion, motion_function=library.LESSON_FUNCTION) == 2
    assert capsys.readouterr().err == f'{lesson}:3: duration is {shown}\n'


def test_a_syntax_error_in_an_edited_lesson_is_named_with_its_line_alone(lesson, capsys):
    lesson.write_text('def play_lesson(robot):\n    robot.move_robot(0.1, 0.0, 1.0\n')
    assert run_command(library.lesson_motion, motion_function=library.LESSON_FUNCTION) == 1
    assert capsys.readouterr().err == f"{lesson}:2: '(' was never closed\n"


def test_a_forgotten_value_in_an_edited_lesson_is_named_without_a_robot(lesson, capsys):
    lesson.write_text('def play_lesson(robot):\n    robot.move_robot(0.1, 0.0)\n')
    assert drive_or_preview(['--plan']) == 1
    assert capsys.readouterr().err == (
        'kachaka_simple_control: unexpected TypeError: move_robot() missing 1 required '
        f"positional argument: 'duration' ({lesson}:2)\n")


def test_a_body_that_returns_has_exit_code_0():
    assert run_command(lambda: None) == 0


def test_an_error_about_a_path_is_one_line_whatever_is_in_it(capsys):
    def body():
        raise UsageError('a\nb\x1b\u202e\udcff: there is no such folder')

    assert run_command(body) == 2
    assert capsys.readouterr().err == (
        'kachaka_simple_control: a\\nb\\x1b\\u202e\\udcff: there is no such folder\n')


@pytest.mark.parametrize('error, printed', [
    (RunFaultError('late'), ''),
    (TypeError('oops'), 'kachaka_simple_control: unexpected TypeError: oops'),
])
def test_a_signal_decides_the_exit_code_whatever_followed_from_it(
        monkeypatch, capsys, error, printed):
    """A run that a signal stopped fails in one way or another; only the unexpected is printed."""
    dispatcher = SignalDispatcher()
    dispatcher.signum = signal.SIGTERM
    monkeypatch.setattr('kachaka_simple_control.process.run_command.signal_dispatcher', dispatcher)

    def body():
        raise error

    assert run_command(body) == 143
    assert capsys.readouterr().err[:len(printed) or None] == printed
