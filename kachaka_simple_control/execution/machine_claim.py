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
"""One program at a time drives a robot: on one machine, the kernel decides which."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import socket
import struct
import sys
import threading
import time

from kachaka_simple_control.execution.frozen import is_running

#: How long the holder may take to say who it is [s]; one that is frozen never does.
ANSWER = 0.3
#: How long a claim is waited for whose program has ended [s]: its guardian stops the robot.
GUARDIAN_LEAVES = 3.0
#: How often it is tried meanwhile [s].
RETRY = 0.05
#: What ``SO_PEERCRED`` returns: process, user and group.
CREDENTIALS = struct.Struct('3i')
#: How many bytes of an answer are read.
LONGEST = 1000


class ClaimedError(Exception):
    """Somebody else holds the claim; the text says who, and since when."""


class MachineClaim:
    """
    The right to one name on this machine: an abstract Unix socket bound to it.

    The kernel gives a name to one socket at a time, and takes it back when the last process that
    has the socket open is gone, however it ended.  So a guardian that inherited the socket keeps
    the claim of a program that was killed until the robot is stopped, and a program that is frozen
    keeps its own.  Linux alone has such sockets; elsewhere every claim is granted.
    """

    def __init__(self) -> None:
        """Hold nothing yet; the socket is there, so that a child may inherit it."""
        self._socket = socket.socket(socket.AF_UNIX)
        self._is_held = False
        os.register_at_fork(after_in_child=self._socket.close)

    def fileno(self) -> int:
        """Return the descriptor that keeps the claim, for a child to inherit."""
        return self._socket.fileno()

    def take(self, name: str, who: str) -> None:
        """
        Take the claim, unless it is held already, by this object or another.

        :param name: what is claimed, the same for all who may want it
        :param who: what others are told of the holder, a line of at most 1000 bytes
        :raises ClaimedError: if somebody else holds it
        """
        if self._is_held or not sys.platform.startswith('linux'):
            return
        end = time.monotonic() + GUARDIAN_LEAVES
        address = _address(name)
        while not self._bind(address):
            holder, is_running = _holder(address)
            if is_running or time.monotonic() > end:
                raise ClaimedError(holder)
            time.sleep(RETRY)
        self._is_held = True
        threading.Thread(
            target=_answer, args=(self._socket, who), name='claim', daemon=True).start()

    def release(self) -> None:
        """Give it back, as far as this process is concerned; it cannot be taken again."""
        # Closing would not wake the thread that accepts, and the kernel would keep the socket.
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()

    def _bind(self, address: bytes) -> bool:
        try:
            self._socket.bind(address)
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                raise
            return False
        self._socket.listen()
        return True


def _address(name: str) -> bytes:
    # An address has room for 107 bytes, and a topic may be longer.
    digest = hashlib.sha256(name.encode()).hexdigest()
    return f'\0kachaka_simple_control/claim/{digest[:32]}'.encode()


def _holder(address: bytes) -> tuple[str, bool]:
    """Return who holds a claim, and whether that program is still running."""
    with socket.socket(socket.AF_UNIX) as asking:
        asking.settimeout(ANSWER)
        try:
            asking.connect(address)
        except OSError:
            # It does not listen yet, or has just left.
            return 'a program that does not answer', False
        process, _, _ = CREDENTIALS.unpack(
            asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size))
        with contextlib.suppress(OSError):
            if said := asking.recv(LONGEST):
                return said.decode(errors='replace'), True
    # Frozen; or ended, and its guardian is not; or of a container that counts processes anew.
    return f'process {process}, which does not answer', process == 0 or is_running(process)


def _answer(listening: socket.socket, text: str) -> None:
    """Tell everybody who asks who holds the claim, until it is released."""
    while True:
        try:
            asking, _ = listening.accept()
        except OSError:
            return
        with asking, contextlib.suppress(OSError):
            asking.sendall(text.encode())
