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
"""The guardian's program: it stops the robot when the driving process cannot."""

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
from kachaka_simple_control.control.timing import DISCOVERY_RETRY_TIMEOUTS, POLL_PERIOD
from kachaka_simple_control.control.waiting import wait_until
from kachaka_simple_control.control.watchdog import GuardianMessage, Watchdog
from kachaka_simple_control.errors import HELD_UP_ADVICE
from kachaka_simple_control.motion.geometry import ZERO
from kachaka_simple_control.ros.endpoints import own_participant
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from rclpy.context import Context
from rclpy.node import Node

#: How many messages are read from the pipe at once [bytes]: more than a minute's.
READ_SIZE = 65536


class GuardianNode:
    """
    A hidden node with a DDS participant and a publisher of velocities of its own.

    :param topic: the topic, resolved already
    :param message_type: Twist or TwistStamped
    :param frame: the frame in the header of a stamped message
    :param domain: the ROS domain
    :param on_participant: called with its DDS participant before the publisher can be seen
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
        """Whether its publisher has a subscriber."""
        return bool(self.publisher.get_subscription_count() > 0)

    def end(self) -> None:
        """Leave the graph."""
        self._node.destroy_node()
        self._context.try_shutdown()


def create_matched_node(
        create: Callable[[], GuardianNode], is_needed: Callable[[], bool]) -> GuardianNode:
    """
    Create the node, and another one each time that no robot is discovered soon; keep the matched.

    Fast DDS announces a participant before it listens.  A robot on the same machine may answer
    before that, answers each newcomer once, and is next discovered when it announces itself, up to
    3 s later.  This happened to every second or fourth participant (measured).

    :param create: creates a node
    :param is_needed: returns whether there is something to do, so that the newest node must stay
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
    Reads the node's messages, and publishes zeros on request or when heartbeats fail.

    :param publisher: the publisher of zeros
    :param shared: memory shared with the node, which holds the ``shared_state``
    :param command_timeout: how long the robot keeps a velocity [s]
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
        Serve until the node is gone or has closed the pipe.

        :param messages: the descriptor to read the node's messages from
        :param signals: a descriptor that becomes readable when this program is to end
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
        # A node that was frozen while it published only seems to publish.
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

    :param args: topic, ROS domain, command timeout [s], type of message and its frame, and two
        descriptors: the node's messages and the memory shared with it
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
        node.end()
    return 0


def _report(line: str) -> None:
    # Not print(): the node may be gone, and its end of the pipe with it.
    with contextlib.suppress(OSError):
        os.write(sys.stdout.fileno(), f'{line}\n'.encode())


def _handle_signals() -> int:
    """Make SIGTERM readable on the returned descriptor, and leave Ctrl+C to the node."""
    reader, _ = wakeup_pipe()
    signal.signal(signal.SIGTERM, lambda *_: None)
    for signum in (signal.SIGINT, signal.SIGHUP):
        signal.signal(signum, signal.SIG_IGN)
    return reader
