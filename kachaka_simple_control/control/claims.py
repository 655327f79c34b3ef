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
"""Claims on a robot: one program drives it, on one machine and among several."""

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
#: Longest description of a holder that is read [bytes].
MAX_DESCRIPTION_BYTES = 1000
#: Most claims that are kept; the network may deliver anything.
MAX_CLAIMS = 64
#: Most of a text from the network that is kept [characters].
MAX_TEXT_LENGTH = 200
#: States of a claim: the robot is not claimed; it is wanted, and taken if no other claim blocks
#: it; it is held until the program ends.
RELEASED, WANTED, HELD = 'nothing', 'wanted', 'held'


class ClaimedError(Exception):
    """
    The claim is held; the message says by which program, and since when.

    :param holder: the message
    :param is_own: whether something in this process holds it
    """

    def __init__(self, holder: str, is_own: bool) -> None:
        super().__init__(holder)
        self.is_own = is_own


class MachineClaim:
    """
    The claim on one name on this machine: an abstract Unix socket that is bound to it.

    The kernel gives a name to one socket at a time, and frees it when the last process that has
    the socket open is gone, however it ended.  So a guardian that inherited the socket keeps the
    claim of a program that was killed until the robot is stopped, and a frozen program keeps its
    own.  Only Linux has such sockets; elsewhere every claim is granted.
    """

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        self._is_held = False
        os.register_at_fork(after_in_child=self._socket.close)

    def fileno(self) -> int:
        """Return the descriptor that keeps the claim, for a child process to inherit."""
        return self._socket.fileno()

    def take(self, name: str, who: str) -> None:
        """
        Take the claim, unless this object holds it already.

        If the holder has ended, wait up to GUARDIAN_LEAVE_TIMEOUT for its guardian.

        :param name: what is claimed
        :param who: describes this program to others, in one line of at most 1000 bytes
        :raises ClaimedError: if another program holds it
        """
        if self._is_held or not sys.platform.startswith('linux'):
            return
        end = time.monotonic() + GUARDIAN_LEAVE_TIMEOUT
        address = _address(name)
        while not self._bind(address):
            holder, process, is_answering = _holder(address)
            if is_answering or process == 0 or is_running(process) or time.monotonic() > end:
                raise ClaimedError(holder, process == os.getpid())
            time.sleep(CLAIM_RETRY_PERIOD)
        self._is_held = True
        threading.Thread(
            target=_serve, args=(self._socket, who), name='claim', daemon=True).start()

    def release(self) -> None:
        """Release the claim in this process; it cannot be taken again."""
        # Closing alone would not wake the thread that accepts, and the socket would stay open.
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


def _holder(address: bytes) -> tuple[str, int, bool]:
    """
    Return a description of who holds a claim, its process, and whether it answers.

    The process is 0 if it is in a container with its own process numbers, and -1 if it does not
    listen yet, or has just left.
    """
    with socket.socket(socket.AF_UNIX) as client:
        client.settimeout(CLAIM_ANSWER_TIMEOUT)
        try:
            client.connect(address)
        except OSError:
            return 'a program that does not answer', -1, False
        process, _, _ = CREDENTIALS.unpack(
            client.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size))
        with contextlib.suppress(OSError):
            if description := client.recv(MAX_DESCRIPTION_BYTES):
                return description.decode(errors='replace'), process, True
    # Frozen; or ended, and its guardian is not.
    return f'process {process}, which does not answer', process, False


def _serve(server: socket.socket, who: str) -> None:
    """Send a description of the holder to each client, until the claim is released."""
    while True:
        try:
            client, _ = server.accept()
        except OSError:
            return
        with client, contextlib.suppress(OSError):
            client.sendall(who.encode())


@dataclass(frozen=True)
class Claim:
    """
    The claim that one program publishes.

    :param participant: its DDS participant, in hexadecimal digits
    :param state: RELEASED, WANTED or HELD
    :param who: describes the program, and says since when it has the claim
    """

    participant: str
    state: str
    who: str

    def to_json(self) -> str:
        """Return it as text."""
        return json.dumps(asdict(self))

    @staticmethod
    def from_json(text: str) -> Claim | None:
        """Return the claim in a text from the network; None if it is none."""
        try:
            claim = Claim(**json.loads(text))
        except (ValueError, TypeError, RecursionError):
            return None
        if not all(isinstance(value, str) for value in asdict(claim).values()):
            return None
        if claim.state not in (RELEASED, WANTED, HELD):
            return None
        who = ''.join(c if c.isprintable() else '?' for c in claim.who[:MAX_TEXT_LENGTH])
        return Claim(claim.participant[:MAX_TEXT_LENGTH], claim.state, who)


class Claims:
    """
    The claims of other programs, as received.

    :param participant: the DDS participant of this program, in hexadecimal digits
    """

    def __init__(self, participant: str) -> None:
        self._participant = participant
        #: by participant: when it was received [s], and the claim; the oldest first
        self._received: dict[str, tuple[float, Claim]] = {}

    def on_claim(self, claim: Claim, now: float) -> None:
        """Keep a claim that was received [s]; this program's own is ignored."""
        if claim.participant == self._participant:
            return
        self._received.pop(claim.participant, None)
        self._received[claim.participant] = now, claim
        if len(self._received) > MAX_CLAIMS:
            self._received.pop(next(iter(self._received)))

    def holder(self, now: float) -> Claim | None:
        """Return a claim that another program holds; None if none does."""
        return next((claim for claim in self._current(now) if claim.state == HELD), None)

    def blocking_claim(self, now: float) -> Claim | None:
        """
        Return the claim to which this program has to yield while it wants the robot.

        :returns: one that is held, else a wanted one of a lower participant, else None
        """
        wanted = (claim for claim in self._current(now)
                  if claim.state == WANTED and claim.participant < self._participant)
        return self.holder(now) or next(wanted, None)

    def _current(self, now: float) -> list[Claim]:
        # A copy first: another thread receives meanwhile.
        return [claim for received, claim in [*self._received.values()]
                if now - received <= CLAIM_TIMEOUT]
