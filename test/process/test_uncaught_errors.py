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
"""How an error that a program does not catch ends it: one line, its own line, the exit code."""

import os
import subprocess
import sys

from kachaka_simple_control.process.signals import TRACEBACK_VARIABLE
import pytest

START = """import sys
from kachaka_simple_control import errors, files
from kachaka_simple_control.process.signals import signal_dispatcher
signal_dispatcher.handle_uncaught()
"""


def run(code, tmp_path, **environment):
    """Return exit code and standard error of a script that begins with ``START``."""
    script = tmp_path / 'script.py'
    script.write_text(START + code)
    done = subprocess.run(
        [sys.executable, str(script)], env={**os.environ, **environment}, capture_output=True,
        text=True, check=False)
    return done.returncode, done.stderr.replace(str(script), 'script.py')


@pytest.mark.parametrize('error, code', [
    ('UsageError', 2), ('InvalidMotionError', 2), ('RobotNotFoundError', 3),
    ('RobotTakenError', 3), ('RunFaultError', 1), ('MotionRefusedError', 1)])
def test_an_error_of_ours_is_one_line_and_its_exit_code(error, code, tmp_path):
    assert run(f'raise getattr(errors, {error!r})("it\\x1bcannot be")', tmp_path) == (
        code, 'script.py:5: it\\x1bcannot be\n')


def test_the_line_is_that_of_the_program_and_a_file_has_its_own(tmp_path):
    pytest.importorskip('jsonschema', reason='needs jsonschema')
    code, text = run(
        'from kachaka_simple_control.files.motion_reader import loads\n'
        'def patrol():\n    loads("steps:\\n- trun: 1 rad\\n- wait: fast", "a.yaml")\npatrol()',
        tmp_path)
    assert code == 2
    assert [line.partition(' ')[0] for line in text.splitlines()] == [
        'script.py:7:', 'a.yaml:3:']


#: A handler whose exception a call of rclpy turns into another one.
INTERRUPTED = """
import os, signal, types
handler = types.SimpleNamespace(
    on_signal=lambda _: None, wake=lambda: None, uncaught=lambda _: None)
signal_dispatcher.register(handler)
rclpy = types.ModuleType('MODULE')
exec('''
def spin(stop):
    try:
        stop()
    except BaseException:
        raise RuntimeError('Unable to convert call argument') from None
''', vars(rclpy))
def stop():
    os.kill(os.getpid(), signal.SIGNUM)
    while True:
        pass
rclpy.spin(stop)
"""


@pytest.mark.parametrize('signum, code', [('SIGINT', 130), ('SIGTERM', 143)])
def test_a_signal_in_a_call_of_rclpy_that_hides_it_ends_the_program_as_a_signal(
        signum, code, tmp_path):
    script = INTERRUPTED.replace('SIGNUM', signum)
    assert run(script.replace('MODULE', 'rclpy.executors'), tmp_path) == (code, '')
    # Any other error of the program is its own.
    ended, text = run(script.replace('MODULE', 'mine'), tmp_path)
    assert ended == 1
    assert 'RuntimeError: Unable to convert call argument' in text
    # An interactive prompt goes on after a signal, and shows its later errors.
    prompt = "sys.ps1 = '>'\n" + script.replace('MODULE', 'rclpy.executors')
    ended, text = run(prompt, tmp_path)
    assert ended == 1
    assert 'RuntimeError: Unable to convert call argument' in text


@pytest.mark.ros
@pytest.mark.needs('rclpy')
@pytest.mark.parametrize('duration', ['-1.0', '"0.1"', 'None'])
def test_the_line_of_a_movement_with_an_invalid_value_is_that_of_the_script(duration, tmp_path):
    code, text = run(
        'from kachaka_simple_control import KachakaSimpleControl\n'
        'node = KachakaSimpleControl({"guardian": False})\n'
        f'node.move_robot(0.1, 0.0, {duration})', tmp_path)
    assert code == 2
    (line,) = (line for line in text.splitlines() if '[INFO]' not in line)
    assert line.startswith('script.py:7: duration is ')


def test_an_error_that_ends_a_thread_is_one_line_too(tmp_path):
    thread = """
import threading
def refused():
    raise errors.MotionRunningError('no')
threading.Thread(target=refused).start()
"""
    assert run(thread, tmp_path) == (0, 'script.py:8: no\n')
    code, text = run(thread, tmp_path, **{TRACEBACK_VARIABLE: '1'})
    assert (code, text.count('Traceback')) == (0, 1)
    assert run(thread.replace('errors.MotionRunningError', 'ValueError'), tmp_path)[1].count(
        'Traceback') == 1


def test_the_line_is_not_that_of_a_thread_that_calls_the_package(tmp_path):
    """No line of the program is in such a call."""
    pytest.importorskip('jsonschema', reason='needs jsonschema')
    code, text = run("""
import threading
from kachaka_simple_control.files.motion_reader import loads
threading.Thread(target=loads, args=('steps:\\n- trun: 1 rad', 'a.yaml')).start()
""", tmp_path)
    assert code == 0
    assert text.startswith('a.yaml:2: ')


def test_other_errors_and_other_hooks_are_left_alone(tmp_path):
    code, text = run('raise ValueError("no")', tmp_path)
    assert (code, text.startswith('Traceback')) == (1, True)
    hook = 'sys.excepthook = lambda *what: print("mine", file=sys.stderr)\n'
    assert run(f'{hook}raise errors.UsageError("no")', tmp_path) == (1, 'mine\n')
    again = 'signal_dispatcher.handle_uncaught()\n'
    assert run(f'{hook}{again}raise errors.UsageError("no")', tmp_path) == (1, 'mine\n')
