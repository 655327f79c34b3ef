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
Claims on a robot: only the program that holds the claim drives the robot.

A ``MachineClaim`` works between the programs on one machine.  ``Claims`` stores the claims that
programs on all machines publish.
"""

from __future__ import annotations

import contextlib
from dataclasses import asdict, dataclass
import errno
import hashlib
import json
import os
import selectors
import socket
import struct
import sys
import threading
import weakref

from kachaka_simple_control.control.preparation import Moment, pause, Steps
from kachaka_simple_control.control.timing import (
    CLAIM_ANSWER_TIMEOUT,
    CLAIM_RETRY_PERIOD,
    CLAIM_TIMEOUT,
    GUARDIAN_LEAVE_TIMEOUT,
)
from kachaka_simple_control.process.processes import call_in_forked_children, is_running

#: The binary format of the result of ``SO_PEERCRED``: the numbers of process, user and group.
CREDENTIALS = struct.Struct('3i')
#: The longest description of the holder of a claim that is read [bytes].
MAX_DESCRIPTION_BYTES = 1000
#: The largest number of claims that are kept in memory.  The network may deliver more.
MAX_CLAIMS = 64
#: A longer text from the network is cut to this length [characters].
MAX_TEXT_LENGTH = 200
#: The states of a claim.  RELEASED: the program does not claim the robot.  WANTED: the program
#: requests the robot, and gets it if no other claim prevents this.  HELD: the program has the
#: robot, and keeps it until the program ends.
RELEASED, WANTED, HELD = 'nothing', 'wanted', 'held'


class ClaimedError(Exception):
    """
    A claim on a robot cannot be taken, because another program or node holds it already.

    :param holder: who holds it, if possible since when; the text of the error
    :param is_own: whether the holder is another node in this process
    """

    def __init__(self, holder: str, is_own: bool) -> None:
        super().__init__(holder)
        self.is_own = is_own


class MachineClaim:
    """
    A claim on one robot, which lets only one program on this machine drive the robot.

    It is an abstract Unix socket that is bound to a name.  The kernel gives a name to one socket
    at a time, and frees it when all processes that have the socket open have ended, normally or
    not. The guardian inherits the socket, so the claim of a killed program lasts until its robot
    was stopped.  A frozen program keeps its claim.  Without abstract sockets (only Linux has them)
    every claim is granted.
    """

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        self._is_held = False
        _answers.join(self._socket)
        self._leave = weakref.finalize(self, _answers.leave, self._socket)
        self._leave.atexit = False
        call_in_forked_children(self._close_in_child)

    def fileno(self) -> int:
        """Return the descriptor of the socket; a process that inherits it keeps the claim."""
        return self._socket.fileno()

    def _close_in_child(self) -> None:
        self._socket.close()

    def take(self, moment: Moment, name: str, who: str) -> Steps[None]:
        """
        Take the claim on a robot, unless this object holds it already.

        The guardian of a holder that has ended may still stop the robot: wait for it, up to
        GUARDIAN_LEAVE_TIMEOUT.

        :param who: what other programs show to their users: one line, at most 1000 bytes
        :raises ClaimedError: if another program, or another node in this process, holds the claim
        """
        if self._is_held or not sys.platform.startswith('linux'):
            return
        end = moment.now + GUARDIAN_LEAVE_TIMEOUT
        address = _address(name)
        while not self._bind(address):
            holder, process, is_answering = _holder(address)
            if is_answering or process == 0 or is_running(process) or moment.now > end:
                raise ClaimedError(holder, process == os.getpid())
            yield from pause(moment, CLAIM_RETRY_PERIOD, 'the guardian of the program before')
        self._is_held = True
        _answers.serve(self._socket, who)

    def release(self) -> None:
        """Close the socket for good; a child that has inherited it keeps the claim."""
        self._leave()
        # The guardian may still have it open, and those that connect must not wait for an answer.
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
    # An address has at most 107 bytes, and a topic name may be longer.
    digest = hashlib.sha256(name.encode()).hexdigest()
    return f'\0kachaka_simple_control/claim/{digest[:32]}'.encode()


def _holder(address: bytes) -> tuple[str, int, bool]:
    """
    Ask the holder of a claim, a program on this machine, to describe itself.

    :returns: its description, its process number, and whether it answered in time.  The number is
        0 if it has process numbers of its own (in a container), -1 if it does not listen yet or
        has ended
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
    # The holder is frozen, or it has ended and its guardian still runs.
    return f'process {process}, which does not answer', process, False


class _Answers:
    """Describes this program to those that ask for its claims, in one thread for all of them."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Begin without any claim; also in a forked child, which has none of its parent's."""
        self._lock = threading.Lock()
        self._sockets: set[socket.socket] = set()
        self._selector: selectors.BaseSelector | None = None

    def join(self, server: socket.socket) -> None:
        """Prepare to answer at a socket, which is not bound yet."""
        with self._lock:
            self._sockets.add(server)
            if self._selector is None:
                self._selector = selectors.DefaultSelector()
                reader, self._writer = socket.socketpair()
                self._selector.register(reader, selectors.EVENT_READ)
                # Started here, because since Python 3.12 no thread can start after the main thread
                # has ended, and another thread may begin to drive then.
                threading.Thread(
                    target=self._run, args=(self._selector, reader), name='claims, this machine',
                    daemon=True).start()

    def serve(self, server: socket.socket, who: str) -> None:
        """
        Answer at a socket that listens now.

        :param who: the answer
        """
        with self._lock:
            if self._selector is not None:
                server.setblocking(False)
                self._selector.register(server, selectors.EVENT_READ, who.encode())

    def leave(self, server: socket.socket) -> None:
        """Answer no more at a socket; end the thread after the last one."""
        with self._lock:
            self._sockets.discard(server)
            if self._selector is None:
                return
            with contextlib.suppress(KeyError, ValueError):  # it was never served
                self._selector.unregister(server)
            if not self._sockets:
                self._selector = None
                self._writer.close()

    @staticmethod
    def _run(selector: selectors.BaseSelector, closed: socket.socket) -> None:
        with selector, closed:
            while True:
                for key, _ in selector.select():
                    if key.fileobj is closed:
                        return
                    assert isinstance(key.fileobj, socket.socket)
                    with contextlib.suppress(OSError):  # the client is gone already
                        client, _ = key.fileobj.accept()
                        with client:
                            client.sendall(key.data)


_answers = _Answers()
os.register_at_fork(after_in_child=_answers.begin)


@dataclass(frozen=True)
class Claim:
    """
    A claim on a robot, in the form in which a program publishes it on the network.

    :param state: RELEASED, WANTED or HELD
    """

    participant: str
    state: str
    who: str

    def to_json(self) -> str:
        """Return the claim as JSON text, which ``from_json`` can read."""
        return json.dumps(asdict(self))

    @staticmethod
    def from_json(text: str) -> Claim | None:
        """Return the claim that a text from the network describes; None if the text is invalid."""
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
    """The claims on a robot that other programs published during the last CLAIM_TIMEOUT."""

    def __init__(self, participant: str) -> None:
        self._participant = participant
        #: the time of reception [s] and the claim, by participant; the oldest claim is first
        self._received: dict[str, tuple[float, Claim]] = {}

    def on_claim(self, claim: Claim, now: float) -> None:
        """Store a claim that was received from the network; ignore this program's own claim."""
        if claim.participant == self._participant:
            return
        self._received.pop(claim.participant, None)
        self._received[claim.participant] = now, claim
        if len(self._received) > MAX_CLAIMS:
            self._received.pop(next(iter(self._received)))

    def holder(self, now: float) -> Claim | None:
        """Return the newest HELD claim of another program; None if there is none."""
        return next((claim for claim in self._current(now) if claim.state == HELD), None)

    def blocking_claim(self, now: float) -> Claim | None:
        """
        Return the claim of another program that keeps the robot from this one; None without one.

        If several want the robot at the same time, the one whose DDS participant comes first in
        alphabetical order gets it.
        """
        wanted = (claim for claim in self._current(now)
                  if claim.state == WANTED and claim.participant < self._participant)
        return self.holder(now) or next(wanted, None)

    def _current(self, now: float) -> list[Claim]:
        # Work on a copy: another thread adds claims at the same time.
        return [claim for received, claim in [*self._received.values()]
                if now - received <= CLAIM_TIMEOUT]
