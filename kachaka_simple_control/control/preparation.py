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
"""Get ready without blocking: steps that say what they wait for, and until when."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
import time
from typing import Generic, TypeVar

from kachaka_simple_control.process.waiting import POLL_PERIOD

ResultT = TypeVar('ResultT')


@dataclass(frozen=True)
class Wait:
    """
    What steps wait for.

    :param until: they want to go on then at the latest [s]
    :param is_polled: whether what they wait for may come earlier
    """

    what: str
    until: float
    is_polled: bool = True


#: Steps that yield what they wait for; whoever goes on with them sets the time of their moment.
Steps = Generator[Wait, None, ResultT]


class Moment:
    """The time that steps are told [s]."""

    now = 0.0


def until(
        moment: Moment, condition: Callable[[], bool], what: str, timeout: float) -> Steps[bool]:
    """Wait for a condition, until the timeout [s] at the latest; return whether it holds."""
    end = moment.now + timeout
    while not condition():
        if moment.now >= end:
            return False
        yield Wait(what, end)
    return True


def pause(moment: Moment, duration: float, what: str) -> Steps[None]:
    """Wait for a time [s]."""
    end = moment.now + duration
    while moment.now < end:
        yield Wait(what, end, is_polled=False)


class Preparation(Moment, Generic[ResultT]):
    """
    Steps under way: ``advance`` goes on with them, and does not block.

    :ivar result: what they have returned; None before their end
    """

    def __init__(self, steps: Callable[[Moment], Steps[ResultT]]) -> None:
        self._steps = steps(self)
        self.result: ResultT | None = None

    def advance(self, now: float) -> Wait | None:
        """Go on; return what the steps wait for now, None at their end; raise what they raise."""
        self.now = now
        try:
            return next(self._steps)
        except StopIteration as end:
            if end.value is not None:
                self.result = end.value
            return None

    def close(self) -> None:
        """End the steps; what they have begun is taken back."""
        self._steps.close()


def complete(
        many: Sequence[Callable[[Moment], Steps[ResultT]]],
        check: Callable[[], None] = lambda: None,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep) -> list[ResultT | None]:
    """
    Go on with the steps of each until all have ended, in the calling thread; return their results.

    An error of one ends them all.

    :param check: called while they wait; an error that it raises ends them
    """
    under_way = every = [Preparation(steps) for steps in many]
    try:
        while waits := [(one, wait) for one in under_way
                        if (wait := one.advance(clock())) is not None]:
            under_way = [one for one, _ in waits]
            now = clock()
            sleep(min(max(0.0, wait.until - now) if not wait.is_polled else
                      min(POLL_PERIOD, max(0.0, wait.until - now)) for _, wait in waits))
            check()
    finally:
        for one in under_way:
            one.close()
    return [one.result for one in every]
