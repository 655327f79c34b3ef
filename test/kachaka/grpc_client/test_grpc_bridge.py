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
"""The bridge to a real robot, a process over real DDS and real gRPC."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
import time

from grpc_client_support import commander, FaultyRobot, real_bridge, SimulatedRobot
from program import environment
import pytest
from ros_support import BridgeProcess
from waiting import wait_until

pytestmark = [
    pytest.mark.ros,
    pytest.mark.needs('rclpy', 'nav_msgs', 'diagnostic_msgs', 'kachaka_api.generated')]


@pytest.fixture
def robot():
    """Return a robot of this test."""
    with FaultyRobot() as robot:
        yield robot


def test_first_velocity_enables_manual_control_and_is_not_lost(probe, namespace, robot):
    """A zero does not enable it; at the end it is switched off."""
    with real_bridge(robot.address, '--namespace', namespace) as process:
        publisher = probe.publisher(namespace, process)
        probe.send(publisher, 0.0)
        assert wait_until(robot.stops)
        assert robot.ask('asked') == []
        probe.send(publisher, 0.1)
        assert wait_until(robot.moves)
        assert robot.ask('rows')[-1][1] == pytest.approx(1.0 / 3.0)
        assert [row[1] for row in robot.ask('asked')] == [True]
        process.process.send_signal(signal.SIGTERM)
        assert process.end(3.0) == 0
        assert robot.stops(robot.moves()[-1])
        assert [row[1] for row in robot.ask('asked')] == [True, False]
        assert 'Traceback' not in process.text


def test_ceased_velocities_are_stopped_before_the_command_timeout(probe, namespace, robot):
    """Without a zero from the publisher."""
    with real_bridge(robot.address, '--namespace', namespace) as process, \
            commander(probe, namespace, process) as driver:
        driver.drive(0.1)
        assert wait_until(lambda: len(robot.moves()) > 5)
        driver.drive(None)
        assert wait_until(lambda: robot.stops(robot.moves()[-1]))
        last = robot.moves()[-1]
        assert 0.2 < robot.stops(last)[0] - last < 0.3


def test_refusals_are_logged_with_their_text(probe, namespace, robot):
    """And after one, nothing moves before a zero."""
    robot.ask('json [{"code": 21051, "title_en": "Emergency stop", "error_type": "Error"}]')
    with real_bridge(robot.address, '--namespace', namespace) as process, \
            commander(probe, namespace, process) as driver:
        driver.drive(0.1)
        assert wait_until(lambda: len(robot.moves()) > 2)
        robot.ask('refuse 21051')
        assert wait_until(lambda: 'refused a velocity: error 21051 (Emergency stop)'
                          in process.text)
        answer = probe.set_enabled(namespace, True)
        assert (answer.success, answer.message) == (False, 'error 21051 (Emergency stop)')
        released = robot.ask('refuse 0')
        time.sleep(0.5)
        assert robot.moves(released) == []
        driver.drive(0.0)
        assert wait_until(lambda: robot.stops(released))
        driver.drive(0.1)
        assert wait_until(lambda: robot.moves(released))
        assert process.text.count('refused a velocity') == 1


def test_diagnostics_report_connection_and_errors(probe, namespace, robot):
    """Each second, in the common format."""
    from diagnostic_msgs.msg import DiagnosticArray
    received = {}
    probe.node.create_subscription(
        DiagnosticArray, '/diagnostics',
        lambda message: received.update({status.name: status for status in message.status}), 10)
    link, state = f'{namespace[1:]}: link', f'{namespace[1:]}: robot'
    with real_bridge(robot.address, '--namespace', namespace) as process:
        assert wait_until(lambda: link in received)
        assert (received[link].level, received[state].message) == (b'\0', 'no errors')
        assert received[link].hardware_id == 'FAULTY, software 1.0'
        robot.ask('json not JSON')
        robot.ask('errors 7 8')
        assert wait_until(lambda: received[state].message == 'error 7; error 8')
        assert received[state].level == b'\2'
        robot.ask('json [{"code": 7, "title_en": "Low battery", "error_type": "Warn"}]')
        robot.ask('errors')
        assert wait_until(lambda: received[state].message == 'no errors')
        robot.ask('errors 7')
        assert wait_until(lambda: received[state].message == 'error 7 (Low battery)')
        assert received[state].level == b'\1'
        # Logged before, but through a pipe: it may arrive after the message.
        assert wait_until(lambda: 'the robot reports error 7 (Low battery)' in process.text)
        robot.ask('cut')
        assert wait_until(lambda: received[link].level == b'\2')


def test_a_simulated_robot_and_its_bridge_tell_charge_and_errors(probe, namespace, robot):
    """As the console shows it."""
    from kachaka_simple_control.ros.robot_info import RobotInfo
    info = RobotInfo(probe.node, namespace)
    with SimulatedRobot() as simulated, real_bridge(
            simulated.address, '--namespace', namespace):
        assert wait_until(lambda: info.battery == 1.0)
        assert wait_until(lambda: info.errors == '')
    with real_bridge(robot.address, '--namespace', namespace):
        robot.ask('errors 7 8')
        assert wait_until(lambda: info.errors == 'error 7; error 8')
    # The maker's bridge has a topic for them.
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
    publisher = probe.node.create_publisher(
        DiagnosticArray, f'{namespace}/diagnostics/error_status', 10)
    message = DiagnosticArray(status=[
        DiagnosticStatus(level=b'\2', name='21051', message='Paused'),
        DiagnosticStatus(level=b'\0', name='1', message='Nothing')])
    assert wait_until(lambda: publisher.publish(message) or info.errors == '21051 Paused')


def test_scans_are_published_from_the_next_one_on_while_somebody_listens(probe, namespace, robot):
    """And the laser runs for 5 s when it is asked to."""
    with real_bridge(robot.address, '--namespace', namespace, '--frame-prefix', 'k1/'):
        time.sleep(0.5)
        assert robot.ask('scans') == 0
        scans = probe.scans(namespace)
        assert wait_until(lambda: robot.ask('scans') > 2)
        assert scans == [], 'what it saw before the laser stopped'
        answer = probe.activate_laser(namespace)
        assert (answer.success, answer.message) == (True, '')
        assert 3.0 < robot.ask('laser') <= 5.0
        assert wait_until(lambda: len(scans) >= 5)
        stamps = [scan.header.stamp.nanosec for scan in scans]
        assert stamps == sorted(set(stamps)), 'each once'
        assert scans[0].header.frame_id == 'k1/laser'
        assert (scans[0].angle_min, scans[0].angle_max, scans[0].range_max) == (-1.0, 1.0, 8.0)
        assert repr([*scans[0].ranges]) == '[0.5, inf, nan]'
        robot.ask('refuse 21051')
        answer = probe.activate_laser(namespace)
        assert (answer.success, answer.message) == (False, 'error 21051')


def test_a_simulated_robot_shows_its_scans_as_a_real_one_does(probe, namespace):
    """It stands, so its laser runs when it is asked to."""
    with SimulatedRobot() as simulated, real_bridge(
            simulated.address, '--namespace', namespace):
        scans = probe.scans(namespace)
        assert probe.activate_laser(namespace).success
        assert wait_until(lambda: len(scans) >= 3)
        assert len(scans[0].ranges) > 100


@pytest.mark.parametrize(('options', 'code', 'text'), [
    (('--address', '127.0.0.1:1'), 3, 'refuses connections: switch the Kachaka API on'),
    (('--address', 'no-such-robot.invalid'), 3, "there is no host 'no-such-robot.invalid'"),
    (('--address', 'http://robot'), 2, 'is no address of a robot'),
    (('--address', 'robot', '--sim'), 2, 'one robot at a time')])
def test_unreachable_robot_is_one_line(options, code, text):
    with BridgeProcess(*options) as process:
        assert process.end(10.0) == code
        assert len(process.lines) == 1
        assert text in process.text


def test_server_that_never_responds_is_reported(tmp_path):
    with socket.create_server(('127.0.0.1', 0)) as server:
        address = f'127.0.0.1:{server.getsockname()[1]}'
        with BridgeProcess('--address', address) as process:
            assert process.end(10.0) == 3
            assert f'{address} accepts connections, but does not answer' in process.text
            assert len(process.lines) == 1


def test_missing_sdk_is_reported_with_what_to_install(tmp_path):
    """Only the bridge to a real robot needs it."""
    (tmp_path / 'kachaka_api.py').write_text('raise ImportError("none here")')
    env = environment()
    env['PYTHONPATH'] = f'{tmp_path}:{env["PYTHONPATH"]}'
    done = subprocess.run(
        [sys.executable, '-m', 'kachaka_simple_control.kachaka.bridge_command',
         '--address', 'robot'],
        env=env, capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 1
    assert 'pip install' in done.stderr
    assert len(done.stderr.splitlines()) == 1
