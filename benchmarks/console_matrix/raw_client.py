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
"""A WebSocket client on a plain socket, which sends whatever it is told to send."""

from __future__ import annotations

import base64
from collections.abc import Callable
import contextlib
import json
import os
import socket
import threading
import time
from typing import Any

from benchmarks.console_matrix.proxy import frame, FrameReader, PING, PONG, TEXT
from waiting import poll

HEADER_END = b'\r\n\r\n'
#: How long an answer may take [s].
PATIENCE = 20.0
Values = dict[str, Any]


class RefusedError(RuntimeError):
    """The server has refused the WebSocket; the text is the first line of its answer."""


class RawClient:
    """
    A connection to the WebSocket of a console.

    :param host: the header field Host; None for that of an honest page
    :param origin: the header field Origin; None for that of an honest page
    :raises RefusedError: if the server refuses the connection
    """

    def __init__(
            self, port: int, token: str = '', host: str | None = None,
            origin: str | None = None, address: str = '127.0.0.1', reads: bool = True) -> None:
        self.state: Values = {}
        self.stamp: float | None = None
        self.is_closed = False
        self.messages: dict[str, Values] = {}
        self._answers: dict[int, Values] = {}
        self._request = self._sequence = 0
        self._writing = threading.Lock()
        self._socket = socket.create_connection((address, port), PATIENCE)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        own = f'{address}:{port}'
        fields = {
            'Host': own if host is None else host, 'Upgrade': 'websocket', 'Connection': 'Upgrade',
            'Sec-WebSocket-Key': base64.b64encode(os.urandom(16)).decode(),
            'Sec-WebSocket-Version': '13', 'Origin': f'http://{own}' if origin is None else origin}
        if token:
            fields['Cookie'] = f'kachaka_console_{port}={token}'
        self._frames = FrameReader()
        try:
            first = self._shake_hands(fields)
        except BaseException:
            self._socket.close()
            raise
        if reads:
            threading.Thread(target=self._read, args=(first,), daemon=True).start()

    def __enter__(self) -> RawClient:
        """Return it."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the connection."""
        self.close()

    def _shake_hands(self, fields: dict[str, str]) -> bytes:
        lines = ['GET /ws HTTP/1.1', *(f'{name}: {value}' for name, value in fields.items())]
        self._socket.sendall('\r\n'.join([*lines, '', '']).encode())
        answer = b''
        while HEADER_END not in answer:
            data = self._socket.recv(4096)
            if not data:
                break
            answer += data
        status, _, rest = answer.partition(b'\r\n')
        if b' 101 ' not in status:
            raise RefusedError(status.decode(errors='replace') or 'closed')
        self._socket.settimeout(None)
        return rest.partition(HEADER_END)[2]

    def send(self, kind: str, **values: Any) -> float:
        """Send a message; return the time just before that [s, system clock]."""
        data = frame(json.dumps({'v': 1, 'type': kind, **values}).encode())
        with self._writing:
            now = time.time()
            self._socket.sendall(data)
        return now

    def send_bytes(self, data: bytes) -> None:
        """Send bytes as they are."""
        with self._writing:
            self._socket.sendall(data)

    def request(self, kind: str, **values: Any) -> tuple[int, float]:
        """Send a request; return its number, and when [s, system clock]."""
        self._request += 1
        return self._request, self.send(kind, id=self._request, **values)

    def ask(self, kind: str, **values: Any) -> Values:
        """Send a request, and return its answer."""
        number, _ = self.request(kind, **values)
        return self.answer(number)

    def answer(self, number: int, timeout: float = PATIENCE) -> Values:
        """
        Return the answer of a request.

        :raises RuntimeError: if there is none in time [s]
        """
        answer: Values | None = poll(lambda: self._answers.get(number), timeout)
        if answer is None:
            raise RuntimeError(f'request {number} was not answered within {timeout:g} s')
        return answer

    def has_answer(self, number: int) -> bool:
        """Return whether a request was answered."""
        return number in self._answers

    def hand(
            self, linear_x: float, stamp: float | None = None, angular_z: float = 0.0) -> float:
        """Send a velocity of the hand; return when [s, system clock]."""
        self._sequence += 1
        return self.send('hand', sequence=self._sequence, stamp=stamp or self.stamp or 0.0,
                         linear_x=linear_x, angular_z=angular_z)

    def until(self, condition: Callable[[], Any], timeout: float = PATIENCE) -> None:
        """
        Return when a condition is true.

        :raises RuntimeError: if it is not in time [s], with the state
        """
        if not poll(condition, timeout, 0.002):
            raise RuntimeError(f'it was not so within {timeout:g} s: {self.state}')

    def greet(self) -> RawClient:
        """Say hello, and wait for the state."""
        self.send('hello')
        self.until(lambda: self.state)
        return self

    def take(self) -> None:
        """Get the lease and the robot, and start the drive process if there is none."""
        self.until(lambda: self.state['process'] in ('running', 'ended'), 40.0)
        if self.state['process'] == 'ended':
            self.ask('start')
            self.until(lambda: self.state['process'] == 'running', 40.0)
        lease = self.ask('lease', want=True)
        if not lease['is_done']:
            raise RuntimeError(lease['text'])
        if self.state['state'] not in ('ready', 'driving by hand'):
            self.ask('take')
        self.until(lambda: self.state['state'] == 'ready' and self.stamp)

    def close(self) -> None:
        """Close the connection."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()

    def _read(self, data: bytes) -> None:
        with contextlib.suppress(OSError):
            while True:
                for opcode, payload in self._frames.feed(data):
                    self._take(opcode, payload)
                data = self._socket.recv(65536)
                if not data:
                    break
        self.is_closed = True

    def _take(self, opcode: int, payload: bytes) -> None:
        if opcode == PING:
            with self._writing:
                self._socket.sendall(frame(payload, PONG))
        elif opcode == TEXT:
            message = json.loads(payload)
            if message['type'] == 'state':
                self.state.update(message['changes'])
            elif message['type'] == 'stamp':
                self.stamp = message['stamp']
            elif message['type'] == 'answer':
                self._answers[message['id']] = message
            else:
                self.messages[message['type']] = message
