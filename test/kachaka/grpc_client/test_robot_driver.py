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
"""The threads around a real robot, and what is told of it; with calls that tests answer."""

from __future__ import annotations

import math
import queue
import threading
import time

from kachaka_simple_control.control.timing import CONNECTION_TIMEOUT
from kachaka_simple_control.kachaka.error_codes import ErrorTexts, Level, link_status, robot_status
from kachaka_simple_control.kachaka.grpc_client.command_arbiter import VelocityCommand
from kachaka_simple_control.kachaka.grpc_client.connection_state import (
    ConnectionEvent,
    ConnectionState,
    RpcFailure,
    RpcResult,
)
from kachaka_simple_control.kachaka.grpc_client.polling import LogThread, OdometryPoller
from kachaka_simple_control.kachaka.grpc_client.robot_driver import RobotDriver
import pytest

OK, LATE = RpcResult(code=0), RpcResult(failure=RpcFailure.LATE, text='no answer within 0.3 s')
GONE = RpcResult(failure=RpcFailure.GONE, text='Connection refused')
TEXTS = ErrorTexts('[{"code": 5, "title_en": "Paused", "error_type": "Warn"}]')


class Client:
    """Calls that are noted, and answered as a test says."""

    def __init__(self):
        """Answer all at once, with success."""
        self.calls = queue.Queue()
        self.outcome, self.error = OK, None
        self.may_answer = threading.Event()
        self.may_answer.set()

    def set_velocity(self, linear, angular, deadline):
        """Note a velocity."""
        self.calls.put((linear, angular))
        self.may_answer.wait(deadline)
        if self.error:
            raise self.error
        return self.outcome

    def set_manual_control(self, enabled, deadline):
        """Note a switch."""
        self.calls.put(enabled)
        return self.outcome

    def close(self):
        """Note the end."""
        self.calls.put('closed')

    def heard(self):
        """Return the next call."""
        return self.calls.get(timeout=3.0)


@pytest.fixture
def client():
    """Return calls."""
    return Client()


@pytest.fixture
def told():
    """Return what a person and the program were told."""
    return []


@pytest.fixture
def robot(client, told):
    """Return a robot that has answered."""
    robot = RobotDriver(
        client, 0.3, TEXTS, lambda level, text: told.append(text),
        lambda text: told.append(f'given up: {text}'))
    robot.note(OK, time.monotonic())
    yield robot
    client.may_answer.set()
    robot.close()


def go(robot, linear=0.5):
    robot.drive(VelocityCommand(linear, 0.0, time.monotonic()))


def test_zero_leaves_while_a_motion_hangs(robot, client):
    client.may_answer.clear()
    go(robot)
    assert client.heard() == (0.5, 0.0)
    go(robot, 0.0)
    assert client.heard() == (0.0, 0.0)


def test_end_leaves_the_robot_at_rest_and_gives_back_what_was_taken(robot, client):
    assert robot.set_manual_control(True).is_success
    go(robot)
    assert [client.heard(), client.heard()] == [True, (0.5, 0.0)]
    robot.close()
    assert [client.heard() for _ in range(4)] == [(0.0, 0.0), (0.0, 0.0), False, 'closed']


def test_end_without_a_motion_sends_nothing(robot, client):
    robot.close()
    assert client.heard() == 'closed'


def test_end_is_soon_even_if_the_robot_never_answers(robot, client):
    assert robot.set_manual_control(True).is_success
    client.may_answer.clear()
    go(robot)
    client.heard()
    client.heard()
    begun = time.monotonic()
    robot.close()
    assert time.monotonic() - begun < 2.0


def test_what_came_while_a_call_was_frozen_is_not_sent(robot, client, told):
    """The other thread that calls may find out later than the one that was in the call."""
    frozen = threading.Event()
    client.set_velocity = lambda linear, angular, deadline: (
        client.calls.put((linear, angular)), linear and frozen.wait(deadline + 0.5), OK)[-1]
    go(robot)
    assert client.heard() == (0.5, 0.0)
    time.sleep(1.0)
    for _ in range(3):
        go(robot, 0.4)
        time.sleep(0.05)
    told_by_then = [client.calls.get_nowait() for _ in range(client.calls.qsize())]
    assert (0.4, 0.0) not in told_by_then
    assert [text.partition(' for ')[0] for text in told] == ['the bridge was held up']


def test_refusal_is_told_once_and_ends_the_run(robot, client, told):
    client.outcome = RpcResult(code=5)
    for _ in range(3):
        go(robot)
    client.heard()
    time.sleep(0.05)
    assert len(told) == 2
    assert told[0].startswith('the robot refused a velocity: error 5 (Paused); it moves again')
    assert told[1] == 'given up: the robot refused a velocity: error 5 (Paused)'


def test_lost_link_is_told_once_and_its_return_too(robot, client, told):
    go(robot)
    client.heard()
    for _ in range(3):
        robot.note(GONE, time.monotonic())
    assert told == [
        'the link to the robot is lost: Connection refused',
        'given up: the link to the robot was lost: Connection refused']
    robot.note(OK, time.monotonic())
    assert client.heard() == (0.0, 0.0)
    assert len(told) == 3
    assert 'is back' in told[2]


def test_what_nobody_thought_of_does_not_keep_the_zero(robot, client, told):
    client.error = OSError('out of everything')
    go(robot)
    assert client.heard() == (0.5, 0.0)
    assert client.heard() == (0.0, 0.0)
    assert 'OSError: out of everything' in told[0]


def test_calls_that_the_end_cuts_short_are_no_lost_link(robot, told):
    robot.close()
    robot.note(GONE, time.monotonic())
    assert told == []


# The link.

def test_one_late_answer_is_no_lost_link():
    link = ConnectionState()
    assert link.on_result(OK, 0.0, 0.1) is ConnectionEvent.FOUND
    assert link.on_result(LATE, 10.0, 10.3) is None
    assert link.on_result(OK, 10.3, 10.4) is None
    assert link.on_result(LATE, 11.0, 11.3) is None


def test_silence_is_a_lost_link_however_many_calls_it_takes():
    link = ConnectionState()
    link.on_result(OK, 0.0, 0.1)
    assert link.on_result(LATE, 10.0, 10.3) is None
    assert link.on_result(LATE, 10.3, 10.6) is None
    assert link.on_result(LATE, 10.6, 10.0 + CONNECTION_TIMEOUT) is ConnectionEvent.LOST
    assert link.on_result(LATE, 11.0, 12.0) is None
    assert link.on_result(RpcResult(failure=RpcFailure.FAILED), 12.0, 12.1) is ConnectionEvent.BACK


def test_other_answers_outweigh_one_that_takes_long():
    link = ConnectionState()
    link.on_result(OK, 0.0, 0.1)
    link.on_result(OK, 1.0, 1.1)
    assert link.on_result(LATE, 0.2, 1.2) is None


# Diagnostics.

def test_diagnostics_say_how_link_and_robot_are():
    link = ConnectionState()
    link.on_result(OK, 0.0, 0.1)
    status = link_status(link, 'robot:1', math.nan, 7, 1.0)
    assert (status.level, status.message) == (Level.OK, 'up')
    assert status.values['velocities dropped'] == '7'
    status = link_status(link, 'robot:1', 0.2, 0, 1.0)
    assert (status.level, status.message) == (
        Level.WARN, 'slow: the robot answered after 200 ms')
    assert robot_status(link, [], TEXTS).message == 'no errors'
    status = robot_status(link, [5, 9], TEXTS)
    assert (status.level, status.message) == (Level.ERROR, 'error 5 (Paused); error 9')
    assert robot_status(link, [5], TEXTS).level is Level.WARN
    link.on_result(GONE, 2.0, 2.0)
    assert link_status(link, 'robot:1', 0.2, 0, 5.0).message == 'lost for 3 s: Connection refused'
    assert robot_status(link, [], TEXTS).level is Level.ERROR


# Odometry and words.

class Answer:
    """Odometry with a cursor."""

    def __init__(self, cursor):
        """Be that of a cursor."""
        self.metadata, self.odometry = self, cursor
        self.cursor = cursor


def test_odometry_is_fetched_while_wanted_and_each_published_once():
    answers = [(OK, Answer(3)), (OK, Answer(3)), (LATE, None), (OK, Answer(4)), (GONE, None)]
    asked, published, noted, wanted = [], [], [], [False]

    def fetch(cursor, deadline):
        asked.append(cursor)
        return answers.pop(0)

    feed = OdometryPoller(
        'feed', fetch, lambda: wanted[0], published.append, lambda *how: noted.append(how[0]))
    assert feed.poll() > 0.0
    assert asked == []
    wanted[0] = True
    pauses = [feed.poll() for _ in range(5)]
    assert asked == [0, 3, 3, 0, 4]
    assert published == [3, 4]
    assert noted == [OK, OK, OK, GONE], 'nothing new is nothing wrong'
    assert pauses[0] > 0.0, 'a robot that ignores cursors is not asked without end'


def test_speaker_does_not_make_anybody_wait_and_does_not_repeat_itself():
    held, said = threading.Event(), []

    def say(level, text):
        held.wait(3.0)
        said.append(text)

    speaker = LogThread(say)
    begun = time.monotonic()
    for text in ('a', 'a', 'b', 'a'):
        speaker.log(Level.WARN, text)
    assert time.monotonic() - begun < 0.5
    held.set()
    speaker.close()
    assert said == ['a', 'b']
