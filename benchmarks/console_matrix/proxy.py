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
"""A TCP proxy between browser and console that can hold bytes back, and WebSocket frames."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
from dataclasses import dataclass
import json
import os
import selectors
import socket
import struct
import threading
import time

#: The opcodes of frames.
TEXT, CLOSE, PING, PONG = 1, 8, 9, 10
#: The largest number of bytes that are read at once.
SIZE = 65536
#: The end of the header of an HTTP request.
HEADER_END = b'\r\n\r\n'


class Proxy:
    """
    Passes bytes between browser and console, in a thread of its own.

    It listens at another address of the loopback interface, at the port of the console: the
    browser then sends a host with the right port, and the console needs no change.
    """

    ADDRESS = '127.0.0.2'

    def __init__(self, port: int) -> None:
        self._port = port
        self.commands: list[PassedCommand] = []
        self._selector = selectors.DefaultSelector()
        self._listening = socket.create_server((self.ADDRESS, port))
        self._selector.register(self._listening, selectors.EVENT_READ, None)
        #: whether bytes of the browser, and of the console, are held back
        self._holds = {'browser': False, 'console': False}
        self._is_over = False
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name='proxy', daemon=True)
        self._thread.start()

    def hold(self, *sides: str) -> float:
        """Hold back all bytes of some sides, in both directions by default."""
        with self._lock:
            for side in sides or ('browser', 'console'):
                self._holds[side] = True
            return time.time()

    def release(self) -> float:
        """Pass on all that was held back, at once; return when [s, system clock]."""
        with self._lock:
            self._holds = dict.fromkeys(self._holds, False)
            return time.time()

    def close(self) -> None:
        """End all connections."""
        self._is_over = True
        self._thread.join(5.0)
        for key in tuple(self._selector.get_map().values()):
            key.fileobj.close()  # type: ignore[union-attr]
        self._selector.close()

    def _run(self) -> None:
        while not self._is_over:
            ready = self._selector.select(0.05)
            with self._lock:
                is_idle = True
                for key, _ in ready:
                    if key.data is None:
                        self._accept()
                        is_idle = False
                    elif not self._holds[self._side(key)]:
                        self._pass_on(key)
                        is_idle = False
            if is_idle and ready:  # all that is there is held back
                time.sleep(0.002)

    @staticmethod
    def _side(key: selectors.SelectorKey) -> str:
        return 'browser' if key.fileobj is key.data.browser else 'console'

    def _accept(self) -> None:
        browser, _ = self._listening.accept()
        try:
            console = socket.create_connection(('127.0.0.1', self._port), 2.0)
        except OSError:
            browser.close()
            return
        connection = _Connection(browser, console)
        for one in (browser, console):
            one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            one.settimeout(2.0)
            self._selector.register(one, selectors.EVENT_READ, connection)

    def _pass_on(self, key: selectors.SelectorKey) -> None:
        source, connection = key.fileobj, key.data
        assert isinstance(source, socket.socket)
        data = b''
        with contextlib.suppress(OSError):
            data = source.recv(SIZE)
        try:
            if data:
                now = time.time()
                connection.other(source).sendall(data)
                if source is connection.browser:
                    self.commands += connection.commands(data, now)
                return
        except OSError:
            pass
        for one in (connection.browser, connection.console):
            with contextlib.suppress(KeyError, ValueError):
                self._selector.unregister(one)
            one.close()


class _Connection:
    """The two sockets of a connection: of the browser, and of the console."""

    def __init__(self, browser: socket.socket, console: socket.socket) -> None:
        self.browser, self.console = browser, console
        self._header = b''
        self._frames: FrameReader | None = None

    def other(self, source: socket.socket) -> socket.socket:
        """Return the socket to which the bytes of a socket belong."""
        return self.console if source is self.browser else self.browser

    def commands(self, data: bytes, now: float) -> list[PassedCommand]:
        """Return the velocities of the hand in the next bytes of the browser."""
        if self._frames is None:
            self._header += data
            head, separator, data = self._header.partition(HEADER_END)
            if not separator or b'upgrade: websocket' not in head.lower():
                return []
            self._frames = FrameReader()
        messages = [json.loads(payload) for opcode, payload in self._frames.feed(data)
                    if opcode == TEXT]
        return [PassedCommand(now, message['linear_x'], message['angular_z'])
                for message in messages if message['type'] == 'hand']


@dataclass(frozen=True)
class PassedCommand:
    """A velocity of the hand that was passed on to the console."""

    time: float
    linear_x: float
    angular_z: float

    @property
    def moves(self) -> bool:
        """Whether it asks for motion."""
        return self.linear_x != 0.0 or self.angular_z != 0.0


class FrameReader:
    """Splits a stream of bytes into frames.  Messages in several frames are not joined."""

    def __init__(self) -> None:
        self._rest = b''

    def feed(self, data: bytes) -> Iterator[tuple[int, bytes]]:
        """Take the next bytes, and yield opcode and payload of each complete frame."""
        self._rest += data
        while (found := self._next()) is not None:
            opcode, payload, self._rest = found
            yield opcode, payload

    def _next(self) -> tuple[int, bytes, bytes] | None:
        data = self._rest
        if len(data) < 2:
            return None
        size, start = data[1] & 0x7f, 2
        if size >= 126:
            width = 2 if size == 126 else 8
            size, start = int.from_bytes(data[2:2 + width], 'big'), 2 + width
        mask = b''
        if data[1] & 0x80:
            mask, start = data[start:start + 4], start + 4
        if len(data) < start + size:
            return None
        payload = data[start:start + size]
        return data[0] & 0x0f, _masked(payload, mask) if mask else payload, data[start + size:]


def frame(payload: bytes, opcode: int = TEXT) -> bytes:
    """Return a frame of a client, which is masked."""
    size, mask = len(payload), os.urandom(4)
    if size < 126:
        head = struct.pack('!BB', 0x80 | opcode, 0x80 | size)
    elif size < 65536:
        head = struct.pack('!BBH', 0x80 | opcode, 0x80 | 126, size)
    else:
        head = struct.pack('!BBQ', 0x80 | opcode, 0x80 | 127, size)
    return head + mask + _masked(payload, mask)


def _masked(payload: bytes, mask: bytes) -> bytes:
    size = len(payload)
    key = (mask * (size // 4 + 1))[:size]
    return (int.from_bytes(payload, 'big') ^ int.from_bytes(key, 'big')).to_bytes(size, 'big')
