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
"""How the guardian discovers the robot, and leaves no second publisher behind."""

import mmap
import os
import signal
import subprocess
import sys
import tempfile
import time

from optional_libraries import optional_imports
import pytest

with optional_imports():
    from kachaka_simple_control.ros.guardian_program import create_matched_node, GuardianNode
    import rclpy

pytestmark = [pytest.mark.ros, pytest.mark.needs('rclpy')]

TOPIC = '/kachaka/manual_control/cmd_vel'
#: A guardian whose middleware never returns from leaving the graph.
HANGS = """
import sys, time
from kachaka_simple_control.ros import guardian_program
guardian_program.GuardianNode.end = lambda self: time.sleep(60.0)
sys.exit(guardian_program.main())
"""


@pytest.fixture
def greeted():
    """Return who has greeted, in order."""
    return []


@pytest.fixture
def enter(greeted):
    """Return a function that makes nodes in the domain of this test."""
    context = rclpy.Context()
    context.init(args=[])
    domain = context.get_domain_id()
    context.try_shutdown()
    return lambda: GuardianNode(TOPIC, 'Twist', 'base_link', domain, greeted.append)


def publishers(observer):
    """Return how many publishers of velocities there are, once that is known."""
    time.sleep(0.5)
    return observer.node.count_publishers(TOPIC)


def test_a_node_that_is_matched_stays(listener, observer, enter, greeted):
    node = create_matched_node(enter, lambda: False)
    try:
        assert node.is_matched
        assert publishers(observer) == 1
    finally:
        node.end()
    assert len(greeted) <= 3


def test_a_node_that_is_not_matched_joins_again(observer, enter, greeted):
    began = time.monotonic()
    node = create_matched_node(enter, lambda: False)
    try:
        assert time.monotonic() - began > 2.0
        assert len(set(greeted)) == len(greeted) == 5
        assert publishers(observer) == 1
    finally:
        node.end()
    assert publishers(observer) == 0


def test_a_node_that_is_needed_stays(enter, greeted):
    node = create_matched_node(enter, lambda: True)
    node.end()
    assert len(greeted) == 1


def test_a_guardian_that_cannot_leave_the_graph_ends_all_the_same():
    """Otherwise it keeps the claim: the robot of a program that was killed stays taken."""
    reader, writer = os.pipe()
    with tempfile.TemporaryFile() as memory:
        memory.truncate(mmap.PAGESIZE)
        kept = (reader, memory.fileno())
        options = (TOPIC, os.environ['ROS_DOMAIN_ID'], 0.3, 'Twist', 'base_link', *kept)
        with subprocess.Popen(
                [sys.executable, '-c', HANGS, *map(str, options)], pass_fds=kept,
                stdout=subprocess.PIPE) as program:
            os.close(reader)
            os.close(writer)
            try:
                assert program.wait(20.0) == -signal.SIGALRM
            finally:
                program.kill()
