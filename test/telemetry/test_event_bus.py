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
"""The bus passes all events on in order, and no reader holds anybody up."""

import threading
import time

from kachaka_simple_control.control.events import (
    MotionEnded,
    MotionStarted,
    ProgressMade,
    RobotEvent,
    VelocitySent,
)
from kachaka_simple_control.telemetry import event_bus as event_bus_module
from kachaka_simple_control.telemetry.event_bus import EventBus
from messages import of_plan
import pytest


def events_of(count):
    """Return distinct events."""
    return [MotionStarted(float(number)) for number in range(count)]


@pytest.fixture
def few(monkeypatch):
    """Let fifty events wait at most, more than gather while none is passed on."""
    monkeypatch.setattr(event_bus_module, 'MAX_WAITING', 50)


def test_all_readers_get_all_events_in_order():
    bus, events, one, other = EventBus(), events_of(5000), [], []
    assert not bus
    bus.subscribe(one.append)
    bus.subscribe(other.append)
    assert bus
    for event in events:
        bus.publish(event)
    assert bus.flush(10.0)
    assert one == other == events


def test_an_event_that_nobody_wants_wakes_no_thread():
    bus, seen = EventBus(), []
    bus.subscribe(seen.append, kinds=(MotionEnded,))
    for event in events_of(7):
        bus.publish(event)
    assert bus._thread is None
    bus.publish(MotionEnded(1.0))
    assert bus.flush(10.0)
    assert seen == [MotionEnded(1.0)]


def test_who_publishes_may_ask_whether_somebody_reads():
    bus, is_active = EventBus(), True
    assert not bus.has_readers(VelocitySent, 'r1')
    bus.subscribe(list, kinds=(VelocitySent,), robot='r1', is_active=lambda: is_active)
    assert bus.has_readers(VelocitySent, 'r1')
    assert not bus.has_readers(VelocitySent, 'r2')
    assert not bus.has_readers(VelocitySent)
    assert not bus.has_readers(MotionEnded, 'r1')
    is_active = False
    assert not bus.has_readers(VelocitySent, 'r1')
    bus.publish(of_plan(1.0), 'r1')
    assert bus._thread is None
    bus.subscribe_to_all(list)
    assert bus.has_readers(VelocitySent, 'r1')
    assert bus.has_readers(VelocitySent, 'r2')
    assert not bus.has_readers(ProgressMade, 'r2'), 'only who asks for it gets it'
    bus.close()
    assert not bus.has_readers(VelocitySent, 'r1')


def test_a_reader_gets_the_events_of_one_robot_or_of_all_with_their_names():
    bus, one, alone, every = EventBus(), [], [], []
    bus.subscribe(one.append, robot='r1')
    bus.subscribe(alone.append)
    bus.subscribe_to_all(every.extend)
    events = events_of(90)
    for number, event in enumerate(events):
        bus.publish(event, ('', 'r1', 'r2')[number % 3])
    assert bus.flush(10.0)
    assert one == events[1::3]
    assert alone == events[::3]
    assert every == [RobotEvent(name, event) if name else event for name, event in zip(
        ('', 'r1', 'r2') * 30, events)]


def test_a_reader_of_all_gets_what_has_gathered_in_few_calls():
    bus, calls = EventBus(), []
    bus.subscribe_to_all(calls.append)
    for number, event in enumerate(events_of(2000)):
        bus.publish(event, f'r{number % 50}')
    assert bus.flush(10.0)
    assert sum(map(len, calls)) == 2000
    assert len(calls) < 200


def test_one_thread_passes_on_the_events_of_all_robots():
    bus, threads = EventBus(), set()
    for number in range(50):
        bus.subscribe(lambda _: threads.add(threading.get_ident()), robot=f'r{number}')
    for number in range(500):
        bus.publish(MotionEnded(1.0), f'r{number % 50}')
    assert bus.flush(10.0)
    assert len(threads) == 1


@pytest.mark.usefixtures('few')
def test_of_more_robots_more_events_may_wait():
    bus, release, seen = EventBus(), threading.Event(), []
    for name in ('r1', 'r2', 'r3'):
        bus.publish(MotionEnded(0.0), name)
    bus.subscribe_to_all(lambda events: (release.wait(10.0), seen.extend(events)))
    for number in range(140):
        bus.publish(MotionEnded(1.0), f'r{number % 3 + 1}')
    release.set()
    assert bus.flush(10.0)
    assert len(seen) == 140
    assert not bus.failures


def test_a_reader_that_raises_is_detached():
    lines, reasons, events, calls = [], [], [], []
    bus = EventBus(lines.append)

    def fail(event):
        calls.append(event)
        raise ValueError('deaf')

    bus.subscribe(fail, reasons.append)
    bus.subscribe(events.append)
    for event in events_of(3):
        bus.publish(event)
    assert bus.flush(10.0)
    assert len(events) == 3
    assert len(calls) == 1
    assert [str(error) for error in bus.failures] == reasons == ['deaf']
    (line,) = lines
    assert line.endswith('fail was detached, and is incomplete: deaf')


@pytest.mark.usefixtures('few')
def test_a_reader_that_does_not_return_is_detached_and_the_others_lose_nothing():
    lines, reasons, before, after = [], [], [], []
    bus, events, release, calls = EventBus(lines.append), events_of(500), threading.Event(), []

    def stuck(event):
        calls.append(event)
        release.wait(30.0)

    bus.subscribe(before.append)
    bus.subscribe(stuck, reasons.append)
    bus.subscribe(after.append)
    for event in events:
        bus.publish(event)
        time.sleep(0.001)
    assert bus.flush(10.0)
    release.set()
    assert before == after == events
    assert calls == events[:1]
    assert reasons == ['it did not keep up']
    assert len(lines) == 1


def test_publishing_waits_for_no_reader():
    bus = EventBus()
    bus.subscribe(lambda _: time.sleep(1.0))
    began = time.monotonic()
    for event in events_of(1000):
        bus.publish(event)
    assert time.monotonic() - began < 0.5


def test_closing_waits_half_a_second_for_a_slow_reader():
    bus = EventBus()
    bus.subscribe(lambda _: time.sleep(2.0))
    for event in events_of(3):
        bus.publish(event)
    began = time.monotonic()
    bus.close()
    assert 0.4 < time.monotonic() - began < 1.0
