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
"""What goes wrong while driving: seen, answered with a stop, and told in one line."""

import time

from program import COMMAND, program, script
import pytest

pytestmark = pytest.mark.ros
pytest.importorskip('rclpy', reason='needs ROS 2')
pytest.importorskip('nav_msgs', reason='needs nav_msgs')

from geometry_msgs.msg import Twist  # noqa: E402, I100
from listener import Listener  # noqa: E402, I100
from nav_msgs.msg import Odometry  # noqa: E402
from rclpy.qos import qos_profile_sensor_data  # noqa: E402

BEGIN = """
import time
import rclpy
from kachaka_simple_control import ControlError, KachakaSimpleControl
rclpy.init()
node = KachakaSimpleControl()
"""


class Odometer:
    """Publishes odometry at 50 Hz on a listener's node, as long as it is asked to."""

    def __init__(self, listener):
        """Begin."""
        self.velocity = 0.0
        self._publisher = listener._node.create_publisher(
            Odometry, 'odometry/odometry', qos_profile_sensor_data)
        self._timer = listener._node.create_timer(0.02, self._tell)

    def silence(self):
        """Tell no more, as a robot that crashed."""
        self._timer.cancel()

    def _tell(self):
        message = Odometry()
        message.twist.twist.linear.x = self.velocity
        self._publisher.publish(message)


def end_of_motion(listener):
    """Return when the last velocity that moves was sent."""
    return max(heard.time for heard in listener.heard if heard.moves)


def test_a_robot_that_leaves_is_noticed_at_once(listener, tmp_path):
    with program(COMMAND, tmp_path) as started:
        listener.wait_for(lambda heard: heard.moves)
        time.sleep(0.2)
        listener.leave()
        left = time.monotonic()
        assert started.end() == 1
        # The stop and the goodbye take their time; the motion itself does not go on.
        assert time.monotonic() - left < 3.0
    assert 'the robot left: nobody subscribes to /kachaka/manual_control/cmd_vel' in started.text
    assert started.text.count('Movement completed') == 1


def test_a_robot_whose_odometry_falls_silent_is_taken_for_lost(listener, tmp_path):
    """Nothing else tells of a cable that was pulled, for 20 s."""
    odometer = Odometer(listener)
    with program(COMMAND, tmp_path) as started:
        moved = listener.wait_for(lambda heard: heard.angular_z != 0.0)
        odometer.silence()
        silent = time.time()
        assert started.end() == 1
    assert 'odometry has been silent for 1.0 s' in started.text
    assert moved.time < end_of_motion(listener) < silent + 1.3
    # The link may come back with what was sent before: the last of it must be zeros.
    assert listener.heard[-1].time - end_of_motion(listener) > 1.3


def test_a_robot_without_odometry_is_driven_as_well(listener, tmp_path):
    with program(COMMAND, tmp_path) as started:
        assert started.end() == 0


def test_somebody_else_who_begins_to_drive_is_given_way(listener, tmp_path):
    command = [*COMMAND, '--ros-args', '-p', 'rate:=20.0']
    with program(command, tmp_path) as started:
        listener.wait_for(lambda heard: heard.angular_z != 0.0)
        other = listener._node.create_publisher(Twist, 'manual_control/cmd_vel', 10)
        came = time.time()
        assert started.end() == 1
    assert 'somebody else publishes on /kachaka/manual_control/cmd_vel (node' in started.text
    assert end_of_motion(listener) - came < 3.0
    # Manual control is the other's by now.
    assert listener.released == []
    listener._node.destroy_publisher(other)


def test_where_somebody_else_drives_already_nothing_begins(listener, tmp_path):
    other = listener._node.create_publisher(Twist, 'manual_control/cmd_vel', 10)
    with program([*COMMAND, '--ros-args', '-p', 'robot_timeout:=3'], tmp_path) as started:
        assert started.end() in (3, 1)
    assert 'somebody else publishes' in started.text
    assert not [heard for heard in listener.heard if heard.moves]
    listener._node.destroy_publisher(other)


def test_somebody_else_may_be_allowed(listener, tmp_path):
    other = listener._node.create_publisher(Twist, 'manual_control/cmd_vel', 10)
    command = [*COMMAND, '--ros-args', '-p', 'allow_other_publishers:=true']
    with program(command, tmp_path) as started:
        assert started.end() == 0
    assert len(listener.moves()) == 3
    listener._node.destroy_publisher(other)


def test_a_robot_that_is_back_does_not_move_by_itself(tmp_path):
    with Listener() as listener, program(COMMAND, tmp_path) as started:
        listener.wait_for(lambda heard: heard.moves)
        listener.leave()
        with Listener() as back:
            assert started.end() == 1
            time.sleep(1.0)
            assert not [heard for heard in back.heard if heard.moves]


def test_after_a_fault_the_robot_is_met_anew(tmp_path):
    """A program that catches the fault and goes on has to find and take the robot again."""
    text = BEGIN + """
try:
    node.move_robot(0.1, 0.0, 20.0)
except ControlError as error:
    print(error, flush=True)
node.move_robot(0.2, 0.0, 0.5)
"""
    with Listener() as listener, script(text, tmp_path) as started:
        listener.wait_for(lambda heard: heard.moves)
        listener.leave()
        started.wait_for_text('the robot left')
        with Listener() as back:
            assert started.end() == 0
            assert [(move.linear_x, move.count) for move in back.moves()] == [(0.2, 5)]
            assert back.enabled
            moved = next(heard for heard in back.heard if heard.moves)
            assert back.enabled[0] < moved.time


def test_zeros_go_on_while_odometry_sees_the_robot_move(listener, tmp_path):
    odometer = Odometer(listener)
    with script(BEGIN + 'node.move_robot(0.1, 0.0, 0.5)\n', tmp_path) as started:
        listener.wait_for(lambda heard: heard.moves)
        odometer.velocity = 0.1
        assert started.end() == 0
    assert 'The stop is unconfirmed' in started.text
    assert listener.heard[-1].time - end_of_motion(listener) > 1.0
