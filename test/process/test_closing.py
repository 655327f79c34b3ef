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
"""Several things are closed at the same time."""

from __future__ import annotations

import threading
import time

from kachaka_simple_control.process.closing import Closers
import pytest


@pytest.fixture
def closers():
    """Return closers."""
    return Closers()


def test_fifty_that_take_a_fifth_of_a_second_each_are_closed_in_that_time(closers):
    closed = []

    def closes(number):
        def close():
            time.sleep(0.2)
            closed.append(number)
        return close

    for number in range(50):
        closers.add(closes(number), 'group')
    began = time.monotonic()
    closers.close_all()
    assert time.monotonic() - began < 0.6  # the bar
    assert sorted(closed) == [*range(50)]


def test_only_those_of_a_group_and_none_that_was_removed_are_closed(closers):
    closed = []
    functions = {name: lambda name=name: closed.append(name) for name in 'abcd'}
    for name, close in functions.items():
        closers.add(close, 'one' if name in 'abc' else 'other')
    closers.remove(functions['b'])
    closers.remove(functions['b'])
    closers.close_all('one')
    assert sorted(closed) == ['a', 'c']
    closers.close_all()
    closers.close_all()
    assert sorted(closed) == ['a', 'c', 'd']


def test_one_alone_is_closed_in_the_thread_that_asks(closers):
    threads = []
    closers.add(lambda: threads.append(threading.current_thread()), 'group')
    closers.close_all()
    assert threads == [threading.current_thread()]


def test_where_no_thread_can_start_nothing_is_added(closers, monkeypatch):
    """As from Python 3.12 on while the program ends: each node closes its own session then."""
    def refuse(self):
        raise RuntimeError("can't create new thread at interpreter shutdown")

    monkeypatch.setattr(threading.Thread, 'start', refuse)
    closed = []
    closers.add(lambda: closed.append(1), 'group')
    closers.close_all()
    assert not closed
