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
The guardian: a separate program that stops robots if the program that drives them cannot.

The guardian has its own DDS participants.  So it can still send stop messages after the program
that drives the robots has ended.
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
from kachaka_simple_control.ros.publisher_search import start_publisher_search
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
    A ROS node of the guardian, with its own ROS context and so its own DDS participant.

    The guardian is a separate program that stops robots if the program that drives them cannot.
    The name of its node begins with ``_``, so that ROS tools hide it.

    :param domain: the number of the ROS domain
    :param on_participant: a function that is called with the identifier of the node's DDS
        participant, before any velocity publisher is created on the node
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
        """Destroy this node of the guardian, and shut down the ROS context of the node."""
        self.node.destroy_node()
        self._context.try_shutdown()


class GuardedRobot:
    """
    A robot that the guardian stops if the program that drives the robot cannot.

    This object has the publishers that send zero velocities to the robot, and a watchdog, which
    decides when the robot must be stopped.

    :param slot: the part of the shared memory for this robot; the driving program uses it as well
    :param topic: the velocity topic of the robot, after remapping
    :param command_timeout: how long the robot keeps a velocity if no new message arrives [s]
    :param message_type: the type of the velocity messages, ``Twist`` or ``TwistStamped``
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
        """Return the nodes of the guardian that have a publisher for this robot."""
        return self._publishers.keys()

    @property
    def is_stopping(self) -> bool:
        """Whether a thread of the guardian is sending zero velocities to stop this robot."""
        return any(thread.is_alive() for thread in self._stopping)

    def join(self, node: GuardianNode) -> None:
        """Create a velocity publisher for this robot on a node of the guardian."""
        self._publishers[node] = VelocityPublisher(node.node, *self._arguments)

    def match(self) -> bool:
        """
        Check whether one of the publishers for this robot has discovered the robot's subscription.

        If so, destroy the other publishers for this robot.  Otherwise keep all publishers.

        :returns: whether a publisher has discovered the subscription
        """
        matched = (node for node, publisher in self._publishers.items()
                   if publisher.get_subscription_count() > 0)
        if (node := next(matched, None)) is not None:
            self.is_matched = True
            self._keep(node)
        return self.is_matched

    def keep_newest(self) -> None:
        """Destroy all publishers for this robot except the newest one."""
        self._keep([*self._publishers][-1])

    def leave(self) -> None:
        """Destroy all publishers for this robot, so that the guardian can no longer send to it."""
        self._keep(None)

    def send_zero(self) -> bool:
        """
        Publish one zero velocity to the robot.

        :returns: True, which tells the caller ``send_stop`` to continue the stop
        """
        [*self._publishers.values()][-1].transmit(ZERO)
        return True

    def begin_stop(self) -> None:
        """
        Block all later motion by the program that drives the robot, and send one zero velocity.

        The motion is blocked by the latch, a flag in shared memory.  The driving program reads the
        latch before it sends a velocity.
        """
        self.slot.latch.trip(time.monotonic())
        self.send_zero()

    def finish_stop(self) -> None:
        """
        Start a thread that sends the zero velocities of a stop to the robot.

        If no new message arrives, the robot keeps a velocity for a limited time.  The thread sends
        zero velocities for longer than this time.  Meanwhile the guardian can watch other robots.
        """
        self._stopping = run_in_threads(
            [partial(send_stop, self.send_zero, self._command_timeout)])

    def wait_for_stop(self) -> None:
        """Wait until the thread that sends the zero velocities of the stop has sent them all."""
        for thread in self._stopping:
            thread.join()

    def _keep(self, kept: GuardianNode | None) -> None:
        for node in [*self._publishers]:
            if node is not kept:
                self._publishers.pop(node).destroy()


class GuardianNodes:
    """
    Creates another ROS node for the guardian if a robot was not discovered in time.

    The guardian is a separate program that stops robots if the program that drives them cannot.
    It begins with one node, which has a publisher for each robot.  A robot is discovered when a
    publisher finds the robot's subscription.  If this takes longer than a timeout, a new node is
    created, with one more publisher for this robot.  The reason: a new node often discovers the
    robot at once, while the old node needs up to 3 s.

    After the last timeout, all publishers for this robot except the newest one are destroyed.  A
    node without publishers is destroyed if another node has publishers.

    :param create: a function that creates a node
    """

    def __init__(self, create: Callable[[], GuardianNode]) -> None:
        self._create = create
        self._nodes: list[GuardianNode] = []
        self._timeouts: Iterator[float] = iter(())
        #: when the next node joins, if a robot is still not matched [s on the steady clock]
        self._join_at = math.inf

    def add(self, robot: GuardedRobot) -> None:
        """
        Create a publisher for a robot on the newest node of the guardian.

        If the publisher does not discover the robot's subscription within a timeout, ``update``
        creates another node.  The timeout starts now.

        :param robot: the robot that the guardian has to watch
        """
        if not self._nodes:
            self._nodes.append(self._create())
        robot.join(self._nodes[-1])
        self._timeouts = iter(DISCOVERY_RETRY_TIMEOUTS)
        self._join_at = time.monotonic() + next(self._timeouts)

    def update(self, robots: Collection[GuardedRobot]) -> None:
        """
        Create another node if a robot was not discovered in time; end nodes that no robot uses.

        Do not call this method while a robot is driven: it can block all other threads of the
        guardian.

        :param robots: all robots that the guardian watches
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
        # Fast DDS announces a participant before it listens.  A robot on the same machine answers
        # each new participant once.  If the answer comes too early, it is lost, and the robot is
        # discovered at its next announcement, up to 3 s later.  Measured: this happened to every
        # second to fourth participant.
        self._nodes.append(self._create())
        for robot in waiting:
            robot.join(self._nodes[-1])
        self._join_at = time.monotonic() + timeout

    def end(self) -> None:
        """End all ROS nodes of the guardian."""
        for node in self._nodes:
            node.end()


class GuardianProgram:
    """
    The main loop of the guardian, a program that stops robots if their driving program cannot.

    The guardian reads messages from the driving program, and publishes zero velocities when the
    messages request this.  During a drive, the driving program writes heartbeats, which show that
    it still works.  The guardian stops a robot if the next heartbeat does not come in time, or if
    the driving program ends before it has sent all zero velocities of its own stop.

    :param memory: the memory that is shared with the driving program, with the heartbeats
    :param nodes: the object that creates the ROS nodes with which the guardian publishes
    """

    def __init__(self, memory: GuardianMemory, nodes: GuardianNodes) -> None:
        self._memory = memory
        self._nodes = nodes
        self._node_pid = os.getppid()
        self._robots: dict[int, GuardedRobot] = {}
        self._claims: dict[int, Sequence[int]] = {}
        #: the slot numbers of the robots that the node releases
        self._leaving: set[int] = set()

    def serve(
            self, messages: int, robots: socket.socket, signals: int,
            search: int | None = None) -> None:
        """
        Run the guardian until the program that drives the robots ends, or a signal arrives.

        Then stop each robot that was driven, unless the driving program has stopped it completely.

        :param messages: the file descriptor of the pipe from which the messages of the driving
            program are read
        :param robots: the socket from which the driving program's descriptions of new robots are
            read
        :param signals: a file descriptor that becomes readable when a signal tells the guardian to
            end
        :param search: the file descriptor from which the lines of the search for publishers are
            read; None without a search
        """
        robots.setblocking(False)
        ended_by = ''
        sources = [messages, robots.fileno(), signals, *([] if search is None else [search])]
        while True:
            readable, _, _ = select.select(sources, [], [], self._timeout())
            now = boottime()
            data = b''
            # A run may begin at the moment of the signal: its first heartbeat counts.
            if messages in readable and not (data := os.read(messages, READ_SIZE)):
                ended_by = 'the node is gone'
            if signals in readable:
                ended_by = 'the guardian was told to end'
            if search in readable and not _pass_on(search):
                sources.remove(search)
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
        Stop several robots at the same time.

        First send one zero velocity to each robot.  Then start a thread for each robot that sends
        the rest of the stop, a series of zero velocities.

        :param reasons: why each robot is stopped; the keys are the numbers of the robots in the
            shared memory
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
    Run the guardian, a program that stops robots if the program that drives them cannot.

    :param args: the command line arguments; None to use ``sys.argv``.  The first argument is the
        number of the ROS domain.  The next three are file descriptors: of the pipe on which the
        driving program sends messages, of the socket on which it sends descriptions of the robots,
        and of the memory that it shares with the guardian
    :returns: the exit code
    """
    parser = argparse.ArgumentParser()
    for name in ('domain', 'messages', 'robots', 'shared'):
        parser.add_argument(name, type=int)
    options = parser.parse_args(args)
    search = start_publisher_search(options.domain, (options.messages, options.robots))
    signals = _handle_signals()
    nodes = GuardianNodes(lambda: GuardianNode(
        options.domain, lambda participant: _report(f'participant {participant.hex()}')))
    try:
        with socket.socket(fileno=options.robots) as robots:
            GuardianProgram(GuardianMemory(options.shared), nodes).serve(
                options.messages, robots, signals, search)
    finally:
        # Measured: 1 of 80 guardians never returned from Fast DDS here after its node was killed,
        # and kept the claim on the robot.  The alarm ends the process.
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_REAL, GUARDIAN_EXIT_TIMEOUT)
        nodes.end()
    return 0


def _pass_on(search: int) -> bool:
    """Print what the search for publishers has found; return False at its end."""
    data = os.read(search, READ_SIZE)
    _print(data)
    return bool(data)


def _report(line: str) -> None:
    _print(f'{line}\n'.encode())


def _print(data: bytes) -> None:
    # Not print(): the node may have ended, and then its end of the pipe is closed.
    with contextlib.suppress(OSError):
        os.write(sys.stdout.fileno(), data)


def _handle_signals() -> int:
    """
    Handle SIGTERM, and ignore SIGINT and SIGHUP.

    The guardian ignores SIGINT and SIGHUP, because the program that drives the robot handles them.

    :returns: a file descriptor that becomes readable at SIGTERM
    """
    reader, _ = wakeup_pipe()
    signal.signal(signal.SIGTERM, lambda *_: None)
    for signum in (signal.SIGINT, signal.SIGHUP):
        signal.signal(signum, signal.SIG_IGN)
    return reader
