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
"""A drive in plain lines, for what is no terminal; pure, told the time."""

from __future__ import annotations

from kachaka_simple_control.audience.glance import Glance, State, Step
from kachaka_simple_control.report.columns import one_line
from kachaka_simple_control.report.preview import amount, counted

#: Lines do not come faster than this [s].
APART = 0.5
#: Nobody needs to be told of a robot that answers sooner [s].
PATIENCE = 2.0
#: The longest name there is room for.
NAME = 36


class StepLines:
    """Finds out what is worth a line: each step that begins, a robot waited for, an early end."""

    def __init__(self) -> None:
        """Have told nothing."""
        self._last_line = float('-inf')
        self._number = 0
        self._state = State.READY
        self._state_since = float('-inf')
        self._has_told_wait = False

    def look(self, glance: Glance, now: float) -> list[str]:
        """
        Look at what is going on.

        :param glance: what there is to see
        :param now: the time [s on the steady clock]; never earlier than before
        :returns: the lines that are due, mostly none
        """
        if glance.state is not self._state:
            self._turn(glance.state, now)
        if glance.state is State.DRIVING and glance.step is not None:
            return self._step(glance.step, now)
        if glance.state is State.WAITING and now - self._state_since >= PATIENCE:
            return self._wait(glance)
        return []

    def _turn(self, state: State, now: float) -> None:
        self._state, self._state_since = state, now
        if state in (State.WAITING, State.MEETING):  # of a motion that begins now
            self._number = 0

    def _wait(self, glance: Glance) -> list[str]:
        if self._has_told_wait:
            return []
        self._has_told_wait = True
        return [f'{one_line(glance.title, NAME)}: waiting for the robot']

    def _step(self, step: Step, now: float) -> list[str]:
        if step.number == self._number or now - self._last_line < APART:
            return []
        passed = step.number - self._number - 1
        self._number, self._last_line = step.number, now
        line = f'{which(step)}: {step.words} ({amount(round(step.duration, 3))} s)'
        return [f'{line}; {counted(passed, "step")} before it passed' if passed > 0 else line]


def which(step: Step) -> str:
    """
    Return which step it is, in words.

    :param step: the step
    :returns: such as ``step 2 of 9``
    """
    if step.count is None:
        return f'movement {step.number}'
    return f'step {step.number} of {step.count}'
