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
"""The bridge to a simulated robot, a process over real DDS."""

from __future__ import annotations

from functools import partial
import math
import os
from pathlib import Path
import signal
import subprocess
import time
from types import SimpleNamespace

from optional_libraries import optional_imports
from program import script
import pytest
from ros_support import bridge, BridgeProcess
from waiting import wait_until

with optional_imports():
    from kachaka_simple_control.files import cdr
    from kachaka_simple_control.motion.geometry import Velocity

pytestmark = [pytest.mark.ros, pytest.mark.distro, pytest.mark.needs('rclpy', 'nav_msgs')]
#: The distance driven in a command timeout of 0.3 s at 0.1 m/s [m].
TIMEOUT_DISTANCE = 0.03
VELOCITY = '/kachaka/manual_control/cmd_vel'


def settled_x(odometry, pause=0.6):
    """Return x once the command timeout is over."""
    time.sleep(pause)
    return odometry[-1][1].pose.pose.position.x


@pytest.mark.parametrize('first', [0.1, 0.0], ids=['velocity', 'zero'])
def test_first_command_is_lost_and_enables_manual_control(probe, namespace, first):
    """The bridge switches manual control on and does not send the velocity again."""
    with bridge('--namespace', namespace) as process:
        odometry, publisher = probe.odometry(namespace), probe.publisher(namespace, process)
        probe.send(publisher, first)
        assert settled_x(odometry) == 0.0
        probe.send(publisher, 0.1)
        assert settled_x(odometry) == pytest.approx(TIMEOUT_DISTANCE, abs=1e-9)


def test_service_switches_manual_control(probe, namespace):
    """No velocity is lost after it; a velocity after the release enables it again."""
    with bridge('--namespace', namespace) as process:
        odometry, publisher = probe.odometry(namespace), probe.publisher(namespace, process)
        assert probe.set_enabled(namespace, True).success is True
        probe.send(publisher, 0.1)
        assert settled_x(odometry) == pytest.approx(TIMEOUT_DISTANCE, abs=1e-9)
        assert probe.set_enabled(namespace, False).success is True
        probe.send(publisher, 0.1)
        assert settled_x(odometry) == pytest.approx(TIMEOUT_DISTANCE, abs=1e-9)
        probe.send(publisher, -0.1)
        assert settled_x(odometry) == pytest.approx(0.0, abs=1e-9)
        assert process.text.count('manual control enabled') == 2
        assert process.text.count('manual control disabled') == 1


def test_robot_clips_and_refuses_velocities(probe, namespace):
    """1 m/s is clipped to 0.3 m/s; a velocity that is not finite changes nothing."""
    with bridge('--namespace', namespace) as process:
        odometry, publisher = probe.odometry(namespace), probe.publisher(namespace, process)
        probe.set_enabled(namespace, True)
        probe.send(publisher, math.inf)
        probe.send(publisher, 0.1, math.nan)
        assert settled_x(odometry) == 0.0
        assert 'is cut' not in process.text
        probe.send(publisher, 1.0)
        assert settled_x(odometry) == pytest.approx(0.09, abs=1e-9)
        process.wait_for_text('a velocity of 1 m/s is cut to 0.3 m/s, the most that a Kachaka')
        probe.set_enabled(namespace, False)
        process.wait_for_text(': pose: 0.0900 m, 0.0000 m, 0.00 deg (x, y, heading')


@pytest.mark.parametrize('velocity, text', [
    ((-1.0, 0.0), 'a velocity of -1 m/s is cut to -0.3 m/s, the most'),
    ((0.0, 2.0), 'a velocity of 2 rad/s is cut to 1.57 rad/s, the most'),
    ((0.0, -2.0), 'a velocity of -2 rad/s is cut to -1.57 rad/s, the most'),
    ((0.5, 3.0), 'a velocity of 0.5 m/s and 3 rad/s is cut to 0.3 m/s and 1.57 rad/s, the most'),
    ((-0.3, 1.57), None)])
def test_a_velocity_that_is_cut_is_said_with_its_sign(node, monkeypatch, velocity, text):
    logged = []
    (robot,) = node.robots
    monkeypatch.setattr(robot, 'drive', lambda *_: None)
    monkeypatch.setattr(robot, 'logger', SimpleNamespace(
        warning=lambda line, **_: logged.append(line)))
    robot.on_velocity(cdr.twist(Velocity(*velocity)), 0.0)
    assert [line.startswith(text) for line in logged] == ([] if text is None else [True])


def test_a_bridge_that_cannot_leave_the_graph_ends_all_the_same(tmp_path):
    text = """
import ctypes
from kachaka_simple_control.kachaka import bridge_command
import rclpy
bridge_command.SHUTDOWN_TIMEOUT = 1.0
rclpy.try_shutdown = lambda: ctypes.PyDLL(None).sleep(60)  # keeps the interpreter's lock
bridge_command.main(['--sim'])
"""
    with script(text, tmp_path) as started:
        started.wait_for_text('ready: ')
        started.send(signal.SIGTERM)
        assert started.end() == 1
    assert 'Timeout (0:00:01)!' in started.text


def test_odometry_comes_at_50_hz(probe, namespace):
    """On average; single messages may be late on a busy machine."""
    with bridge('--namespace', namespace):
        odometry = probe.odometry(namespace)
        time.sleep(0.3)
        first = len(odometry) - 1
        time.sleep(2.0)
        (began, _), (ended, _) = odometry[first], odometry[-1]
        # 44 Hz were seen beside nine busy tests on two cores.
        assert 35.0 < (len(odometry) - 1 - first) / (ended - began) < 55.0


def test_quality_of_service_is_the_official_one(probe, namespace):
    """Best effort throughout: a velocity that is lost is not sent again."""
    from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
    with bridge('--namespace', namespace):
        probe.odometry(namespace)
        node = probe.node
        ends = [
            *node.get_subscriptions_info_by_topic(f'{namespace}/manual_control/cmd_vel'),
            *node.get_publishers_info_by_topic(f'{namespace}/odometry/odometry'),
            *node.get_publishers_info_by_topic(f'{namespace}/wheel_odometry/wheel_odometry')]
        assert len(ends) == 3
        for end in ends:
            assert end.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
            assert end.qos_profile.durability == DurabilityPolicy.VOLATILE


class CountingPublisher:
    """A publisher with a number of subscriptions that counts messages."""

    def __init__(self, count):
        """Set the number of subscriptions."""
        self.count, self.published = count, 0

    def get_subscription_count(self):
        """Return the number of subscriptions."""
        return self.count

    def publish(self, _):
        """Count."""
        self.published += 1


def make_node(namespace):
    """Return the node of a bridge with a simulated robot."""
    from kachaka_simple_control.kachaka.bridge_node import BridgeNode
    from kachaka_simple_control.kachaka.simulated_robot import SimulatedRobot
    from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
    return BridgeNode(namespace, {
        '': partial(SimulatedRobot, robot=SimulatedKachaka(time.monotonic()))})


@pytest.fixture
def node(namespace):
    """Yield the node of a bridge in this process."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = make_node(namespace)
    yield node
    node.destroy_node()
    rclpy.try_shutdown()


def test_odometry_is_published_only_for_subscribers(node):
    """Each of the two topics by itself."""
    (robot,) = node.robots
    for counts in ((0, 0), (1, 0), (0, 2)):
        robot._odometry = [CountingPublisher(count) for count in counts]
        node.update()
        assert [int(count > 0) for count in counts] == [
            publisher.published for publisher in robot._odometry]


def claims():
    """Return how many Unix sockets this process has; those of DDS come and go."""
    every = {f'socket:[{line.split()[6]}]'
             for line in Path('/proc/net/unix').read_text().splitlines()[1:]}
    own = [os.path.realpath(entry) for entry in Path('/proc/self/fd').iterdir()]
    return sum(link.rpartition('/')[2] in every for link in own)


def test_a_bridge_that_is_destroyed_or_refused_leaves_no_claim(node, namespace):
    """Not even an open socket."""
    from kachaka_simple_control.errors import RobotTakenError
    before = claims()
    assert before > 0
    with pytest.raises(RobotTakenError, match='an earlier node of this program has the robot'):
        make_node(namespace)
    assert claims() == before
    node.destroy_node()
    make_node(namespace).destroy_node()


@pytest.mark.parametrize('signum', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_end_it_without_a_traceback(signum):
    """Exit code 0, soon; a second signal does not interrupt the shutdown."""
    with bridge() as process:
        assert wait_until(lambda: 'ready' in process.text)
        process.process.send_signal(signum)
        process.process.send_signal(signum)
        assert process.end(3.0) == 0
        assert 'Traceback' not in process.text
        assert len(process.lines) == 1
        for name in ('manual_control/cmd_vel', 'manual_control/set_enabled', 'odometry/odometry'):
            assert f'/kachaka/{name}' in process.text


def test_end_of_the_parent_ends_it():
    """Its standard input closes; without --with-parent that means nothing."""
    with bridge('--with-parent', stdin=subprocess.PIPE) as child, \
            bridge('--namespace', 'free', stdin=subprocess.PIPE) as free:
        assert wait_until(lambda: 'ready' in child.text and 'ready' in free.text)
        child.process.stdin.write('anything but an end')
        child.process.stdin.flush()
        time.sleep(0.3)
        assert child.process.poll() is None
        for process in (child, free):
            process.process.stdin.close()
        assert child.end(3.0) == 0
        assert free.process.poll() is None


@pytest.mark.parametrize(('options', 'text'), [
    ((), 'which robot? --sim shows a simulated one'),
    (('--sim', '--lag', '-1'), '--lag is -1.0 s; it must be 0 s or more, and finite'),
    (('--sim', '--velocity-noise', 'much'), "--velocity-noise: 'much'; it must be a number"),
    (('--sim', '--speed', '3'), 'unrecognized arguments: --speed 3'),
    (('--sim', '-p', 'a:=1'), 'a:=1; write ROS arguments after --ros-args'),
    (('--address', 'robot', '--odometry-rate', '10'), 'for simulated robots: it needs --sim'),
    (('--sim', '--odometry-rate', '0'), '--odometry-rate is 0 Hz; it must be above 0 Hz'),
    (('--sim', '--odometry-rate', '1001 Hz'), 'it must be above 0 Hz, and 1000 Hz at most'),
    (('--sim', '--namespace', 'a-b'), "--namespace is '/a-b'; a namespace begins with a slash"),
    (('--sim', '--namespace', 'a' * 230), 'characters; ROS takes 247 at most'),
    (('--sim', '--namespace', b'\xff'), 'surrogates not allowed'),
    (('--sim', '--ros-args', '-r', '__ns:=/a b'), "the namespace in -r __ns:= is '/a b'"),
    (('--sim', '--ros-args', '-r', f'/rosout:={VELOCITY}'), f'to {VELOCITY}, which moves'),
    (('--sim', '--ros-args', '--log-level', 'loud'), 'levels are debug, info, warn, error'),
    (('--sim', '--\x1b'), r'unrecognized arguments: --\x1b'),
    (('--address', 'a' * 5000), 'it has at most 261 characters'),
    (('--sim', '--ros-args', '-p'), 'ROS could not be started')])
def test_bad_arguments_are_one_line(options, text):
    """Exit code 2."""
    with BridgeProcess(*options) as process:
        assert process.end() == 2
        assert len(process.lines) == 1
        assert process.text.startswith('kachaka_bridge: ')
        assert text in process.text
