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
"""Several robots and nodes beside each other in one domain, each pair in its own namespaces."""

from __future__ import annotations

import contextlib
import sys

from optional_libraries import optional_imports
from program import program, script
import pytest
from ros_support import bridge

with optional_imports():
    from topic_observer import positions, TopicObserver

pytestmark = [pytest.mark.ros, pytest.mark.slow, pytest.mark.needs('nav_msgs', 'diagnostic_msgs')]

#: With time before and after, for discovery may find the observer late.
MOTION = """
name: {name}
steps:
  - wait: 2 s
  - forward: {distance} m
  - wait: 2 s
"""
#: Two nodes in one program; closing each takes half a second.
END_OF_TWO = """
import os, sys, time
import rclpy
from kachaka_simple_control import KachakaSimpleControl
from kachaka_simple_control.ros.commander import Commander
close, closed = Commander.close, []

def slow_close(self):
    if self not in closed:
        closed.append(self)
        os.write(1, f'closing at {time.monotonic()}\\n'.encode())
        time.sleep(0.5)
    close(self)

Commander.close = slow_close
rclpy.init()
nodes = [KachakaSimpleControl(namespace=name) for name in ('one', 'two')]
"""
#: Namespace of the robot, namespace of the node, name of the node, how far it goes [m].
PAIRS = (('/left/robot', '/lab', 'one', 0.1), ('/right', '/', 'two', -0.05))


@contextlib.contextmanager
def driven(robot, namespace, name, distance, folder):
    """Drive a robot of its own."""
    file = folder / f'{name}.yaml'
    file.write_text(MOTION.format(name=name, distance=distance))
    (folder / name).mkdir()
    command = [
        sys.executable, '-m', 'kachaka_simple_control', str(file), '--ros-args',
        '-r', f'__ns:={namespace}', '-r', f'__node:={name}', '-p', f'robot_namespace:={robot}']
    with bridge('--namespace', robot), program(command, folder / name) as started:
        yield started


def test_two_nodes_drive_two_robots_at_once(tmp_path):
    with TopicObserver() as observer, contextlib.ExitStack() as stack:
        names = [f'{namespace.rstrip("/")}/{name}' for _, namespace, name, _ in PAIRS]
        planned = [observer.planned(node, matched=False) for node in names]
        driven_paths = [observer.driven(node, matched=False) for node in names]
        sent = [observer.velocities(node, matched=False) for node in names]
        diagnoses = observer.diagnostics(matched=False)
        programs = [stack.enter_context(driven(*pair, tmp_path)) for pair in PAIRS]
        assert [one.end() for one in programs] == [0, 0], [one.text for one in programs]
        for pair, plans, paths, velocities in zip(PAIRS, planned, driven_paths, sent):
            distance = pair[-1]
            assert positions(plans[-1])[-1] == pytest.approx((distance, 0.0))
            # The last of it may not have been published any more.
            assert 0.0 <= positions(paths[-1])[-1][0] / distance <= 1.05
            assert {v.twist.linear.x * distance >= 0.0 for v in velocities} == {True}
            assert any(v.twist.linear.x for v in velocities)
        statuses = {(one.status[0].name, one.status[0].hardware_id) for one in diagnoses}
        assert statuses == {
            (f'{node.lstrip("/")}: drive', f'kachaka on {pair[0]}/manual_control/cmd_vel')
            for node, pair in zip(names, PAIRS)}


@pytest.mark.parametrize(('end', 'code'), [('sys.exit(3)', 3), ('rclpy.shutdown()', 0)])
def test_the_robots_of_a_program_are_closed_at_the_same_time(end, code, tmp_path):
    """Each close begins with the stop of a robot that may still be driven by another thread."""
    with script(END_OF_TWO + end, tmp_path, '--ros-args', '-p', 'guardian:=false') as started:
        assert started.end() == code
    begun = [float(line.split()[-1]) for line in started.text.splitlines() if 'closing' in line]
    assert len(begun) == 2
    assert abs(begun[1] - begun[0]) < 0.3  # less than one takes
