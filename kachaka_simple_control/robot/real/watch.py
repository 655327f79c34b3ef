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
"""Look regularly whether the robot is there, and what is wrong with it."""

from __future__ import annotations

from collections.abc import Callable
import threading
import time
from typing import TYPE_CHECKING

from kachaka_simple_control.robot.real.error_texts import ErrorTexts, Level
from kachaka_simple_control.robot.real.real_robot import RealRobot

if TYPE_CHECKING:
    from kachaka_simple_control.robot.real.robot_client import RobotClient

#: How often to look [s], while the robot is there and while it is not.
PERIOD = 1.0
PERIOD_LOST = 0.3
#: How long it may take to answer [s].
DEADLINE = 1.0


class Watch:
    """Looks at the robot in a thread of its own; so a lost link is noticed, and its return."""

    def __init__(
            self, client: RobotClient, robot: RealRobot, tell: Callable[[Level, str], None],
            on_look: Callable[[], None]) -> None:
        """
        Look from ``start`` on.

        :param client: the robot's calls
        :param robot: told whether it answers
        :param tell: called with what a person should know
        :param on_look: called after each look
        """
        self._client = client
        self._robot = robot
        self._tell = tell
        self._on_look = on_look
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name='watch', daemon=True)
        #: the errors that the robot reports
        self.codes: list[int] = []

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """End; a look under way is not waited for."""
        self._over.set()
        self._thread.join(DEADLINE / 2.0)

    def look(self) -> None:
        """Look once."""
        begun = time.monotonic()
        outcome, codes = self._client.errors(DEADLINE)
        self._robot.note(outcome, begun)
        if outcome.is_success:
            self._learn(codes)
            self._report(codes)
        self._on_look()

    def _run(self) -> None:
        while not self._over.is_set():
            self.look()
            self._over.wait(PERIOD if self._robot.link.is_up else PERIOD_LOST)

    def _learn(self, codes: list[int]) -> None:
        """Ask what errors mean if a new one has no text yet: the robot may not have been ready."""
        new = set(codes) - set(self.codes)
        if any(not self._robot.texts.find(code).title for code in new):
            outcome, text = self._client.error_texts(DEADLINE)
            if outcome.is_success:
                self._robot.texts = ErrorTexts(text)

    def _report(self, codes: list[int]) -> None:
        for code in codes:
            if code not in self.codes:
                level = self._robot.texts.find(code).level
                self._tell(level, f'the robot reports {self._robot.texts.describe(code)}')
        if self.codes and not codes:
            self._tell(Level.OK, 'the robot reports no errors any more')
        self.codes = codes
