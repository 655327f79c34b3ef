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
"""Environment variables and the network are checked before ROS is started."""

import os
from pathlib import Path
import socket
import subprocess
import sys

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.ros import environment
import pytest


@pytest.mark.parametrize(('variables', 'text'), [
    ({'ROS_AUTOMATIC_DISCOVERY_RANGE': 'OFF'}, 'is OFF: then no program finds another'),
    ({'ROS_SECURITY_ENABLE': 'true', 'ROS_SECURITY_STRATEGY': 'Enforce',
      'ROS_SECURITY_KEYSTORE': '/nowhere'}, "ROS_SECURITY_KEYSTORE is '/nowhere': name the keyst"),
    ({'ROS_DOMAIN_ID': '300'}, 'from 0 to 232')])
def test_what_lets_nothing_work_is_refused_with_the_variable(monkeypatch, variables, text):
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    monkeypatch.delenv('ROS_DISTRO', raising=False)
    with pytest.raises(UsageError, match=text):
        environment.check_environment()


def test_on_humble_the_range_of_later_distros_is_not_read(monkeypatch):
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'OFF')
    monkeypatch.setenv('ROS_DISTRO', 'humble')
    environment.check_environment()


@pytest.mark.parametrize('form', ['127.0.0.1:{}', 'localhost:{}', ';127.0.0.1:{}', '[::1]:{}'])
def test_a_discovery_server_that_is_not_there_is_known_before_the_search(monkeypatch, form):
    monkeypatch.setenv('ROS_SUPER_CLIENT', 'TRUE')
    family = socket.AF_INET6 if '::' in form else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM) as server:
        try:
            server.bind(('::1' if '::' in form else '127.0.0.1', 0))
        except OSError:
            pytest.skip('no IPv6 here')
        monkeypatch.setenv('ROS_DISCOVERY_SERVER', form.format(server.getsockname()[1]))
        environment.check_environment()
    with pytest.raises(UsageError, match='no discovery server is there'):
        environment.check_environment()


@pytest.mark.parametrize('text', ['TCPv4:[127.0.0.1]:9', ':::', ';', ''])
def test_of_another_server_nothing_is_known(monkeypatch, text):
    monkeypatch.setenv('ROS_SUPER_CLIENT', 'TRUE')
    monkeypatch.setenv('ROS_DISCOVERY_SERVER', text)
    environment.check_environment()


@pytest.fixture
def server(monkeypatch):
    """Let a discovery server be where the variable says."""
    monkeypatch.setenv('ROS_DISTRO', 'jazzy')
    monkeypatch.setenv('ROS_SUPER_CLIENT', '')
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as server:
        server.bind(('127.0.0.1', 0))
        monkeypatch.setenv('ROS_DISCOVERY_SERVER', f'127.0.0.1:{server.getsockname()[1]}')
        yield server


@pytest.mark.usefixtures('server')
def test_a_client_of_a_discovery_server_is_a_super_client():
    """Another one would not see who else drives its robot."""
    environment.check_environment()
    assert os.environ['ROS_SUPER_CLIENT'] == 'TRUE'


@pytest.mark.usefixtures('server')
def test_another_client_is_refused(monkeypatch):
    monkeypatch.setenv('ROS_SUPER_CLIENT', 'FALSE')
    with pytest.raises(UsageError, match="ROS_SUPER_CLIENT is 'FALSE', .* set it to TRUE"):
        environment.check_environment()


@pytest.mark.usefixtures('server')
def test_on_humble_a_profile_makes_a_super_client(monkeypatch, tmp_path):
    monkeypatch.setenv('ROS_DISTRO', 'humble')
    monkeypatch.setenv('FASTRTPS_DEFAULT_PROFILES_FILE', '')
    with pytest.raises(UsageError, match='name a profile of a SUPER_CLIENT'):
        environment.check_environment()
    profile = tmp_path / 'client.xml'
    profile.write_text('<discoveryProtocol>SUPER_CLIENT</discoveryProtocol>')
    monkeypatch.setenv('FASTRTPS_DEFAULT_PROFILES_FILE', str(profile))
    environment.check_environment()
    assert not os.environ['ROS_SUPER_CLIENT']


@pytest.mark.usefixtures('server')
def test_simulated_robots_use_no_discovery_server():
    assert 'ROS_DISCOVERY_SERVER is left out' in environment.leave_discovery_server()
    assert 'ROS_DISCOVERY_SERVER' not in os.environ
    assert environment.leave_discovery_server() is None


@pytest.mark.parametrize(('variables', 'text'), [
    ({'HOME': None}, 'HOME is not set'), ({'HOME': '/dev/null'}, '/dev/null/.ros/log cannot be'),
    ({'ROS_HOME': '/dev/null'}, '/dev/null/log cannot be'),
    ({'ROS_LOG_DIR': '/dev/null'}, '/dev/null cannot be written')])
def test_logs_go_to_a_folder_of_their_own_if_need_be(monkeypatch, tmp_path, variables, text):
    monkeypatch.setenv('TMPDIR', str(tmp_path))
    monkeypatch.setattr('tempfile.tempdir', None)
    for name in ('ROS_LOG_DIR', 'ROS_HOME'):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value or '')
    told = environment.use_log_folder()
    assert text in told
    assert 'set ROS_LOG_DIR' in told
    assert Path(os.environ['ROS_LOG_DIR']).parent == tmp_path
    assert environment.use_log_folder() is None


def test_logs_stay_where_they_can_be_written(monkeypatch, tmp_path):
    monkeypatch.setenv('ROS_LOG_DIR', str(tmp_path / 'log'))
    assert environment.use_log_folder() is None
    assert os.environ['ROS_LOG_DIR'] == str(tmp_path / 'log')


def run(words, **variables):
    """Return what a command prints to standard error, and its exit code."""
    result = subprocess.run(
        [*words], env={**os.environ, **variables}, capture_output=True, text=True, timeout=60,
        check=False)
    return result.stderr, result.returncode


@pytest.mark.ros
@pytest.mark.parametrize('module', [
    'kachaka_simple_control', 'kachaka_simple_control.kachaka.bridge_command'])
def test_a_middleware_that_is_not_installed_is_one_line(module):
    pytest.importorskip('rclpy', reason='needs ROS 2')
    printed, code = run([sys.executable, '-m', module, '--sim'], RMW_IMPLEMENTATION='rmw_nothing')
    assert (printed.count('\n'), code) == (1, 2)
    assert "RMW_IMPLEMENTATION is 'rmw_nothing', which is not installed here" in printed


@pytest.mark.ros
def test_without_a_network_nothing_is_searched():
    pytest.importorskip('rclpy', reason='needs ROS 2')
    alone = ['unshare', '--map-root-user', '--net']
    if subprocess.run([*alone, 'true'], capture_output=True, check=False).returncode:
        pytest.skip('this user may not make a network namespace')
    printed, code = run([*alone, sys.executable, '-m', 'kachaka_simple_control', '--sim'])
    assert (printed.count('\n'), code) == (1, 2)
    assert 'this machine has no network' in printed
