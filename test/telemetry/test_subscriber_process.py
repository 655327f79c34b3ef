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
"""Telling others what happens never gets in the way of the drive."""

import io
import sys

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.control import processes
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.steps import Motion, Move
from kachaka_simple_control.telemetry.event_stream import decode, encode, WHOLE
from kachaka_simple_control.telemetry.events import (
    EventBus,
    MotionPlanned,
    MotionStarted,
    VelocitySent,
)
from kachaka_simple_control.telemetry.subscriber_process import SubscriberProcess

LONG = MotionPlanned(
    Motion('long', tuple(Move(0.1, 0.001 * k, 0.1) for k in range(1000))), Limits(0.3, 1.5), 10.0)
COUNT = """
import sys
from kachaka_simple_control.telemetry.event_stream import decode
told = list(decode(sys.stdin.buffer))
sys.exit(len(told))
"""


def teller_of(source):
    """Return a teller to a program."""
    return SubscriberProcess([sys.executable, '-c', source], processes.child_environment())


@given(st.lists(st.one_of(
    st.builds(MotionStarted, st.floats(0.0, 1e6)),
    st.builds(VelocitySent, st.floats(0.0, 1e6),
    st.builds(Velocity, st.floats(-1, 1), st.floats(-2, 2))),
    st.just(LONG)), max_size=10))
def test_what_is_written_is_what_is_read(told):
    packed = [packet for event in told for packet in encode(event)]
    assert all(len(packet) <= WHOLE for packet in packed)
    assert list(decode(io.BytesIO(b''.join(packed)))) == told


def test_an_event_that_was_cut_off_is_left_away():
    """The program that told it was killed."""
    data = b''.join(encode(MotionStarted(1.0)) + encode(LONG))
    assert list(decode(io.BytesIO(data[:-100]))) == [MotionStarted(1.0)]


def test_a_listener_hears_all_until_the_end():
    teller = teller_of(COUNT)
    for event in (LONG, MotionStarted(1.0), LONG):
        teller.send(event)
    assert teller.close(20.0) == 3
    assert teller.failure is None


def test_a_listener_that_is_gone_holds_nobody_up():
    teller = teller_of('')
    assert teller._process.wait(20.0) == 0
    for _ in range(3):
        teller.send(MotionStarted(1.0))
    assert teller.failure == 'it is gone (Broken pipe)'


def test_a_listener_that_does_not_read_holds_nobody_up():
    teller = teller_of('import time; time.sleep(60)')
    for number in range(100_000):
        teller.send(MotionStarted(float(number)))
    assert teller.failure == 'it did not keep up'
    assert teller.close(0.0) is None
    teller._process.kill()
    teller._process.wait()


def test_a_hearer_that_fails_is_told_nothing_more():
    audience, heard, calls = EventBus(), [], []

    def fail(event):
        calls.append(event)
        raise ValueError('deaf')

    audience.subscribe(fail)
    audience.subscribe(heard.append)
    for number in range(3):
        audience.publish(MotionStarted(float(number)))
    assert len(heard) == 3
    assert len(calls) == 1
    assert [str(error) for error in audience.failures] == ['deaf']
