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
"""Three processes, a robot over gRPC, the bridge, the node: the lesson, and how it ends."""

from __future__ import annotations

import re
import signal
import time

from grpc_client_support import FaultyRobot, real_bridge, SimulatedRobot
from program import COMMAND, program
import pytest
from waiting import wait_until

pytestmark = [
    pytest.mark.ros, pytest.mark.slow,
    pytest.mark.needs('rclpy', 'nav_msgs', 'diagnostic_msgs', 'kachaka_api.generated')]


def test_lesson_ends_at_its_planned_pose(tmp_path):
    """As with --sim, but over gRPC."""
    with SimulatedRobot() as robot, \
            program([*COMMAND, '--yes', '--address', robot.address], tmp_path) as started:
        assert started.end(40.0) == 0, started.text
    pose = re.search(r'x (\S+) m, y (\S+) m, heading (\S+) degrees', started.text)
    x, y, heading = (float(number) for number in pose.groups())
    assert x == pytest.approx(0.1, abs=0.005)
    assert y == pytest.approx(0.0, abs=0.005)
    assert heading == pytest.approx(0.0, abs=2.0)
    assert 'manual control disabled' in started.text


@pytest.mark.parametrize(('signum', 'code', 'within'), [
    (signal.SIGINT, 130, 0.3), (signal.SIGKILL, 137, 0.3), (signal.SIGSTOP, None, 0.4)])
def test_zeros_reach_the_robot_however_the_node_ends(tmp_path, signum, code, within):
    with FaultyRobot() as robot, real_bridge(robot.address), \
            program(COMMAND, tmp_path) as started:
        assert wait_until(lambda: len(robot.moves()) > 3, 30.0)
        started.send(signum)
        asked = time.monotonic()
        assert wait_until(lambda: robot.stops(robot.moves()[-1]))
        first = robot.stops(robot.moves()[-1])[0]
        assert first - asked < within
        time.sleep(1.0)
        assert robot.moves(first) == []
        assert len(robot.stops(first)) > 3
        if code is not None:
            assert started.end(5.0) == code


def test_emergency_stop_ends_the_run_with_the_robots_error_text(tmp_path):
    with FaultyRobot() as robot:
        robot.ask('json [{"code": 21051, "title_en": "Emergency stop"}]')
        with program([*COMMAND, '--yes', '--address', robot.address], tmp_path) as started:
            assert wait_until(lambda: len(robot.moves()) > 3, 30.0)
            robot.ask('refuse 21051')
            assert started.end(10.0) == 1
        assert ('kachaka_simple_control: the bridge to the robot ended early (exit code 1): '
                'kachaka_bridge: the robot refused a velocity: error 21051 (Emergency stop)\n'
                ) in started.text
        assert 'Traceback' not in started.text


def test_lost_robot_ends_the_run(tmp_path):
    with FaultyRobot() as robot, \
            program([*COMMAND, '--yes', '--address', robot.address], tmp_path) as started:
        assert wait_until(lambda: len(robot.moves()) > 3, 30.0)
        robot.ask('cut')
        assert started.end(10.0) == 1
        assert 'the link to the robot was lost' in started.text
