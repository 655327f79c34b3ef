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
"""Requests to resume and to stop: a key that repeats, many clients, requests that cross."""

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.control.drive_requests import ResumeConfirmation, StopRequests
from kachaka_simple_control.control.timing import RESUME_CONFIRM_TIMEOUT, RESUME_QUIET_TIME
from kachaka_simple_control.errors import MotionRefusedError
import pytest


class Clock:
    """A clock that a test sets."""

    now = 0.0

    def __call__(self):
        """Return the time."""
        return self.now


def answers(times):
    """Return which requests at some times [s] confirm, if the robot was moved before the first."""
    clock = Clock()
    confirmation, confirmed = ResumeConfirmation(clock), []
    for now in times:
        clock.now = now
        confirmed.append(confirmation.on_request())
        if not confirmed[-1]:
            confirmation.on_warning()
    return confirmed


def every(period, duration):
    """Return times with a period [s]."""
    return [number * period for number in range(int(duration / period))]


@pytest.mark.parametrize('times', [
    every(1.0 / 30.0, 5.0),  # a key that is held
    every(0.3, 3.0),  # ten clients
    every(0.5, 60.0),  # a client that tries again
    [0.0, 0.0], [0.0, 0.99], [0.0, 0.9, 1.8]])
def test_requests_that_follow_each_other_confirm_nothing(times):
    assert not any(answers(times))


def test_a_late_request_confirms_nothing_and_a_confirmation_serves_once():
    assert answers([0.0, 10.1, 12.0]) == [False, False, True]
    assert answers([0.0, 2.0, 4.0]) == [False, True, False]


@given(st.lists(st.floats(0.0, 3.0), max_size=40))
def test_what_confirms_came_after_a_second_of_silence_and_soon_after_a_warning(pauses):
    times = [sum(pauses[:count + 1]) for count in range(len(pauses))]
    for number, is_confirmed in enumerate(answers(times)):
        if is_confirmed:
            assert RESUME_QUIET_TIME <= times[number] - times[number - 1] <= RESUME_CONFIRM_TIMEOUT


def test_nothing_starts_at_the_same_time_as_a_stop():
    clock = Clock()
    requests = StopRequests(clock)
    requests.require_none()
    clock.now = 7.0
    requests.on_stop()
    for clock.now in (7.0, 7.003, 7.049):
        with pytest.raises(MotionRefusedError, match='a stop came at the same time: call again'):
            requests.require_none()
    clock.now = 7.06
    requests.require_none()
