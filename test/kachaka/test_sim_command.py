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
"""The command ``kachaka_sim``: where it listens, how it ends, and what it refuses in one line."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys

from program import environment, program, without
import pytest

pytestmark = pytest.mark.real_time

COMMAND = [sys.executable, '-m', 'kachaka_simple_control.kachaka.sim_command']
START = """
sys.argv = ['kachaka_sim', '--grpc-port', '0']
from kachaka_simple_control.kachaka.sim_command import main
sys.exit(main())
"""


def needs_sdk():
    """Skip a test where the extra is absent."""
    pytest.importorskip('grpc', reason='needs the extra "kachaka"')
    return pytest.importorskip('kachaka_api', reason='needs the SDK of the robot')


def refusal(*arguments: str) -> tuple[int, str]:
    """Return exit code and the one line of a robot that does not start."""
    result = subprocess.run(
        [*COMMAND, *arguments], capture_output=True, text=True, env=environment(), check=False,
        timeout=60)
    assert result.stdout == ''
    assert result.stderr.count('\n') == 1, result.stderr
    return result.returncode, result.stderr


@pytest.mark.parametrize('signum', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_cleanly(signum, tmp_path):
    """While a client waits; it needs no ROS."""
    kachaka_api = needs_sdk()
    ros = ('rclpy', 'geometry_msgs', 'nav_msgs', 'std_srvs')
    with program(without(ros, START), tmp_path) as robot:
        robot.wait_for_text('ready: simulated Kachaka at 127.0.0.1:')
        address = robot.text.split()[-1]
        stub = kachaka_api.KachakaApiClient(address).stub
        waiting = stub.GetError.future(kachaka_api.pb2.GetRequest(
            metadata=stub.GetError(kachaka_api.pb2.GetRequest()).metadata))
        robot.send(signum)
        assert robot.end() == 0
        assert robot.text.count('\n') == 1, robot.text
        assert waiting.exception() is not None


def test_the_power_button_is_a_signal(tmp_path):
    """Once for a pause, once more for its end."""
    kachaka_api = needs_sdk()
    with program([*COMMAND, '--grpc-port', '0'], tmp_path) as robot:
        robot.wait_for_text('ready: ')
        client = kachaka_api.KachakaApiClient(robot.text.split()[-1])
        reading = client.stub.GetError(kachaka_api.pb2.GetRequest())
        for codes in ([21051], []):
            robot.send(signal.SIGUSR1)
            reading = client.stub.GetError(
                kachaka_api.pb2.GetRequest(metadata=reading.metadata), timeout=10.0)
            assert list(reading.error_codes) == codes
        robot.send(signal.SIGTERM)
        assert robot.end() == 0


def test_a_port_in_use_is_one_line():
    """Whatever program uses it."""
    needs_sdk()
    with socket.socket() as other:
        other.bind(('127.0.0.1', 0))
        other.listen()
        port = other.getsockname()[1]
        code, line = refusal('--grpc-port', str(port))
    assert code == 2
    assert line == (f'kachaka_sim: cannot listen at 127.0.0.1:{port}: Address already in use; '
                    'choose another --grpc-port\n')


@pytest.mark.parametrize(('arguments', 'words'), [
    (('--grpc-port', '65536'), ["'65536'", '--grpc-port']),
    (('--grpc-port', 'x'), ["'x'"]),
    (('--lag', '-1'), ['--lag is -1.0 s']),
    (('--sim',), ['--sim']),
    (('--host', '192.0.2.1', '--grpc-port', '0'), ['192.0.2.1', 'cannot listen']),
    (('--host', 'no such host', '--grpc-port', '0'), ['no such host', 'cannot listen'])])
def test_invalid_options_are_refused_in_one_line(arguments, words):
    if '--host' in arguments:
        needs_sdk()
    code, line = refusal(*arguments)
    assert code == 2
    assert [word for word in ['kachaka_sim: ', *words] if word not in line] == []


def test_a_floor_has_a_line_for_each_error_and_a_contact_is_told(tmp_path):
    kachaka_api = needs_sdk()
    file = tmp_path / 'floor.yaml'
    file.write_text('walls: [[[1 m, 0 m]]]\nposts: 1\n')
    with program([*COMMAND, '--grpc-port', '0', '--floor', str(file)], tmp_path) as robot:
        assert robot.end() == 2
    assert [line.partition(': ')[0] for line in robot.text.splitlines()] == [
        f'{file}:1', f'{file}:2']
    file.write_text('walls: [[[0.25 m, -1 m], [0.25 m, 1 m]]]\n')
    with program([*COMMAND, '--grpc-port', '0', '--floor', str(file)], tmp_path) as robot:
        robot.wait_for_text('ready: ')
        client = kachaka_api.KachakaApiClient(robot.text.split()[-1])
        client.set_manual_control_enabled(True)
        client.set_robot_velocity(0.2, 0.0)
        robot.wait_for_text('kachaka_sim: contact with a wall at x 0.01')


@pytest.mark.parametrize('name', ['grpc', 'kachaka_api', 'numpy'])
def test_without_the_sdk_it_prints_how_to_install_it(name):
    needs_sdk()
    result = subprocess.run(
        without((name,), START), capture_output=True, text=True, env=environment(), check=False,
        timeout=60)
    assert result.returncode == 1
    assert result.stderr.count('\n') == 1, result.stderr
    assert name in result.stderr
    assert 'pip install --no-deps kachaka-api' in result.stderr
