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
"""
The open pages of a console: their rates, the state that each has been sent, and the log.

Tested by test/console/test_server_security.py.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from kachaka_simple_control.console.page_protocol import StateChanges
from kachaka_simple_control.console.security import HAND_RATE, OTHER_RATE, RateLimit
from kachaka_simple_control.files.messages import Message
from kachaka_simple_control.files.protocol import Log

#: How many lines of the log a new page gets.
LOG_LENGTH = 50


class Page(Protocol):
    """An open page."""

    @property
    def may_drive(self) -> bool:
        """Return whether the page may ask for the lease."""

    @property
    def is_behind(self) -> bool:
        """Return whether the page has not yet taken the last messages."""

    def send(self, message: Message) -> None:
        """Send a message to the page, or drop the page if it does not take messages."""


@dataclass
class OpenPage:
    """
    What the console knows of an open page.

    :param shown: the state that it has been sent; None before it has said hello
    """

    hand_rate: RateLimit
    other_rate: RateLimit
    sequence: int = -1
    shown: dict[str, Any] | None = None


class OpenPages:
    """The open pages; iterating gives each ``Page``."""

    def __init__(self) -> None:
        #: the last lines of the log, for a new page
        self.log_lines: deque[Log] = deque(maxlen=LOG_LENGTH)
        self._pages: dict[Page, OpenPage] = {}

    def __iter__(self) -> Iterator[Page]:
        """Iterate over the pages that are open now; pages may be closed meanwhile."""
        return iter(tuple(self._pages))

    def __len__(self) -> int:
        """Return how many pages are open."""
        return len(self._pages)

    def __contains__(self, page: Page) -> bool:
        """Return whether a page is open."""
        return page in self._pages

    def add(self, page: Page, now: float) -> None:
        """Add a page that was opened."""
        self._pages[page] = OpenPage(RateLimit(HAND_RATE, now), RateLimit(OTHER_RATE, now))

    def remove(self, page: Page) -> bool:
        """Remove a page that was closed; return whether it was there."""
        return self._pages.pop(page, None) is not None

    def find(self, page: Page) -> OpenPage | None:
        """Return what is known of a page; None if it is closed."""
        return self._pages.get(page)

    def send(self, message: Message) -> None:
        """Send a message to each page that has said hello."""
        for page, entry in tuple(self._pages.items()):
            if entry.shown is not None:
                page.send(message)

    def send_if_free(self, message: Message) -> None:
        """Send a message, which a newer one replaces, to each page that is not behind."""
        for page, entry in tuple(self._pages.items()):
            if entry.shown is not None and not page.is_behind:
                page.send(message)

    def log(self, line: Log) -> None:
        """Send each page a line of the log, and keep it for new ones."""
        self.log_lines.append(line)
        self.send(line)

    def show(
            self, state: Mapping[str, Any],
            own: Callable[[Page], Mapping[str, Any]] = lambda _: {}) -> None:
        """
        Send each page what has changed since its last state.

        :param own: returns what differs from page to page
        """
        for page, entry in tuple(self._pages.items()):
            # A page that is behind gets the newest state later, instead of all of them.
            if entry.shown is None or page.is_behind:
                continue
            values = {**state, **own(page)}
            changes = {key: value for key, value in values.items()
                       if key not in entry.shown or entry.shown[key] != value}
            if changes:
                entry.shown = values
                page.send(StateChanges(changes))
