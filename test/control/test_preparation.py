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
"""Steps say what they wait for, block nobody, and take back what they began."""

from fake_time import FakeTime
from kachaka_simple_control.control.preparation import complete, Preparation, until, Wait
import pytest


class Robot:
    """A robot that answers after some time, and what was begun with it."""

    def __init__(self, answers_at):
        self.answers_at, self.done = answers_at, []

    def prepare(self, moment):
        """Wait for the answer for 2 s at most."""
        try:
            if not (yield from until(
                    moment, lambda: moment.now >= self.answers_at, 'its answer', 2.0)):
                raise TimeoutError
        except BaseException:
            self.done.append('withdrawn')
            raise
        self.done.append('ready')


def test_ten_robots_get_ready_in_the_time_of_one():
    time, began = FakeTime(), FakeTime().now
    robots = [Robot(began + 0.1 * number) for number in range(10)]
    complete([robot.prepare for robot in robots], lambda: None, time.clock, time.sleep)
    assert time.now - began < 1.0
    assert all(robot.done == ['ready'] for robot in robots)


def test_one_that_never_gets_ready_ends_all():
    time, began = FakeTime(), FakeTime().now
    robots = [Robot(began + 10.0), Robot(began + 1.0), Robot(began + 11.0)]
    with pytest.raises(TimeoutError):
        complete([robot.prepare for robot in robots], lambda: None, time.clock, time.sleep)
    assert [robot.done for robot in robots] == [['withdrawn'], ['ready'], ['withdrawn']]


def test_they_say_what_they_wait_for_and_until_when():
    preparation = Preparation(Robot(1.0).prepare)
    assert preparation.advance(0.5) == Wait('its answer', 2.5)
    assert preparation.advance(1.0) is None
    assert preparation.advance(1.1) is None


def test_what_never_comes_ends_them():
    robot = Robot(10.0)
    preparation = Preparation(robot.prepare)
    assert preparation.advance(0.0)
    with pytest.raises(TimeoutError):
        preparation.advance(2.0)
    assert robot.done == ['withdrawn']


def test_whoever_is_stopped_meanwhile_takes_back_what_was_begun():
    time, robot = FakeTime(), Robot(1.0e9)

    def check():
        if time.now > 1000.3:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        complete([robot.prepare], check, time.clock, time.sleep)
    assert robot.done == ['withdrawn']
