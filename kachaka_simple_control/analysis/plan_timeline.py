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
"""Convert between clock time and plan time of a motion; they differ after a pause."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from itertools import accumulate
from operator import attrgetter

from kachaka_simple_control.control.events import VelocitySent

#: A message less than this too early counts as on time [s], because times are rounded sums.
ROUNDING = 1e-6


class PlanTimeline:
    """
    Converts between clock time and plan time, with the messages of a motion.

    Times between two messages are interpolated.  If the plan was held at a plan time, the plan
    time is converted to the first of its clock times.

    :param began: the time t = 0 of the motion [s on the steady clock]
    :param messages: the motion's messages, in order, up to and with the zero that ended the
        motion; at least one
    """

    def __init__(self, began: float, messages: Sequence[VelocitySent]) -> None:
        self._began = began
        self._messages = messages
        #: whether a message of the motion was delayed by a pause or a speed factor
        self.is_delayed = any(
            message.is_of_run and message.is_delayed for message in messages)
        # A motion without delay needs no lists, to save memory.
        self._times: list[float] = []
        self._plan_times: list[float] = []
        if self.is_delayed:
            self._times = [message.time for message in messages]
            # Plan times come from a bisection and are rounded, so they may decrease slightly.
            self._plan_times = list(accumulate(map(self._message_plan_time, messages), max))

    def _message_plan_time(self, message: VelocitySent) -> float:
        if message.plan_time is not None:
            return message.plan_time
        # The first zero of the stop has no plan time: continue from the last message.
        last = self._messages[-2] if len(self._messages) > 1 else None
        if last is None or last.plan_time is None:
            return message.time - self._began
        return last.plan_time + message.time - last.time

    @property
    def reached(self) -> float:
        """Return the reached plan time [s of the plan]; accurate to one period if delayed."""
        last = self._messages[-1]
        if not self.is_delayed:
            return last.time - self._began
        if not last.is_of_run and len(self._messages) > 1:
            last = self._messages[-2]
        return self._message_plan_time(last)

    def first(self, plan_time: float) -> int:
        """
        Return the index of the first message at or after a plan time.

        :param plan_time: the plan time [s of the plan]
        :returns: the index; the number of messages if there is no such message
        """
        if self.is_delayed:
            return bisect_left(self._plan_times, plan_time - ROUNDING)
        return bisect_left(
            self._messages, self._began + plan_time - ROUNDING, key=attrgetter('time'))

    def time(self, plan_time: float) -> float:
        """
        Return the clock time at which the plan first reaches a plan time.

        :param plan_time: the plan time [s of the plan]
        :returns: the clock time [s on the steady clock], extrapolated after the last message
        """
        if not self.is_delayed:
            return self._began + plan_time
        return _interpolated(self._plan_times, self._times, plan_time, self.first(plan_time))

    def plan_time(self, time: float) -> float:
        """
        Return the plan time of the motion at a clock time.

        :param time: the clock time [s on the steady clock]
        :returns: the plan time [s of the plan]
        """
        if not self.is_delayed:
            return time - self._began
        return _interpolated(self._times, self._plan_times, time, bisect_right(self._times, time))


def _interpolated(
        arguments: Sequence[float], values: Sequence[float], argument: float, index: int,
) -> float:
    """
    Return the linearly interpolated value at an argument; outside the range the slope is one.

    :param index: the index of the first of ``arguments`` that is not below the argument
    """
    if index in (0, len(arguments)):
        nearest = max(0, index - 1)
        return values[nearest] + argument - arguments[nearest]
    before, after = arguments[index - 1], arguments[index]
    part = min(1.0, (argument - before) / (after - before))
    return values[index - 1] + part * (values[index] - values[index - 1])
