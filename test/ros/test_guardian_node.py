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
"""How the guardian discovers robots, guards several, and leaves no publisher behind."""

from contextlib import contextmanager
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

from kachaka_simple_control.control.guardian import begin_heartbeat, GuardianProcess
from kachaka_simple_control.control.guardian_memory import GuardianMemory
from kachaka_simple_control.control.preparation import complete
from kachaka_simple_control.control.watchdog import GuardianMessage
from kachaka_simple_control.process.processes import (
    boottime,
    child_environment,
    is_running,
    python_command,
)
from optional_libraries import MISSING, optional_imports
import pytest
from waiting import poll, wait_until

own_participant = MISSING
with optional_imports():
    from kachaka_simple_control.ros.endpoints import own_participant
    from kachaka_simple_control.ros.guardian_program import (
        GuardedRobot,
        GuardianNode,
        GuardianNodes,
        GuardianProgram,
    )
    from listener import Listener
    import rclpy

pytestmark = [pytest.mark.ros, pytest.mark.distro, pytest.mark.needs('rclpy')]

TOPIC = '/kachaka/manual_control/cmd_vel'
NOBODY = '/nobody/cmd_vel'
HANGS = """
import sys, time
from kachaka_simple_control.ros import guardian_program
guardian_program.GuardianNode.end = lambda self: time.sleep(60.0)
sys.exit(guardian_program.main())
"""


@pytest.fixture
def domain():
    """Return the domain of this test."""
    context = rclpy.Context()
    context.init(args=[])
    domain = context.get_domain_id()
    context.try_shutdown()
    return domain


@pytest.fixture
def greeted():
    """Return who has greeted, in order."""
    return []


@pytest.fixture
def shared():
    """Yield the descriptor of the memory of a guardian."""
    with tempfile.TemporaryFile() as file:
        file.truncate(GuardianMemory.SIZE)
        yield file.fileno()


@pytest.fixture
def nodes(domain, greeted):
    """Yield the nodes of a guardian."""
    nodes = GuardianNodes(lambda: GuardianNode(domain, greeted.append))
    yield nodes
    nodes.end()


@pytest.fixture
def process(domain):
    """Yield the process of a guardian."""
    process = GuardianProcess(
        [*python_command('kachaka_simple_control.ros.guardian_program'), str(domain)],
        child_environment())
    yield process
    complete([guardian.leave for guardian in [*process._guardians.values()]])
    assert not is_running(process._process.pid)


def robot(nodes, shared, topic=TOPIC):
    """Return a robot with its first publisher."""
    robot = GuardedRobot(GuardianMemory(shared).slot(1), topic, 0.3, 'Twist', 'base_link')
    nodes.add(robot)
    return robot


def add(process, shared, topic=TOPIC):
    """Let a process guard a robot."""
    return process.add(topic, 0.3, 'Twist', 'base_link', shared)


def match(nodes, *robots, timeout=4.0):
    """Let nodes join and leave until the robots are matched and nothing changes any more."""
    end = time.monotonic() + timeout
    while time.monotonic() < end:
        for one in robots:
            one.match()
        if all(one.is_matched for one in robots):
            end = min(end, time.monotonic() + 0.1)
        nodes.update(robots)
        time.sleep(0.02)


def prime(listener, *guardians):
    """Wait until the robot receives each guardian: it may be later than the guardian's match."""
    for one in guardians:
        wait_until(lambda: one.is_matched)  # noqa: B023
        listener.received.clear()
        wait_until(lambda: one.prime() or poll(lambda: listener.received, 0.1))  # noqa: B023
    listener.received.clear()


def begin(*guardians):
    """Begin a run of robots that one thread drives; return what writes its heartbeat."""
    beat = begin_heartbeat(guardians)
    for one in guardians:
        one.check()
    return beat


@contextmanager
def driving(*guardians):
    """Send the heartbeats of a run during a block, and then report its stop."""
    ended = threading.Event()

    def drive():
        while not ended.wait(0.02):
            beat()

    beat = begin(*guardians)
    thread = threading.Thread(target=drive)
    thread.start()
    yield
    ended.set()
    thread.join()
    for one in guardians:
        one.report_stopping()
        one.report_stopped()


def publishers(observer, topic=TOPIC):
    """Return how many publishers of velocities there are, once that is known."""
    time.sleep(0.5)
    return observer.node.count_publishers(topic)


def test_a_node_that_is_matched_stays(listener, observer, nodes, greeted, shared):
    one = robot(nodes, shared)
    match(nodes, one)
    assert one.is_matched
    assert len(one.nodes) == 1
    assert publishers(observer) == 1
    assert len(greeted) <= 3


def test_beside_a_drive_the_graph_is_asked_only_after_a_change(listener, nodes, shared):
    """A slow answer would delay the stop of the robot that is driven."""
    one, asked = robot(nodes, shared), []
    match(nodes, one)
    [publisher], [node] = one._publishers.values(), one.nodes
    node.node.get_subscriptions_info_by_topic = lambda topic: asked.append(topic) or []
    publisher.get_subscription_count = iter((1, 0, 1, 1)).__next__
    for times in (0, 0, 1):  # it stays, it leaves, it comes again
        one.match(is_driving=True)
        assert len(asked) == times
    for message in (GuardianMessage.HEARTBEAT, GuardianMessage.STOPPED):
        one.watchdog.on_message(message, boottime())
        one.match(is_driving=True)
    assert len(asked) == 2, 'it may have been replaced during its own drive'


def test_a_robot_is_found_later_than_another_subscriber_and_after_a_drive(
        listener, process, shared):
    """The first may be a tool on this machine, and a robot may be replaced between drives."""
    guardian = add(process, shared)
    prime(listener, guardian)
    with driving(guardian):
        pass
    with Listener() as second:
        tool, robot = ({own_participant(one._node)} for one in (listener, second))
        assert guardian.unmatched(tool) == set()
        wait_until(lambda: not guardian.unmatched(tool | robot))
    wait_until(lambda: guardian.unmatched(tool | robot) == robot)


def test_a_node_that_is_not_matched_joins_again(observer, nodes, greeted, shared):
    one = robot(nodes, shared)
    match(nodes, one, timeout=3.0)
    assert len(set(greeted)) == len(greeted) == 5
    assert publishers(observer) == 1
    nodes.end()
    assert publishers(observer) == 0
    nodes._nodes.clear()


def test_a_robot_that_comes_later_gets_its_publisher_on_a_node_that_is_there(
        listener, nodes, greeted, shared):
    one = robot(nodes, shared)
    match(nodes, one)
    before = len(greeted)
    other = robot(nodes, shared)
    assert len(greeted) == before
    match(nodes, one, other)
    assert other.is_matched
    assert one.is_matched


def test_no_node_joins_while_a_robot_is_driven(listener, process, shared):
    """To join takes some hundredths of a second, in which nobody would be guarded."""
    driven = add(process, shared)
    wait_until(lambda: driven.is_matched)
    before = len(process.participants)
    with driving(driven):
        other = add(process, shared, NOBODY)
        time.sleep(1.0)
        assert len(process.participants) == before
    wait_until(lambda: len(process.participants) > before)
    assert driven.stopped_because is other.stopped_because is None


def test_a_thread_that_hangs_stops_its_robots_alone(listener, process, shared):
    silent, driven = [[add(process, shared) for _ in range(2)] for _ in range(2)]
    prime(listener, *silent, *driven)
    with driving(*driven):
        begin(*silent)
        wait_until(lambda: all(one.stopped_because for one in silent))
        time.sleep(0.5)
    for one in silent:
        assert 'the node sent no heartbeat for 0.1 s' in one.stopped_because
        assert one.latch.guardian_stop_time is not None
    for one in driven:
        assert one.stopped_because is None
        assert not one.latch.is_set
    assert len(listener.received) > 30


def test_a_robot_is_stopped_in_time_while_another_is_being_stopped(listener, process, shared):
    first, second = add(process, shared), add(process, shared)
    prime(listener, first, second)
    begin(first)
    wait_until(lambda: first.latch.guardian_stop_time)
    # The stop of the first takes 0.4 s.  The limit is 0.1 s; a busy machine has as much again.
    began = time.monotonic()
    begin(second)
    assert wait_until(lambda: second.latch.guardian_stop_time) - began < 0.3


def test_a_robot_that_is_left_in_a_run_is_stopped_first(listener, process, shared):
    left, other = add(process, shared), add(process, shared, NOBODY)
    prime(listener, left)
    begin(left)
    complete([left.leave])
    assert len(listener.received) > 15
    assert left.stopped_because == 'the node is gone'
    assert other.stopped_because is None


def test_all_robots_are_stopped_at_once_when_the_guardian_is_told_to_end(
        listener, process, shared):
    robots = [add(process, shared) for _ in range(3)]
    prime(listener, *robots)
    begin(*robots)
    process._process.send_signal(signal.SIGTERM)
    wait_until(lambda: process.has_ended)
    assert {one.stopped_because for one in robots} == {'the guardian was told to end'}
    times = [one.latch.guardian_stop_time for one in robots]
    assert max(times) - min(times) < 0.05  # a whole stop takes 0.4 s
    assert len(listener.received) > 45


def test_a_run_that_begins_at_the_moment_of_the_signal_is_stopped(nodes, shared):
    """All that came before the guardian looked counts, and the robot with its first heartbeat."""
    (messages, node), (signals, signalled) = os.pipe(), os.pipe()
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        socket.send_fds(ours, [b'[1, "/cmd_vel", 0.3, "Twist", "base_link"]'], [messages])
        os.write(node, b'\1b')
        os.write(signalled, bytes([signal.SIGTERM]))
        memory = GuardianMemory(shared)
        GuardianProgram(memory, nodes).serve(messages, theirs, signals)
    for descriptor in (messages, node, signals, signalled):
        os.close(descriptor)
    assert memory.slot(1).latch.guardian_stop_time is not None


def test_one_process_guards_all_robots_of_a_context(make):
    first, second = (make(guardian=True) for _ in range(2))
    process = first.robot.guardian._process
    assert second.robot.guardian._process is process
    first.destroy_node()
    assert is_running(process._process.pid)
    second.destroy_node()
    assert not is_running(process._process.pid)
    third = make(guardian=True)
    assert third.robot.guardian._process is not process


def test_a_guardian_that_cannot_leave_the_graph_ends_all_the_same(domain, shared):
    """Otherwise it keeps the claim: the robot of a program that was killed stays taken."""
    reader, writer = os.pipe()
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    kept = (reader, theirs.fileno(), shared)
    with ours, theirs, subprocess.Popen(
            [sys.executable, '-c', HANGS, *map(str, (domain, *kept))], pass_fds=kept,
            stdout=subprocess.PIPE) as program:
        socket.send_fds(ours, [b'[1, "/cmd_vel", 0.3, "Twist", "base_link"]'], [shared])
        assert program.stdout.readline().startswith(b'participant')
        os.close(reader)
        os.close(writer)
        try:
            assert program.wait(20.0) == -signal.SIGALRM
        finally:
            program.kill()
