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
"""The question before a robot drives, at a terminal."""

import sys

from kachaka_simple_control.commands.drive_or_preview import confirm
import pytest
from terminals import at_terminal, Typed

pytestmark = pytest.mark.real_time

ASK = """
import sys, time
from kachaka_simple_control.commands.drive_or_preview import confirm
from kachaka_simple_control.process.run_command import run_command
print('begun', flush=True)
time.sleep(float(sys.argv[1]))
sys.exit(run_command(lambda: confirm('1.00 m x 2.00 m', 'Mark it.  ') or print('drives')))
"""

ASK_BESIDE_A_THREAD = """
import signal, sys, threading, time
from kachaka_simple_control.commands.drive_or_preview import confirm
from kachaka_simple_control.process.run_command import run_command
threading.Thread(target=time.sleep, args=(60.0,), daemon=True).start()
signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
sys.exit(run_command(lambda: confirm('1.00 m x 2.00 m')))
"""


def asked(pause=0.0):
    """Return a terminal at which somebody is asked after a pause [s]."""
    return at_terminal([sys.executable, '-c', ASK, str(pause)], 100, 20)


@pytest.mark.parametrize('typed', [b'\r', b'y\r', b'Yes\r', b' yes \r'])
def test_consent_drives(typed):
    with asked() as shown:
        shown.wait_for_text(
            'The robot needs 1.00 m x 2.00 m of free floor.  Mark it.  Enter drives')
        shown.press(typed)
        assert shown.end() == 0
        assert 'drives' in shown.screen.above


@pytest.mark.parametrize('typed, code', [
    (b'n\r', 2), (b'no\r', 2), (b'q\r', 2), (b'x\r', 2), (b'\x04', 2), (b'\x03', 130)])
def test_everything_else_refuses(typed, code):
    with asked() as shown:
        shown.wait_for_text('Enter drives')
        shown.press(typed)
        assert shown.end() == code
        assert 'drives' not in shown.screen.above


def test_what_was_typed_before_the_question_is_no_answer():
    with asked(pause=0.5) as shown:
        shown.wait_for_text('begun')
        shown.press(b'\r\ryes\r')
        shown.wait_for_text('Enter drives')
        shown.read_for(0.5)
        assert shown.process.poll() is None
        shown.press(b'n\r')
        assert shown.end() == 2


def test_what_is_typed_once_the_question_can_be_read_is_the_answer(monkeypatch, capsys):
    monkeypatch.setattr('sys.stdin', Typed('y\n'))
    monkeypatch.setattr(
        'termios.tcflush', lambda *_: print('/'.join(capsys.readouterr()), file=sys.stderr))
    confirm('1.00 m x 2.00 m')
    shown = capsys.readouterr()
    assert 'of free floor' in shown.err
    assert 'Enter' not in shown.err
    assert 'Enter drives' in shown.out


def test_ctrl_c_ends_it_if_the_signal_interrupts_no_read():
    # Another thread takes the signal here; a signal just before the read has the same effect.
    with at_terminal([sys.executable, '-c', ASK_BESIDE_A_THREAD], 100, 20) as shown:
        shown.wait_for_text('Enter drives')
        shown.press(b'\x03')
        assert shown.end() == 130
