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
A console with a scripted robot, and its page in Chromium, for tests of the page.

The browser records what the page sends over its WebSocket, with times; tests read this record.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
import json
import os
from pathlib import Path
import subprocess
import sys
import time
from typing import Any

import pytest

SCRIPT = Path(__file__).with_name('scripted_console.py')
#: How long the page may take for anything [s].
PATIENCE = 30.0
#: What the page shows where there is no value.
NOTHING = '\u2013'


class Console:
    """A console process with a scripted drive process."""

    def __init__(
            self, folder: Path, *words: str, script: Path = SCRIPT, port: int = 0,
            fleet: str | None = None) -> None:
        what = f'--folder={folder}' if fleet is None else f'--fleet={fleet}'
        self._process = subprocess.Popen(
            [sys.executable, str(script), f'--port={port}', what,
             *(f'--drive={word}' for word in words)],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
            env={**os.environ, 'PYTHONUNBUFFERED': '1'})
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line.startswith('ready: '):
            pytest.fail(f'the console has not started: {line!r}')
        self.address = line.split()[1]

    def close(self) -> None:
        """End the process and its drive process."""
        self._process.terminate()
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()


class Page:
    """The page of a console in a browser."""

    def __init__(self, driver: Any, address: str) -> None:
        self.driver = driver
        self.address = address
        self._events: list[dict[str, Any]] = []

    def open(  # noqa: A003
            self, width: int = 1440, height: int = 900, scheme: str = 'light') -> Page:
        """Load the page anew, at a size [px] and in a colour scheme; wait until it is ready."""
        # A new tab: nothing that a test has done to the old one stays.
        old = self.driver.window_handles
        self.driver.switch_to.new_window('tab')
        new = self.driver.current_window_handle
        for handle in old:
            self.driver.switch_to.window(handle)
            self.driver.close()
        self.driver.switch_to.window(new)
        self.driver.execute_cdp_cmd('Network.enable', {})
        self.resize(width, height, scheme)
        self.driver.get_log('performance')
        self.driver.get_log('browser')
        self._events = []
        self.driver.get(self.address)
        self._wait_until_ready()
        return self

    def _wait_until_ready(self) -> None:
        self.wait(lambda: self.text('#plan-duration') != NOTHING, 'a plan')
        self.wait(lambda: self.text('#robot-name') == 'scripted', 'the robot')

    def resize(self, width: int, height: int, scheme: str = 'light') -> None:
        """Set the size [px] and the colour scheme."""
        self.driver.execute_cdp_cmd('Emulation.setDeviceMetricsOverride', {
            'width': width, 'height': height, 'deviceScaleFactor': 1, 'mobile': width < 600})
        self.driver.execute_cdp_cmd('Emulation.setEmulatedMedia', {'features': [
            {'name': 'prefers-color-scheme', 'value': scheme}]})

    def wait(self, condition: Callable[[], Any], what: str, patience: float = PATIENCE) -> Any:
        """Wait until a condition holds, and return its value."""
        end = time.monotonic() + patience
        while not (value := condition()):
            if time.monotonic() > end:
                pytest.fail(f'the page does not show {what}; state {self.text("#state")!r}, '
                            f'fault {self.text("#fault-text")!r}')
            time.sleep(0.03)
        return value

    def find(self, selector: str) -> Any:
        """Return an element."""
        return self.driver.find_element('css selector', selector)

    def text(self, selector: str) -> str:
        """Return the text of an element."""
        return str(self.run('return document.querySelector(arguments[0]).textContent.trim()',
                            selector))

    def run(self, script: str, *arguments: Any) -> Any:
        """Run a script in the page."""
        return self.driver.execute_script(script, *arguments)

    def click(self, selector: str) -> None:
        """Click an element as a mouse does."""
        self.find(selector).click()

    def keys(self) -> Any:
        """Return a new sequence of key presses."""
        from selenium.webdriver.common.action_chains import ActionChains
        return ActionChains(self.driver)

    def press(self, key: str) -> None:
        """Press and release a key, wherever the focus is."""
        self.keys().send_keys(key).perform()

    def take(self) -> None:
        """Take the robot, and wait until the hand may drive."""
        self.wait(lambda: self.find('#lease').is_enabled(), 'the lease button')
        self.click('#lease')
        self.wait(lambda: self.find('#ask').is_displayed(), 'the question')
        self.click('#ask-run')
        self.wait(lambda: self.text('#lease') == 'Release the robot', 'that the robot is taken')
        self.wait(lambda: self.text('#state') == 'ready', 'that the robot is ready')
        self.run('document.activeElement.blur()')
        # The first stamps arrive.
        time.sleep(0.2)

    def touch(self, kind: str, *points: tuple[float, float]) -> None:
        """Touch the page with a finger: ``touchStart``, ``touchMove``, ``touchEnd``..."""
        self.driver.execute_cdp_cmd('Input.dispatchTouchEvent', {
            'type': kind, 'touchPoints': [{'x': x, 'y': y} for x, y in points]})

    def hold_stick(self, right: float, down: float) -> None:
        """Hold the stick with a finger, so far from its middle [diameters]."""
        x, y, size = self.run(
            'const stick = document.querySelector("#stick");'
            'stick.scrollIntoView({block: "center"});'
            'const box = stick.getBoundingClientRect();'
            'return [box.left + box.width / 2, box.top + box.height / 2, box.width]')
        self.touch('touchStart', (x, y - 0.1 * size))
        self.touch('touchMove', (x + right * size, y + down * size))

    def let_go(self) -> None:
        """Let go what a test holds: a key, a finger, the life of the page."""
        from selenium.common.exceptions import WebDriverException
        self.keys().key_up('w').perform()
        for command, values in (
                ('Page.setWebLifecycleState', {'state': 'active'}),
                ('Input.dispatchTouchEvent', {'type': 'touchCancel', 'touchPoints': []})):
            with suppress(WebDriverException):
                self.driver.execute_cdp_cmd(command, values)

    def _read_events(self) -> list[dict[str, Any]]:
        self._events += [json.loads(entry['message'])['message']
                         for entry in self.driver.get_log('performance')]
        return self._events

    def _frames(self, method: str, kind: str) -> list[dict[str, Any]]:
        messages = [
            {**json.loads(event['params']['response']['payloadData']),
             'time': event['params']['timestamp']}
            for event in self._read_events() if event['method'] == method]
        return [message for message in messages if message['type'] == kind]

    def sent(self, kind: str) -> list[dict[str, Any]]:
        """Return the messages of a type that the page has sent, each with its ``time`` [s]."""
        return self._frames('Network.webSocketFrameSent', kind)

    def received(self, kind: str) -> list[dict[str, Any]]:
        """Return the messages of a type that the page has got, each with its ``time`` [s]."""
        return self._frames('Network.webSocketFrameReceived', kind)

    def requests(self) -> list[str]:
        """Return the addresses that the page has asked for."""
        return [event['params'].get('url') or event['params']['request']['url']
                for event in self._read_events() if event['method'] in (
                    'Network.requestWillBeSent', 'Network.webSocketCreated')]

    def complaints(self) -> list[str]:
        """Return the errors in the console of the browser."""
        return [entry['message'] for entry in self.driver.get_log('browser')
                if entry['level'] == 'SEVERE']
