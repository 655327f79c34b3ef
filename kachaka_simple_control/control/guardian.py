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
The node's interface to the guardian: one process for all robots of a ROS context.

Node and guardian share memory, in which each robot has a slot, and each thread that drives has a
heartbeat.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Sequence
import contextlib
import json
import os
import socket
import subprocess
import tempfile
import threading

from kachaka_simple_control.control.guardian_memory import (
    GuardianMemory,
    Latch,
    RobotSlot,
    SharedFlag,
)
from kachaka_simple_control.control.preparation import Moment, Steps, until
from kachaka_simple_control.control.timing import (
    GUARDIAN_EXIT_TIMEOUT,
    GUARDIAN_START_TIMEOUT,
    GUARDIAN_TIMEOUT,
    STOP_MARGIN,
)
from kachaka_simple_control.control.watchdog import GuardianMessage, GuardianWatch
from kachaka_simple_control.errors import HELD_UP_ADVICE, RunFaultError, UsageError
from kachaka_simple_control.process.processes import boottime, call_in_forked_children

#: How long the node waits for space in the guardian's socket when it adds a robot [s].  The
#: socket is full after 200 robots, and the guardian reads nothing while it starts.
ADD_TIMEOUT = 5.0


class NullGuardian:
    """Replaces ``Guardian`` if the ROS parameter ``guardian`` is false: there is no process."""

    participants: frozenset[bytes] = frozenset()
    has_searched = is_matched = True
    stopped_because: str | None = None
    has_ended = False
    shared_memory: tuple[int, int] | None = None

    def __init__(self) -> None:
        self.latch, self.sending = Latch(), SharedFlag()
        self.prime_count = 0

    def prime(self) -> None:
        """Add 1 to ``prime_count``, for which the caller waits, although nothing is published."""
        self.prime_count += 1

    def unmatched(self, _: set[bytes]) -> set[bytes]:
        """Return an empty set, because there is no guardian that has to match a subscriber."""
        return set()

    def found_publishers(self, _: str) -> set[bytes]:
        """Return an empty set, because there is no guardian that searches for publishers."""
        return set()

    def follow(self, _: dict[GuardianProcess, Heartbeat]) -> None:
        """Do nothing, because there is no guardian: no separate process checks heartbeats."""

    def check(self) -> None:
        """Do nothing, because there is no guardian that could have ended."""

    report_stopping = report_stopped = check

    def leave(self, _: Moment) -> Steps[None]:
        """Do nothing, because there is no guardian that sends to the robot."""
        yield from ()


class Heartbeat:
    """
    The heartbeat of a thread that drives, for the robots of one guardian process.

    :param number: that of the thread in the shared memory
    """

    def __init__(self, memory: GuardianMemory, number: int) -> None:
        self.number = number
        self._memory = memory
        self._watch = GuardianWatch()
        #: whether the guardian has checked no heartbeat for GUARDIAN_TIMEOUT
        self.is_guardian_frozen = False
        # Before a slot refers to it: the thread that had this number may have ended long ago.
        self.write(boottime())

    def write(self, now: float) -> None:
        """Report that the thread still works; ``now`` is in s since boot."""
        self.is_guardian_frozen = self._watch.is_frozen(now, self._memory.check_count)
        self._memory.write_heartbeat(self.number, now)


def begin_heartbeat(guardians: Iterable[Guardian | NullGuardian]) -> Callable[[], None]:
    """
    Let one heartbeat count for all robots of a thread, from now on.

    :returns: writes the heartbeat; only this thread may call it
    """
    heartbeats: dict[GuardianProcess, Heartbeat] = {}
    for guardian in guardians:
        guardian.follow(heartbeats)

    def write() -> None:
        now = boottime()
        for heartbeat in heartbeats.values():
            heartbeat.write(now)

    return write


class Guardian:
    """
    The node's interface to the guardian, for one robot.

    The guardian watches the node from the first heartbeat of a drive until the end of the stop is
    reported.  If the node ends or is silent for too long meanwhile, it sets the latch and stops
    the robot.
    """

    def __init__(
            self, process: GuardianProcess, number: int, slot: RobotSlot,
            command_timeout: float) -> None:
        self._process, self._slot = process, slot
        #: the number of the robot's slot in the shared memory
        self.number = number
        #: how long the guardian may take to leave the robot, with a complete stop before [s]
        self.leave_timeout = command_timeout + STOP_MARGIN + GUARDIAN_EXIT_TIMEOUT
        #: that of the thread of the newest drive; None before the first
        self._heartbeat: Heartbeat | None = None
        #: whether the newest message was a heartbeat, so that the guardian now reads heartbeats
        #: from the memory
        self.is_watching = False
        self.latch, self.sending = slot.latch, slot.sending
        #: number of zero velocities that the guardian has published on request
        self.prime_count = 0
        #: the participants of the subscribers that the guardian's publisher has matched
        self._subscribers: frozenset[bytes] = frozenset()
        #: why the guardian stopped the robot; None if it did not
        self.stopped_because: str | None = None
        #: set when the guardian can no longer send to the robot
        self.has_left = threading.Event()

    @property
    def participants(self) -> set[bytes]:
        """Return the guardian's DDS participants; if none is found in time, it joins once more."""
        return self._process.participants

    @property
    def has_ended(self) -> bool:
        """Whether the guardian, a separate process, has ended; then no robot may be driven."""
        return self._process.has_ended

    @property
    def has_searched(self) -> bool:
        """Whether the guardian's search for velocity publishers is over, or the guardian ended."""
        return self._process.has_searched or self._process.has_ended

    def found_publishers(self, topic: str) -> set[bytes]:
        """Return the participants of velocity publishers that the search at its start found."""
        # A copy: another thread may still add to the set.
        return {participant for participant, name in [*self._process.found_publishers]
                if name == topic}

    @property
    def shared_memory(self) -> tuple[int, int] | None:
        """Return the descriptor of the shared memory, and the slot; None without guardian."""
        file = self._process.shared_file
        return None if file is None else (file, self.number)

    def prime(self) -> None:
        """
        Ask the guardian to publish one zero: a new publisher's first messages may be lost.

        :raises RunFaultError: if the guardian has ended
        """
        self._process.send(self, GuardianMessage.PRIME)

    def follow(self, heartbeats: dict[GuardianProcess, Heartbeat]) -> None:
        """
        Let the heartbeat of a thread count for this robot, and no other one any more.

        :param heartbeats: those of the thread, by guardian process; a missing one is added
        """
        if self._process not in heartbeats:
            heartbeats[self._process] = self._process.add_heartbeat()
        heartbeat = heartbeats[self._process]
        self._slot.thread, self._heartbeat = heartbeat.number, heartbeat

    def check(self) -> None:
        """
        Check that the guardian works; the first check of a drive makes it watch the robot.

        :raises RunFaultError: if the guardian has ended or is frozen
        """
        assert self._heartbeat is not None
        if self._heartbeat.is_guardian_frozen:
            raise RunFaultError(
                f'the guardian has not answered for {GUARDIAN_TIMEOUT:g} s: it was held up, '
                f'{HELD_UP_ADVICE}')
        # The first heartbeat wakes the guardian.  If it has ended, the message fails.
        if not self.is_watching or self._process.has_ended:
            self._process.send(self, GuardianMessage.HEARTBEAT)

    def report_stopping(self) -> None:
        """Report that the drive is over, and that the node now sends zero velocities."""
        self._report(GuardianMessage.STOPPING)

    def report_stopped(self) -> None:
        """Report that all zeros of a stop were sent: the guardian need not stop the robot now."""
        self._report(GuardianMessage.STOPPED)

    def leave(self, moment: Moment) -> Steps[None]:
        """
        End the guardian's work for this robot, and wait until it can no longer send.

        It first stops the robot if ``report_stopped`` was not called after the last drive.
        """
        yield from self._process.remove(self, moment)

    def detach(self) -> None:
        """Go on with a copy of the robot's slot: the guardian has left the robot."""
        self._slot.detach()

    @property
    def is_matched(self) -> bool:
        """Whether the guardian's publisher has matched a subscriber."""
        return bool(self._subscribers)

    def unmatched(self, subscribers: set[bytes]) -> set[bytes]:
        """Return those of the participants that the guardian's publisher has not matched yet."""
        return subscribers - self._subscribers

    def on_report(self, word: str, value: str) -> None:
        """
        Process a line that the guardian has printed about this robot.

        :param word: ``primed`` (a zero was published on request), ``matched`` (with the
            participants of all subscribers), ``stopped`` (with the reason) or ``left`` (it sends
            no more)
        """
        if word == 'primed':
            self.prime_count += 1
        elif word == 'matched':
            self._subscribers = frozenset(map(bytes.fromhex, value.split()))
        elif word == 'stopped':
            self.stopped_because = value
        elif word == 'left':
            self.has_left.set()

    def _report(self, message: GuardianMessage) -> None:
        with contextlib.suppress(RunFaultError):
            self._process.send(self, message)


class GuardianProcess:
    """
    Starts the guardian process, and sends messages to it.

    It runs in its own session (``setsid``), so Ctrl+C does not reach it.  The messages go through
    a pipe, whose end shows it that the node has ended; a forked child of the node closes its copy
    of the pipe at once for that reason.

    :param command: starts the guardian; its last arguments are three descriptors: the pipe for
        messages, the socket for descriptions of robots, and the file of the shared memory
    """

    def __init__(self, command: Sequence[str], environment: dict[str, str]) -> None:
        #: DDS participants of the guardian; several if it has joined the graph again
        self.participants: set[bytes] = set()
        #: velocity publishers that the search at the start has found: DDS participant and topic
        self.found_publishers: set[tuple[bytes, str]] = set()
        #: whether this search is over
        self.has_searched = False
        #: whether the process has ended
        self.has_ended = False
        self._guardians: dict[int, Guardian] = {}
        #: the newest numbers of a slot and of a thread
        self._number = self._thread = 0
        self._adding, self._writing = threading.Lock(), threading.Lock()
        with tempfile.TemporaryFile() as file:
            file.truncate(GuardianMemory.SIZE)
            self.memory = GuardianMemory(file.fileno())
            #: file descriptor of the shared memory; None after the process has ended
            self.shared_file: int | None = os.dup(file.fileno())
            messages, self._pipe = os.pipe()
            os.set_blocking(self._pipe, False)
            robots, self._robots = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            self._robots.settimeout(ADD_TIMEOUT)
            call_in_forked_children(self._close_in_child)
            kept = (messages, robots.fileno(), file.fileno())
            self._process = subprocess.Popen(
                [*command, *map(str, kept)], env=environment, pass_fds=kept,
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, start_new_session=True,
                text=True)
            os.close(messages)
            robots.close()
        threading.Thread(target=self._read_output, name='guardian', daemon=True).start()

    def add(
            self, topic: str, command_timeout: float, message_type: str, frame: str,
            claim: int) -> Guardian | None:
        """
        Make the guardian process guard one more robot.

        :param claim: the descriptor of the claim, which the guardian keeps open while it guards
        :returns: None if the guardian has ended, or does not read the robot's description in time
        :raises UsageError: if the process guards MAX_ROBOTS robots already
        """
        with self._adding:
            if self._pipe < 0 or self.has_ended:
                return None
            if len(self._guardians) == GuardianMemory.MAX_ROBOTS:
                raise UsageError(
                    f'a guardian stops at most {GuardianMemory.MAX_ROBOTS} robots: drive the '
                    'others from another program')
            self._number = number = _next_number(
                self._number, GuardianMemory.MAX_ROBOTS, self._guardians)
            slot = self.memory.slot(number)
            slot.clear()
            guardian = self._guardians[number] = Guardian(self, number, slot, command_timeout)
            robot = json.dumps([number, topic, command_timeout, message_type, frame])
            try:
                socket.send_fds(self._robots, [robot.encode()], [claim])
            except OSError:
                del self._guardians[number]
                return None
            return guardian

    def add_heartbeat(self) -> Heartbeat:
        """Make the heartbeat of a thread that drives; no slot refers to its number yet."""
        with self._writing:  # never held for long
            self._thread = _next_number(
                self._thread, GuardianMemory.MAX_THREADS,
                {self.memory.slot(number).thread for number in [*self._guardians]})
            return Heartbeat(self.memory, self._thread)

    def remove(self, guardian: Guardian, moment: Moment) -> Steps[None]:
        """
        End the guardian's work for one robot; after the last robot, end the guardian process.

        Wait until it can no longer send to the robot.  If it does not answer in time, it is
        killed, and the drives of all other robots end with an error; one that has not started yet
        gets more time if there are other robots.
        """
        with contextlib.suppress(RunFaultError):
            self.send(guardian, GuardianMessage.LEAVE)
        timeout = guardian.leave_timeout
        # It reports its participant when it has started.
        if len(self._guardians) > 1 and not self.participants:
            timeout += GUARDIAN_START_TIMEOUT
        if not (yield from until(
                moment, guardian.has_left.is_set, 'the guardian', timeout)):
            self._process.kill()
        guardian.detach()
        with self._adding:
            self._guardians.pop(guardian.number, None)
            if self._guardians:
                return
            self._close()
            self.memory.detach()
        self._wait()
        if self.shared_file is not None:
            os.close(self.shared_file)
            self.shared_file = None

    def send(self, guardian: Guardian, message: GuardianMessage) -> None:
        """
        Send a message about one robot to the guardian process.

        :raises RunFaultError: if it has ended, reads nothing, or no longer guards this robot
        """
        # Its slot may belong to another robot by now.
        has_left = self._guardians.get(guardian.number) is not guardian
        try:
            with self._writing:
                # Under the lock: the end of a drive may be reported while the next drive begins.
                guardian.is_watching = message is GuardianMessage.HEARTBEAT
                os.write(-1 if has_left else self._pipe, bytes([guardian.number]) + message.value)
        except OSError as error:
            # If the pipe is broken, the guardian has ended.  If it is full, the guardian has not
            # read for minutes.
            raise RunFaultError(
                f'the guardian is gone ({error.strerror}), so the motion was ended') from None

    def _read_output(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for line in lines:
                word, _, value = line.strip().partition(' ')
                if word == 'participant':
                    self.participants.add(bytes.fromhex(value))
                    continue
                if word == 'searched':
                    self.has_searched = True
                    continue
                number, _, value = value.partition(' ')
                if word == 'publisher':
                    self.found_publishers.add((bytes.fromhex(number), value))
                    continue
                # Fast DDS may print a message of its own.
                guardian = self._guardians.get(int(number)) if number.isdigit() else None
                if guardian is not None:
                    guardian.on_report(word, value)
        self.has_ended = True
        for guardian in [*self._guardians.values()]:
            guardian.has_left.set()

    def _wait(self) -> None:
        """Wait until the guardian process has ended; after GUARDIAN_EXIT_TIMEOUT, kill it."""
        try:
            self._process.wait(GUARDIAN_EXIT_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _close(self) -> None:
        with self._writing:
            pipe, self._pipe = self._pipe, -1
        if pipe >= 0:
            os.close(pipe)
            self._robots.close()

    def _close_in_child(self) -> None:
        # A new lock: if another thread held the old one at the fork, it stays locked in the child.
        self._writing = threading.Lock()
        self._close()


def _next_number(number: int, largest: int, used: Container[int]) -> int:
    """Return the next number that is not used: each as late as possible after its last use."""
    # Others may still read the old values, or write them.
    while (number := number % largest + 1) in used:
        pass
    return number
