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
"""Pause, resume and less speed in real time: over DDS, with a listener or the simulated robot."""

from __future__ import annotations

from contextlib import contextmanager
from functools import partial
from itertools import pairwise
import math
import random
import threading
import time
from unittest.mock import Mock

from kachaka_simple_control.control.drive_requests import StopRequests
from kachaka_simple_control.control.events import OdometryReceived, VelocitySent
from kachaka_simple_control.control.preparation import pause
from kachaka_simple_control.control.tick_scheduler import TickScheduler
from kachaka_simple_control.errors import ControlError, MotionRefusedError, PauseTimeoutError
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.motion.geometry import integrate, ORIGIN, relative_to
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Forward, Motion, Repeat, Turn
from optional_libraries import MISSING, optional_imports
import pytest
from ros_support import bridge
from waiting import wait_until

NODE = ODOMETRY = TRANSIENT_LOCAL = MISSING
with optional_imports():
    from kachaka_simple_control.ros import commander
    from kachaka_simple_control.ros.commander import Commander
    from rcl_interfaces.msg import Parameter as ParameterMessage
    from rcl_interfaces.msg import ParameterValue
    from rcl_interfaces.srv import SetParameters, SetParametersAtomically
    from std_msgs.msg import Float64
    from topic_observer import figures, NODE, ODOMETRY, TRANSIENT_LOCAL

pytestmark = [pytest.mark.ros, pytest.mark.needs('rclpy', 'nav_msgs', 'diagnostic_msgs')]

CRUISE = 0.3
#: The distance from 0.3 m/s to rest with 0.5 m/s^2 and 2 m/s^3 [m]: v / 2 (v / a + a / j).
BRAKING_DISTANCE = 0.1275
#: How late a message may be on a loaded machine [s].
LATENESS = 0.02


@contextmanager
def driving(function, *arguments):
    """Run a drive in another thread; yield a list that its error is added to when it ends."""
    raised = []

    def drive():
        try:
            function(*arguments)
            raised.append(None)
        except ControlError as error:
            raised.append(error)
            print(f'the drive ended: {error}')

    thread = threading.Thread(target=drive)
    thread.start()
    try:
        yield raised
    finally:
        function.__self__.stop_robot()
        thread.join(10.0)
        assert not thread.is_alive()


def is_zero(velocity):
    """Return whether a velocity is zero."""
    return not velocity.moves


def is_at_cruise(velocity):
    """Return whether a velocity is the one of the cruise."""
    return velocity.linear_x == CRUISE


def pause_in_cruise(node, listener):
    """Pause a node in its cruise; return when, and when its first zero was sent [s]."""
    listener.wait_for(is_at_cruise)
    time.sleep(0.3)
    count, paused = len(listener.received), time.time()
    node.pause()
    return paused, listener.wait_for(is_zero, after=count).time


def driven_distance(velocities, since, until):
    """Return how far a robot drives that holds each velocity until the next [m]."""
    return sum(one.linear_x * (min(two.time, until) - max(one.time, since))
               for one, two in pairwise(velocities) if one.time < until and two.time > since)


def call_set(observer, values):
    """Set parameters of the node; return why each was refused, empty if it was not."""
    answer = observer.call(
        SetParameters, f'{NODE}/set_parameters', SetParameters.Request(parameters=[
            ParameterMessage(name=name, value=value) for name, value in values]))
    assert all(result.successful != bool(result.reason) for result in answer.results)
    return [result.reason for result in answer.results]


@pytest.mark.slow
def test_a_motion_with_five_pauses_ends_where_it_would(make, monkeypatch):
    """As sent, to a millimetre; as a simulated robot drove, to what a machine has of noise."""
    ticks = []

    class Recorded(TickScheduler):

        def due(self, elapsed, factor=1.0):
            tick = super().due(elapsed, factor)
            ticks.append(tick)
            return tick

    monkeypatch.setattr(commander, 'TickScheduler', Recorded)
    motion = Motion('half a square', (Repeat(2, (Forward(0.6), Turn(math.pi / 2.0))),))
    planned = plan(motion, KACHAKA.limits, 20.0)
    with bridge():
        node = make(rate=20.0)
        events, refused = [], []
        node.event_bus.subscribe(events.append)

        def pause_and_resume():
            chance = random.Random(20261123)
            while not any(tick and not tick.velocity.is_zero for tick in ticks):
                time.sleep(0.01)
            for _ in range(5):
                # Some end while it still brakes, and some begin before it is at speed again.
                time.sleep(chance.uniform(0.3, 2.5))
                node.pause()
                time.sleep(chance.uniform(0.3, 1.2))
                try:
                    node.resume()
                except MotionRefusedError as error:
                    refused.append(error)
                    node.resume(even_if_moved=True)

        thread = threading.Thread(target=pause_and_resume)
        thread.start()
        node.run(motion)
        thread.join()
        # The newest odometry may be one from before the stop.
        time.sleep(0.3)
        node.event_bus.flush()
        node.destroy_node()
    assert refused == []
    assert ticks.pop() is None
    assert ticks[-1].deadline > planned.duration + 0.5
    sent = [event.velocity for event in events if isinstance(event, VelocitySent)]
    moving = [velocity for velocity in sent if not velocity.is_zero]
    assert moving == [tick.velocity for tick in ticks if not tick.velocity.is_zero]
    end, skipped = ORIGIN, 0.0
    for tick, following in zip(ticks, [*(tick.start for tick in ticks[1:]), ticks[-1].deadline]):
        end = integrate(end, tick.velocity, following - tick.start)
        skipped += following - tick.deadline
    # While a tick is skipped, the velocity of the one before it is kept.
    away = math.hypot(end.x - planned.pose.x, end.y - planned.pose.y)
    assert away < 1e-3 + KACHAKA.limits.max_linear_velocity * skipped
    assert end.theta == pytest.approx(
        planned.pose.theta, abs=math.radians(0.1) + KACHAKA.limits.max_angular_velocity * skipped)
    # The robot drives what it is sent when it is sent: a late message moves its end, not the plan.
    sent, expected = [event for event in events if isinstance(event, VelocitySent)], ORIGIN
    for message, following in pairwise(sent):
        expected = integrate(expected, message.velocity, following.time - message.time)
    driven = [event.pose for event in events if isinstance(event, OdometryReceived)]
    way = relative_to(driven[0], driven[-1])
    assert math.hypot(way.x - expected.x, way.y - expected.y) < 0.01
    assert math.remainder(way.theta - expected.theta, math.tau) == pytest.approx(
        0.0, abs=math.radians(1.5))


def test_a_pause_brakes_within_the_limits_and_holds_with_zeros(listener, observer, make):
    rate = 20.0
    node = make(rate=rate, guardian=True)
    seen = observer.diagnostics()
    with driving(node.move_robot, CRUISE, 0.0, 30.0) as ended:
        paused, rest = pause_in_cruise(node, listener)
        assert wait_until(lambda: seen and figures(seen[-1])['state'] == 'paused')
        values = figures(seen[-1])
        assert values['speed'] == 'paused'
        assert values['guardian'] == 'matched'
        time.sleep(1.0)
        assert node.speed_factor == 0.0
        held = [velocity for velocity in listener.received if velocity.time >= rest]
        count = len(listener.received)
        node.resume()
        listener.wait_for(is_at_cruise, after=count)
        assert ended == []
        assert node.speed_factor == 1.0
    distance = driven_distance(listener.received, paused, rest)
    assert distance < BRAKING_DISTANCE + CRUISE * (1.0 / rate + LATENESS)
    assert distance > BRAKING_DISTANCE - CRUISE * LATENESS
    assert not any(velocity.moves for velocity in held)
    gaps = sorted(two.time - one.time for one, two in pairwise(held))
    assert len(gaps) >= 0.8 * rate
    # All but the worst tenth, on a machine that others load too; none is a gap for the robot.
    assert gaps[len(gaps) * 9 // 10 - 1] < 1.0 / rate + LATENESS
    assert gaps[-1] < KACHAKA.command_timeout


def test_a_pause_between_two_movements_holds_the_next(listener, make):
    node = make()
    node.move_robot(0.1, 0.0, 0.2)
    node.pause()
    with driving(node.move_robot, 0.2, 0.0, 1.0) as ended:
        time.sleep(1.0)
        resumed = time.time()
        assert [move.linear_x for move in listener.moves()] == [0.1]
        # It is held within its run, which sends zeros at the rate.
        assert sum(resumed - 0.55 < velocity.time < resumed for velocity in listener.received) >= 4
        node.resume()
        assert wait_until(lambda: ended)
        assert ended == [None]
    after = [velocity for velocity in listener.received if velocity.time > resumed]
    assert max(velocity.linear_x for velocity in after) == 0.2
    distance = driven_distance(after, resumed, after[-1].time)
    assert distance == pytest.approx(0.2, abs=0.2 * LATENESS)


@pytest.mark.parametrize('by', ['service', 'method'])
def test_a_robot_that_was_moved_goes_on_only_when_asked_twice(listener, observer, make, by):
    pose = observer.publish_odometry(ODOMETRY, 1.0, 2.0, 0.0, 1.0, 'odom')
    node = make()
    with driving(node.move_robot, CRUISE, 0.0, 30.0) as ended:
        pause_in_cruise(node, listener)
        time.sleep(1.0)  # its pose at rest is noted after 0.5 s
        pose.position.y += 0.05
        time.sleep(0.3)
        count, reason = len(listener.received), 'the robot was moved by 5.0 cm and 0.0 deg'
        if by == 'service':
            answer = listener.call('resume')
            assert not answer.success
            assert reason in answer.message
            assert 'resume once more, 1 to 10 s from now' in answer.message
        else:
            with pytest.raises(MotionRefusedError, match=rf'{reason}.*even_if_moved=True'):
                node.resume()
        time.sleep(1.2)
        assert not any(velocity.moves for velocity in listener.received[count:])
        assert node.speed_factor == 0.0
        if by == 'service':
            answer = listener.call('resume')
            assert (answer.success, answer.message) == (True, 'resumed')
        else:
            node.resume(even_if_moved=True)
        listener.wait_for(is_at_cruise, after=count)
        assert ended == []


def test_many_requests_at_once_do_not_confirm_each_other(listener, observer, make):
    """As of ten clients, or of a key that repeats."""
    pose = observer.publish_odometry(ODOMETRY, 1.0, 2.0, 0.0, 1.0, 'odom')
    node = make()
    with driving(node.move_robot, CRUISE, 0.0, 30.0) as ended:
        pause_in_cruise(node, listener)
        time.sleep(1.0)
        pose.position.y += 0.5
        time.sleep(0.3)
        count = len(listener.received)
        assert not any(listener.call('resume').success for _ in range(10))
        for _ in range(20):
            with pytest.raises(MotionRefusedError, match='was moved by 50'):
                node.commander.resume_when_confirmed()
            time.sleep(0.033)
        time.sleep(0.3)
        assert not any(velocity.moves for velocity in listener.received[count:])
        assert ended == []


def hold(node, listener):
    """Hold a node in its cruise as an obstacle would, until its pose at rest is noted."""
    listener.wait_for(is_at_cruise)
    node.speed.set('obstacle', 0.0)
    count = len(listener.received)
    listener.wait_for(is_zero, after=count)
    time.sleep(1.0)
    return len(listener.received)


@pytest.mark.parametrize('by', ['service', 'method'])
def test_a_hold_is_kept_if_the_robot_was_moved_meanwhile(listener, observer, make, capfd, by):
    pose = observer.publish_odometry(ODOMETRY, 1.0, 2.0, 0.0, 1.0, 'odom')
    node = make()
    with driving(node.move_robot, CRUISE, 0.0, 30.0) as ended:
        count = hold(node, listener)
        pose.position.x += 0.3
        time.sleep(0.3)
        began = time.monotonic()
        node.speed.set('obstacle', 1.0)
        assert time.monotonic() - began < 0.1, 'whoever releases a hold waits for nothing'
        assert wait_until(lambda: 'moved' in node.speed.factors)
        time.sleep(0.5)
        assert not any(velocity.moves for velocity in listener.received[count:])
        if by == 'service':
            assert not listener.call('resume').success
            time.sleep(1.2)
            assert listener.call('resume').success
        else:
            with pytest.raises(MotionRefusedError, match='moved by 30.0 cm'):
                node.resume()
            node.resume(even_if_moved=True)
        listener.wait_for(is_at_cruise, after=count)
        assert node.speed_factor == 1.0
        assert ended == []
    assert capfd.readouterr().err.count('the robot was moved by 30.0 cm') == 1


def test_a_parameter_that_is_refused_with_another_changes_no_speed(listener, observer, make):
    node = make()
    with driving(node.move_robot, CRUISE, 0.0, 30.0):
        node.speed_factor = 0.1
        listener.wait_for(lambda velocity: velocity.linear_x == pytest.approx(0.03))
        for second in (('speed_factor', ParameterValue(type=4, string_value='x')),
                       ('use_sim_time', ParameterValue(type=4, string_value='x'))):
            answer = observer.call(
                SetParametersAtomically, f'{NODE}/set_parameters_atomically',
                SetParametersAtomically.Request(parameters=[
                    ParameterMessage(
                        name='speed_factor', value=ParameterValue(type=3, double_value=1.0)),
                    ParameterMessage(name=second[0], value=second[1])]))
            assert not answer.result.successful
            assert node.speed_factor == 0.1
        count = len(listener.received)
        time.sleep(0.5)
        assert max(one.linear_x for one in listener.received[count:]) == pytest.approx(0.03)


@pytest.mark.parametrize('end, reason', [
    # As if this program were gone.
    (lambda process: process._close(), 'the guardian stopped the robot: the node is gone'),
    (lambda process: process._process.kill(), 'the guardian has ended')])
def test_after_the_guardian_s_stop_or_end_requests_are_refused(listener, make, end, reason):
    node = make(guardian=True)
    with driving(node.move_robot, CRUISE, 0.0, 30.0) as ended:
        listener.wait_for(is_at_cruise)
        end(node.robot.guardian._process)
        assert wait_until(lambda: ended)
    answer = listener.call('resume')
    assert not answer.success
    assert reason in answer.message
    with pytest.raises(ControlError, match='until this program is started again'):
        node.commander.request(elsewhere=True)


def test_nothing_starts_or_goes_on_at_the_same_time_as_a_stop(listener, make):
    node, now = make(), [7.0]
    node.drive_services.stop_requests = StopRequests(lambda: now[0])
    drive = partial(node.run, Motion('on', (Forward(1.0),)), KACHAKA.limits)
    node.drive_services.serve('~/run', partial(node.drive_services.start, drive))
    node.move_robot(0.1, 0.0, 0.2)
    node.pause()
    assert listener.call('stop').success
    now[0] += 0.049
    for name in ('run', 'resume'):
        answer = listener.call(name)
        assert (answer.success, answer.message) == (
            False, 'a stop came at the same time: call again')
    assert not node.commander.is_driving()
    assert node.speed_factor == 0.0
    count, now[0] = len(listener.received), now[0] + 0.002
    for name in ('resume', 'run'):
        assert listener.call(name).success
    listener.wait_for(lambda velocity: velocity.moves, after=count)
    node.stop_robot()


def test_a_long_pause_gives_the_motion_up_and_the_robot_back(listener, make):
    node = make(pause_timeout=1.0)
    with driving(node.move_robot, CRUISE, 0.0, 30.0) as ended:
        _, rest = pause_in_cruise(node, listener)
        assert wait_until(lambda: ended)
        assert isinstance(ended[0], PauseTimeoutError)
        assert 'pause_timeout' in str(ended[0])
        (released,) = listener.released
        assert released - rest == pytest.approx(1.0, abs=0.8)
        assert rest < listener.received[-1].time < released
        node.resume()
        time.sleep(0.5)
    assert not any(velocity.moves for velocity in listener.received if velocity.time > rest)
    # A program that goes on takes the robot again.
    node.move_robot(0.1, 0.0, 0.2)
    assert [move.linear_x for move in listener.moves()][-1] == 0.1
    assert len(listener.enabled) >= 2


def test_the_speed_is_a_parameter_and_a_topic(listener, observer, make):
    node = make()
    shown = observer.subscribe(Float64, f'{NODE}/speed_factor', TRANSIENT_LOCAL)
    assert wait_until(lambda: shown)
    assert shown[0].data == 1.0
    with driving(node.move_robot, CRUISE, 0.0, 30.0):
        listener.wait_for(is_at_cruise)
        for value in (ParameterValue(type=3, double_value=0.0), ParameterValue(type=2),
                      ParameterValue(type=3, double_value=2.0),
                      ParameterValue(type=3, double_value=math.nan),
                      ParameterValue(type=1, bool_value=True),
                      ParameterValue(type=4, string_value='x')):
            assert call_set(observer, [('speed_factor', value)]) != ['']
        half = ParameterValue(type=3, double_value=0.5)
        fast = ParameterValue(type=3, double_value=50.0)
        (reason,) = call_set(observer, [('rate', fast)])
        assert 'read-only' in reason
        # All or none.
        answer = observer.call(
            SetParametersAtomically, f'{NODE}/set_parameters_atomically',
            SetParametersAtomically.Request(parameters=[
                ParameterMessage(name='speed_factor', value=half),
                ParameterMessage(name='rate', value=fast)]))
        assert not answer.result.successful
        assert node.speed_factor == 1.0
        count = len(listener.received)
        assert call_set(observer, [('speed_factor', half)]) == ['']
        assert node.speed_factor == 0.5
        listener.wait_for(lambda velocity: velocity.linear_x == CRUISE / 2.0, after=count)
        assert wait_until(lambda: shown[-1].data == 0.5)
        node.pause()
        assert wait_until(lambda: shown[-1].data == 0.0)
        late = observer.subscribe(Float64, f'{NODE}/speed_factor', TRANSIENT_LOCAL)
        assert wait_until(lambda: late)
        assert late[0].data == 0.0
        assert call_set(
            observer, [('speed_factor', ParameterValue(type=2, integer_value=1))]) == ['']
        node.resume()
        listener.wait_for(is_at_cruise, after=len(listener.received))
    for wrong in (0.0, 1.5, math.nan, 'x', True):
        with pytest.raises(MotionRefusedError, match='speed_factor'):
            node.speed_factor = wrong
    assert node.speed_factor == 1.0


def test_a_pause_after_the_guardians_stop_is_refused(make):
    """It said 'paused', and nothing moves until the program is started again."""
    node = make()
    node.robot.guardian.stopped_because = 'the node sent no heartbeat'
    for command in (node.pause, partial(node.commander.set_speed, 0.5)):
        with pytest.raises(ControlError, match='the guardian stopped the robot'):
            command()


@pytest.mark.parametrize(('change', 'kept'), [
    (lambda node: node.pause(), {'pause': 0.0, 'override': 0.5}),
    (lambda node: node.commander.set_speed(0.3), {'pause': 0.0, 'override': 0.3}),
    (lambda node: None, {'override': 0.8})])
def test_to_begin_anew_keeps_a_pause_or_a_speed_that_came_later(make, change, kept):
    """As after STOP: what somebody asks for while the stop is sent must not be lost."""
    node = make(speed_factor=0.8)
    node.speed_factor = 0.5
    node.pause()
    changes = node.commander.changes
    change(node)
    node.commander.begin_anew(changes, 0.8)
    assert dict(node.speed.factors) == kept


def test_fifty_robots_whose_ports_take_a_fifth_of_a_second_are_closed_in_that_time():
    released = []

    def release(moment):
        yield from pause(moment, 0.2, 'its answer')
        released.append(moment)

    robots = [Mock(release=release) for _ in range(50)]
    for robot in robots:
        robot.stopper.steps = lambda moment, reason: (_ for _ in ())
        robot.stopper.unconfirmed.return_value = None
    began = time.monotonic()
    Commander(Mock(), robots).close()
    assert time.monotonic() - began < 3.0  # one after the other they take 10 s
    assert len(released) == 50
