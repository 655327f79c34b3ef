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
"""The program of the guardian: it stops the robot if the driving process cannot."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
import contextlib
import mmap
import os
import select
import signal
import sys
import time

from kachaka_simple_control.control.guardian import shared_state
from kachaka_simple_control.control.processes import boottime, is_stopped
from kachaka_simple_control.control.signals import wakeup_pipe
from kachaka_simple_control.control.stop import send_stop
from kachaka_simple_control.control.timing import (
    DISCOVERY_RETRY_TIMEOUTS,
    GUARDIAN_EXIT_TIMEOUT,
    POLL_PERIOD,
)
from kachaka_simple_control.control.waiting import wait_until
from kachaka_simple_control.control.watchdog import GuardianMessage, Watchdog
from kachaka_simple_control.errors import HELD_UP_ADVICE
from kachaka_simple_control.motion.geometry import ZERO
from kachaka_simple_control.ros.endpoints import own_participant
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from rclpy.context import Context
from rclpy.node import Node

#: How many messages are read from the pipe at once [bytes]: more than arrive in a minute.
READ_SIZE = 65536


class GuardianNode:
    """
    The hidden node of the guardian, with its own DDS participant and velocity publisher.

    :param topic: the velocity topic, after remapping
    :param message_type: Twist or TwistStamped
    :param frame: the frame in the header of a stamped message
    :param domain: the ROS domain
    :param on_participant: called with the DDS participant before the publisher is created
    """

    def __init__(
            self, topic: str, message_type: str, frame: str, domain: int,
            on_participant: Callable[[bytes], None]) -> None:
        self._context = Context()
        # Without arguments: the topic must not be remapped again.
        self._context.init(args=[], domain_id=domain)
        self._node = node = Node(
            f'_guardian_{os.getpid()}', context=self._context, use_global_arguments=False,
            enable_rosout=False, start_parameter_services=False)
        on_participant(own_participant(node))
        self.publisher = VelocityPublisher(node, topic, message_type, frame)

    @property
    def is_matched(self) -> bool:
        """Whether the velocity publisher has a subscriber."""
        return bool(self.publisher.get_subscription_count() > 0)

    def end(self) -> None:
        """Destroy the node and shut down its context."""
        self._node.destroy_node()
        self._context.try_shutdown()


def create_matched_node(
        create: Callable[[], GuardianNode], is_needed: Callable[[], bool]) -> GuardianNode:
    """
    Create nodes until one is matched with a robot, and return the matched node.

    If a node is not matched within a timeout, the next node is created.  All other nodes are
    destroyed at the end.  If no node is matched, the newest node is returned.

    The reason: Fast DDS announces a participant before it listens.  A robot on the same machine
    answers each new participant once.  If the answer comes too early, it is lost.  Then the robot
    is discovered at its next announcement, up to 3 s later.  This happened to every second or
    fourth participant (measured).

    :param create: creates a node
    :param is_needed: returns whether the guardian has work to do; then no further node is created
    """
    nodes: list[GuardianNode] = []
    for timeout in DISCOVERY_RETRY_TIMEOUTS:
        nodes.insert(0, create())
        if wait_until(
                lambda: any(node.is_matched for node in nodes) or is_needed(), timeout):
            break
    kept = next((node for node in nodes if node.is_matched), nodes[0])
    for node in nodes:
        if node is not kept:
            node.end()
    return kept


class GuardianProgram:
    """
    Reads the messages of the node, and publishes zeros on request or if heartbeats stop.

    :param publisher: the publisher of the zeros
    :param shared: the memory that is shared with the node and holds the ``shared_state``
    :param command_timeout: the command timeout: how long the robot keeps a velocity [s]
    """

    def __init__(
            self, publisher: VelocityPublisher, shared: memoryview,
            command_timeout: float) -> None:
        self._publisher = publisher
        self._latch, self._publishing, self._served = shared_state(shared)
        self._command_timeout = command_timeout
        self._node_pid = os.getppid()
        self._watchdog = Watchdog()
        self._is_matched = False

    def serve(self, messages: int, signals: int) -> None:
        """
        Run until the node has ended or has closed the pipe.

        :param messages: the file descriptor from which the messages of the node are read
        :param signals: a file descriptor that becomes readable when this program must end
        """
        while not self._watchdog.is_over:
            readable, _, _ = select.select([messages, signals], [], [], self._timeout())
            now = boottime()
            if signals in readable:
                self._on_disconnect('the guardian was told to end')
            elif messages in readable:
                self._on_messages(os.read(messages, READ_SIZE), now)
            elif self._watchdog.has_timed_out(now, self._node_is_publishing()):
                self._stop(
                    f'the node sent no heartbeat for {self._watchdog.allowed:g} s: the program '
                    f'was held up, {HELD_UP_ADVICE}')
            self._report_match()

    def _node_is_publishing(self) -> bool:
        # If the node was frozen while it published, its flag is still set: it does not publish.
        return self._publishing.is_set and not is_stopped(self._node_pid)

    def _timeout(self) -> float | None:
        timeout = self._watchdog.timeout()
        if self._is_matched:
            return timeout
        return POLL_PERIOD if timeout is None else min(POLL_PERIOD, timeout)

    def _on_messages(self, data: bytes, now: float) -> None:
        if not data:
            self._on_disconnect('the node is gone')
        for value in data:
            message = bytes([value])
            self._watchdog.on_message(message, now)
            if message == GuardianMessage.HEARTBEAT:
                self._served.increment()
            if message == GuardianMessage.PRIME:
                self._send_zero()
                _report('primed')

    def _on_disconnect(self, reason: str) -> None:
        if self._watchdog.on_disconnect():
            self._stop(reason)

    def _stop(self, reason: str) -> None:
        self._latch.trip(time.monotonic())
        _report(f'stopped {reason}')
        send_stop(self._send_zero, self._command_timeout)

    def _send_zero(self) -> bool:
        self._publisher.transmit(ZERO)
        return True

    def _report_match(self) -> None:
        if not self._is_matched and self._publisher.get_subscription_count() > 0:
            self._is_matched = True
            _report('matched')


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the guardian.

    :param args: the topic, the ROS domain, the command timeout [s], the message type, its frame,
        and two file descriptors: the messages of the node, and the memory shared with the node
    :returns: the exit code
    """
    parser = argparse.ArgumentParser()
    for name, kind in (
            ('topic', str), ('domain', int), ('command_timeout', float), ('type', str),
            ('frame', str), ('messages', int), ('shared', int)):
        parser.add_argument(name, type=kind)
    options = parser.parse_args(args)
    signals = _handle_signals()
    shared = memoryview(mmap.mmap(options.shared, mmap.PAGESIZE))
    node = create_matched_node(
        lambda: GuardianNode(
            options.topic, options.type, options.frame, options.domain,
            lambda participant: _report(f'participant {participant.hex()}')),
        lambda: bool(select.select([options.messages, signals], [], [], 0.0)[0]))
    try:
        program = GuardianProgram(node.publisher, shared, options.command_timeout)
        program.serve(options.messages, signals)
    finally:
        # Measured: 1 of 80 guardians never returned from Fast DDS here after its node was killed,
        # and kept the claim on the robot.  The alarm ends the process.
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_REAL, GUARDIAN_EXIT_TIMEOUT)
        node.end()
    return 0


def _report(line: str) -> None:
    # Not print(): the node may have ended, and then its end of the pipe is closed.
    with contextlib.suppress(OSError):
        os.write(sys.stdout.fileno(), f'{line}\n'.encode())


def _handle_signals() -> int:
    """
    Handle SIGTERM, and ignore SIGINT and SIGHUP: the node handles them.

    :returns: a file descriptor that becomes readable at SIGTERM
    """
    reader, _ = wakeup_pipe()
    signal.signal(signal.SIGTERM, lambda *_: None)
    for signum in (signal.SIGINT, signal.SIGHUP):
        signal.signal(signum, signal.SIG_IGN)
    return reader
