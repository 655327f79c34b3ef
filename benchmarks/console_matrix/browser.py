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
"""A Chromium with the page of a console and real key events, and a screen for its windows."""

from __future__ import annotations

from collections.abc import Callable
import contextlib
import os
from pathlib import Path
import shutil
import signal
import subprocess
import tempfile
import time
from typing import Any

from benchmarks.console_matrix.console_run import descendants
import chromium
from console.page_browser import Page
from selenium.common.exceptions import WebDriverException
from waiting import poll

#: The longest time for any reaction of the page [s].
PATIENCE = 20.0
#: How often the drive process is started; on a busy machine its guardian may end it.
MAX_STARTS = 3
#: Records the events of the page, and whether the browser itself caused each.
WATCH = """
window.seen = [];
for (const type of [
    'blur', 'visibilitychange', 'freeze', 'resume', 'pagehide', 'contextmenu'])
  addEventListener(type, event => {
    // An element that loses the focus is not the window.
    if (type !== 'blur' || event.target === window)
      window.seen.push([type, event.isTrusted]);
  }, true);
"""
#: The key for forward.
KEY = {'key': 'w', 'code': 'KeyW', 'windowsVirtualKeyCode': 87}
#: The programs that a screen needs.
PROGRAMS = ('Xvfb', 'openbox')
SIZE = '1280x900x24'
SCREEN_IS_HERE = all(map(shutil.which, PROGRAMS))
SCREEN_MISSING = f'needs {" and ".join(PROGRAMS)}: make browser'


class Browser:
    """
    A browser with a new profile, and with processes that a trial may freeze or kill.

    :param display: the X11 screen for its windows; None for a browser without windows
    """

    def __init__(self, display: str | None = None) -> None:
        self._profile = Path(tempfile.mkdtemp(prefix='console_matrix_'))
        self.driver = chromium.start(self._profile, display)
        self._pid = int(self.driver.capabilities['goog:processID'])
        #: an empty tab behind the page, without which the browser would end with the page's tab
        self._spare = self.driver.current_window_handle
        #: the tab that a trial has opened before the page
        self._cover: str | None = None

    @property
    def processes(self) -> list[int]:
        """Return the ids of all processes of the browser, from the top down."""
        return [self._pid, *descendants(self._pid)]

    @property
    def renderers(self) -> list[int]:
        """Return the ids of the processes that run pages."""
        return [pid for pid in self.processes if b'--type=renderer' in command_line(pid)]

    def signal(self, signum: int, pids: list[int]) -> float:
        """Send processes a signal; return when the first was sent [s, system clock]."""
        now = time.time()
        for pid in pids:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signum)
        return now

    def open(self, address: str) -> None:  # noqa: A003
        """Load a page in a new tab, and close those of earlier trials."""
        self.close_pages()
        self.driver.switch_to.new_window('tab')
        self.driver.set_page_load_timeout(PATIENCE)
        self.driver.get(address)
        self.driver.execute_script(WATCH)
        self._cover = None

    def open_another(self, address: str) -> None:
        """Load a page in another new tab."""
        self.driver.switch_to.new_window('tab')
        self.driver.get(address)

    def close_pages(self) -> None:
        """Close all tabs but an empty one."""
        for handle in self.driver.window_handles:
            if handle != self._spare:
                self.driver.switch_to.window(handle)
                self.driver.close()
        self.driver.switch_to.window(self._spare)

    def take(self, address: str) -> None:
        """
        Take the robot with the page.

        :raises RuntimeError: if the page does not get the robot
        """
        page = Page(self.driver, address)

        def is_asked() -> bool:
            # After a permanent stop the first press only starts the drive process again.
            if page.find('#lease').is_enabled():
                page.click('#lease')
                time.sleep(0.2)
            return bool(page.find('#ask').is_displayed())

        def outcome() -> str:
            state, label = page.text('#state'), page.text('#lease')
            # Another page may have left the robot taken: then there is only a lease to get.
            is_mine = label == 'Release the robot' and state in ('ready', 'driving by hand')
            return 'ready' if is_mine else 'ended' if label == 'Start again' else ''

        for _ in range(MAX_STARTS):
            self._until(is_asked, 'there is no question')
            page.click('#ask-run')
            if self._until(outcome, 'it is not ready') == 'ready':
                break
        else:
            raise RuntimeError('the drive process ends each time before it is ready')
        page.run('document.activeElement.blur()')
        time.sleep(0.2)  # the first stamps arrive

    def hand_text(self) -> str:
        """Return what the page says of driving by hand."""
        return str(self.driver.execute_script(
            "return document.querySelector('#hand-state').textContent"))

    def _until(self, condition: Callable[[], Any], otherwise: str) -> Any:
        value = poll(condition, PATIENCE, 0.05)
        if not value:
            state, fault = (self.driver.execute_script(
                'return document.querySelector(arguments[0]).textContent', selector)
                for selector in ('#state', '#fault-text'))
            raise RuntimeError(f'{otherwise}: state {state!r}, fault {fault!r}')
        return value

    def press(self) -> None:
        """Press the key for forward, and keep it down."""
        self.command('Input.dispatchKeyEvent', type='rawKeyDown', **KEY)

    def repeat(self, duration: float) -> None:
        """Let the held key repeat, as a keyboard does, for a while [s]."""
        end = time.monotonic() + duration
        while time.monotonic() < end:
            with contextlib.suppress(WebDriverException):
                self.command('Input.dispatchKeyEvent', type='rawKeyDown', autoRepeat=True, **KEY)
            time.sleep(0.033)

    def open_menu(self) -> None:
        """Press the right mouse button on the page."""
        self.command('Input.dispatchMouseEvent', type='mousePressed', x=5, y=300, button='right',
                     clickCount=1)

    def let_go(self) -> None:
        """Release the key."""
        with contextlib.suppress(WebDriverException):
            self.command('Input.dispatchKeyEvent', type='keyUp', **KEY)

    def cover(self, new_window: bool) -> None:
        """Bring another tab, or another window, to the front of the page."""
        if self._cover is None:
            self._cover = self.command(
                'Target.createTarget', url='about:blank', newWindow=new_window)['targetId']
        self.command('Target.activateTarget', targetId=self._cover)

    def minimize(self) -> None:
        """Minimize the window."""
        window = self.command('Browser.getWindowForTarget')['windowId']
        self.command('Browser.setWindowBounds', windowId=window,
                     bounds={'windowState': 'minimized'})

    def restore(self) -> None:
        """Show the window again."""
        window = self.command('Browser.getWindowForTarget')['windowId']
        self.command('Browser.setWindowBounds', windowId=window, bounds={'windowState': 'normal'})

    def uncover(self) -> None:
        """Bring the page to the front."""
        self.command('Page.bringToFront')

    def seen(self) -> list[str]:
        """Return the types of the real events that the page has got from the browser."""
        return [kind for kind, is_real in self.driver.execute_script('return window.seen')
                if is_real]

    def command(self, name: str, **values: Any) -> Any:
        """Send a command of DevTools, and return its result."""
        return self.driver.execute_cdp_cmd(name, values)

    def close(self) -> None:
        """End the browser; kill what does not end."""
        pids = self.processes
        self.signal(signal.SIGCONT, pids)
        with contextlib.suppress(Exception):
            self.driver.quit()
        self.signal(signal.SIGKILL, [pid for pid in pids if self._is_ours(pid)])
        shutil.rmtree(self._profile, ignore_errors=True)

    @staticmethod
    def _is_ours(pid: int) -> bool:
        # The id of an ended process may be another's by now.
        return b'chrom' in command_line(pid)


def command_line(pid: int) -> bytes:
    """Return the command line of a process; empty if it has ended."""
    with contextlib.suppress(OSError):
        return Path(f'/proc/{pid}/cmdline').read_bytes()
    return b''


class Screen:
    """A virtual X11 screen with a window manager."""

    def __init__(self) -> None:
        reading, writing = os.pipe()
        self._server = subprocess.Popen(
            ['Xvfb', '-displayfd', str(writing), '-screen', '0', SIZE, '-nolisten', 'tcp'],
            pass_fds=[writing], stderr=subprocess.DEVNULL)
        os.close(writing)
        with os.fdopen(reading) as stream:
            self.display = f':{stream.readline().strip()}'
        self._manager = subprocess.Popen(
            ['openbox'], env={**os.environ, 'DISPLAY': self.display}, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL)

    def close(self) -> None:
        """End the window manager and the screen."""
        for process in (self._manager, self._server):
            process.terminate()
            process.wait()
