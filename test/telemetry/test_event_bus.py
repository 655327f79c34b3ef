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

from kachaka_simple_control.control.events import MotionStarted
from kachaka_simple_control.telemetry import event_bus as event_bus_module
from kachaka_simple_control.telemetry.event_bus import EventBus
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
    bus, events, seen = EventBus(), events_of(20), []
    bus.subscribe(seen.append, wants=lambda event: event is events[7])
    for event in events[:7]:
        bus.publish(event)
    assert bus._thread is None
    for event in events[7:]:
        bus.publish(event)
    assert bus.flush(10.0)
    assert seen == [events[7]]


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
