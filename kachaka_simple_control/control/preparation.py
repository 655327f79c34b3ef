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

from collections.abc import Callable, Generator
from dataclasses import dataclass
import time
from typing import TypeVar

from kachaka_simple_control.control.timing import POLL_PERIOD

ResultT = TypeVar('ResultT')


@dataclass(frozen=True)
class Wait:
    """
    What steps wait for.

    :param until: they want to go on then at the latest [s]
    """

    what: str
    until: float


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


class Preparation(Moment):
    """Steps under way: ``advance`` goes on with them, and does not block."""

    def __init__(self, steps: Callable[[Moment], Steps[None]]) -> None:
        self._steps = steps(self)

    def advance(self, now: float) -> Wait | None:
        """Go on; return what the steps wait for now, None at their end; raise what they raise."""
        self.now = now
        return next(self._steps, None)

    def close(self) -> None:
        """End the steps; what they have begun is taken back."""
        self._steps.close()


def complete(
        steps: Callable[[Moment], Steps[None]], check: Callable[[], None],
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep) -> None:
    """
    Go on with steps until their end, in the calling thread.

    :param check: called while they wait; an error that it raises ends them
    """
    preparation = Preparation(steps)
    try:
        while (wait := preparation.advance(clock())) is not None:
            sleep(min(POLL_PERIOD, max(0.0, wait.until - clock())))
            check()
    finally:
        preparation.close()
