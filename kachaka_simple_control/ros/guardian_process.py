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
import socket
import sys

from kachaka_simple_control.control.latch import Latch, SharedFlag
from kachaka_simple_control.control.processes import boottime, is_stopped
from kachaka_simple_control.control.stop import send_stop
from kachaka_simple_control.control.timing import DISCOVERY_RETRY_TIMEOUTS, POLL_PERIOD
from kachaka_simple_control.control.waiting import wait_until
from kachaka_simple_control.control.watchdog import GuardianMessage, Watchdog
from kachaka_simple_control.motion.geometry import ZERO
from kachaka_simple_control.ros.participants import own_participant
from kachaka_simple_control.ros.velocity_publisher import VelocityMessage, VelocityPublisher
from rclpy.context import Context
from rclpy.node import Node


class GuardianNode:
    """A publisher of velocities with a hidden node and a DDS participant of its own."""

    def __init__(
            self, topic: str, message_type: str, frame: str, domain: int,
            introduced: Callable[[bytes], None]) -> None:
        """
        Be there.

        :param topic: where velocities go, resolved already
        :param message_type: Twist or TwistStamped
        :param frame: the frame in the header of a stamped message
        :param domain: the ROS domain
        :param introduced: told its DDS participant, before the publisher is seen
        """
        self._context = Context()
        # No arguments: the topic must not be remapped again.
        self._context.init(args=[], domain_id=domain)
        self._node = node = Node(
            f'_guardian_{os.getpid()}', context=self._context, use_global_arguments=False,
            enable_rosout=False, start_parameter_services=False)
        introduced(own_participant(node))
        message = VelocityMessage(message_type, frame, lambda: node.get_clock().now().to_msg())
        self.publisher = VelocityPublisher(node, topic, message)

    @property
    def is_matched(self) -> bool:
        """Whether somebody subscribes to what it publishes."""
        return bool(self.publisher.get_subscription_count() > 0)

    def end(self) -> None:
        """Leave the graph."""
        self._node.destroy_node()
        self._context.try_shutdown()


def create_matched_node(
        enter: Callable[[], GuardianNode], is_wanted: Callable[[], bool]) -> GuardianNode:
    """
    Be there, and be there anew if no robot answers soon.

    Fast DDS sends its greeting before it listens.  A robot on the same machine may be quicker
    with its answer than that, answers each newcomer once, and is next heard of when it announces
    itself: up to 3 s later.  Every fourth newcomer was seen to wait for that.

    :param enter: makes a new presence
    :param is_wanted: whether there is something else to do, so that it stays as it is
    :returns: the presence that is left
    """
    for patience in DISCOVERY_RETRY_TIMEOUTS:
        presence = enter()
        if wait_until(_either(presence, is_wanted), patience):
            return presence
        presence.end()
    return enter()


def _either(presence: GuardianNode, is_wanted: Callable[[], bool]) -> Callable[[], bool]:
    return lambda: presence.is_matched or is_wanted()


#: Enough for minutes of signs.
PIPE = 65536


class GuardianProcess:
    """Listens to its node's signs, and publishes zeros: on request, or when signs fail."""

    def __init__(self, publisher: VelocityPublisher, shared: memoryview, hold: float) -> None:
        """
        Have heard nothing yet.

        :param publisher: where zeros go
        :param shared: the node's memory: the latch, which is set before the first zero of a stop,
            and the flag that is up while the node hands a message to DDS or asks it something
        :param hold: how long the robot keeps a velocity without a new one [s]
        """
        self._publisher = publisher
        self._latch, self._sending = Latch(shared[:1]), SharedFlag(shared[1:2])
        self._hold = hold
        self._node = os.getppid()
        self._watchdog = Watchdog()
        self._is_matched = False

    def serve(self, signs: int, endings: int) -> None:
        """
        Serve until the node is gone or has closed the pipe.

        :param signs: the descriptor that signs are read from
        :param endings: a descriptor that becomes readable when this program is to end
        """
        while not self._watchdog.is_over:
            readable, _, _ = select.select([signs, endings], [], [], self._patience())
            now = boottime()
            if endings in readable:
                self._lost('the guardian was told to end')
            elif signs in readable:
                self._hear(os.read(signs, PIPE), now)
            elif self._watchdog.has_timed_out(now, self._waits_for_dds()):
                self._stop('the node fell silent')
            self._look_for_a_subscriber()

    def _waits_for_dds(self) -> bool:
        # One that was frozen just then only seems to wait.
        return self._sending.is_set and not is_stopped(self._node)

    def _patience(self) -> float | None:
        patience = self._watchdog.timeout()
        if self._is_matched:
            return patience
        return POLL_PERIOD if patience is None else min(POLL_PERIOD, patience)

    def _hear(self, heard: bytes, now: float) -> None:
        if not heard:
            self._lost('the node is gone')
        for value in heard:
            sign = bytes([value])
            self._watchdog.on_message(sign, now)
            if sign == GuardianMessage.PRIME:
                self._zero()
                _say('primed')

    def _lost(self, why: str) -> None:
        if self._watchdog.on_disconnect():
            self._stop(why)

    def _stop(self, why: str) -> None:
        self._latch.trip()
        _say(f'stopped {why}')
        send_stop(self._zero, self._hold)

    def _zero(self) -> bool:
        self._publisher.transmit(ZERO)
        return True

    def _look_for_a_subscriber(self) -> None:
        if not self._is_matched and self._publisher.get_subscription_count() > 0:
            self._is_matched = True
            _say('matched')


def main(args: Sequence[str] | None = None) -> int:
    """
    Be a guardian.

    :param args: topic, ROS domain, hold [s], type of message and its frame, and two descriptors:
        signs and the memory shared with the node
    :returns: the exit code
    """
    parser = argparse.ArgumentParser()
    for name, kind in (
            ('topic', str), ('domain', int), ('hold', float), ('type', str), ('frame', str),
            ('signs', int), ('shared', int)):
        parser.add_argument(name, type=kind)
    options = parser.parse_args(args)
    endings = _hear_signals()
    shared = memoryview(mmap.mmap(options.shared, mmap.PAGESIZE))
    presence = create_matched_node(
        lambda: GuardianNode(options.topic, options.type, options.frame, options.domain,
        _introduced),
        lambda: _is_readable(options.signs, endings))
    try:
        GuardianProcess(presence.publisher, shared, options.hold).serve(options.signs, endings)
    finally:
        presence.end()
    return 0


def _introduced(participant: bytes) -> None:
    _say(f'participant {participant.hex()}')


def _is_readable(*descriptors: int) -> bool:
    return bool(select.select(descriptors, [], [], 0.0)[0])


def _say(line: str) -> None:
    # Not print(): the node may be gone, and its end of the pipe with it.
    with contextlib.suppress(OSError):
        os.write(sys.stdout.fileno(), f'{line}\n'.encode())


def _hear_signals() -> int:
    """Make SIGTERM readable on a descriptor; leave Ctrl+C to the node."""
    reader, writer = socket.socketpair()
    writer.setblocking(False)
    signal.set_wakeup_fd(writer.detach(), warn_on_full_buffer=False)
    signal.signal(signal.SIGTERM, lambda *_: None)
    for signum in (signal.SIGINT, signal.SIGHUP):
        signal.signal(signum, signal.SIG_IGN)
    return reader.detach()
