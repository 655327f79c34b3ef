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
"""Start a console with the scripted drive process, and speak with it as a page does."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
import contextlib
import http.client
import json
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import time
from typing import Any

from kachaka_simple_control.console.page_protocol import Hello, Lease
from kachaka_simple_control.files.messages import Message, to_json
from kachaka_simple_control.files.protocol import Stop, Take
from optional_libraries import optional_imports
from waiting import wait_until

with optional_imports():
    from tornado.httpclient import HTTPRequest
    from tornado.websocket import websocket_connect

SCRIPT = Path(__file__).with_name('scripted_console.py')
#: How long a test waits for a message [s].
PATIENCE = 30.0
Values = dict[str, Any]


class ConsoleProgram:
    """A console in a process of its own, with the scripted drive process."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.record = folder / 'lines.jsonl'
        self.clients: list[PageClient] = []
        self.process = subprocess.Popen(
            [sys.executable, str(SCRIPT), '--port', '0', f'--drive=--record={self.record}',
             *options],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)})
        assert self.process.stdout is not None
        ready = self.process.stdout.readline()
        found = re.search(r'http://([^/]+)/(?:\?token=(\S+))?', ready)
        assert found, ready
        self.host = found[1]
        self.port = int(self.host.rpartition(':')[2])
        self.driver = found[2]
        self.viewer = ''
        if self.driver:
            self.viewer = self.process.stdout.readline().strip().partition('=')[2]

    def lines(self, *kinds: str) -> list[Values]:
        """Return the lines that the drive process has got, with their times, except ``alive``."""
        if not self.record.exists():
            return []
        # The last part may be half a line.
        complete = self.record.read_text().split('\n')[:-1]
        entries = [json.loads(line) for line in complete]
        return [entry['line'] | {'time': entry['time']} for entry in entries
                if (not kinds and entry['line']['type'] != 'alive')
                or entry['line']['type'] in kinds]

    def children(self) -> list[int]:
        """Return the process IDs of the drive process and of other children."""
        path = Path(f'/proc/{self.process.pid}/task/{self.process.pid}/children')
        return [int(word) for word in path.read_text().split()]

    def drive_pid(self) -> int:
        """Return the process ID of the drive process."""
        return wait_until(lambda: next(
            (pid for pid in self.children()
             if b'/scripted_' in Path(f'/proc/{pid}/cmdline').read_bytes()), 0))

    def end(self) -> int:
        """End the console as Ctrl+C does, and return its exit code."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            self.process.communicate(timeout=15.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.communicate()
            raise
        return self.process.returncode


def fetch(
        program: ConsoleProgram, path: str, method: str = 'GET',
        **headers: str) -> tuple[int, dict[str, str], str]:
    """Send a request, and return its status, header fields and text."""
    connection = http.client.HTTPConnection('127.0.0.1', program.port, timeout=10)
    connection.request(method, path, headers=headers)
    response = connection.getresponse()
    text = response.read().decode()
    connection.close()
    return response.status, dict(response.getheaders()), text


@contextlib.contextmanager
def console(folder: Path, *options: str) -> Iterator[ConsoleProgram]:
    """Run a console during a ``with`` block."""
    program = ConsoleProgram(folder, *options)
    try:
        yield program
    finally:
        program.end()


class PageClient:
    """A page without a browser: it sends messages, and keeps those that it gets."""

    def __init__(self, connection: Any) -> None:
        self.connection = connection
        self.state: Values = {}
        self.messages: list[Values] = []
        self.stamp: float | None = None
        self.is_closed = False
        self._request = 0
        self._sequence = 0
        self.reader = asyncio.get_running_loop().create_task(self._read())

    @classmethod
    async def connect(cls, program: ConsoleProgram, **headers: str) -> PageClient:
        """Open the WebSocket of a console; ``headers`` replace those of an honest page."""
        token = headers.pop('token', program.driver)
        fields = {'Origin': f'http://{program.host}', **headers}
        if token:
            fields['Cookie'] = f'kachaka_console_{program.port}={token}'
        fields = {name: value for name, value in fields.items() if value}
        client = cls(await websocket_connect(HTTPRequest(
            f'ws://127.0.0.1:{program.port}/ws', headers=fields)))
        program.clients.append(client)
        return client

    async def _read(self) -> None:
        while (text := await self.connection.read_message()) is not None:
            message = json.loads(text)
            if message['type'] == 'state':
                self.state.update(message['changes'])
            elif message['type'] == 'stamp':
                self.stamp = message['stamp']
            else:
                self.messages.append(message)
        self.is_closed = True

    def send(self, message: Message) -> None:
        """Send a message."""
        self.connection.write_message(to_json(message))

    def send_text(self, text: str) -> None:
        """Send any text."""
        self.connection.write_message(text)

    async def ask(self, kind: type[Message], **values: object) -> Values:
        """Send a request, and return what answers it."""
        self._request += 1
        number = self._request
        self.send(kind(id=number, **values))
        await self.until(lambda: self._answer(number))
        return self._answer(number) or {}

    def _answer(self, number: int) -> Values | None:
        return next((message for message in self.messages
                     if message.get('id') == number), None)

    def hand_text(self, linear_x: float, angular_z: float = 0.0, **changes: object) -> str:
        """Return a velocity of the hand, with the newest stamp."""
        self._sequence += 1
        values = {'v': 1, 'type': 'hand', 'sequence': self._sequence, 'stamp': self.stamp,
                  'linear_x': linear_x, 'angular_z': angular_z, **changes}
        return json.dumps(values)

    def hand(self, linear_x: float, angular_z: float = 0.0, **changes: object) -> None:
        """Send a velocity of the hand, with the newest stamp."""
        self.send_text(self.hand_text(linear_x, angular_z, **changes))

    async def until(self, condition: Callable[[], Any], patience: float = PATIENCE) -> None:
        """Return when a condition is true; fail if it is not in time [s]."""
        end = time.monotonic() + patience
        while not condition():
            assert time.monotonic() < end, (self.state, self.messages[-5:])
            await asyncio.sleep(0.005)

    async def greet(self) -> Values:
        """Say hello, and return the welcome when the whole state is there as well."""
        self.send(Hello())
        await self.until(lambda: self.state and any(
            message['type'] == 'welcome' for message in self.messages))
        return next(message for message in self.messages if message['type'] == 'welcome')

    async def take(self) -> None:
        """Say hello, get the lease and take the robot, and wait for a stamp."""
        await self.greet()
        await self.until(lambda: self.state['process'] == 'running')
        assert (await self.ask(Lease, want=True))['is_done']
        assert (await self.ask(Take))['is_done']
        await self.until(lambda: self.stamp and self.state['state'] == 'ready')

    async def stop(self) -> Values:
        """Stop the robot, and return the answer."""
        return await self.ask(Stop)

    def close(self) -> None:
        """Close the connection."""
        self.connection.close()


def serve(folder: Path, scenario: Callable[[ConsoleProgram], Any], *options: str) -> Any:
    """Run an asynchronous scenario with a console, and return its result."""
    async def body(program: ConsoleProgram) -> Any:
        try:
            return await scenario(program)
        finally:
            # A socket that is closed by the garbage collector fails another test.
            for client in program.clients:
                client.close()
                with contextlib.suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(client.reader, 2.0)

    with console(folder, *options) as program:
        return asyncio.run(asyncio.wait_for(body(program), 60.0))
