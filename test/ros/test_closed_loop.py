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
"""A closed loop over DDS: where the robot ends, what is refused, and what ends a run."""

import contextlib
import math
import re
import threading
import time

from kachaka_simple_control.errors import MotionRefusedError, RunFaultError, UsageError
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.motion.steps import Forward, Motion
from program import COMMAND, final_pose, program
import pytest
from waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.needs('rclpy', 'nav_msgs', 'jsonschema')]

CALIBRATED = 'extends: kachaka\ncalibration: {delay: 0.3 s}\n'
#: Errors of a simulated robot that the calibration does not have.
ERRORS = ['--linear-gain', '0.95', '--angular-gain', '0.96', '--veer', '0.05', '--dead-time',
          '0.2', '--lag', '0.1']
WORN = 'scale: 0.95, wheel_ratio: 0.99, track_ratio: 1.05, track: 0.2 m'
WORN_OPTIONS = 'odometry-scale=0.95 wheel-ratio=0.99 track-ratio=1.05'
CORNER = """
closed_loop: true
rate: 20 Hz
robot: ./own.yaml
steps:
  - forward: 0.4 m
  - turn: 90 deg
  - forward: 0.4 m
"""


@pytest.fixture
def robot(tmp_path):
    """Return the file of a robot whose delay is known."""
    file = tmp_path / 'own.yaml'
    file.write_text(CALIBRATED)
    return str(file)


def test_a_closed_loop_ends_where_the_plan_does(robot, tmp_path):
    """By the key of its file; the same without is centimetres and degrees off.  A busy machine."""
    assert robot
    file = tmp_path / 'corner.yaml'
    file.write_text(CORNER)
    with program([*COMMAND, str(file), '--sim', *ERRORS], tmp_path) as started:
        assert started.end(40.0) == 0, started.text
    x, y, heading = final_pose(started.text)
    assert math.hypot(x - 0.4, y - 0.4) < 0.02
    assert heading == pytest.approx(90.0, abs=1.0)
    assert re.search(r'settle 1.5 s +0.0000 m  0.0000 rad', started.text)


def test_a_worn_robot_ends_there_on_the_floor(tmp_path):
    """Its odometry is wrong, as its file says, and so are its gains, as it does not."""
    (tmp_path / 'own.yaml').write_text(f'{CALIBRATED}odometry_calibration: {{{WORN}}}\n')
    (tmp_path / 'corner.yaml').write_text(CORNER)
    worn = [f'--{word}' for word in WORN_OPTIONS.split()]
    with program([*COMMAND, str(tmp_path / 'corner.yaml'), '--sim', *ERRORS, *worn],
                 tmp_path) as started:
        assert started.end(40.0) == 0, started.text
    x, y, heading = map(float, re.search(
        r'true pose: (\S+) m, (\S+) m, (\S+) deg', started.text).groups())
    assert math.hypot(x - 0.4, y - 0.4) < 0.02
    assert heading == pytest.approx(90.0, abs=1.0)


@contextlib.contextmanager
def repeated_odometry(node, velocity, stamped_for=math.inf):
    """Publish one pose and a velocity all the time; its stamps go on for a time [s]."""
    from nav_msgs.msg import Odometry
    publisher = node.create_publisher(Odometry, '/kachaka/odometry/odometry', 10)
    ended = threading.Event()

    def publish():
        message, began = Odometry(), time.monotonic()
        message.header.stamp.sec = 1
        message.twist.twist.linear.x = velocity
        while not ended.wait(0.02):
            if time.monotonic() - began < stamped_for:
                message.header.stamp = node.get_clock().now().to_msg()
            publisher.publish(message)

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def test_odometry_that_repeats_one_pose_ends_the_run(listener, observer, make, robot):
    """As of a sensor that hangs."""
    node = make(robot=robot, closed_loop=True)
    with repeated_odometry(observer.node, 0.0):
        began = time.monotonic()
        with pytest.raises(RunFaultError, match='from where it should be'):
            node.run(Motion('far', (Forward(2.0),)))
        assert time.monotonic() - began < 15.0
    assert any(velocity.moves for velocity in listener.received)
    assert not any(velocity.moves for velocity in listener.received[-10:])


def test_without_odometry_it_is_refused_before_anything_moves(listener, make, robot):
    node = make(robot=robot, closed_loop=True)
    with pytest.raises(MotionRefusedError, match='a closed loop needs odometry on '
                       '/kachaka/odometry/odometry, and within 3 s none has come'):
        node.run(Motion('far', (Forward(2.0),)))
    assert not any(velocity.moves for velocity in listener.received)


def test_a_robot_in_motion_is_refused(listener, observer, make, robot):
    """Where it starts is unknown, even if another program may drive it."""
    node = make(robot=robot, closed_loop=True, allow_other_publishers=True)
    with repeated_odometry(observer.node, 0.1), pytest.raises(
            MotionRefusedError, match='a closed loop begins at rest, and odometry on .* sees the '
                                      'robot move'):
        node.run(Motion('far', (Forward(2.0),)))
    assert not any(velocity.moves for velocity in listener.received)


def test_a_stop_that_is_unconfirmed_does_not_hide_why_there_was_one(
        listener, observer, robot, tmp_path):
    """Two lines: odometry shows motion, before and after."""
    assert listener
    with repeated_odometry(observer.node, 0.1), program(
            [*COMMAND, 'straight', '--closed-loop', '--robot', robot, '--ros-args', '-p',
             'allow_other_publishers:=true'], tmp_path) as started:
        assert started.end() == 1
    lines = [line for line in started.text.splitlines()
             if line.startswith('kachaka_simple_control: ')]
    assert ['a closed loop begins at rest' in lines[0], 'unconfirmed' in lines[1]] == [True, True]


def test_without_a_delay_there_is_no_node(make):
    with pytest.raises(UsageError, match='needs to know the delay of the robot, and that of '
                                         'kachaka was not measured'):
        make(closed_loop=True)


def test_move_robot_sends_what_it_is_told(listener, make, robot):
    """Also where the parameter is true."""
    node = make(robot=robot, closed_loop=True)
    node.move_robot(0.1, 0.2, 0.5)
    moves = [velocity for velocity in listener.received if velocity.moves]
    assert moves
    assert {(velocity.linear_x, velocity.angular_z) for velocity in moves} == {(0.1, 0.2)}


def test_a_stamp_that_is_not_later_corrects_nothing(observer, make, robot):
    """Odometry that is repeated; what says whether the robot moves takes it all the same."""
    from nav_msgs.msg import Odometry
    import rclpy
    node = make(robot=robot, closed_loop=True)
    taken = []
    node.robot.reader.on_odometry = lambda now, pose, velocity, is_new: taken.append(
        (pose.x, velocity, is_new))
    publisher = observer.node.create_publisher(Odometry, '/kachaka/odometry/odometry', 10)

    def send(number, second):
        message = Odometry()
        message.header.stamp.sec = second
        message.pose.pose.position.x = float(number)
        publisher.publish(message)
        rclpy.spin_once(node, timeout_sec=0.2)

    # Best effort: the first ones may be lost.
    assert wait_until(lambda: send(-1, 0) or taken)
    for number, second in enumerate((5, 6, 6, 4, 5, 0)):
        send(number, second)
        assert wait_until(lambda: taken[-1][0] == number or rclpy.spin_once(  # noqa: B023
            node, timeout_sec=0.2))
    taken = [each for each in taken if each[0] >= 0.0]
    assert [(x, is_new) for x, _, is_new in taken] == [
        (0.0, True), (1.0, True), (2.0, False), (3.0, False), (4.0, True), (5.0, True)]
    assert {velocity for _, velocity, _ in taken} == {Velocity()}
