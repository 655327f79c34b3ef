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
"""Which of the received messages this program has sent, at random."""

import threading

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.control.sent_messages import MAX_QUEUED, SentMessages
from kachaka_simple_control.control.timing import MAX_GUARDIAN_DELAY, MAX_TRANSIT_TIME
import pytest

ZERO, FORWARD, LEFT, FOREIGN = b'zero', b'forward', b'left', b'foreign'
OWN = st.lists(st.sampled_from([ZERO, FORWARD, LEFT]), max_size=40)


def sent(*messages, now=0.0):
    """Return a record of messages that were sent at one time."""
    log = SentMessages()
    for message in messages:
        log.record(now, message)
    return log


@given(OWN, st.data())
def test_our_own_messages_are_ours_whichever_are_lost(messages, data):
    log = sent(*messages)
    arrived = [m for m in messages if data.draw(st.booleans())]
    assert all(log.consume(m, m == ZERO, 0.0) for m in arrived)


@given(OWN)
def test_a_message_that_was_never_sent_is_foreign(messages):
    assert not sent(*messages).consume(FOREIGN, False, 0.0)


@given(OWN, st.sampled_from([ZERO, FORWARD, LEFT]), st.integers(min_value=0, max_value=40))
def test_one_extra_message_is_detected_even_if_it_equals_ours(messages, foreign, place):
    """Not which one: with nothing lost, one message is more than was sent."""
    log = sent(*messages)
    received = [*messages]
    received.insert(min(place, len(received)), foreign)
    # All of them are asked about, whatever the first answers are.
    answers = [log.consume(m, m == ZERO, 0.0) for m in received]
    assert False in answers


def test_a_zero_of_the_guardian_is_ours_once_and_for_a_limited_time():
    log = sent()
    log.record_guardian_zero(0.0)
    log.record_guardian_zero(0.0)
    assert log.consume(ZERO, True, 0.5)
    assert not log.consume(FORWARD, False, 0.5)
    assert not log.consume(ZERO, True, MAX_GUARDIAN_DELAY + 0.1)


def test_old_messages_are_discarded_when_a_subscription_begins():
    log = sent(FORWARD, now=0.0)
    log.record(1.0, LEFT)
    log.discard_old(1.0 + MAX_TRANSIT_TIME)
    assert not log.consume(FORWARD, False, 1.1)
    assert log.consume(LEFT, False, 1.1)


@pytest.mark.parametrize('rate', [10.0, 1000.0])
def test_what_is_kept_does_not_grow_in_a_long_drive(rate):
    log = SentMessages()
    for number in range(20_000):
        log.record(number / rate, b'%d' % number)
    assert MAX_QUEUED < len(log._sent) <= MAX_QUEUED + rate * MAX_TRANSIT_TIME + 2


@pytest.mark.parametrize('rate', [10.0, 1000.0])
def test_a_full_queue_that_is_read_late_is_ours(rate):
    """The oldest in it was sent long ago, and the newest messages are still on their way."""
    log, number = SentMessages(), 5000
    for index in range(number):
        log.record(index / rate, b'%d' % index)
    in_transit = int(rate * MAX_TRANSIT_TIME)
    queued = range(number - in_transit - MAX_QUEUED, number - in_transit)
    assert all(log.consume(b'%d' % index, False, number / rate) for index in queued)


def test_one_may_record_while_another_consumes():
    log, total, alien = SentMessages(), 2000, []
    recorder = threading.Thread(
        target=lambda: [log.record(0.0, b'%d' % number) for number in range(total)])
    recorder.start()
    while recorder.is_alive():
        alien.append(log.consume(FOREIGN, False, 0.0))
    recorder.join()
    assert not any(alien)
    assert all(log.consume(b'%d' % number, False, 0.0) for number in range(total))
