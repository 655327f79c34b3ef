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
"""Everybody who is told what happens."""

from __future__ import annotations

from collections.abc import Callable

from kachaka_simple_control.report.events import Event

Hearer = Callable[[Event], None]


class Audience:
    """
    Tells events to whoever wants to hear them, in the thread in which they happen.

    A hearer must return at once, for the thread may be the one that moves the robot.  One that
    fails is told nothing more; the drive goes on.
    """

    def __init__(self) -> None:
        """Have nobody to tell."""
        self._hearers: tuple[Hearer, ...] = ()
        #: why hearers were dropped
        self.failures: list[Exception] = []

    def __bool__(self) -> bool:
        """Return whether anybody wants to hear."""
        return bool(self._hearers)

    def join(self, hearer: Hearer) -> None:
        """
        Add a hearer.

        :param hearer: called with each event from now on
        """
        self._hearers = (*self._hearers, hearer)

    def tell(self, event: Event) -> None:
        """
        Tell everybody.

        :param event: what happened
        """
        for hearer in self._hearers:
            try:
                hearer(event)
            except Exception as error:  # noqa: PERF203 (the robot comes first)
                self.failures.append(error)
                self._hearers = tuple(one for one in self._hearers if one is not hearer)
