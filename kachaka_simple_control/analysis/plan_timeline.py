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
"""When a motion was where on its plan: the clock and the plan differ after a pause."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from itertools import accumulate
from operator import attrgetter

from kachaka_simple_control.control.events import VelocitySent

#: A message is not early if it is by less than this [s]: times are sums, and rounded.
ROUNDING = 1e-6


class PlanTimeline:
    """
    Converts between the clock and the time of a plan, by the messages of a motion.

    Between two messages time is interpolated.  A plan that was held at a time of its own is there
    at the first of the times on the clock.

    :param began: t = 0 of the motion [s on the steady clock]
    :param messages: its messages, in order, to the zero that ended it; at least one
    """

    def __init__(self, began: float, messages: Sequence[VelocitySent]) -> None:
        self._began = began
        self._messages = messages
        #: whether any of it was not driven as planned
        self.is_delayed = any(
            message.is_of_run and message.is_delayed for message in messages)
        # A motion as planned needs no lists, however long it is.
        self._times: list[float] = []
        self._plan_times: list[float] = []
        if self.is_delayed:
            self._times = [message.time for message in messages]
            # Plan times come from a bisection and are rounded, so they may decrease slightly.
            self._plan_times = list(accumulate(map(self._message_plan_time, messages), max))

    def _message_plan_time(self, message: VelocitySent) -> float:
        if message.plan_time is not None:
            return message.plan_time
        # The first zero of the stop: from where the plan was left.
        last = self._messages[-2] if len(self._messages) > 1 else None
        if last is None or last.plan_time is None:
            return message.time - self._began
        return last.plan_time + message.time - last.time

    @property
    def reached(self) -> float:
        """Return how far on the plan it came, to a period if it was delayed [s of the plan]."""
        last = self._messages[-1]
        if not self.is_delayed:
            return last.time - self._began
        if not last.is_of_run and len(self._messages) > 1:
            last = self._messages[-2]
        return self._message_plan_time(last)

    def first(self, plan_time: float) -> int:
        """
        Return the index of the first message at a time of the plan, or after it.

        :param plan_time: the time [s of the plan]
        :returns: the index; the number of messages if there is none
        """
        if self.is_delayed:
            return bisect_left(self._plan_times, plan_time - ROUNDING)
        return bisect_left(
            self._messages, self._began + plan_time - ROUNDING, key=attrgetter('time'))

    def time(self, plan_time: float) -> float:
        """
        Return when the plan was at a time of its own first, or will be.

        :param plan_time: the time [s of the plan]
        :returns: when [s on the steady clock]
        """
        if not self.is_delayed:
            return self._began + plan_time
        return _interpolated(self._plan_times, self._times, plan_time, self.first(plan_time))

    def plan_time(self, time: float) -> float:
        """
        Return where on the plan the motion was.

        :param time: when [s on the steady clock]
        :returns: where [s of the plan]
        """
        if not self.is_delayed:
            return time - self._began
        return _interpolated(self._times, self._plan_times, time, bisect_right(self._times, time))


def _interpolated(
        arguments: Sequence[float], values: Sequence[float], argument: float, index: int,
) -> float:
    """
    Return the value at an argument, before the first and after the last with a slope of one.

    :param index: of the first argument that is not before it
    """
    if index in (0, len(arguments)):
        nearest = max(0, index - 1)
        return values[nearest] + argument - arguments[nearest]
    before, after = arguments[index - 1], arguments[index]
    part = min(1.0, (argument - before) / (after - before))
    return values[index - 1] + part * (values[index] - values[index - 1])
