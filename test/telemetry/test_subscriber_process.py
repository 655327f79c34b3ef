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
"""Subscribers never delay the process that publishes."""

import contextlib
import io
import resource
import signal
import sys
import threading
import time

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.control.events import (
    MotionPlanned,
    MotionStarted,
    OdometryReceived,
    RobotEvent,
    SessionEnded,
    VelocityKind,
    VelocitySent,
)
from kachaka_simple_control.errors import RunFaultError
from kachaka_simple_control.motion.geometry import Pose, Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.steps import Motion, Move
from kachaka_simple_control.process.signals import signal_dispatcher
from kachaka_simple_control.telemetry import subscriber_process
from kachaka_simple_control.telemetry.event_bus import EventBus
from kachaka_simple_control.telemetry.event_file import EventFile
from kachaka_simple_control.telemetry.subscriber_process import (
    ATOMIC_WRITE_SIZE,
    decode,
    encode,
    SubscriberProcess,
    SubscriberProcesses,
)
from messages import of_plan
import pytest
from waiting import poll

LONG = MotionPlanned(
    Motion('long', tuple(Move(0.1, 0.001 * k, 0.1) for k in range(1000))), Limits(0.3, 1.5), 10.0)
COUNT = """
import sys
from kachaka_simple_control.telemetry.subscriber_process import decode
events = list(decode(sys.stdin.buffer))
sys.exit(len(events))
"""


def subscriber_of(source):
    """Return a subscriber that runs some code."""
    return SubscriberProcess([sys.executable, '-c', source])


@given(st.lists(st.one_of(
    st.builds(MotionStarted, st.floats(0.0, 1e6)),
    st.builds(VelocitySent, st.floats(0.0, 1e6),
              st.builds(Velocity, st.floats(-1, 1), st.floats(-2, 2))),
    st.just(LONG)), max_size=10))
def test_what_is_written_is_what_is_read(events):
    packets = [packet for event in events for packet in encode(event)]
    assert all(len(packet) <= ATOMIC_WRITE_SIZE for packet in packets)
    assert list(decode(io.BytesIO(b''.join(packets)))) == events


@pytest.mark.slow
@given(st.lists(st.lists(st.one_of(
    st.just(LONG), st.builds(RobotEvent, st.sampled_from(['r1', 'r2']), st.builds(
        VelocitySent, st.floats(0.0, 1e6),
        st.builds(Velocity, st.floats(-1, 1), st.floats(-2, 2)), st.just(VelocityKind.PLAN)))),
    min_size=1, max_size=60), max_size=4))
def test_events_that_are_written_together_are_read_one_by_one(batches):
    packets = [packet for batch in batches for packet in encode(*batch)]
    assert all(len(packet) <= ATOMIC_WRITE_SIZE for packet in packets)
    assert list(decode(io.BytesIO(b''.join(packets)))) == [
        event for batch in batches for event in batch]


def test_velocities_that_are_written_together_take_little_room():
    """A second of 50 robots at 20 Hz with odometry: the pipe has room for some seconds."""
    events = [RobotEvent(f'r{number}', event) for number in range(50) for event in (
        of_plan(1000.0 + number / 3.0, Velocity(0.1 + number / 7.0, 0.3)),
        OdometryReceived(1000.0 + number / 3.0, Pose(number / 3.0, number / 7.0, 0.1)))]
    assert sum(map(len, encode(*events))) < 100 * len(events)


def test_a_subscriber_of_all_robots_receives_each_event():
    event_bus = EventBus()
    subscribers, subscriber = SubscriberProcesses(event_bus), subscriber_of(COUNT)
    subscribers.add(subscriber, {VelocitySent})
    for number in range(100):
        event_bus.publish(MotionStarted(1.0), f'r{number % 50}')
        event_bus.publish(of_plan(1.0), f'r{number % 50}')
    assert event_bus.flush(10.0)
    assert subscriber.close(20.0) == 100
    assert subscriber.failure is None


def test_an_event_that_was_cut_off_is_dropped():
    """The program that sent it was killed."""
    data = b''.join(encode(MotionStarted(1.0)) + encode(LONG))
    assert list(decode(io.BytesIO(data[:-100]))) == [MotionStarted(1.0)]


def test_a_full_disk_is_an_error_even_if_it_takes_a_part():
    file, limits = EventFile(), resource.getrlimit(resource.RLIMIT_FSIZE)
    file.send(MotionStarted(1.0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (200, limits[1]))
    try:
        with pytest.raises(OSError, match='No space left on device'):
            file.send(LONG)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert list(file.events()) == [MotionStarted(1.0)]


def test_a_subscriber_receives_all_events():
    subscriber = subscriber_of(COUNT)
    for event in (LONG, MotionStarted(1.0), LONG):
        subscriber.send(event)
    assert subscriber.close(20.0) == 3
    assert subscriber.failure is None


def test_large_events_of_two_threads_are_not_mixed():
    """One of them is the end of a session with a long error."""
    subscriber = subscriber_of(COUNT)
    threads = [
        threading.Thread(target=lambda event=event: [subscriber.send(event) for _ in range(50)])
        for event in (LONG, SessionEnded(1.0, error='x' * 20_000))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert subscriber.failure is None
    assert subscriber.close(20.0) == 100


def test_a_subscriber_that_has_ended_does_not_delay_the_publisher():
    subscriber = subscriber_of('')
    assert subscriber._process.wait(20.0) == 0
    for _ in range(3):
        subscriber.send(MotionStarted(1.0))
    assert subscriber.failure == 'it is gone (Broken pipe)'


def test_a_subscriber_that_does_not_read_does_not_delay_the_publisher():
    subscriber = subscriber_of('import time; time.sleep(60)')
    for number in range(100_000):
        subscriber.send(MotionStarted(float(number)))
    assert subscriber.failure == 'it did not keep up'
    assert subscriber.close(0.0) is None
    subscriber._process.kill()
    subscriber._process.wait()


SLOW = """
import os, time
while data := os.read(0, 128_000):
    time.sleep(0.25)
"""


def test_a_plan_waits_for_a_slow_subscriber_that_reads(monkeypatch):
    """It takes longer than the time after which one that reads nothing is given up."""
    monkeypatch.setattr(subscriber_process, 'PLAN_WRITE_TIMEOUT', 1.5)
    subscriber = subscriber_of(SLOW)
    start = time.monotonic()
    subscriber.send(SessionEnded(1.0, error=3_000_000 * 'x'))
    assert time.monotonic() - start > 2.0
    assert subscriber.failure is None
    assert subscriber.close(20.0) == 0


def test_the_end_of_a_session_does_not_wait_for_a_plan():
    subscriber = subscriber_of('import time; time.sleep(60)')
    plan = threading.Thread(
        target=subscriber.send, args=[SessionEnded(1.0, error=3_000_000 * 'x')], daemon=True)
    plan.start()
    assert poll(lambda: subscriber.sent_bytes > 900_000, 10.0)
    start = time.monotonic()
    subscriber.send(SessionEnded(1.0, error=3_000 * 'x'))
    assert time.monotonic() - start < 2.0
    subscriber._process.kill()
    plan.join(20.0)
    assert not plan.is_alive()
    assert subscriber.close(20.0) == -signal.SIGKILL


@pytest.mark.parametrize('is_required, error, signum, lines', [
    (False, None, None, 1), (True, None, None, 0), (True, RunFaultError('x'), None, 1),
    (True, None, 2, 1)])
def test_a_failure_is_told_unless_the_program_tells_it(
        is_required, error, signum, lines, monkeypatch, capfd):
    """The program tells it as its own error: it has none, or prints none, in the other cases."""
    monkeypatch.setattr(signal_dispatcher, 'signum', signum)
    subscribers, subscriber = SubscriberProcesses(EventBus()), subscriber_of('')
    subscribers.add(subscriber)
    subscribers.required = subscriber if is_required else None
    subscriber.fail('it did not keep up')
    with contextlib.suppress(RunFaultError), subscribers:
        if error is not None:
            raise error
    assert capfd.readouterr().err == lines * (
        'kachaka_simple_control: what was shown or reported ends early: it did not keep up\n')
