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
The program of the guardian, which stops robots if the program that drives them cannot.

It has its own DDS participants, so it can still publish after the driving program has ended.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Collection, Iterator, Sequence
import contextlib
from functools import partial
import json
import math
import os
import select
import signal
import socket
import sys
import threading
import time

from kachaka_simple_control.control.guardian import GuardianMemory, RobotSlot
from kachaka_simple_control.control.processes import boottime, is_stopped
from kachaka_simple_control.control.signals import run_in_threads, wakeup_pipe
from kachaka_simple_control.control.stop import send_stop
from kachaka_simple_control.control.timing import (
    DISCOVERY_RETRY_TIMEOUTS,
    GUARDIAN_EXIT_TIMEOUT,
    POLL_PERIOD,
)
from kachaka_simple_control.control.watchdog import GuardianMessage, Watchdog
from kachaka_simple_control.errors import HELD_UP_ADVICE
from kachaka_simple_control.motion.geometry import ZERO
from kachaka_simple_control.ros.endpoints import own_participant
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from rclpy.context import Context
from rclpy.node import Node

#: How many bytes are read from the pipe at once: more than arrive in a minute.  An even number,
#: because a message has two bytes.
READ_SIZE = 65536
#: The longest description of a robot [bytes]; a topic name has at most 255 characters.
MAX_ROBOT_SIZE = 4096


class GuardianNode:
    """
    A hidden node of the guardian, with its own DDS participant.

    :param domain: the ROS domain
    :param on_participant: called with the DDS participant before a publisher is created
    """

    def __init__(self, domain: int, on_participant: Callable[[bytes], None]) -> None:
        self._context = Context()
        # Without arguments: the topics must not be remapped again.
        self._context.init(args=[], domain_id=domain)
        self.node = Node(
            f'_guardian_{os.getpid()}', context=self._context, use_global_arguments=False,
            enable_rosout=False, start_parameter_services=False)
        on_participant(own_participant(self.node))

    def end(self) -> None:
        """Destroy the node and shut down its context."""
        self.node.destroy_node()
        self._context.try_shutdown()


class GuardedRobot:
    """
    A robot that the guardian stops: its publishers and its watchdog.

    :param slot: the memory that is shared with the node for this robot
    :param topic: the velocity topic of the robot, after remapping
    :param command_timeout: how long the robot keeps a velocity if no new message arrives [s]
    :param message_type: Twist or TwistStamped
    :param frame: the frame in the header of a stamped message
    """

    def __init__(
            self, slot: RobotSlot, topic: str, command_timeout: float, message_type: str,
            frame: str) -> None:
        self.slot = slot
        self._arguments = topic, message_type, frame
        self._command_timeout = command_timeout
        self.watchdog = Watchdog()
        #: whether one of the publishers has a matched subscriber
        self.is_matched = False
        #: the publishers for this robot by node, the newest last; only one is left after the match
        self._publishers: dict[GuardianNode, VelocityPublisher] = {}
        self._stopping: list[threading.Thread] = []

    @property
    def nodes(self) -> Collection[GuardianNode]:
        """Return the nodes that have a publisher for this robot."""
        return self._publishers.keys()

    @property
    def is_stopping(self) -> bool:
        """Whether a stop is being sent."""
        return any(thread.is_alive() for thread in self._stopping)

    def join(self, node: GuardianNode) -> None:
        """Create a publisher for this robot on a node."""
        self._publishers[node] = VelocityPublisher(node.node, *self._arguments)

    def match(self) -> bool:
        """Keep only the publisher that has a subscriber; return whether there is one."""
        matched = (node for node, publisher in self._publishers.items()
                   if publisher.get_subscription_count() > 0)
        if (node := next(matched, None)) is not None:
            self.is_matched = True
            self._keep(node)
        return self.is_matched

    def keep_newest(self) -> None:
        """Keep only the newest publisher for this robot."""
        self._keep([*self._publishers][-1])

    def leave(self) -> None:
        """Destroy the publishers for this robot."""
        self._keep(None)

    def send_zero(self) -> bool:
        """Publish one zero velocity; return True, which tells ``send_stop`` to continue."""
        [*self._publishers.values()][-1].transmit(ZERO)
        return True

    def begin_stop(self) -> None:
        """Set the latch, which blocks all motion of the node, and send one zero velocity."""
        self.slot.latch.trip(time.monotonic())
        self.send_zero()

    def finish_stop(self) -> None:
        """Send the complete stop in a thread, because other robots must be guarded meanwhile."""
        self._stopping = run_in_threads(
            [partial(send_stop, self.send_zero, self._command_timeout)])

    def wait_for_stop(self) -> None:
        """Wait until the stop was sent."""
        for thread in self._stopping:
            thread.join()

    def _keep(self, kept: GuardianNode | None) -> None:
        for node in [*self._publishers]:
            if node is not kept:
                self._publishers.pop(node).destroy()


class GuardianNodes:
    """
    Creates the nodes of the guardian: one for all robots, and more until each robot is matched.

    A robot is matched when a publisher of the guardian has discovered its subscription.  If this
    does not happen within a timeout, the next node joins the graph.  Nodes that no robot needs
    are ended.  If no node matches a robot, the newest publisher for this robot remains.

    The reason: Fast DDS announces a participant before it listens.  A robot on the same machine
    answers each new participant once.  If the answer comes too early, it is lost.  Then the robot
    is discovered at its next announcement, up to 3 s later.  This happened to every second or
    fourth participant (measured).

    :param create: creates a node
    """

    def __init__(self, create: Callable[[], GuardianNode]) -> None:
        self._create = create
        self._nodes: list[GuardianNode] = []
        self._timeouts: Iterator[float] = iter(())
        #: when the next node joins, if a robot is still not matched [s on the steady clock]
        self._join_at = math.inf

    def add(self, robot: GuardedRobot) -> None:
        """Create a publisher for a robot, and start the timeout for the next node."""
        if not self._nodes:
            self._nodes.append(self._create())
        robot.join(self._nodes[-1])
        self._timeouts = iter(DISCOVERY_RETRY_TIMEOUTS)
        self._join_at = time.monotonic() + next(self._timeouts)

    def update(self, robots: Collection[GuardedRobot]) -> None:
        """
        Create the next node if a robot is not matched in time, and end unused nodes.

        Do not call this while a robot is driven, because Python may run no other thread meanwhile.

        :param robots: all robots
        """
        waiting = [robot for robot in robots if not robot.is_matched]
        if waiting and time.monotonic() >= self._join_at:
            self._join(waiting)
        used = {node for robot in robots for node in robot.nodes}
        for node in [node for node in self._nodes if used and node not in used]:
            self._nodes.remove(node)
            node.end()

    def _join(self, waiting: Collection[GuardedRobot]) -> None:
        timeout = next(self._timeouts, None)
        self._join_at = math.inf
        if timeout is None:
            for robot in waiting:
                robot.keep_newest()
            return
        self._nodes.append(self._create())
        for robot in waiting:
            robot.join(self._nodes[-1])
        self._join_at = time.monotonic() + timeout

    def end(self) -> None:
        """End all nodes of the guardian."""
        for node in self._nodes:
            node.end()


class GuardianProgram:
    """
    Reads the messages of the node, publishes zero velocities on request, and stops robots.

    The guardian stops a robot if the heartbeats of its node stop, or if the node ends before it
    has sent a complete stop.

    :param memory: the memory that is shared with the node
    :param nodes: creates the nodes that publish
    """

    def __init__(self, memory: GuardianMemory, nodes: GuardianNodes) -> None:
        self._memory = memory
        self._nodes = nodes
        self._node_pid = os.getppid()
        self._robots: dict[int, GuardedRobot] = {}
        self._claims: dict[int, Sequence[int]] = {}
        #: the slot numbers of the robots that the node releases
        self._leaving: set[int] = set()

    def serve(self, messages: int, robots: socket.socket, signals: int) -> None:
        """
        Run until the node has ended or has closed the pipe.

        :param messages: the file descriptor from which the messages of the node are read
        :param robots: the socket from which the descriptions of robots are read
        :param signals: a file descriptor that becomes readable when this program must end
        """
        robots.setblocking(False)
        ended_by = ''
        sources = [messages, robots.fileno(), signals]
        while True:
            readable, _, _ = select.select(sources, [], [], self._timeout())
            now = boottime()
            data = b''
            # A run may begin at the moment of the signal: its first heartbeat counts.
            if messages in readable and not (data := os.read(messages, READ_SIZE)):
                ended_by = 'the node is gone'
            if signals in readable:
                ended_by = 'the guardian was told to end'
            if readable:
                # A robot is described before the first message about it is sent.
                self._add_robots(robots)
                self._on_messages(data, now)
            self._check_heartbeats(now)
            if ended_by:
                break
            self._update()
        self._stop({number: ended_by for number in [*self._robots] if self._must_stop(number)})
        for robot in self._robots.values():
            robot.wait_for_stop()

    def _timeout(self) -> float | None:
        timeouts = [timeout for robot in self._robots.values()
                    if (timeout := robot.watchdog.timeout()) is not None]
        if self._leaving or not all(robot.is_matched for robot in self._robots.values()):
            timeouts.append(POLL_PERIOD)
        return min(timeouts, default=None)

    def _add_robots(self, robots: socket.socket) -> None:
        with contextlib.suppress(BlockingIOError):
            while True:
                data, claims, _, _ = socket.recv_fds(robots, MAX_ROBOT_SIZE, 1)
                if not data:
                    return
                number, *arguments = json.loads(data)
                robot = GuardedRobot(self._memory.slot(number), *arguments)
                self._nodes.add(robot)
                self._robots[number], self._claims[number] = robot, claims

    def _on_messages(self, data: bytes, now: float) -> None:
        for number, value in zip(data[::2], data[1::2]):
            robot, message = self._robots.get(number), bytes([value])
            if robot is None:  # it was released
                continue
            robot.watchdog.on_message(message, now)
            if message == GuardianMessage.PRIME:
                robot.send_zero()
                _report(f'primed {number}')
            elif message == GuardianMessage.LEAVE:
                self._leaving.add(number)
                if self._must_stop(number):
                    self._stop({number: 'the node is gone'})

    def _must_stop(self, number: int) -> bool:
        return self._robots[number].watchdog.on_disconnect()

    def _check_heartbeats(self, now: float) -> None:
        silent = {}
        for number, robot in self._robots.items():
            robot.watchdog.on_heartbeat(robot.slot.heartbeat, now)
            # If the node was frozen while it published, its flag is still set: it does not
            # publish.
            is_publishing = robot.slot.sending.is_set and not is_stopped(self._node_pid)
            if robot.watchdog.has_timed_out(now, is_publishing):
                silent[number] = (
                    f'the node sent no heartbeat for {robot.watchdog.allowed:g} s: the program '
                    f'was held up, {HELD_UP_ADVICE}')
        self._stop(silent)
        self._memory.count_check()

    def _stop(self, reasons: dict[int, str]) -> None:
        """
        Stop robots: first send one zero velocity to each robot, then the complete stop to each.

        :param reasons: the reason for the stop of each robot, by slot number
        """
        for number in reasons:
            with contextlib.suppress(Exception):  # the other robots must be stopped all the same
                self._robots[number].begin_stop()
        for number, reason in reasons.items():
            _report(f'stopped {number} {reason}')
            self._robots[number].finish_stop()

    def _update(self) -> None:
        for number, robot in self._robots.items():
            if not (robot.is_matched or robot.is_stopping) and robot.match():
                _report(f'matched {number}')
        for number in [*self._leaving]:
            if not self._robots[number].is_stopping:
                self._leave(number)
        if not any(robot.is_stopping or robot.watchdog.timeout() is not None
                   for robot in self._robots.values()):
            self._nodes.update(self._robots.values())

    def _leave(self, number: int) -> None:
        self._leaving.remove(number)
        self._robots.pop(number).leave()
        for claim in self._claims.pop(number):
            os.close(claim)
        _report(f'left {number}')


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the guardian.

    :param args: the ROS domain, and three file descriptors: the messages of the node, the socket
        for the descriptions of robots, and the memory shared with the node
    :returns: the exit code
    """
    parser = argparse.ArgumentParser()
    for name in ('domain', 'messages', 'robots', 'shared'):
        parser.add_argument(name, type=int)
    options = parser.parse_args(args)
    signals = _handle_signals()
    nodes = GuardianNodes(lambda: GuardianNode(
        options.domain, lambda participant: _report(f'participant {participant.hex()}')))
    try:
        with socket.socket(fileno=options.robots) as robots:
            GuardianProgram(GuardianMemory(options.shared), nodes).serve(
                options.messages, robots, signals)
    finally:
        # Measured: 1 of 80 guardians never returned from Fast DDS here after its node was killed,
        # and kept the claim on the robot.  The alarm ends the process.
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_REAL, GUARDIAN_EXIT_TIMEOUT)
        nodes.end()
    return 0


def _report(line: str) -> None:
    # Not print(): the node may have ended, and then its end of the pipe is closed.
    with contextlib.suppress(OSError):
        os.write(sys.stdout.fileno(), f'{line}\n'.encode())


def _handle_signals() -> int:
    """
    Handle SIGTERM, and ignore SIGINT and SIGHUP, because the node handles them.

    :returns: a file descriptor that becomes readable at SIGTERM
    """
    reader, _ = wakeup_pipe()
    signal.signal(signal.SIGTERM, lambda *_: None)
    for signum in (signal.SIGINT, signal.SIGHUP):
        signal.signal(signum, signal.SIG_IGN)
    return reader
