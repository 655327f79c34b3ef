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
"""The page of the console beside a drive that begins in a terminal."""

import contextlib
import os
import re
import signal
import socket
import sys

from benchmarks.console_matrix.raw_client import RawClient
from kachaka_simple_control.console.console_command import PORT
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.process.processes import is_running
from program import children_of, COMMAND, environment, find_process, Program
import pytest
from waiting import poll, wait_until

pytestmark = [
    pytest.mark.ros, pytest.mark.needs('rclpy', 'nav_msgs', 'tornado', 'yaml', 'jsonschema')]

CONSOLE = 'console.console_command'


@contextlib.contextmanager
def drive(tmp_path, length):
    """Drive so far [m] on a simulated robot with a page beside it; yield program and client."""
    file = tmp_path / 'ahead.yaml'
    file.write_text('name: ahead\nparameters: {far: }\n'
                    'steps: [include: {motion: ./leg.yaml, with: {far: $far}}]\n')
    (tmp_path / 'leg.yaml').write_text('parameters: {far: }\nsteps: [forward: $far]\n')
    command = [*COMMAND, str(file), f'--with=far={length}m', '--sim', '--quiet', '--console']
    with Program(command, env=environment()) as program:
        program.wait_for_text('Console: http://')
        port = re.search(r'Console: http://127.0.0.1:(\d+)/', program.text)[1]
        client = RawClient(int(port)).greet()
        try:
            client.until(lambda: client.state['state'] == 'driving')
            yield program, client
        finally:
            client.close()


def console_of(program):
    """Return the process of the console."""
    return find_process(children_of(program.process.pid), CONSOLE)


def test_a_page_beside_a_drive_shows_holds_and_stops_it(tmp_path):
    with contextlib.ExitStack() as stack:
        # Somebody else may listen at its port.
        with contextlib.suppress(OSError):
            stack.enter_context(socket.create_server(('127.0.0.1', PORT)))
        program, client = stack.enter_context(drive(tmp_path, 20.0))
        assert client.state['start'] == pytest.approx([0.0, 0.0, 0.0], abs=1e-3)
        client.until(lambda: 'driven' in client.messages)
        assert client.messages['driven']['plan']['points'][-1] == [20.0, 0.0, 0.0]
        assert client.messages['welcome']['robot']['is_driven_here'] is False
        assert client.state['motion'] == 'ahead'
        for kind, values in (
                ('lease', {'want': True}), ('take', {}), ('record', {'on': True}),
                ('run', {'name': 'square'}), ('release', {})):
            answer = client.ask(kind, **values)
            assert (answer['is_done'], 'terminal' in answer['text']
                    or 'another program drives' in answer['text']) == (False, True)
        assert client.ask('speed', factor=0.5)['is_done']
        client.until(lambda: client.state['factors'] == {'override': 0.5})
        client.until(lambda: client.state['is_still'] is False)
        assert client.ask('pause')['is_done']
        client.until(lambda: client.state['state'] == 'paused' and not client.state['velocity'][0])
        client.until(lambda: client.state['is_still'])
        assert client.ask('resume')['is_done']
        client.until(lambda: client.state['state'] == 'driving' and client.state['velocity'][0])
        answer = client.ask('stop')
        assert (answer['is_done'], answer['is_confirmed']) == (True, True)
        console = console_of(program)
        assert program.end() == 1
        assert 'remote stop' in program.text
        assert client.state['state'] == 'ended'
        assert wait_until(lambda: client.is_closed)
        assert poll(lambda: console is None or not is_running(console), 3.0)


@pytest.mark.parametrize('signum', [signal.SIGKILL, signal.SIGSTOP])
def test_the_drive_goes_on_without_its_console(tmp_path, signum):
    with drive(tmp_path, 0.6) as (program, _):

        console = console_of(program)
        os.kill(console, signum)
        assert program.end() == 0
        assert 'Motion completed: ahead' in program.text
        assert ('The console has ended; the drive goes on' in program.text) == (
            signum == signal.SIGKILL)
        assert not is_running(console)


def test_without_tornado_a_sentence_says_what_to_install(monkeypatch):
    from kachaka_simple_control.commands.console_beside import ConsoleBeside
    monkeypatch.setattr('importlib.util.find_spec', lambda _: None)
    with pytest.raises(UsageError, match=r'the page needs tornado, .*pip install'):
        ConsoleBeside(None, None, None)


def test_a_drive_without_it_needs_nothing_of_the_console():
    code = ('import sys; import kachaka_simple_control.commands.drive; '
            "sys.exit(any('.console' in name for name in sys.modules))")
    with Program([sys.executable, '-c', code], env=environment()) as program:
        assert program.end() == 0
