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
"""What is sent to a real robot, and in which order, under injected time."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.control.timing import (
    MAX_CONSECUTIVE_TIMEOUTS,
    STOP_REPEAT_PERIOD,
    STREAM_TIMEOUT,
)
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.kachaka.grpc_client.command_arbiter import (
    CommandArbiter,
    LatestCommand,
    RpcKind,
    StreamTimeout,
    VelocityCommand,
)
from kachaka_simple_control.kachaka.robot_status import RpcFailure, RpcResult
import pytest

COMMAND_TIMEOUT = KACHAKA.command_timeout
OK = RpcResult(code=0)
NO_CONTROL = RpcResult(code=13151)
REFUSED = RpcResult(code=21051)
LATE = RpcResult(failure=RpcFailure.LATE)
FAILED = RpcResult(failure=RpcFailure.FAILED)
GONE = RpcResult(failure=RpcFailure.GONE)


def motion(time, linear=0.5):
    return VelocityCommand(linear, 0.0, time)


def stop(time):
    return VelocityCommand(0.0, 0.0, time)


@pytest.fixture
def arbiter():
    """Return an arbiter whose robot responds."""
    arbiter = CommandArbiter(COMMAND_TIMEOUT)
    arbiter.on_connected()
    return arbiter


def sent(arbiter, now):
    """Return the one request that is due now."""
    request = arbiter.next_request(now)
    assert arbiter.next_request(now) is None
    return request


# The latest command.

@given(st.lists(st.tuples(st.sampled_from(['motion', 'stop', 'take', 'take stop', 'back']),
                          st.floats(0.0, 0.2)), max_size=40))
def test_latest_command_is_the_newest_and_never_older_than_a_stop(steps):
    """In any order of events."""
    latest, now, taken = LatestCommand(COMMAND_TIMEOUT), 0.0, []
    newest, last_stop, is_pending = None, -1.0, False
    for name, pause in steps:
        now += pause
        if name == 'motion':
            newest = motion(now)
            latest.put(newest)
        elif name == 'stop':
            latest.put(stop(now))
            newest, last_stop, is_pending = None, now, True
        elif name == 'take':
            command = latest.take_motion(now)
            if command is not None:
                assert command is newest
                assert now - command.time <= COMMAND_TIMEOUT
                assert not is_pending
                taken.append(command)
        elif name == 'take stop':
            assert latest.take_stop() == is_pending
            is_pending = False
        elif taken:
            latest.requeue(taken[-1])
            assert not latest.has_motion(now) or latest.take_motion(now).time >= last_stop


# The stream timeout.

def test_ceased_velocities_are_detected_before_the_command_timeout():
    timeout = StreamTimeout()
    for time in (0.0, 0.1, 0.2):
        timeout.on_command(False, time)
    assert timeout.end == pytest.approx(0.2 + STREAM_TIMEOUT)
    assert not timeout.has_expired(0.2 + STREAM_TIMEOUT - 1e-6)
    assert timeout.has_expired(0.2 + STREAM_TIMEOUT)
    assert not timeout.has_expired(9.0), 'once'
    assert STREAM_TIMEOUT < COMMAND_TIMEOUT


@given(st.floats(0.2, 0.25), st.integers(1, 20))
def test_a_5_hz_publisher_is_left_to_the_command_timeout(period, count):
    """Also with late messages."""
    timeout = StreamTimeout()
    for tick in range(count):
        timeout.on_command(False, tick * period)
    assert timeout.end is None


# The arbiter.


def test_one_motion_at_a_time_and_the_newest_next(arbiter):
    arbiter.on_command(motion(0.0, 0.1))
    first = sent(arbiter, 0.0)
    for time in (0.01, 0.02, 0.03):
        arbiter.on_command(motion(time, time))
        assert arbiter.next_request(time) is None
    arbiter.on_response(first, OK, 0.04)
    assert sent(arbiter, 0.04).command == motion(0.03, 0.03)
    assert arbiter.dropped == 2


def test_a_stop_overtakes_a_motion_and_is_sent_again_after_it(arbiter):
    """The robot may have received them in either order."""
    arbiter.on_command(motion(0.0))
    slow = sent(arbiter, 0.0)
    arbiter.on_command(stop(0.1))
    overtaking = sent(arbiter, 0.1)
    assert overtaking.kind is RpcKind.STOP
    arbiter.on_response(overtaking, OK, 0.12)
    assert arbiter.next_request(0.12) is None
    assert arbiter.may_move
    arbiter.on_response(slow, OK, 0.2)
    again = sent(arbiter, 0.2)
    assert again.kind is RpcKind.STOP
    arbiter.on_response(again, OK, 0.21)
    assert not arbiter.may_move
    assert arbiter.next_request(9.0) is None


def test_a_motion_older_than_the_command_timeout_is_dropped(arbiter):
    arbiter.on_command(motion(0.0))
    slow = sent(arbiter, 0.0)
    arbiter.on_command(motion(0.2))  # so slow a publisher is left to the command timeout
    arbiter.on_response(slow, OK, 0.2 + COMMAND_TIMEOUT + 0.001)
    assert arbiter.next_request(0.2 + COMMAND_TIMEOUT + 0.001) is None
    assert arbiter.dropped == 1


def test_manual_control_is_switched_on_for_a_motion_which_is_then_sent(arbiter):
    arbiter.on_command(motion(0.0))
    arbiter.on_response(sent(arbiter, 0.0), NO_CONTROL, 0.01)
    enable = sent(arbiter, 0.01)
    assert enable.kind is RpcKind.ENABLE
    arbiter.on_response(enable, OK, 0.02)
    assert sent(arbiter, 0.02).command == motion(0.0)


def test_manual_control_is_never_switched_on_for_a_zero(arbiter):
    arbiter.on_command(stop(0.0))
    arbiter.on_response(sent(arbiter, 0.0), NO_CONTROL, 0.01)
    assert arbiter.next_request(0.01) is None


def test_a_zero_while_manual_control_comes_on_leaves_no_motion(arbiter):
    arbiter.on_command(motion(0.0))
    arbiter.on_response(sent(arbiter, 0.0), NO_CONTROL, 0.01)
    enable = sent(arbiter, 0.01)
    arbiter.on_command(stop(0.02))
    zero = sent(arbiter, 0.02)
    assert zero.kind is RpcKind.STOP
    arbiter.on_response(zero, NO_CONTROL, 0.03)
    arbiter.on_response(enable, OK, 0.04)
    assert arbiter.next_request(0.04) is None


def test_a_motion_before_the_release_does_not_enable_manual_control(arbiter):
    arbiter.on_command(motion(0.0))
    in_flight = sent(arbiter, 0.0)
    arbiter.cancel_motion()
    assert sent(arbiter, 0.01).kind is RpcKind.STOP
    arbiter.on_response(in_flight, NO_CONTROL, 0.02)
    assert arbiter.next_request(0.02) is None


@pytest.mark.parametrize('refused', [RpcKind.MOTION, RpcKind.ENABLE])
def test_after_a_refusal_motions_are_blocked_until_a_rest(arbiter, refused):
    """An emergency stop that is released must not set the robot in motion again."""
    arbiter.on_command(motion(0.0))
    request = sent(arbiter, 0.0)
    if refused is RpcKind.ENABLE:
        arbiter.on_response(request, NO_CONTROL, 0.01)
        request = sent(arbiter, 0.01)
    arbiter.on_response(request, REFUSED, 0.02)
    arbiter.on_response(sent(arbiter, 0.02), REFUSED, 0.03)
    for tick in range(1, 50):
        arbiter.on_command(motion(0.03 + tick * 0.1))
        assert arbiter.next_request(0.03 + tick * 0.1) is None
    arbiter.on_command(stop(6.0))
    arbiter.on_response(sent(arbiter, 6.0), OK, 6.0)
    arbiter.on_command(motion(6.1))
    assert sent(arbiter, 6.1).kind is RpcKind.MOTION


def test_commands_queued_while_the_bridge_was_suspended_are_not_sent(arbiter):
    """Whether it is received before the stall is detected, or after."""
    arbiter.on_command(motion(0.0))
    arbiter.on_response(sent(arbiter, 0.0), OK, 0.01)
    arbiter.on_command(motion(5.0))
    arbiter.on_stall(5.0)
    arbiter.on_command(motion(5.001))
    assert sent(arbiter, 5.001).kind is RpcKind.STOP


def test_a_restored_connection_sends_a_stop_and_no_motion(arbiter):
    arbiter.on_command(motion(0.0))
    arbiter.on_response(sent(arbiter, 0.0), GONE, 0.1)
    arbiter.on_connection_lost()
    for tick in range(2, 20):
        arbiter.on_command(motion(tick * 0.1))
        assert arbiter.next_request(tick * 0.1) is None
    # A zero received meanwhile is no rest after the connection is back.
    arbiter.on_command(stop(2.0))
    arbiter.on_command(motion(2.05))
    arbiter.on_connected()
    zero = sent(arbiter, 2.1)
    assert zero.kind is RpcKind.STOP
    arbiter.on_response(zero, OK, 2.1)
    arbiter.on_command(motion(2.2))
    assert arbiter.next_request(2.2) is None


@pytest.fixture
def failed(arbiter):
    """Return an arbiter whose robot moves, and could not execute a stop at 1 s."""
    arbiter.on_command(motion(0.0))
    arbiter.on_response(sent(arbiter, 0.0), OK, 0.1)
    arbiter.on_command(stop(1.0))
    arbiter.on_response(sent(arbiter, 1.0), FAILED, 1.0)
    return arbiter


def test_a_stop_that_failed_is_sent_again_until_it_is_done(failed):
    for now in (1.0 + STOP_REPEAT_PERIOD, 1.0 + 2 * STOP_REPEAT_PERIOD):
        assert failed.may_move
        assert failed.next_request(now - 1e-6) is None, 'it may fail at once again'
        assert failed.next_check == pytest.approx(now)
        again = sent(failed, now + 1e-9)
        assert again.kind is RpcKind.STOP
        failed.on_response(again, FAILED, now)
    now = 1.0 + 3 * STOP_REPEAT_PERIOD
    failed.on_response(sent(failed, now + 1e-9), OK, now)
    assert not failed.may_move
    assert failed.next_check is None


def test_a_zero_that_failed_is_not_repeated_to_a_robot_at_rest(arbiter):
    arbiter.on_command(stop(0.0))
    arbiter.on_response(sent(arbiter, 0.0), FAILED, 0.0)
    assert arbiter.next_check is None
    assert arbiter.next_request(9.0) is None


def test_a_robot_slower_than_its_command_timeout_is_stopped_then_blocked(arbiter):
    for tick in range(MAX_CONSECUTIVE_TIMEOUTS):
        arbiter.on_command(motion(float(tick)))
        arbiter.on_response(sent(arbiter, float(tick)), LATE, tick + COMMAND_TIMEOUT)
        arbiter.on_command(motion(tick + COMMAND_TIMEOUT))
        zero = sent(arbiter, tick + COMMAND_TIMEOUT)
        assert zero.kind is RpcKind.STOP, 'nothing piles up in a slow robot'
        arbiter.on_response(zero, OK, tick + 0.5)
        arbiter.next_request(tick + 0.8)
    assert arbiter.is_blocked
