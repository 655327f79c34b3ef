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
"""A bridge of several simulated robots, one process over real DDS."""

from __future__ import annotations

import contextlib
from functools import partial
from pathlib import Path
import signal
import threading
import time

from kachaka_simple_control.control.claims import Claim, HELD
from kachaka_simple_control.errors import RobotNotFoundError, RobotTakenError
from kachaka_simple_control.kachaka.bridge_process import simulated_fleet
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.motion.geometry import Pose
from optional_libraries import optional_imports
import pytest
from ros_support import bridge, BridgeProcess
from waiting import wait_until

with optional_imports():
    from kachaka_simple_control.kachaka.bridge_node import BridgeNode
    from kachaka_simple_control.kachaka.simulated_robot import SimulatedRobot
    from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
    from kachaka_simple_control.ros import robot_claim
    import rclpy
    from rclpy.qos import DurabilityPolicy, QoSProfile
    from rclpy.signals import SignalHandlerOptions
    from std_msgs.msg import String

pytestmark = [
    pytest.mark.ros, pytest.mark.slow, pytest.mark.needs('rclpy', 'nav_msgs', 'yaml')]
#: The distance driven in a command timeout of 0.3 s at 0.1 m/s [m].
TIMEOUT_DISTANCE = 0.03
THREE = """
robots:
  r1: {motion: straight, start: {x: 1 m, heading: 90 deg}}
  r2: {motion: straight, simulation: {linear_gain: 0.5}}
  r3: {motion: straight}
"""


@pytest.fixture
def three(tmp_path):
    """Return the path of a file of three robots."""
    return written(tmp_path, THREE)


def written(folder, text):
    """Return the path of a file with a text."""
    path = Path(folder) / 'robots.yaml'
    path.write_text(text)
    return str(path)


def many(count):
    """Return the text of a file of many robots."""
    return 'robots:\n' + ''.join(f'  r{n}: {{motion: straight}}\n' for n in range(1, count + 1))


@contextlib.contextmanager
def fleet(file, *options):
    """Run the bridge of a fleet, which is ready, for the length of a block."""
    with bridge('--robots', file, *options) as process:
        process.wait_for_text('ready: ')
        yield process


def publisher(probe, robot, process):
    """Return a publisher of velocities that a robot of the bridge has matched for certain."""
    return probe.publisher(f'/{robot}', process, f'[kachaka_bridge.{robot}]: the robot refused')


def test_each_robot_is_driven_by_its_own_topics(probe, three):
    with fleet(three) as process:
        assert 'ready: 3 simulated robots: r1, r2, r3\n' in process.text
        odometry = {name: probe.odometry(f'/{name}') for name in ('r1', 'r2', 'r3')}
        publishers = {name: publisher(probe, name, process) for name in odometry}
        for name in odometry:
            assert probe.set_enabled(f'/{name}', True).success
        probe.send(publishers['r1'], 0.1)
        probe.send(publishers['r2'], 0.1)
        time.sleep(0.6)
        # Each begins at 0 in its odometry, wherever the file says that it is.
        assert [odometry[name][-1][1].pose.pose.position.x for name in odometry] == pytest.approx(
            [TIMEOUT_DISTANCE, TIMEOUT_DISTANCE / 2.0, 0.0], abs=1e-9)
        for name, received in odometry.items():
            message = received[-1][1]
            assert message.header.frame_id == f'{name}/odom'
            assert message.child_frame_id == f'{name}/base_footprint'
        probe.send(publishers['r3'], 1.0)
        process.wait_for_text('[kachaka_bridge.r3]: a velocity of 1 m/s is cut to 0.3 m/s')
        for name in odometry:
            assert probe.set_enabled(f'/{name}', False).success
        before = process.text
        process.send(signal.SIGTERM)
        assert process.end(3.0) == 0
        assert 'manual control' not in process.text
        assert 'pose' not in before
        assert ('[kachaka_bridge.r1]: true pose: 1.0000 m, 0.0300 m, 90.00 deg '
                '(x, y, heading, on the floor)\n') in process.text
        assert process.text.count('true pose') == 3


def test_one_robot_in_a_file_has_frames_without_its_name(probe, tmp_path):
    with fleet(written(tmp_path, many(1))) as process:
        assert 'ready: 1 simulated robot: r1\n' in process.text
        assert probe.odometry('/r1')[-1][1].header.frame_id == 'odom'


def test_of_many_robots_the_log_has_one_line(probe, tmp_path):
    with fleet(written(tmp_path, many(12))) as process:
        for number in range(1, 13):
            assert probe.set_enabled(f'/r{number}', True).success
        process.send(signal.SIGTERM)
        process.send(signal.SIGINT)
        assert process.end(3.0) == 0
        (line,) = process.lines
        assert line.endswith(
            '[kachaka_bridge]: ready: 12 simulated robots: r1, r2, r3, r4, r5 and 7 more')


def threads(process):
    """Return how many threads a process has."""
    return len([*Path(f'/proc/{process.process.pid}/task').iterdir()])


def test_many_robots_need_no_more_threads_than_one(tmp_path):
    with bridge('--namespace', 'alone') as one, fleet(written(tmp_path, many(12))) as twelve:
        one.wait_for_text('ready: ')
        assert wait_until(lambda: threads(twelve) == threads(one))


@pytest.mark.parametrize('rate, least, most', [('10', 8.0, 10.5), ('50 Hz', 35.0, 55.0)])
def test_odometry_comes_at_the_rate_that_was_chosen(probe, three, rate, least, most):
    with fleet(three, '--odometry-rate', rate):
        odometry = probe.odometry('/r3')
        time.sleep(0.3)
        first = len(odometry) - 1
        time.sleep(2.0)
        (began, _), (ended, _) = odometry[first], odometry[-1]
        assert least < (len(odometry) - 1 - first) / (ended - began) < most


def test_a_robot_that_another_bridge_shows_is_named(three):
    with bridge('--namespace', 'r2') as other, contextlib.ExitStack() as stack:
        other.wait_for_text('ready: ')
        refused = stack.enter_context(bridge('--robots', three))
        assert refused.end() == 3
        (line,) = refused.lines
        assert '/r2/kachaka_bridge (process ' in line
        assert line.endswith('shows a robot on /r2/manual_control/cmd_vel; stop it, or choose '
                             'another name in --robots')
        with pytest.raises(RobotNotFoundError, match='/r2/manual_control/cmd_vel'), \
                simulated_fleet(three) as child:
            assert wait_until(lambda: child.is_over)
        # Those that were refused have claimed nothing.
        one = stack.enter_context(bridge('--namespace', 'r1'))
        one.wait_for_text('ready: ')


def test_a_child_process_brings_robots_along_that_no_file_describes(probe):
    robots = {'yes': (Pose(1.0), SimulationParameters(linear_gain=0.5)),
              'r2': (Pose(), SimulationParameters())}
    with simulated_fleet(robots, ['--odometry-rate', '20']) as process:
        process.wait_until_ready()
        assert process.participant is not None
        assert probe.odometry('/yes')[-1][1].header.frame_id == 'yes/odom'
        assert probe.odometry('/r2')
    assert process.is_over


@pytest.mark.parametrize('text, problem', [
    ('robots:\n  r1: {motion: square, simulation: {wheel_ratio: 0}}\n',
     'robots.yaml:2: robots.r1.simulation.wheel_ratio: '),
    ('robots: [', 'robots.yaml:2: this is not YAML'),
    (None, 'robots.yaml: ')])
def test_a_broken_file_is_one_line(tmp_path, text, problem):
    file = str(tmp_path / 'robots.yaml')
    if text is not None:
        written(tmp_path, text)
    with bridge('--robots', file) as process:
        assert process.end() == 2
        (line,) = process.lines
        assert line.startswith('kachaka_bridge: ')
        assert problem in line


@pytest.mark.parametrize('options, text', [
    (('--address', 'robot', '--robots', 'minuet'), '--robots is for simulated robots: it needs'),
    (('--sim', '--robots', 'minuet', '--namespace', 'r1'), '--namespace is for one robot; what'),
    (('--sim', '--robots', 'minuet', '--lag', '0'), '--lag is for one robot; what the robots of'),
    (('--sim', '--robots', 'menuet'), "there is no fleet of this name; did you mean 'minuet'?")])
def test_options_that_do_not_fit_are_one_line(options, text):
    with BridgeProcess(*options) as process:
        assert process.end() == 2
        (line,) = process.lines
        assert text in line


@pytest.fixture
def context():
    """Run ROS in this process."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    yield
    rclpy.try_shutdown()


def node_of(*names, on_conflict=lambda *_: None):
    """Return a node with simulated robots."""
    return BridgeNode('/', {
        name: partial(SimulatedRobot, robot=SimulatedKachaka(time.monotonic()))
        for name in names}, 0.02, on_conflict)


@pytest.mark.usefixtures('context')
def test_a_destroyed_node_releases_all_its_robots():
    first = node_of('r1', 'r2')
    with pytest.raises(RobotTakenError, match='an earlier node of this program has the robot on '
                                              '/r2/manual_control/cmd_vel'):
        node_of('r2', 'r3')
    first.destroy_node()
    node_of('r1', 'r2', 'r3').destroy_node()


def claimed(probe, robot):
    """Publish what a bridge on another machine publishes of its robot."""
    publisher = probe.node.create_publisher(
        String, f'/{robot}/manual_control/cmd_vel/_bridge',
        QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    publisher.publish(String(data=Claim('ff', HELD, 'somebody on another machine').to_json()))
    return publisher


@pytest.mark.usefixtures('context')
def test_a_robot_that_another_machine_shows_is_refused_and_named(probe, monkeypatch):
    monkeypatch.setattr(robot_claim, 'is_localhost_only', lambda: False)
    publisher = claimed(probe, 'far2')
    with pytest.raises(RobotTakenError, match='somebody on another machine shows a robot on '
                                              '/far2/manual_control/cmd_vel'):
        node_of('far1', 'far2', 'far3')
    probe.node.destroy_publisher(publisher)


@pytest.mark.usefixtures('context')
def test_a_conflict_with_another_machine_says_of_which_robot(probe, monkeypatch):
    monkeypatch.setattr(robot_claim, 'is_localhost_only', lambda: False)
    found = []
    node = node_of('late1', 'late2', on_conflict=lambda *conflict: found.append(conflict))
    loops = node.executors()
    threads = [threading.Thread(target=loop.run) for loop in loops]
    for thread in threads:
        thread.start()
    publisher = claimed(probe, 'late2')
    try:
        assert wait_until(lambda: found)
    finally:
        for loop, thread in zip(loops, threads):
            loop.stop()
            thread.join()
    assert found[0] == ('late2', 'somebody on another machine')
    probe.node.destroy_publisher(publisher)
    monkeypatch.setattr(robot_claim, 'CLAIM_CONFLICT_TIME', 0.0)
    node.destroy_node()
