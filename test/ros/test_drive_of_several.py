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
"""Several robots of one node: they are made ready, driven and stopped together, or alone."""

from __future__ import annotations

import contextlib
from dataclasses import replace
import os
from pathlib import Path
import sys
import threading
import time
import traceback

import kachaka_simple_control
from kachaka_simple_control.control.events import RobotsApart
from kachaka_simple_control.errors import (
    MotionRefusedError,
    MotionStoppedError,
    RobotNotFoundError,
    RunFaultError,
    UsageError,
)
from kachaka_simple_control.files.robot_profile import find_robot
from kachaka_simple_control.motion.drive_order import DriveOrder
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.steps import Forward, Motion, Move
from kachaka_simple_control.process.exit_codes import code_of, NO_ROBOT
from optional_libraries import optional_imports
from program import children_of
import pytest
from waiting import wait_until

with optional_imports():
    from kachaka_simple_control.ros.drive_node import DriveNode
    from listener import Listener
    import rclpy
    from rclpy.publisher import Publisher

pytestmark = [pytest.mark.ros, pytest.mark.needs('rclpy')]

TEN = [f'robot{number}' for number in range(10)]
PACKAGE = str(Path(kachaka_simple_control.__file__).parent)
VELOCITY_TOPIC = '/kachaka/manual_control/cmd_vel'


@pytest.fixture
def lab():
    """Yield a function that makes a node, and a robot for each of its names but the silent."""
    with contextlib.ExitStack() as stack:
        rclpy.init(args=[])
        stack.callback(rclpy.try_shutdown)

        def make(*names, silent=(), mute=(), **parameters):
            listeners = {name: stack.enter_context(Listener(name, serves=name not in mute))
                         for name in names if name not in silent}
            node = DriveNode('lab', {
                name: {'guardian': False, 'prime_time': 0.2, **parameters} for name in names})
            stack.callback(node.destroy_node)
            return node, listeners
        yield make


def forward(robot, duration=1.0, speed=0.1):
    """Return an order for a robot."""
    return DriveOrder.of(Motion('forward', (Move(speed, 0.0, duration),)),
                         robot.settings.profile.planning_limits, robot.settings.parameters.rate)


def drive_all(node, **order):
    """Drive all robots of a node."""
    node.commander.drive({robot: forward(robot, **order) for robot in node.robots.values()})


def test_they_begin_together_each_with_its_own_order(lab):
    node, listeners = lab('one', 'two', 'three')
    speeds = dict(zip(node.robots, (0.05, 0.1, 0.15)))
    node.commander.drive({
        robot: forward(robot, speed=speeds[name]) for name, robot in node.robots.items()})
    first = [listener.wait_for(lambda velocity: velocity.moves).time
             for listener in listeners.values()]
    assert max(first) - min(first) < 0.05, 'on a busy machine; the benchmark says 3 ms'
    for name, listener in listeners.items():
        assert [(move.linear_x, move.count) for move in listener.moves()] == [(speeds[name], 10)]


def test_each_has_names_of_its_own(lab):
    node, _ = lab('one', 'two')
    services = {name for name, _ in node.get_service_names_and_types()}
    for name in ('/lab/stop', '/lab/one/stop', '/lab/two/pause', '/lab/two/resume'):
        assert name in services
    topics = {name for name, _ in node.get_topic_names_and_types()}
    assert {'/lab/one/commanded_velocity', '/lab/two/speed_factor', '/diagnostics',
            '/one/manual_control/cmd_vel', '/two/manual_control/cmd_vel'} <= topics
    assert node.get_parameter('one.rate').value == 10.0
    one, two = node.robots.values()
    node.commander.set_speed(0.5, [two])
    assert (one.speed_factor.value, two.speed_factor.value) == (1.0, 0.5)
    node.set_parameters([rclpy.parameter.Parameter('one.speed_factor', value=0.25)])
    assert (one.speed_factor.value, two.speed_factor.value) == (0.25, 0.5)


def test_two_with_one_topic_are_refused():
    rclpy.init(args=[])
    try:
        with pytest.raises(Exception, match='two robots obey /same/manual_control/cmd_vel'):
            DriveNode('lab', {name: {'robot_namespace': '/same'} for name in ('one', 'two')})
    finally:
        rclpy.try_shutdown()


def test_if_one_cannot_be_made_the_others_are_released():
    before = set(children_of(os.getpid()))
    rclpy.init(args=[])
    try:
        with pytest.raises(UsageError, match='within needs odometry'):
            DriveNode('lab', {'one': {}, 'two': {'robot': 'turtlesim', 'within': '2cm'}})
        assert set(children_of(os.getpid())) == before, 'the guardian of the first'
    finally:
        rclpy.try_shutdown()


def test_after_a_stop_another_drive_may_begin_at_once(listener, make):
    """The thread that drives notices the end of the stop a little later."""
    node = make()
    for _ in range(5):
        def drive():
            with pytest.raises(MotionStoppedError):
                node.move_robot(0.1, 0.0, 5.0)

        thread = threading.Thread(target=drive)
        thread.start()
        assert wait_until(lambda: listener.received and listener.received[-1].moves)
        node.stop_robot()
        node.move_robot(0.0, 0.0, 0.1)
        thread.join()


@pytest.mark.parametrize('silence', ['silent', 'mute'])
def test_nobody_moves_unless_all_are_ready(lab, silence):
    """One of ten has no subscription, or no service."""
    node, listeners = lab(*TEN[1:], 'lost', robot_timeout=2.0, **{silence: ('lost',)})
    begun = time.monotonic()
    with pytest.raises(RobotNotFoundError, match='^lost: ') as raised:
        drive_all(node)
    assert time.monotonic() - begun < 3.0
    assert code_of(raised.value) == NO_ROBOT
    assert not any(velocity.moves for listener in listeners.values()
                   for velocity in listener.received)


@pytest.mark.parametrize('goes_on', [False, True])
def test_a_fault_of_one_stops_all_or_that_one_alone(lab, goes_on):
    node, listeners = lab('one', 'two')
    orders = {robot: forward(robot, 2.0) for robot in node.robots.values()}
    request = node.commander.request()
    threading.Thread(target=lambda: (
        listeners['one'].wait_for(lambda velocity: velocity.moves), listeners['one'].leave())
    ).start()
    with pytest.raises(RunFaultError, match='^one: the robot left'):
        node.commander.drive(orders, request, goes_on=goes_on)
    assert wait_until(lambda: listeners['two'].received[-1].linear_x == 0.0, 3.0)
    [move] = listeners['two'].moves()
    assert move.count == 20 if goes_on else move.count < 20


@pytest.mark.parametrize('service', ['one/stop', 'stop'])
def test_a_service_stops_one_or_all(lab, service):
    node, listeners = lab('one', 'two')
    ended = {}

    def drive(name, robot):
        try:
            node.commander.drive({robot: forward(robot, 4.0)})
        except MotionStoppedError as error:
            ended[name] = str(error)

    threads = [threading.Thread(target=drive, args=one) for one in node.robots.items()]
    for thread in threads:
        thread.start()
    for listener in listeners.values():
        listener.wait_for(lambda velocity: velocity.moves)
    response = listeners['one'].call(f'/lab/{service}')
    assert (response.success, response.message) == (True, 'the robot was stopped')
    for thread in threads:
        thread.join()
    assert set(ended) == ({'one'} if service == 'one/stop' else {'one', 'two'})
    assert (listeners['two'].moves()[0].count == 40) is (service == 'one/stop')


def test_a_second_drive_of_one_of_them_is_refused_and_others_may_drive(lab):
    node, _ = lab('one', 'two')
    one, two = node.robots.values()
    request = node.commander.request([one])
    with pytest.raises(Exception, match='a motion is running already'):
        node.commander.request()
    node.commander.drive({two: forward(two, 0.3)})
    node.commander.drive({one: forward(one, 0.3)}, request)


def test_many_robots_need_no_more_threads_than_one(lab):
    """20 show it; 50 need too much of two cores that other tests use at the same time."""
    before = threading.active_count()
    names = [f'robot{number}' for number in range(20)]
    with Listener(names[0]) as listener:
        for name in names[1:]:
            listener.also(name)
        node, _ = lab(*names, silent=names, guardian=True)
        drive_all(node, duration=0.3)
        ours = threading.active_count() - before - 1
        node.destroy_node()
    assert ours + 1 <= 12, [thread.name for thread in threading.enumerate()]


def test_few_of_our_functions_are_between_the_call_and_the_wire(listener, make, monkeypatch):
    """Also between Ctrl+C in the main thread and its first zero."""
    sent, publish = [], Publisher.publish

    def record(publisher, message):
        publish(publisher, message)
        if isinstance(message, bytes) and publisher.topic_name == VELOCITY_TOPIC:
            sent.append((any(message[-48:]), [
                frame.f_code.co_name for frame, _ in traceback.walk_stack(sys._getframe())
                if frame.f_code.co_filename.startswith(PACKAGE)]))
            if sum(moves for moves, _ in sent) == 3 and sent[-1][0]:
                raise KeyboardInterrupt

    monkeypatch.setattr(Publisher, 'publish', record)
    with pytest.raises(KeyboardInterrupt):
        make().move_robot(0.1, 0.0, 5.0)
    first = next(number for number, (moves, _) in enumerate(sent) if moves)
    (_, to_wire), (_, to_zero) = sent[first], sent[first + 3]
    assert len(to_wire) <= 6, to_wire
    assert len(to_zero) <= 7, to_zero


def test_commands_leave_earlier_by_the_delay_of_a_robot(lab, tmp_path):
    """So that robots move together, and not messages; generous for a busy machine."""
    slow = tmp_path / 'slow.yaml'
    slow.write_text('extends: kachaka\ncalibration: {delay: 0.4 s}\n')
    node, listeners = lab('one', 'two')
    node.robots['one'].settings = replace(
        node.robots['one'].settings, profile=find_robot(str(slow)))
    drive_all(node)
    one, two = (listeners[name].wait_for(lambda velocity: velocity.moves).time
                for name in ('one', 'two'))
    assert 0.3 < two - one < 0.5


def test_a_start_is_a_time_or_nobody_moves(lab):
    node, listeners = lab('one', 'two')
    orders = {robot: forward(robot) for robot in node.robots.values()}
    with pytest.raises(MotionRefusedError, match=r'ready \d+\.\d s after .* start later'):
        node.commander.drive(orders, start=time.monotonic() + 0.01)
    assert not any(listener.moves() for listener in listeners.values())
    wanted = time.monotonic() + 2.0
    node.commander.drive(orders, start=wanted)
    for listener in listeners.values():
        began = listener.wait_for(lambda velocity: velocity.moves).time
        assert began - time.time() + time.monotonic() == pytest.approx(wanted, abs=0.1)


def test_after_a_pause_they_wait_for_each_other_at_a_rest(lab):
    """The second has a third of the deceleration of the first."""
    node, listeners = lab('one', 'two')
    apart = []
    node.event_bus.subscribe(apart.append, kinds=[RobotsApart])
    motion = Motion('there and back', (Forward(0.3), Forward(-0.3)))
    one, two = node.robots.values()
    thread = threading.Thread(target=node.commander.drive, args=({
        one: DriveOrder.of(motion, Limits(0.3, 1.5, 0.5, 2.5), 20.0),
        two: DriveOrder.of(motion, Limits(0.3, 1.5, 0.15, 2.5), 20.0)},))
    thread.start()
    listeners['two'].wait_for(lambda velocity: velocity.linear_x > 0.15)
    node.commander.pause()
    time.sleep(1.0)
    node.commander.resume()
    thread.join()
    node.event_bus.flush()
    assert [event.robots for event in apart] == [2]
    assert apart[0].apart > 0.05
    for listener in listeners.values():
        assert sum(move.linear_x * move.duration for move in listener.moves()) == pytest.approx(
            0.0, abs=0.01), 'held by the clock of a busy machine'
