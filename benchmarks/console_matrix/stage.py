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
"""The console and the browser of all trials; started again if a trial has ended one of them."""

from __future__ import annotations

import contextlib

from benchmarks.console_matrix.browser import Browser, Screen, SCREEN_IS_HERE
from benchmarks.console_matrix.console_run import ConsoleRun


class Stage:
    """A context manager for consoles and browser; each is started when it is first used."""

    def __init__(self) -> None:
        self._browser: Browser | None = None
        self._console: ConsoleRun | None = None
        self._dropped: list[ConsoleRun] = []
        self._with_token: ConsoleRun | None = None
        self._screen: Screen | None = None
        self._has_windows = False

    def __enter__(self) -> Stage:
        """Return it."""
        return self

    def __exit__(self, *error: object) -> None:
        """End all."""
        self.drop_browser()
        self.drop_console()
        self._close_dropped()
        if self._with_token is not None:
            self._with_token.close()
        if self._screen is not None:
            self._screen.close()

    @property
    def browser(self) -> Browser:
        """Return the browser."""
        if self._browser is None:
            self._browser = Browser(self._display())
        return self._browser

    def use_windows(self, has_windows: bool) -> None:
        """Use a browser with windows on a virtual screen, or one without windows."""
        if has_windows != self._has_windows:
            self.drop_browser()
        self._has_windows = has_windows

    def _display(self) -> str | None:
        if not self._has_windows or not SCREEN_IS_HERE:
            return None
        self._screen = self._screen or Screen()
        return self._screen.display

    @property
    def console(self) -> ConsoleRun:
        """Return the console that needs no token."""
        self._console = self._console or ConsoleRun()
        return self._console

    @property
    def console_with_token(self) -> ConsoleRun:
        """Return the console that needs a token."""
        self._with_token = self._with_token or ConsoleRun('--token')
        return self._with_token

    def let_go(self) -> None:
        """Release the key, if the browser is still there."""
        self._close_dropped()
        if self._browser is not None:
            self._browser.let_go()

    def leave_page(self) -> None:
        """Close the page, which may have the lease."""
        if self._browser is not None:
            self._browser.close_pages()

    def drop_browser(self) -> None:
        """End the browser; the next trial gets a new one."""
        if self._browser is not None:
            self._browser.close()
        self._browser = None

    def drop_console(self) -> None:
        """Use another console from now on; this one is closed later, so that it can be read."""
        if self._console is not None:
            self._dropped.append(self._console)
        self._console = None

    def restart(self) -> None:
        """End browser and console after a trial that failed to begin."""
        with contextlib.suppress(Exception):
            self.drop_browser()
        self.drop_console()
        self._close_dropped()

    def _close_dropped(self) -> None:
        for console in self._dropped:
            console.close()
        self._dropped.clear()
