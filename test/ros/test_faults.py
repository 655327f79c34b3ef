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
"""Faults while driving: detected, answered with a stop, and reported in one line."""

import math
import signal
import time

from optional_libraries import MISSING, optional_imports
from program import program, QUICK_COMMAND, quick_drive, script
import pytest
from waiting import wait_until

qos_profile_sensor_data = MISSING
with optional_imports():
    from geometry_msgs.msg import Twist
    from listener import Listener
    from nav_msgs.msg import Odometry
    from rclpy.qos import qos_profile_sensor_data

pytestmark = [pytest.mark.ros, pytest.mark.needs('rclpy', 'nav_msgs')]

BEGIN = """
import rclpy
from kachaka_simple_control import ControlError, KachakaSimpleControl
rclpy.init(args=[
    '--ros-args', '-p', 'guardian:=false', '-p', 'prime_time:=0.2', '-p', 'rate:=20.0'])
node = KachakaSimpleControl()
"""
#: As the lesson, with a shorter first movement.
DRIVE = BEGIN + """
node.move_robot(0.1, 0.0, 0.3)
node.move_robot(0.0, 0.5, 4.0)
"""


class Odometer:
    """Publishes odometry at 50 Hz on a listener's node, as long as it is asked to."""

    def __init__(self, listener):
        """Begin."""
        self.velocity = 0.0
        self._publisher = listener._node.create_publisher(
            Odometry, 'odometry/odometry', qos_profile_sensor_data)
        self._timer = listener._node.create_timer(0.02, self._publish)

    def wait_until_received(self):
        """Wait until a program has had time to receive some of it."""
        assert wait_until(self._publisher.get_subscription_count)
        time.sleep(0.3)

    def silence(self):
        """Publish no more, as a robot that crashed."""
        self._timer.cancel()

    def _publish(self):
        message = Odometry()
        message.twist.twist.linear.x = self.velocity
        self._publisher.publish(message)


def end_of_motion(listener):
    """Return when the last velocity that moves was sent."""
    return max(velocity.time for velocity in listener.received if velocity.moves)


def test_a_robot_that_leaves_is_noticed_at_once(listener, tmp_path):
    with program(QUICK_COMMAND, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        time.sleep(0.2)
        listener.leave()
        left = time.monotonic()
        assert started.end() == 1
        # The stop and the release take their time; the motion itself does not go on.
        assert time.monotonic() - left < 3.0
    assert 'the robot left: nobody subscribes to /kachaka/manual_control/cmd_vel' in started.text
    assert started.text.count('Movement completed') == 1


def test_a_robot_whose_odometry_falls_silent_is_taken_for_lost(listener, tmp_path):
    """Nothing else reports a pulled cable within 20 s."""
    odometer = Odometer(listener)
    with script(DRIVE, tmp_path) as started:
        moved = listener.wait_for(lambda velocity: velocity.angular_z != 0.0)
        odometer.silence()
        silent = time.time()
        assert started.end() == 1
    assert 'odometry has been silent for 1.0 s' in started.text
    assert moved.time < end_of_motion(listener) < silent + 1.3
    # The link may come back within 3 s with what was sent before: zeros must follow it.
    assert listener.received[-1].time - end_of_motion(listener) > 3.3


def test_a_second_robot_that_comes_in_mid_motion_ends_it(listener, tmp_path):
    """Both would obey."""
    Odometer(listener)
    with script(DRIVE, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        with Listener() as second:
            Odometer(second)
            assert started.end() == 1
            assert not second.received[-1].moves
    assert '2 robots publish /kachaka/odometry/odometry' in started.text


def test_odometry_that_is_not_a_number_is_ignored(listener, tmp_path):
    """A robot that publishes nothing else counts as silent."""
    odometer = Odometer(listener)
    with script(DRIVE, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.angular_z != 0.0)
        odometer.velocity = math.nan
        assert started.end() == 1
    assert 'odometry has been silent for 1.0 s' in started.text


def test_a_robot_without_odometry_is_driven_as_well(listener, tmp_path):
    with script(BEGIN + 'node.move_robot(0.1, 0.0, 1.5)\n', tmp_path) as started:
        assert started.end() == 0
    assert started.text.count('No odometry has come on /kachaka/odometry/odometry yet') == 1


class OtherPublisher:
    """A publisher of velocities, which sends at 20 Hz from ``send`` on."""

    #: Something that our programs never send.
    SPEED = 0.07

    def __init__(self, listener, quality=10):
        """Create the publisher, and send nothing yet."""
        self._node = listener._node
        self._publisher = self._node.create_publisher(Twist, 'manual_control/cmd_vel', quality)
        self._message = None
        self._timer = self._node.create_timer(0.05, self._send)
        #: when it sent first [s, system clock]
        self.began = None

    def send(self, speed=SPEED):
        """Send from now on."""
        message = Twist()
        message.linear.x = speed
        self._message = message

    def leave(self):
        """Destroy the publisher."""
        self._timer.cancel()
        self._node.destroy_publisher(self._publisher)

    def _send(self):
        if self._message is not None:
            self.began = self.began or time.time()
            self._publisher.publish(self._message)


def ours(listener, other):
    """Return our velocities other than zero after the other publisher began."""
    return [velocity for velocity in listener.received
            if velocity.time > other.began + 0.05 and velocity.moves
            and velocity.linear_x != OtherPublisher.SPEED]


@pytest.mark.parametrize('quality', [10, qos_profile_sensor_data])
def test_the_first_velocity_of_another_publisher_ends_the_run(listener, tmp_path, quality):
    other = OtherPublisher(listener, quality)
    with script(DRIVE, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.angular_z != 0.0)
        other.send()
        assert started.end() == 1
    (line,) = [line for line in started.text.splitlines() if 'another program' in line]
    assert '(node listener) sends velocities on /kachaka/manual_control/cmd_vel' in line
    assert ours(listener, other) == []
    # Our zeros end, and manual control is the other's by now.
    assert max(h.time for h in listener.received if not h.moves) - other.began < 1.0
    assert listener.released == []
    other.leave()


def test_another_publisher_that_joins_in_mid_motion_ends_the_run(listener, tmp_path):
    with script(DRIVE, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.angular_z != 0.0)
        other = OtherPublisher(listener)
        other.send()
        assert started.end() == 1
    assert 'another program (node listener) sends velocities' in started.text
    assert end_of_motion_of_ours(listener) - other.began < 1.0
    other.leave()


def end_of_motion_of_ours(listener):
    """Return when our last velocity that moves was sent."""
    return max(velocity.time for velocity in listener.received
               if velocity.moves and velocity.linear_x != OtherPublisher.SPEED)


def test_a_publisher_that_never_sends_is_no_fault(listener, tmp_path):
    """Neither before a run, nor in it, nor when the robot is released."""
    other = OtherPublisher(listener)
    with script(DRIVE.replace('4.0', '2.0'), tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.angular_z != 0.0)
        another = OtherPublisher(listener)
        assert started.end() == 0
    assert len(listener.moves()) == 2
    assert len(listener.released) == 1
    other.leave()
    another.leave()


def test_a_robot_that_leaves_beside_a_silent_publisher_ends_the_run(listener, tmp_path):
    """The node's own subscription, which shows whether that one sends, is not the robot."""
    other = OtherPublisher(listener)
    with script(DRIVE, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.angular_z != 0.0)
        listener.leave()
        assert started.end() == 1
    assert 'the robot left: nobody subscribes to' in started.text
    other.leave()


def test_no_run_begins_while_another_publisher_sends(listener, tmp_path):
    other = OtherPublisher(listener)
    other.send()
    listener.wait_for(lambda velocity: velocity.moves)
    with script(DRIVE, tmp_path) as started:
        code = started.end()
    assert 'another program (node ' in started.text
    assert f') sends velocities on {listener._subscription.topic_name}' in started.text
    # 1 where discovery found the publisher after the robot: then zeros were sent already.
    assert code in (3, 1)
    allowed = {OtherPublisher.SPEED} if code == 3 else {OtherPublisher.SPEED, 0.0}
    assert {velocity.linear_x for velocity in listener.received} <= allowed
    assert code == 1 or listener.answered == []
    other.leave()


@pytest.mark.parametrize('velocity, code', [(0.05, 3), (-0.05, 3), (0.005, 0)])
def test_a_robot_that_moves_already_is_not_taken(listener, tmp_path, velocity, code):
    """Whoever drives it may be found by discovery seconds later than the robot itself."""
    odometer = Odometer(listener)
    odometer.velocity = velocity
    with script(BEGIN + 'node.move_robot(0.1, 0.0, 0.3)\n', tmp_path) as started:
        assert started.end() == code
    assert ('sees the robot move already' in started.text) == bool(code)
    if code:
        assert listener.received == []
        assert listener.answered == []


def test_a_publisher_that_is_found_before_the_robot_is_taken_is_left_alone(listener, tmp_path):
    """As where discovery finds it while the node waits for its guardian, or for odometry."""
    other = OtherPublisher(listener)
    other.send()
    listener.wait_for(lambda velocity: velocity.moves)
    with script("""
from kachaka_simple_control.control.preparation import until
from kachaka_simple_control.ros.foreign_messages import ForeignMessages
from kachaka_simple_control.ros.robot_connection import RobotConnection

def require_none(self, moment):
    self.update()
    yield from ()

ForeignMessages.require_none = require_none
RobotConnection._require_at_rest = lambda self, moment: until(
    moment, lambda: False, 'a test', 5.0)
""" + BEGIN + 'node.move_robot(0.1, 0.0, 0.3)\n', tmp_path) as started:
        assert started.end() == 3
    assert 'nothing was sent' in started.text
    assert {velocity.linear_x for velocity in listener.received} == {OtherPublisher.SPEED}
    assert listener.answered == []
    other.leave()


def test_other_publishers_may_be_allowed(listener, tmp_path):
    other = OtherPublisher(listener)
    text = DRIVE.replace('rate:=20.0', 'allow_other_publishers:=true').replace('4.0', '1.5')
    with script(text, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        other.send(0.0)
        assert started.end() == 0
    other.leave()


def test_a_robot_that_is_replaced_in_mid_motion_ends_the_run(tmp_path):
    """Somebody subscribes all the time, but in the end not the robot that was taken."""
    with Listener() as listener, script(DRIVE, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        with Listener() as second:
            second.wait_for(lambda velocity: velocity.moves)
            listener.leave()
            assert started.end() == 1
            assert not second.received[-1].moves
    assert 'who subscribes to /kachaka/manual_control/cmd_vel now came later' in started.text


def test_after_a_fault_the_robot_is_connected_again(tmp_path):
    """A program that catches the fault and goes on has to find and take the robot again."""
    text = BEGIN + """
try:
    node.move_robot(0.1, 0.0, 20.0)
except ControlError as error:
    print(error, flush=True)
node.move_robot(0.2, 0.0, 0.5)
"""
    with Listener() as listener, script(text, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        listener.leave()
        started.wait_for_text('the robot left')
        with Listener() as back:
            assert started.end() == 0
            assert [(move.linear_x, move.count) for move in back.moves()] == [(0.2, 10)]
            assert back.enabled
            moved = next(velocity for velocity in back.received if velocity.moves)
            assert back.enabled[0] < moved.time


@pytest.mark.needs('yaml', 'jsonschema')
def test_a_stop_that_odometry_does_not_confirm_is_a_fault(listener, tmp_path):
    odometer = Odometer(listener)
    with program(quick_drive(tmp_path), tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        odometer.velocity = 0.1
        assert started.end() == 1
    assert started.text.count('the stop is unconfirmed') == 1
    assert started.text.splitlines()[-1].startswith('kachaka_simple_control: the stop is unconf')


def test_a_stop_by_a_signal_that_is_not_confirmed_is_reported_once(listener, tmp_path):
    odometer = Odometer(listener)
    with program(QUICK_COMMAND, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        odometer.velocity = 0.1
        started.send(signal.SIGINT)
        assert started.end() == 130
    assert started.text.count('the stop is unconfirmed') == 1
