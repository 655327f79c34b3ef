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

It has its own DDS participants, so it can still send after that program has ended.

Tested by test/ros/test_guardian_node.py.
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

from kachaka_simple_control.control.guardian_memory import GuardianMemory, RobotSlot
from kachaka_simple_control.control.preparation import complete
from kachaka_simple_control.control.stop import stop_steps
from kachaka_simple_control.control.timing import (
    DISCOVERY_RETRY_TIMEOUTS,
    GUARDIAN_EXIT_TIMEOUT,
)
from kachaka_simple_control.control.watchdog import (
    GuardianMessage,
    silent_robots,
    Watchdog,
)
from kachaka_simple_control.errors import HELD_UP_ADVICE
from kachaka_simple_control.motion.geometry import ZERO
from kachaka_simple_control.process.processes import boottime, is_stopped
from kachaka_simple_control.process.signals import run_in_threads, wakeup_pipe
from kachaka_simple_control.process.waiting import POLL_PERIOD
from kachaka_simple_control.ros.endpoints import own_participant, participants
from kachaka_simple_control.ros.publisher_search import start_publisher_search
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from rclpy.context import Context
from rclpy.node import Node

#: How many bytes are read from the pipe at once: more than arrive in a minute.  An even number,
#: because a message has two bytes.
READ_SIZE = 65536
#: The longest description of a robot [bytes]; a topic name has at most 255 characters.
MAX_ROBOT_SIZE = 4096
#: How often other subscribers are looked for after the first match, except during a drive [s].
MATCH_PERIOD = 0.2


class GuardianNode:
    """
    A ROS node of the guardian, with its own ROS context and so its own DDS participant.

    Its name begins with ``_``, so that ROS tools hide it.

    :param on_participant: called with its participant before it has a velocity publisher
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
    A robot that the guardian stops: its publishers, and its watchdog, which decides when.

    :param slot: shared with the driving program
    """

    def __init__(
            self, slot: RobotSlot, topic: str, command_timeout: float, message_type: str,
            frame: str) -> None:
        self.slot = slot
        self._arguments = topic, message_type, frame
        self._command_timeout = command_timeout
        self.watchdog = Watchdog()
        #: the DDS participants of the subscribers that the kept publisher has matched at last
        self.subscribers: frozenset[bytes] = frozenset()
        self._subscriber_count = 0
        #: the publishers for this robot by node, the newest last; only one is left after the match
        self._publishers: dict[GuardianNode, VelocityPublisher] = {}
        self._stopping: list[threading.Thread] = []

    @property
    def nodes(self) -> Collection[GuardianNode]:
        """Return the nodes of the guardian that have a publisher for this robot."""
        return self._publishers.keys()

    @property
    def is_matched(self) -> bool:
        """Whether a publisher has matched a subscriber, which need not be the robot."""
        return bool(self.subscribers)

    @property
    def is_driven(self) -> bool:
        """Whether a drive or its stop is under way: a call to DDS could delay the guardian."""
        return self.is_stopping or self.watchdog.timeout() is not None

    @property
    def is_stopping(self) -> bool:
        """Whether a thread of the guardian is sending zero velocities to stop this robot."""
        return any(thread.is_alive() for thread in self._stopping)

    def join(self, node: GuardianNode) -> None:
        """Create a velocity publisher for this robot on a node of the guardian."""
        self._publishers[node] = VelocityPublisher(node.node, *self._arguments)

    def match(self, is_driving: bool = False) -> bool:
        """
        Find the subscribers, but not in a drive; keep the first publisher that has any.

        :param is_driving: whether any robot is driven: then the graph is asked only if the number
            of subscribers has changed, because the answer may take 0.17 s
        :returns: whether the subscribers have changed
        """
        if self.is_driven:
            self._subscriber_count = 0  # the robot may be replaced meanwhile
            return False
        before = self.subscribers
        for node, publisher in [*self._publishers.items()]:
            known, self._subscriber_count = (
                self._subscriber_count, publisher.get_subscription_count())
            if self._subscriber_count > 0:
                if not is_driving or self._subscriber_count != known:
                    self.subscribers = frozenset(participants(
                        node.node.get_subscriptions_info_by_topic(publisher.topic_name)))
                self._keep(node)
                break
        return self.subscribers != before

    def keep_newest(self) -> None:
        """Destroy all publishers for this robot except the newest one."""
        self._keep([*self._publishers][-1])

    def leave(self) -> None:
        """Destroy all publishers for this robot, so that the guardian can no longer send to it."""
        self._keep(None)

    def send_zero(self) -> bool:
        """Publish one zero velocity; return True, so that ``stop_steps`` continues."""
        [*self._publishers.values()][-1].transmit(ZERO)
        return True

    def begin_stop(self) -> None:
        """Set the latch, which blocks the driving program, and send one zero velocity."""
        self.slot.latch.trip(time.monotonic())
        self.send_zero()

    def finish_stop(self) -> None:
        """Send the zeros of a stop in a thread; other robots are watched meanwhile."""
        self._stopping = run_in_threads(
            [partial(complete, [partial(
                stop_steps, send_zero=self.send_zero, command_timeout=self._command_timeout)])])

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

    A new node often discovers the robot at once, while the old one needs up to 3 s.  After the
    last timeout, all publishers for this robot except the newest one are destroyed, and so is a
    node that has none left, unless it is the last.
    """

    def __init__(self, create: Callable[[], GuardianNode]) -> None:
        self._create = create
        self._nodes: list[GuardianNode] = []
        self._timeouts: Iterator[float] = iter(())
        #: when the next node joins, if a robot is still not matched [s on the steady clock]
        self._join_at = math.inf

    def add(self, robot: GuardedRobot) -> None:
        """Create a publisher for a robot on the newest node; its timeout starts now."""
        if not self._nodes:
            self._nodes.append(self._create())
        robot.join(self._nodes[-1])
        self._timeouts = iter(DISCOVERY_RETRY_TIMEOUTS)
        self._join_at = time.monotonic() + next(self._timeouts)

    def update(self, robots: Collection[GuardedRobot]) -> None:
        """
        Create another node if a robot was not discovered in time; end nodes that no robot uses.

        Not while a robot is driven: this can block all other threads of the guardian.
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
    The main loop of the guardian.

    It publishes zeros when messages of the driving program request this.  It stops a robot if the
    next heartbeat of a drive does not come in time, or the program ends before it has sent all
    zero velocities of its own stop.
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
        Run until the driving program ends or a signal arrives; then stop each robot still driven.

        :param signals: a descriptor that becomes readable when a signal tells the guardian to end
        :param search: the descriptor of the lines of the search for publishers; None without a
            search
        """
        robots.setblocking(False)
        ended_by = ''
        sources = [messages, robots.fileno(), signals, *([] if search is None else [search])]
        while True:
            readable, _, _ = select.select(sources, [], [], self._timeout())
            now = boottime()
            data = b''
            # A drive may begin at the moment of the signal: its first heartbeat counts.
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
        elif not all(robot.is_driven for robot in self._robots.values()):
            timeouts.append(MATCH_PERIOD)
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
        silent = silent_robots(
            self._robots, self._memory, now, partial(is_stopped, self._node_pid))
        self._stop({number: (
            f'the node sent no heartbeat for {self._robots[number].watchdog.allowed:g} s: the '
            f'program was held up, {HELD_UP_ADVICE}') for number in silent})
        self._memory.count_check()

    def _stop(self, reasons: dict[int, str]) -> None:
        """Stop several robots at once: first one zero to each, then the rest in threads."""
        for number in reasons:
            with contextlib.suppress(Exception):  # the other robots must be stopped all the same
                self._robots[number].begin_stop()
        for number, reason in reasons.items():
            _report(f'stopped {number} {reason}')
            self._robots[number].finish_stop()

    def _update(self) -> None:
        is_driving = any(robot.is_driven for robot in self._robots.values())
        for number, robot in self._robots.items():
            if robot.match(is_driving):
                _report(f'matched {number} {" ".join(map(bytes.hex, robot.subscribers))}')
        for number in [*self._leaving]:
            if not self._robots[number].is_stopping:
                self._leave(number)
        if not is_driving:
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

    :param args: None to use ``sys.argv``: the ROS domain, and three descriptors, of the pipe for
        messages, of the socket for descriptions of robots, and of the shared memory
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
    Handle SIGTERM, and ignore SIGINT and SIGHUP, which the driving program handles.

    :returns: a descriptor that becomes readable at SIGTERM
    """
    reader, _ = wakeup_pipe()
    signal.signal(signal.SIGTERM, lambda *_: None)
    for signum in (signal.SIGINT, signal.SIGHUP):
        signal.signal(signum, signal.SIG_IGN)
    return reader
