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
"""The search for velocity publishers, which finds those that a new node would find late."""

import contextlib
from functools import partial
import os
import subprocess
import sys
import tempfile
import time

from kachaka_simple_control.control.guardian import GuardianProcess
from kachaka_simple_control.control.preparation import complete
from kachaka_simple_control.control.velocity_gate import GateState
from kachaka_simple_control.errors import RobotNotFoundError
from kachaka_simple_control.process.processes import child_environment, python_command
from optional_libraries import MISSING, optional_imports
import pytest
from waiting import wait_until

dds_transport = robot_discovery = own_participant = MISSING
with optional_imports():
    from kachaka_simple_control.ros import dds_transport, robot_discovery
    from kachaka_simple_control.ros.endpoints import own_participant
    from listener import Listener
    from nav_msgs.msg import Odometry

pytestmark = [pytest.mark.ros, pytest.mark.distro, pytest.mark.needs('rclpy', 'nav_msgs')]

TOPIC = '/kachaka/manual_control/cmd_vel'
#: Another program: it joins the graph as its user would start it, and has a publisher.
OTHER = f"""
import sys
from geometry_msgs.msg import Twist
import rclpy
rclpy.init()
node = rclpy.create_node('other')
publisher = node.create_publisher(Twist, '{TOPIC}', 10)
print(flush=True)
sys.stdin.read()
"""
#: A guardian whose search does not return from Fast DDS, and is killed.
FROZEN_SEARCH = """
import signal, sys
from kachaka_simple_control.ros import guardian_program, publisher_search
publisher_search._search = lambda *_: signal.pause()
publisher_search.PUBLISHER_SEARCH_TIMEOUT = 0.2
sys.exit(guardian_program.main())
"""
#: How many searches must find the publisher, one after the other.  A plain node of Fast DDS finds
#: it in time with a probability of about 0.3, so ten of ten are no accident.
SEARCHES = 10


@pytest.fixture
def as_a_user(monkeypatch):
    """Let programs meet on this machine by ROS's own settings, which announce a node rarely."""
    if dds_transport._fast_dds() in (None, dds_transport.HUMBLE):
        pytest.skip('needs Fast DDS 2.14 or later')
    for name in dds_transport.CHOICES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv(dds_transport.RANGE, 'LOCALHOST')


@pytest.fixture
def other(as_a_user):
    """Run another program with a velocity publisher."""
    with subprocess.Popen([sys.executable, '-c', OTHER], env=child_environment(),
                          stdin=subprocess.PIPE, stdout=subprocess.PIPE) as program:
        program.stdout.readline()
        # Its own first announcements are over: from now on a newcomer depends on an answer.
        time.sleep(1.0)
        yield program
        program.stdin.close()
        program.wait(10.0)


@pytest.fixture
def domain():
    """Return the domain of this test."""
    return int(os.environ['ROS_DOMAIN_ID'])


@pytest.fixture
def connection(make):
    """Return how a node gets control of its robot, while a search has found a program."""
    robot = make(robot_timeout=5.0).robot
    robot.discovery._guardian = Search()
    return robot.connection


class Search:
    """Stands for a guardian that has found a publisher which this node never discovers."""

    participants = frozenset()
    has_searched = True
    #: the participants of the only subscribers that it has matched; None: it has matched all
    matched = None

    def unmatched(self, subscribers):
        """Return those that it has not matched."""
        return set() if self.matched is None else subscribers - self.matched

    def found_publishers(self, topic):
        """Return a participant that is not there."""
        return {b'participant!'} if topic == TOPIC else set()


@pytest.mark.parametrize(('has_searched', 'found', 'is_alone'), [
    (True, {'own'}, True), (True, {'own', 'other'}, False), (True, {'other'}, False),
    (True, set(), False), (False, {'own'}, False)])
def test_it_is_alone_if_the_search_has_found_its_publisher_and_no_other(
        connection, monkeypatch, has_searched, found, is_alone):
    """A search that does not find the publisher of its own node does not work, or came before."""
    discovery = connection.discovery
    participants = {'own': discovery._graph.participant, 'other': b'other'}
    guardian = discovery._guardian
    monkeypatch.setattr(guardian, 'has_searched', has_searched)
    monkeypatch.setattr(
        guardian, 'found_publishers', lambda _: {participants[name] for name in found})
    assert discovery.is_alone is is_alone


@contextlib.contextmanager
def run_guardian(*command):
    """Run the guardian's program for one robot; yield its process and the interface to it."""
    with tempfile.TemporaryFile() as claim:
        process = GuardianProcess(command, child_environment())
        guardian = process.add(TOPIC, 0.3, 'Twist', 'base_link', claim.fileno())
        try:
            yield process, guardian
        finally:
            complete([guardian.leave])


def search(domain):
    """Run a guardian until its search is over; return the participants of others that it found."""
    with run_guardian(*python_command('kachaka_simple_control.ros.guardian_program'),
                      str(domain)) as (process, guardian):
        wait_until(lambda: guardian.has_searched)
        return guardian.found_publishers(TOPIC) - process.participants


@pytest.mark.slow
def test_each_search_finds_the_publisher_of_another_program(other, domain):
    dds_transport.use_udp_transport()
    found = [search(domain) for _ in range(SEARCHES)]
    assert [len(one) for one in found] == [1] * SEARCHES
    assert len(set.union(*found)) == 1


def test_a_search_that_finds_nobody_says_that_it_is_over(domain):
    assert search(domain) == set()


def test_a_search_that_was_killed_is_not_over(domain):
    """Whoever waits for it then waits until it must have found all publishers itself."""
    with run_guardian(sys.executable, '-c', FROZEN_SEARCH, str(domain)) as (process, guardian):
        wait_until(lambda: process.participants)  # by then the search was started
        time.sleep(1.0)  # and killed after 0.2 s
        assert not guardian.has_searched
        assert not process.has_ended


def test_nothing_is_sent_before_all_that_was_found_is_discovered(listener, connection):
    def check():
        if listener.received or connection.drive.gate.state is not GateState.NOT_OPENED:
            raise AssertionError('too soon')
        if time.monotonic() > end:
            raise InterruptedError

    end = time.monotonic() + 2.0  # a publisher is discovered within 3 s
    with pytest.raises(InterruptedError):
        complete([connection.prepare], check)
    assert not listener.received


def test_a_publisher_that_has_left_keeps_nobody_waiting_for_long(
        listener, connection, monkeypatch):
    monkeypatch.setattr(robot_discovery, 'DISCOVERY_TIMEOUT', 0.3)
    complete([connection.prepare], lambda: None)
    assert listener.received


def test_with_others_allowed_nobody_waits_for_them(listener, make):
    robot = make(allow_other_publishers=True).robot
    robot.discovery._guardian = Search()
    began = time.monotonic()
    complete([robot.connection.prepare], lambda: None)
    assert time.monotonic() - began < robot_discovery.DISCOVERY_TIMEOUT


def test_the_drive_waits_until_the_guardian_knows_the_robot(listener, make, monkeypatch):
    """The subscriber that it knows may be a tool on this machine, and not the robot."""
    monkeypatch.setattr(robot_discovery, 'DISCOVERY_TIMEOUT', 1.0)
    discovery = make(allow_other_publishers=True).robot.discovery
    guardian = discovery._guardian = Search()

    def wait():
        began = time.monotonic()
        complete([partial(discovery.wait_for_guardian, timeout=2.0)], lambda: None)
        return time.monotonic() - began

    with Listener() as other:
        wait_until(lambda: discovery.subscriber_count == 2)
        robot, tool = ({own_participant(one._node)} for one in (listener, other))
        guardian.matched = tool
        assert 1.0 <= wait() < 1.7, 'without odometry, each of them may be the robot'
        listener._node.create_publisher(Odometry, 'odometry/odometry', 1)
        wait_until(lambda: discovery._find_robot() == robot)
        with pytest.raises(RobotNotFoundError, match='the guardian has not discovered the robot'):
            wait()
        guardian.matched = robot
        assert wait() < 0.7
