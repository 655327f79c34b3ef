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
"""The lease of the hand: one page at a time, and not for ever."""

from __future__ import annotations

from typing import get_args

from kachaka_simple_control.console.lease import HandLease, IDLE_TIME
from kachaka_simple_control.files.protocol import StateName
import pytest


def test_the_first_who_asks_gets_it_until_it_is_given_up():
    lease: HandLease[str] = HandLease()
    assert lease.ask('one', 0.0)
    assert not lease.ask('two', 1.0)
    assert not lease.give_up('two', 2.0)
    assert lease.ask('one', 3.0)
    assert lease.give_up('one', 4.0)
    assert lease.free_since == 4.0
    assert lease.ask('two', 5.0)
    assert not lease.give_up('one', 6.0)


def test_only_input_of_its_holder_keeps_it():
    lease: HandLease[str] = HandLease()
    assert not lease.is_idle(1e9, 'ready')
    lease.ask('one', 0.0)
    lease.note_input('two', 50.0)
    assert not lease.is_idle(IDLE_TIME - 0.001, 'ready')
    assert lease.is_idle(IDLE_TIME, 'ready')
    assert not lease.is_idle(IDLE_TIME, 'paused')
    lease.note_input('one', 50.0)
    assert not lease.is_idle(IDLE_TIME + 1.0, 'ready')
    assert not lease.ask('two', 60.0)
    assert not lease.is_idle(109.0, 'ready')
    assert lease.is_idle(110.0, 'ready')


@pytest.mark.parametrize('has_finished', [True, False])
def test_who_has_finished_frees_the_robot_at_once_others_after_a_while(has_finished: bool):
    lease: HandLease[str] = HandLease()

    def free(now: float) -> set[str]:
        return {state for state in get_args(StateName) if lease.is_robot_free(now, state)}

    lease.ask('one', 0.0)
    assert set() == free(1e9)
    assert lease.give_up('one', 10.0, has_finished)
    assert not lease.give_up('two', 20.0)
    assert ({'ready', 'driving by hand'} if has_finished else set()) == free(9.9 + IDLE_TIME)
    assert {'ready', 'driving by hand', 'paused'} == free(10.0 + IDLE_TIME)
    lease.ask('two', 100.0)
    assert set() == free(1e9)
