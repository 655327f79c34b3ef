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
"""Claims to a robot: one program drives it, on this machine and among several."""

from __future__ import annotations

import contextlib
from dataclasses import asdict, dataclass
import errno
import hashlib
import json
import os
import socket
import struct
import sys
import threading
import time

from kachaka_simple_control.control.processes import is_running
from kachaka_simple_control.control.timing import (
    CLAIM_ANSWER_TIMEOUT,
    CLAIM_RETRY_PERIOD,
    CLAIM_TIMEOUT,
    GUARDIAN_LEAVE_TIMEOUT,
)

#: What ``SO_PEERCRED`` returns: process, user and group.
CREDENTIALS = struct.Struct('3i')
#: How many bytes of an answer are read.
MAX_ANSWER_BYTES = 1000


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
        end = time.monotonic() + GUARDIAN_LEAVE_TIMEOUT
        address = _address(name)
        while not self._bind(address):
            holder, is_running = _holder(address)
            if is_running or time.monotonic() > end:
                raise ClaimedError(holder)
            time.sleep(CLAIM_RETRY_PERIOD)
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
        asking.settimeout(CLAIM_ANSWER_TIMEOUT)
        try:
            asking.connect(address)
        except OSError:
            # It does not listen yet, or has just left.
            return 'a program that does not answer', False
        process, _, _ = CREDENTIALS.unpack(
            asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size))
        with contextlib.suppress(OSError):
            if said := asking.recv(MAX_ANSWER_BYTES):
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


#: No more claims than this are kept: the network may tell anything.
MAX_CLAIMS = 64
#: No more of a text than this is shown.
MAX_TEXT_LENGTH = 200

#: What is claimed: nothing any more; the robot, as soon as nobody else does; the robot, for good.
RELEASED, WANTED, HELD = 'nothing', 'wanted', 'held'


@dataclass(frozen=True)
class Claim:
    """
    What one program tells of itself.

    :param participant: its DDS participant, in hexadecimal digits
    :param state: what it claims: NOTHING, WANTED or HELD
    :param who: what people call it, and since when it holds the claim
    """

    participant: str
    state: str
    who: str

    def to_json(self) -> str:
        """Return it as text, for the network."""
        return json.dumps(asdict(self))

    @staticmethod
    def from_json(text: str) -> Claim | None:
        """
        Read a claim.

        :param text: what came from the network, which may be anything
        :returns: the claim; None if it is none
        """
        try:
            claim = Claim(**json.loads(text))
        except (ValueError, TypeError, RecursionError):
            return None
        if not all(isinstance(value, str) for value in asdict(claim).values()):
            return None
        if claim.state not in (RELEASED, WANTED, HELD):
            return None
        shown = ''.join(c if c.isprintable() else '?' for c in claim.who[:MAX_TEXT_LENGTH])
        return Claim(claim.participant[:MAX_TEXT_LENGTH], claim.state, shown)


class Claims:
    """What is known of the claims of others."""

    def __init__(self, participant: str) -> None:
        """
        Know of none.

        :param participant: the DDS participant of this program, in hexadecimal digits
        """
        self._participant = participant
        self._heard: dict[str, tuple[float, Claim]] = {}

    def on_claim(self, claim: Claim, now: float) -> None:
        """
        Take note of a claim.

        :param claim: the claim; one of our own says nothing
        :param now: when it was heard [s]
        """
        if claim.participant == self._participant:
            return
        self._heard.pop(claim.participant, None)
        self._heard[claim.participant] = now, claim
        if len(self._heard) > MAX_CLAIMS:
            self._heard.pop(next(iter(self._heard)))

    def holder(self, now: float) -> Claim | None:
        """
        Return a claim that somebody else holds.

        :param now: the time [s]
        :returns: the claim; None if nobody does
        """
        return next((claim for claim in self._fresh(now) if claim.state == HELD), None)

    def blocking_claim(self, now: float) -> Claim | None:
        """
        Return a claim that we have to yield to, as long as we want the robot and do not hold it.

        :param now: the time [s]
        :returns: one that is held, or else that of another newcomer whose participant comes first
        """
        wanted = (claim for claim in self._fresh(now)
                  if claim.state == WANTED and claim.participant < self._participant)
        return self.holder(now) or next(wanted, None)

    def _fresh(self, now: float) -> list[Claim]:
        return [claim for heard, claim in [*self._heard.values()] if now - heard <= CLAIM_TIMEOUT]
