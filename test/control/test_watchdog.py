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
"""The watchdog of the guardian: when it stops the robot, and when it must not."""

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.control.timing import (
    CHECK_PERIOD,
    FIRST_CHECK_DELAY,
    GUARDIAN_TIMEOUT,
    HEARTBEAT_TIMEOUT,
    PUBLISH_TIMEOUT,
    STOPPING_TIMEOUT,
    WATCHDOG_PERIOD,
)
from kachaka_simple_control.control.watchdog import (
    GuardianMessage,
    GuardianWatch,
    ROUNDING_ERROR,
    Watchdog,
)
import pytest

MESSAGES = st.lists(
    st.tuples(st.floats(0.0, 0.3), st.sampled_from(list(GuardianMessage))), max_size=40)
#: The messages that say nothing of a run.
NEUTRAL = (GuardianMessage.PRIME, GuardianMessage.LEAVE)


def after(*messages, pause=0.02):
    """Return a watchdog that received messages, and the time of the last."""
    watchdog, now = Watchdog(), 0.0
    for message in messages:
        now += pause
        watchdog.on_message(message, now)
    return watchdog, now


def test_a_disconnect_during_a_run_requires_a_stop():
    watchdog, _ = after(GuardianMessage.PRIME, GuardianMessage.HEARTBEAT)
    assert watchdog.on_disconnect()


@pytest.mark.parametrize('messages', [
    (), (GuardianMessage.PRIME,), (GuardianMessage.HEARTBEAT, GuardianMessage.STOPPED),
    (GuardianMessage.HEARTBEAT, GuardianMessage.STOPPING, GuardianMessage.STOPPED),
    (GuardianMessage.HEARTBEAT, GuardianMessage.STOPPED, GuardianMessage.STOPPING)])
def test_a_disconnect_before_a_motion_or_after_a_whole_stop_requires_none(messages):
    watchdog, _ = after(*messages)
    assert not watchdog.on_disconnect()


def test_one_zero_at_the_end_of_a_run_is_not_a_stop():
    watchdog, _ = after(GuardianMessage.HEARTBEAT, GuardianMessage.STOPPING)
    assert watchdog.on_disconnect()


def wait(watchdog, now, duration):
    """Wait without a message, as the guardian does; return when it timed out, or None."""
    end = now + duration
    while (timeout := watchdog.timeout()) is not None and now < end:
        now += timeout
        if watchdog.has_timed_out(now):
            return now
    return None


def test_missing_heartbeats_in_a_run_are_detected_once():
    watchdog, now = after(GuardianMessage.HEARTBEAT)
    assert wait(watchdog, now, 60.0) == pytest.approx(now + HEARTBEAT_TIMEOUT)
    assert wait(watchdog, now, 60.0) is None
    assert not watchdog.on_disconnect()


def test_time_in_which_the_guardian_was_suspended_does_not_count():
    """The whole machine was suspended, node and guardian alike."""
    watchdog, now = after(GuardianMessage.HEARTBEAT)
    assert not watchdog.has_timed_out(now + 0.5)
    watchdog.on_message(GuardianMessage.HEARTBEAT, now + 0.51)
    assert not watchdog.has_timed_out(now + 1.0)


def test_a_node_that_waits_for_dds_is_given_more_time():
    watchdog, now = after(GuardianMessage.HEARTBEAT)
    looks = round(0.4 / 0.02)
    assert not any(
        watchdog.has_timed_out(now + 0.02 * (k + 1), is_publishing=True) for k in range(looks))
    # Back from there, it has the usual time for its next message.
    assert wait(watchdog, now + 0.4, 1.0) == pytest.approx(now + 0.4 + HEARTBEAT_TIMEOUT)


def test_a_node_that_never_returns_from_dds_is_detected():
    watchdog, now = after(GuardianMessage.HEARTBEAT)
    timed_out = [
        k for k in range(100) if watchdog.has_timed_out(now + 0.02 * (k + 1), is_publishing=True)]
    assert timed_out == [pytest.approx(PUBLISH_TIMEOUT / 0.02 - 1, abs=1)]


@pytest.mark.parametrize('messages', [
    (), (GuardianMessage.PRIME,), (GuardianMessage.STOPPING,),
    (GuardianMessage.HEARTBEAT, GuardianMessage.STOPPED),
    (GuardianMessage.HEARTBEAT, GuardianMessage.STOPPING, GuardianMessage.STOPPED),
    (GuardianMessage.HEARTBEAT, GuardianMessage.STOPPED, GuardianMessage.STOPPING)])
def test_silence_outside_a_run_and_its_stop_is_no_fault(messages):
    watchdog, now = after(*messages)
    assert not watchdog.has_timed_out(now + 3600.0)
    assert watchdog.timeout() is None


def test_a_node_that_falls_silent_before_its_whole_stop_is_detected():
    """Its run has sent a zero, which may be lost; whatever holds it up may hold it for ever."""
    watchdog, now = after(GuardianMessage.HEARTBEAT, GuardianMessage.STOPPING)
    assert wait(watchdog, now, 60.0) == pytest.approx(now + STOPPING_TIMEOUT)
    assert wait(watchdog, now, 60.0) is None
    assert not watchdog.on_disconnect()


@given(st.lists(st.tuples(
    st.lists(st.floats(0.0, HEARTBEAT_TIMEOUT - 2 * WATCHDOG_PERIOD), min_size=1, max_size=5),
    st.floats(0.0, STOPPING_TIMEOUT - 2 * WATCHDOG_PERIOD), st.integers(0, 5)), max_size=5))
def test_a_healthy_node_is_never_stopped(movements):
    """Heartbeats, a zero, a pause, and then a stop, whole or cut short by the next movement."""
    watchdog, now = Watchdog(), 0.0
    for beats, pause, zeros in movements:
        messages = [(0.0, GuardianMessage.HEARTBEAT),
                    *((beat, GuardianMessage.HEARTBEAT) for beat in beats),
                    (0.0, GuardianMessage.STOPPING), (pause, GuardianMessage.STOPPING),
                    *[(0.04, GuardianMessage.STOPPING)] * zeros]
        for silence, message in messages:
            assert wait(watchdog, now, silence) is None
            now += silence
            watchdog.on_message(message, now)
        if zeros:
            watchdog.on_message(GuardianMessage.STOPPED, now)
            assert wait(watchdog, now, 3600.0) is None


@given(begin=st.floats(0.0, 0.3), length=st.floats(0.0, 1.0),
       recovery=st.floats(0.0, HEARTBEAT_TIMEOUT - FIRST_CHECK_DELAY - 0.001))
def test_a_pause_of_the_whole_machine_ends_no_drive(begin, length, recovery):
    """However long it is; after it, the node may need a while to get the processor."""
    def after_pause(moment):
        return max(moment, begin + length) if moment > begin else moment

    watchdog, now, written = Watchdog(), 0.0, 0.0
    watchdog.on_message(GuardianMessage.HEARTBEAT, now)
    while now < begin + length + 0.5:
        now = after_pause(now + watchdog.timeout())
        while (due := written + CHECK_PERIOD) <= now:
            held_up = begin < due < begin + length
            if held_up and begin + length + recovery > now:
                break
            written = begin + length + recovery if held_up else due
        watchdog.on_heartbeat(written, now)
        assert not watchdog.has_timed_out(now)


def test_a_healthy_node_wakes_its_guardian_20_times_a_second():
    watchdog, now, checks = Watchdog(), 0.0, 0
    watchdog.on_message(GuardianMessage.HEARTBEAT, now)
    while now < 10.0:
        now += watchdog.timeout()
        checks += 1
        watchdog.on_heartbeat(now // CHECK_PERIOD * CHECK_PERIOD, now)
        assert not watchdog.has_timed_out(now)
    assert checks / 10.0 == pytest.approx(20.0, abs=1.0)


@given(MESSAGES)
def test_the_robot_is_stopped_at_most_once_unless_it_moved_again(messages):
    """And never without a heartbeat before it."""
    watchdog, now, moved = Watchdog(), 0.0, False
    for pause, message in messages:
        now += pause
        if watchdog.has_timed_out(now):
            assert moved
            moved = False
        watchdog.on_message(message, now)
        moved = (moved or message is GuardianMessage.HEARTBEAT) and (
            message is not GuardianMessage.STOPPED)
    if watchdog.on_disconnect():
        assert moved
    assert not watchdog.on_disconnect()


@given(MESSAGES)
def test_silence_is_detected_within_its_timeout(messages):
    """Whatever messages were received; without a heartbeat it is never detected."""
    watchdog, now = Watchdog(), 0.0
    for pause, message in messages:
        now += pause
        watchdog.on_message(message, now)
    detected = wait(watchdog, now, 10.0)
    left = [message for message in since_stop(messages) if message not in NEUTRAL]
    if GuardianMessage.HEARTBEAT not in left:
        assert detected is None
    else:
        allowed = HEARTBEAT_TIMEOUT if left[-1] is GuardianMessage.HEARTBEAT else STOPPING_TIMEOUT
        # A message that changes nothing may have come since the last one that did.
        assert detected - now <= allowed + ROUNDING_ERROR


def since_stop(messages):
    """Return the messages after the last whole stop."""
    received = [message for _, message in messages]
    ends = [index for index, message in enumerate(received) if message is GuardianMessage.STOPPED]
    return received[ends[-1] + 1:] if ends else received


def test_a_heartbeat_in_memory_counts_from_when_it_was_written():
    watchdog, now = after(GuardianMessage.HEARTBEAT)
    for _ in range(50):
        assert not watchdog.has_timed_out(now + 0.01)
        watchdog.on_heartbeat(now + 0.015, now + 0.02)
        assert not watchdog.has_timed_out(now + 0.02)
        now += 0.02
    assert wait(watchdog, now, 60.0) == pytest.approx(now - 0.005 + HEARTBEAT_TIMEOUT)


def test_the_same_heartbeat_in_memory_counts_once():
    watchdog, now = after(GuardianMessage.HEARTBEAT)
    begin = now
    watchdog.on_heartbeat(begin, begin)
    while not watchdog.has_timed_out(now):
        now += 0.01
        watchdog.on_heartbeat(begin, now)
    assert now - begin == pytest.approx(HEARTBEAT_TIMEOUT)


@pytest.mark.parametrize('messages', [
    (), (GuardianMessage.PRIME,), (GuardianMessage.HEARTBEAT, GuardianMessage.STOPPED),
    (GuardianMessage.HEARTBEAT, GuardianMessage.STOPPING, GuardianMessage.STOPPED)])
def test_a_late_heartbeat_in_memory_begins_no_run(messages):
    """It was written before the stop, and is read after it; nobody sends another."""
    watchdog, now = after(*messages)
    watchdog.on_heartbeat(now - 0.001, now + 0.01)
    assert watchdog.timeout() is None
    assert not watchdog.on_disconnect()


@given(st.floats())
def test_a_heartbeat_that_is_read_while_it_is_written_delays_a_stop_by_one_check(value):
    """Half of the old number and half of the new one may be any number."""
    watchdog, now = after(GuardianMessage.HEARTBEAT)
    watchdog.on_heartbeat(value, now + 0.02)
    timed_out = wait(watchdog, now + 0.02, 60.0)
    assert timed_out <= now + 0.02 + HEARTBEAT_TIMEOUT + ROUNDING_ERROR


def test_a_guardian_that_serves_nothing_for_half_a_second_is_frozen():
    watch, now = GuardianWatch(), 0.0
    for count in range(50):
        now += 0.02
        assert not watch.is_frozen(now, count)
    noticed = next(step for step in range(100) if watch.is_frozen(now + 0.02 * step, 49))
    assert 0.02 * noticed == pytest.approx(GUARDIAN_TIMEOUT, abs=0.03)


def test_time_in_which_the_node_was_held_up_itself_does_not_count():
    watch, now = GuardianWatch(), 0.0
    for _ in range(11):
        now += 60.0
        assert not watch.is_frozen(now, 7)
    assert watch.is_frozen(now + 0.04, 7)
