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
"""The threads around a real robot and their log; with a fake client."""

from __future__ import annotations

import math
import queue
import sys
import threading
import time

from kachaka_simple_control.control.diagnosis import Level
from kachaka_simple_control.control.timing import CONNECTION_TIMEOUT
from kachaka_simple_control.kachaka.grpc_client.command_arbiter import VelocityCommand
from kachaka_simple_control.kachaka.grpc_client.robot_driver import (
    LogThread,
    ReadingPoller,
    RobotDriver,
)
from kachaka_simple_control.kachaka.robot_status import (
    connection_status,
    ConnectionEvent,
    ConnectionState,
    ErrorTexts,
    robot_status,
    RpcFailure,
    RpcResult,
)
import pytest

OK, LATE = RpcResult(code=0), RpcResult(failure=RpcFailure.LATE, text='no answer within 0.3 s')
GONE = RpcResult(failure=RpcFailure.GONE, text='Connection refused')
TEXTS = ErrorTexts('[{"code": 5, "title_en": "Paused", "error_type": "Warn"}]')


class Client:
    """A client that records calls and returns what a test sets."""

    def __init__(self):
        """Return success at once."""
        self.calls = queue.Queue()
        self.result, self.error = OK, None
        self.may_answer = threading.Event()
        self.may_answer.set()

    def set_velocity(self, linear, angular, deadline):
        """Record a velocity."""
        self.calls.put((linear, angular))
        self.may_answer.wait(deadline)
        if self.error:
            raise self.error
        return self.result

    def set_manual_control(self, enabled, deadline):
        """Record a switch of manual control."""
        self.calls.put(enabled)
        return self.result

    def close(self):
        """Record the end."""
        self.calls.put('closed')

    def next_call(self):
        """Return the next call."""
        return self.calls.get(timeout=3.0)


@pytest.fixture
def client():
    """Return a client."""
    return Client()


@pytest.fixture
def logged():
    """Return what was logged, and the reasons of aborts."""
    return []


@pytest.fixture
def robot(client, logged):
    """Return a driver whose robot has responded."""
    robot = RobotDriver(
        client, 0.3, TEXTS, lambda level, text: logged.append(text),
        lambda text: logged.append(f'given up: {text}'))
    robot.on_result(OK, time.monotonic())
    yield robot
    client.may_answer.set()
    robot.close()


def send(robot, linear=0.5):
    robot.drive(VelocityCommand(linear, 0.0, time.monotonic()))


def test_zero_is_sent_while_a_motion_is_in_flight(robot, client):
    client.may_answer.clear()
    send(robot)
    assert client.next_call() == (0.5, 0.0)
    send(robot, 0.0)
    assert client.next_call() == (0.0, 0.0)


def test_close_stops_the_robot_and_switches_manual_control_off(robot, client):
    assert robot.set_manual_control(True).is_success
    send(robot)
    assert [client.next_call(), client.next_call()] == [True, (0.5, 0.0)]
    robot.close()
    assert [client.next_call() for _ in range(4)] == [(0.0, 0.0), (0.0, 0.0), False, 'closed']


def test_close_is_bounded_if_the_robot_never_responds(robot, client):
    assert robot.set_manual_control(True).is_success
    client.may_answer.clear()
    send(robot)
    client.next_call()
    client.next_call()
    begun = time.monotonic()
    robot.close()
    assert time.monotonic() - begun < 2.0


def test_commands_received_during_a_suspended_call_are_not_sent(robot, client, logged):
    """The other worker may detect it later than the one in the call."""
    frozen = threading.Event()
    client.set_velocity = lambda linear, angular, deadline: (
        client.calls.put((linear, angular)), linear and frozen.wait(deadline + 0.5), OK)[-1]
    send(robot)
    assert client.next_call() == (0.5, 0.0)
    time.sleep(1.0)
    for _ in range(3):
        send(robot, 0.4)
        time.sleep(0.05)
    calls_by_then = [client.calls.get_nowait() for _ in range(client.calls.qsize())]
    assert (0.4, 0.0) not in calls_by_then
    assert [text.partition(' for ')[0] for text in logged] == ['the bridge was held up']


def test_refusal_is_logged_once_and_aborts_the_run(robot, client, logged):
    client.result = RpcResult(code=5)
    for _ in range(3):
        send(robot)
    client.next_call()
    time.sleep(0.05)
    assert len(logged) == 2
    assert logged[0].startswith('the robot refused a velocity: error 5 (Paused); it moves again')
    assert logged[1] == 'given up: the robot refused a velocity: error 5 (Paused)'


def test_lost_connection_and_its_return_are_logged_once(robot, client, logged):
    send(robot)
    client.next_call()
    for _ in range(3):
        robot.on_result(GONE, time.monotonic())
    assert logged == [
        'the link to the robot is lost: Connection refused',
        'given up: the link to the robot was lost: Connection refused']
    robot.on_result(OK, time.monotonic())
    assert client.next_call() == (0.0, 0.0)
    assert len(logged) == 3
    assert 'is back' in logged[2]


def test_an_unexpected_exception_does_not_prevent_the_zero(robot, client, logged):
    client.error = OSError('out of everything')
    send(robot)
    assert client.next_call() == (0.5, 0.0)
    # Nor does the exception of one zero prevent the next.
    assert [client.next_call(), client.next_call()] == [(0.0, 0.0), (0.0, 0.0)]
    assert 'OSError: out of everything' in logged[0]


# The connection.


def test_no_response_for_the_timeout_is_a_lost_connection():
    connection = ConnectionState()
    connection.on_result(OK, 0.0, 0.1)
    assert connection.on_result(LATE, 10.0, 10.3) is None
    assert connection.on_result(LATE, 10.3, 10.6) is None
    assert connection.on_result(LATE, 10.6, 10.0 + CONNECTION_TIMEOUT) is ConnectionEvent.LOST
    assert connection.on_result(LATE, 11.0, 12.0) is None
    assert connection.on_result(
        RpcResult(failure=RpcFailure.FAILED), 12.0, 12.1) is ConnectionEvent.BACK


# Diagnostics.

def test_diagnostics_report_connection_and_robot():
    connection = ConnectionState()
    connection.on_result(OK, 0.0, 0.1)
    status = connection_status(connection, 'robot:1', math.nan, 7, 1.0)
    assert (status.level, status.message) == (Level.OK, 'up')
    assert status.values['velocities dropped'] == '7'
    status = connection_status(connection, 'robot:1', 0.2, 0, 1.0)
    assert (status.level, status.message) == (
        Level.WARN, 'slow: the robot answered after 200 ms')
    assert robot_status(connection, [], TEXTS).message == 'no errors'
    status = robot_status(connection, [5, 9], TEXTS)
    assert (status.level, status.message) == (Level.ERROR, 'error 5 (Paused); error 9')
    assert robot_status(connection, [5], TEXTS).level is Level.WARN
    connection.on_result(GONE, 2.0, 2.0)
    status = connection_status(connection, 'robot:1', 0.2, 0, 5.0)
    assert status.message == 'lost for 3 s: Connection refused'
    assert robot_status(connection, [], TEXTS).level is Level.ERROR


# Odometry and log.

class Response:
    """Odometry with a cursor."""

    def __init__(self, cursor):
        """Have a cursor."""
        self.metadata = self
        self.cursor = cursor


def test_odometry_is_fetched_while_wanted_and_each_published_once():
    responses = [
        (OK, Response(3)), (OK, Response(3)), (LATE, None), (OK, Response(4)), (GONE, None)]
    cursors, published, results, wanted = [], [], [], [False]

    def fetch(cursor, deadline):
        cursors.append(cursor)
        return responses.pop(0)

    poller = ReadingPoller(
        'feed', fetch, lambda: wanted[0], lambda response: published.append(response.cursor),
        lambda *how: results.append(how[0]))
    assert poller.poll() > 0.0
    assert cursors == []
    wanted[0] = True
    pauses = [poller.poll() for _ in range(5)]
    assert cursors == [0, 3, 3, 0, 4]
    assert published == [3, 4]
    assert results == [OK, OK, OK, GONE], 'nothing new is nothing wrong'
    assert pauses[0] > 0.0, 'a robot that ignores cursors is not asked without end'


def test_a_reading_that_may_be_old_is_left_out_where_none_is_taken():
    """What the laser saw before it stopped."""
    responses = [*map(Response, (3, 3, 4)), None, *map(Response, (4, 5, 0))]
    published = []

    def fetch(cursor, deadline):
        response = responses.pop(0)
        return (LATE if response is None else OK), response

    poller = ReadingPoller(
        'scan', fetch, lambda: True, lambda response: published.append(response.cursor),
        lambda *_: None, takes_old=False)
    while responses:
        poller.poll()
    # Who has no cursors cannot say what is old.
    assert published == [4, 5, 0]


def test_log_thread_does_not_block_and_drops_repeats():
    held, emitted = threading.Event(), []

    def emit(level, text):
        held.wait(3.0)
        emitted.append(text)

    log_thread = LogThread(emit)
    begun = time.monotonic()
    for text in ('a', 'a', 'b', 'a'):
        log_thread.log(Level.WARN, text)
    assert time.monotonic() - begun < 0.5
    held.set()
    log_thread.close()
    assert emitted == ['a', 'b']


def test_several_threads_may_log_at_the_same_time():
    log_thread, errors = LogThread(lambda level, text: None), []

    def log_many(name):
        try:
            for number in range(1000):
                log_thread.log(Level.WARN, f'{name} {number}')
        except RuntimeError as error:
            errors.append(error)

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        threads = [threading.Thread(target=log_many, args=(name,)) for name in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        sys.setswitchinterval(interval)
        log_thread.close()
    assert not errors
