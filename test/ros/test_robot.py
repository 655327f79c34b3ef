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
"""The node inside this process: what it refuses, renews and records."""

import gc
import math
from pathlib import Path
import threading
import time
import weakref

from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.control import drive_monitor
from kachaka_simple_control.control.drive_loop import DriveLoop
from kachaka_simple_control.errors import (
    InvalidMotionError,
    MotionRefusedError,
    RunFaultError,
    UsageError,
)
from kachaka_simple_control.files.library import find
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.steps import Forward, Motion, Move
from kachaka_simple_control.process.processes import is_running
from optional_libraries import optional_imports
import pytest
from waiting import wait_until

with optional_imports():
    from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
    from std_srvs.srv import Trigger
    from topic_observer import ODOMETRY

pytestmark = [pytest.mark.ros, pytest.mark.needs('rclpy')]


@pytest.mark.parametrize('motion', [None, 5, Forward(0.1)])
def test_what_is_no_motion_is_refused_with_what_to_do(make, motion):
    with pytest.raises(UsageError, match=r"drives a Motion, not .* as in run\('square'\)"):
        make().run(motion)


@pytest.mark.needs('yaml', 'jsonschema')
def test_a_name_a_path_and_a_list_of_steps_are_motions(listener, make, tmp_path):
    node, file = make(), tmp_path / 'slow.yaml'
    file.write_text(
        'rate: 20 Hz\nlimits: {max_linear_velocity: 0.05 m/s}\nsteps: [forward: 3 cm]\n')
    node.run([Move(0.1, 0.0, 0.2)])
    assert [(move.linear_x, move.count) for move in listener.moves()] == [(0.1, 2)]
    count = len(listener.received)
    node.run(file)
    driven = [velocity for velocity in listener.received[count:] if velocity.moves]
    assert max(velocity.linear_x for velocity in driven) == 0.05
    assert driven[1].time - driven[0].time == pytest.approx(0.05, abs=0.03)
    with pytest.raises(InvalidMotionError, match='there is no motion of this name'):
        node.run('sqare')


@pytest.mark.needs('yaml', 'jsonschema')
def test_a_motion_that_was_found_with_values_is_driven_as_its_file_says(listener, make, tmp_path):
    file = tmp_path / 'slow.yaml'
    file.write_text('limits: {max_linear_velocity: 0.05 m/s}\nparameters: {side: 1 m}\n'
                    'steps: [forward: $side]\n')
    node = make()
    node.run(find(file, side='2 cm'))
    moves = listener.moves()
    assert sum(move.linear_x * move.duration for move in moves) == pytest.approx(0.02, abs=0.005)
    assert max(move.linear_x for move in moves) <= 0.05
    file.write_text('robot: turtlebot3\nsteps: []\n')
    with pytest.raises(InvalidMotionError, match='and this node drives kachaka: leave it out'):
        node.run(find(file))


@pytest.mark.needs('yaml', 'jsonschema')
@pytest.mark.parametrize('line, text', [
    ('robot: turtlebot3', "own.yaml:1: robot: 'turtlebot3', and this node drives kachaka: leave"),
    ('closed_loop: true', 'own.yaml:1: closed_loop: true, and the parameter closed_loop is f'),
    ('watch: true', 'own.yaml:1: watch: true, and the parameter watch is false: leave it out')])
def test_a_file_for_another_robot_or_control_is_refused(make, tmp_path, line, text):
    (tmp_path / 'own.yaml').write_text(f'{line}\nsteps: [forward: 3 cm]\n')
    with pytest.raises(InvalidMotionError) as caught:
        make().run(tmp_path / 'own.yaml')
    assert text in str(caught.value)


@pytest.mark.needs('yaml', 'jsonschema')
def test_what_the_laser_does_not_see_is_refused_before_anything_is_sent(listener, make, tmp_path):
    (tmp_path / 'back.yaml').write_text('steps: [forward: -3 cm]\n')
    node = make(watch=True)
    for drive in (
            lambda: node.move_robot(-0.1, 0.0, 1.0), lambda: node.run([Forward(-0.1)]),
            lambda: node.run(tmp_path / 'back.yaml'),
            lambda: node.run(tmp_path / 'back.yaml', Limits(0.1, 1.0))):
        with pytest.raises(InvalidMotionError, match='driven backwards, where the laser of kach'):
            drive()
    assert listener.received == []


@pytest.mark.parametrize('rate', [0.0, 1.0, 2000.0, math.nan])
def test_a_rate_that_the_robot_cannot_be_driven_at_is_refused(make, rate):
    with pytest.raises(UsageError, match=r'rate is .* Hz; for kachaka it must be from .* to '):
        make().run(Motion('ahead', (Forward(0.1),)), rate=rate)


@pytest.mark.parametrize('arguments, text', [
    ((0.31, 0.0, 1.0), 'linear_x is 0.31 m/s'),
    ((0.0, 1.58, 1.0), 'angular_z is 1.58 rad/s'),
    ((float('nan'), 0.0, 1.0), 'linear_x is nan'),
    ((0.1, 0.0, -1.0), 'duration is -1.0 s'),
])
def test_a_bad_movement_is_refused_before_anything_is_sent(listener, make, arguments, text):
    node = make()
    with pytest.raises(InvalidMotionError, match=f'^{text}'):
        node.move_robot(*arguments)
    time.sleep(0.3)
    assert listener.received == []
    assert listener.answered == []


def test_whole_numbers_are_velocities_too(listener, make):
    make().move_robot(0, 1, 0.2)
    assert listener.moves()[0].angular_z == 1.0


def test_the_topic_and_its_depth_are_the_lessons(make):
    publisher = make().publisher
    assert publisher.topic_name == '/kachaka/manual_control/cmd_vel'
    assert publisher.qos_profile.depth == 10


def test_the_guardian_is_gone_before_the_robot_is_released(listener, make, monkeypatch):
    """Its zero would take the robot again."""
    node = make(guardian=True)
    node.move_robot(0.1, 0.0, 0.2)
    guardian, manual_control = node.robot.guardian, node.robot.connection.manual_control
    release, ran = manual_control.release, []

    def released(*arguments):
        ran.append(is_running(guardian._process._process.pid))
        return release(*arguments)

    monkeypatch.setattr(manual_control, 'release', released)
    node.destroy_node()
    assert ran == [False]


def test_nothing_publishes_beside_the_velocity_gate(listener, make):
    from geometry_msgs.msg import Twist
    with pytest.raises(MotionRefusedError, match='use those'):
        make().publisher.publish(Twist())
    assert listener.received == []


def start_driving(node):
    """Drive in another thread; return it, and a list that will hold the text of its error."""
    raised = []

    def drive():
        try:
            node.move_robot(0.1, 0.0, 20.0)
        except MotionRefusedError as error:
            raised.append(str(error))

    thread = threading.Thread(target=drive)
    thread.start()
    return thread, raised


def test_stopping_in_another_thread_ends_the_movement_there(listener, make):
    node = make()
    thread, raised = start_driving(node)
    listener.wait_for(lambda velocity: velocity.moves)
    node.stop_robot()
    thread.join(2.0)
    assert raised == ['the movement was ended by stop_robot()']
    assert not listener.received[-1].moves
    # Stopped, but not permanently.
    node.move_robot(0.2, 0.0, 0.2)
    assert listener.moves()[-1].linear_x == 0.2


def test_a_stop_ends_a_movement_that_still_waits_for_its_robot(make):
    """A robot that comes later is not even taken."""
    from listener import Listener
    node = make()
    thread, raised = start_driving(node)
    time.sleep(0.3)
    node.stop_robot()
    with Listener() as late:
        thread.join(1.0)
        time.sleep(1.5)
        assert raised == ['the movement was ended by stop_robot()']
        assert late.received == late.answered == []
        # Not permanently: a new request is accepted.
        node.move_robot(0.2, 0.0, 0.2)
        assert [move.linear_x for move in late.moves()] == [0.2]


@pytest.mark.parametrize('after', [0.0, 0.1, 0.3, 0.6])
def test_after_a_stop_before_the_first_velocity_none_is_sent(listener, make, after):
    node = make(prime_time=0.5)
    motion = Motion('test', (Move(0.1, 0.0, 1.0),))
    request = node.commander.request(elsewhere=True)
    ended = []

    def driven():
        try:
            node.run(motion, None, request)
        except MotionRefusedError as error:
            ended.append(str(error))

    thread = threading.Thread(target=driven)
    thread.start()
    time.sleep(after)
    node.stop_robot()
    stopped = time.time()
    thread.join(5.0)
    assert ended == ['the movement was ended by stop_robot()']
    time.sleep(1.0)
    assert not [velocity for velocity in listener.received
                if velocity.moves and velocity.time > stopped]


def test_a_stop_between_two_movements_of_a_sequence_ends_the_sequence(listener, make):
    """The caller of the stop cannot know that one movement has just ended."""
    node = make(rate=5.0)
    node.move_robot(0.1, 0.0, 0.2)
    stop = threading.Thread(target=node.stop_robot)
    stop.start()
    time.sleep(0.02)
    with pytest.raises(MotionRefusedError, match='ended by stop_robot'):
        node.move_robot(0.2, 0.0, 0.2)
    stop.join()
    # A movement after that is a new request.
    node.move_robot(0.3, 0.0, 0.2)
    assert [move.linear_x for move in listener.moves()] == [0.1, 0.3]


def test_two_movements_at_once_are_refused(listener, make):
    node = make()
    record = DriveLog()
    node.event_bus.subscribe(record.on_event)
    thread = threading.Thread(target=node.move_robot, args=(0.1, 0.0, 1.0))
    thread.start()
    listener.wait_for(lambda velocity: velocity.moves)
    with pytest.raises(MotionRefusedError, match='running already'):
        node.move_robot(0.2, 0.0, 1.0)
    thread.join()
    node.event_bus.flush()
    # What was refused never happened.
    assert [motion.is_complete for motion in record.motions] == [True]
    assert [(move.linear_x, move.count) for move in listener.moves()] == [(0.1, 10)]


@pytest.mark.parametrize('own_executor', [False, True])
def test_a_movement_from_a_callback_of_its_own_is_refused(listener, make, own_executor):
    """It would wait for callbacks that wait for it."""
    node = make()
    raised = []

    def callback():
        timer.cancel()
        with pytest.raises(MotionRefusedError, match='callback of its own node') as caught:
            node.move_robot(0.1, 0.0, 1.0)
        raised.append(caught.value)

    timer = node.create_timer(0.2, callback)
    if own_executor:
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        end = time.monotonic() + 5.0
        while not raised and time.monotonic() < end:
            executor.spin_once(timeout_sec=0.1)
        executor.remove_node(node)
    else:
        node.move_robot(0.0, 0.0, 1.0)
    assert raised
    assert not [velocity for velocity in listener.received if velocity.moves]


def test_a_service_of_the_user_may_drive_where_a_thread_is_free(listener, make):
    """Stop, pause and resume answer meanwhile."""
    node, raised = make(), []

    def go(request, response):
        try:
            node.move_robot(0.1, 0.0, 20.0)
        except MotionRefusedError as error:
            raised.append(str(error))
        return response

    node.create_service(Trigger, '~/go', go)
    executor = MultiThreadedExecutor(4)
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
    going = threading.Thread(target=listener.call, args=('go',))
    going.start()
    listener.wait_for(lambda velocity: velocity.moves)
    for name in ('pause', 'resume', 'stop'):
        assert listener.call(name).success
    going.join(5.0)
    assert raised == ['the movement was ended by ~/stop']
    assert not listener.received[-1].moves
    executor.shutdown()


def test_manual_control_is_renewed_while_it_moves(listener, make, monkeypatch):
    """In simulated minutes: what takes 40 s on a robot takes 0.4 s here."""
    monkeypatch.setattr(drive_monitor, 'LEASE_RENEW_AT_REST', 0.2)
    monkeypatch.setattr(drive_monitor, 'LEASE_RENEW_LATEST', 0.4)
    make().move_robot(0.1, 0.0, 2.0)
    assert 4 <= len(listener.enabled) <= 7
    assert [move.count for move in listener.moves()] == [20]


def test_between_two_movements_that_follow_at_once_one_zero_is_sent(listener, make):
    node = make()
    for _ in range(5):
        node.move_robot(0.1, 0.0, 0.2)
    last = max(velocity.time for velocity in listener.received if velocity.moves)
    begun = next(index for index, velocity in enumerate(listener.received) if velocity.moves)
    zeros = [velocity for velocity in listener.received[begun:]
             if not velocity.moves and velocity.time < last]
    assert len(zeros) == 4


def test_a_renewal_slower_than_the_command_timeout_is_a_fault(make, monkeypatch):
    from listener import Listener
    monkeypatch.setattr(drive_monitor, 'LEASE_RENEW_AT_REST', 0.5)
    monkeypatch.setattr(drive_monitor, 'LEASE_RENEW_LATEST', 1.0)
    with Listener(delay=0.4) as listener:
        with pytest.raises(RunFaultError, match='not renewed within 200 ms'):
            make().move_robot(0.1, 0.0, 5.0)
        time.sleep(0.5)
        assert not listener.received[-1].moves


def test_the_time_for_a_renewal_follows_from_the_rate_of_the_motion(make, monkeypatch):
    from listener import Listener
    monkeypatch.setattr(drive_monitor, 'LEASE_RENEW_AT_REST', 0.5)
    monkeypatch.setattr(drive_monitor, 'LEASE_RENEW_LATEST', 1.0)
    with Listener(delay=0.4) as listener:
        # 280 ms at the 50 Hz of the parameter; a period at 5.5 Hz takes 182 of the 300 ms.
        with pytest.raises(RunFaultError, match='not renewed within 118 ms'):
            make(rate=50.0).run(Motion('slow', [Move(0.1, 0.0, 5.0)]), rate=5.5)
        time.sleep(0.5)
        assert not listener.received[-1].moves


def test_a_robot_without_manual_control_is_not_asked_for_it(make):
    pytest.importorskip('nav_msgs', reason='needs nav_msgs')
    from listener import Listener
    from nav_msgs.msg import Odometry
    with Listener(serves=False) as listener:
        listener._node.create_publisher(Odometry, 'odometry/odometry', 10)
        make(manual_control=False).move_robot(0.1, 0.0, 0.2)
        assert len(listener.moves()) == 1


@pytest.mark.parametrize('drives', [True, False])
def test_manual_control_is_not_taken_from_another_program_that_drives(listener, make, drives):
    from geometry_msgs.msg import Twist
    node = make()
    node.move_robot(0.1, 0.0, 0.2)
    other = listener._node.create_publisher(Twist, 'manual_control/cmd_vel', 10)
    velocity = Twist()
    velocity.linear.x = 0.07
    timer = listener._node.create_timer(0.1, lambda: drives and other.publish(velocity))
    time.sleep(0.5)
    node.destroy_node()
    time.sleep(0.2)
    assert len(listener.released) == (0 if drives else 1)
    timer.cancel()
    listener._node.destroy_publisher(other)


def test_a_closed_node_moves_no_more(listener, make):
    node = make()
    node.move_robot(0.1, 0.0, 0.2)
    node.commander.close()
    count = len(listener.received)
    with pytest.raises(MotionRefusedError, match='ended: nothing is driven'):
        node.move_robot(0.1, 0.0, 0.2)
    node.stop_robot()
    time.sleep(0.2)
    assert len(listener.received) == count


def test_a_stop_that_failed_is_logged_beside_the_error_of_the_drive(
        listener, make, monkeypatch, capfd):
    node = make()

    def fail(*_):
        monkeypatch.setattr(node.robot.gate, 'send_zero', gone)
        raise RunFaultError('a fault in mid-motion')

    def gone(*_, **__):
        raise OSError('publisher gone')
    monkeypatch.setattr(DriveLoop, 'run', fail)
    with pytest.raises(RunFaultError, match='a fault in mid-motion'):
        node.move_robot(0.1, 0.0, 0.2)
    monkeypatch.undo()
    assert capfd.readouterr().err.count('the stop could not be sent: publisher gone') == 1


OFF_PLAN = pytest.mark.parametrize('step, text', [
    (Forward(0.06), '6.0 cm and 0.0 deg'), (Move(0.0, 0.5, 0.4), '0.0 cm and 11.5 deg')])


@pytest.mark.needs('nav_msgs')
@OFF_PLAN
def test_a_robot_that_ends_off_its_plan_is_said_to(listener, observer, make, capfd, step, text):
    observer.publish_odometry(ODOMETRY, 1.0, 2.0, 0.0, 1.0, 'odom')  # as if it stood still
    node = make()
    assert wait_until(lambda: node.robot.pose is not None)
    node.run([step])
    node.stop_robot()
    assert capfd.readouterr().err.count(
        f'the robot came to rest {text} from the planned end, by odometry, more than 2 cm or 3 '
        'deg; ') == 1


@pytest.mark.needs('nav_msgs')
@OFF_PLAN
def test_within_lets_such_a_drive_fail(listener, observer, make, step, text):
    observer.publish_odometry(ODOMETRY, 1.0, 2.0, 0.0, 1.0, 'odom')
    node = make(within='5cm,4deg')
    assert wait_until(lambda: node.robot.pose is not None)
    with pytest.raises(RunFaultError, match=f'{text} from .*, more than 5 cm or 4 deg$'):
        node.run([step])
    assert node.robot.drive.progress.ended_by is not None
    node.run([Forward(0.04)])  # within 5 cm
    node.move_robot(0.0, 0.0, 0.2)


def test_within_needs_odometry(listener, make):
    node = make(within='2cm')
    with pytest.raises(RunFaultError, match='for odometry does not show the robot at rest'):
        node.move_robot(0.1, 0.0, 0.2)
    with pytest.raises(UsageError, match='profile turtlesim names none'):
        make(robot='turtlesim', within='2cm')


@pytest.mark.parametrize('velocity', [(0.31, 0.0), (-0.31, 0.0), (0.0, 1.6)])
def test_limits_above_those_of_the_robot_are_no_way_to_a_fault_in_mid_motion(
        listener, make, velocity):
    node = make()
    linear, angular = velocity
    motion = Motion('fast', (Move(0.1, 0.0, 1.0), Move(linear, angular, 1.0)))
    with pytest.raises(InvalidMotionError, match="outside the robot's limits"):
        node.run(motion, Limits(1.0, 3.0))
    assert listener.received == []


def test_a_destroyed_node_leaves_nothing_behind(listener, make):
    """No descriptor at once, and no object: neither its context nor a hook for forks keeps it."""
    from kachaka_simple_control import KachakaSimpleControl
    from rclpy.parameter import Parameter
    make()  # the first node makes what belongs to the process
    parameters = [Parameter('prime_time', value=0.1), Parameter('summary', value=True)]
    nodes, counts = [], []
    for _ in range(4):
        node = KachakaSimpleControl(parameter_overrides=parameters)
        node.move_robot(0.1, 0.0, 0.1)
        node.destroy_node()
        assert len(node.drive_log.steps) == 1
        counts.append(sum(1 for _ in Path('/proc/self/fd').iterdir()))
        nodes.append(weakref.ref(node))
        del node
    gc.collect()
    # A thread of the newest node may still be ending.
    assert [index for index, node in enumerate(nodes[:-1]) if node() is not None] == []
    assert counts == counts[:1] * 4
