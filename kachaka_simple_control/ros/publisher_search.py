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
"""Find all velocity publishers in the ROS graph within half a second of the program's start."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import os
import signal
import sys
import time

from kachaka_simple_control.control.timing import PUBLISHER_SEARCH_TIME, PUBLISHER_SEARCH_TIMEOUT
from kachaka_simple_control.ros.dds_transport import repeated_joining
from kachaka_simple_control.ros.endpoints import participants
from rclpy.context import Context
from rclpy.node import Node

#: How often the search looks at the graph [s].  Chosen.
SEARCH_PERIOD = 0.02
#: The types of velocity messages.
VELOCITY_TYPES = ('geometry_msgs/msg/Twist', 'geometry_msgs/msg/TwistStamped')


def start_publisher_search(domain: int, closed: Sequence[int]) -> int:
    """
    Search for velocity publishers in a child process of this process.

    It writes a line ``publisher PARTICIPANT TOPIC`` for each (the participant is hexadecimal), and
    ``searched`` at its end: after PUBLISHER_SEARCH_TIME (0.55 s), or with this process.

    A new DDS participant may discover another one up to 3 s late, and this program could take a
    robot that another drives.  The node of the search joins the graph again and again, so it
    discovers all others in time; it cannot send velocities, because others forget it each time.

    Call this before this process uses DDS or starts threads.  The search has its own process
    because Fast DDS reads its profile once.

    :param closed: descriptors that the child closes, so that their other ends notice the end of
        this process
    :returns: the descriptor from which the lines are read; it ends with the search
    """
    parent = os.getpid()
    # The system removes the child process after its end.
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    reader, writer = os.pipe()
    if os.fork() != 0:
        os.close(writer)
        return reader
    try:
        # Fast DDS may hang.  The alarm ends this process.
        signal.setitimer(signal.ITIMER_REAL, PUBLISHER_SEARCH_TIMEOUT)
        for descriptor in closed:
            os.close(descriptor)
        # Not closed: a library may print.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        _search(domain, lambda line: os.write(writer, f'{line}\n'.encode()),
                lambda: os.getppid() == parent)
    finally:
        os._exit(0)  # without the exit functions of the parent


def _search(domain: int, report: Callable[[str], object], is_wanted: Callable[[], bool]) -> None:
    context = Context()
    context.init(args=[], domain_id=domain)
    with repeated_joining():
        node = Node(
            f'_publisher_search_{os.getpid()}', context=context, use_global_arguments=False,
            enable_rosout=False, start_parameter_services=False)
    end, found = time.monotonic() + PUBLISHER_SEARCH_TIME, set[tuple[str, bytes]]()
    while time.monotonic() < end and is_wanted():
        time.sleep(SEARCH_PERIOD)
        publishers = {
            (topic, participant)
            for topic, types in node.get_topic_names_and_types() if set(types) & {*VELOCITY_TYPES}
            for participant in participants(node.get_publishers_info_by_topic(topic))}
        for topic, participant in publishers - found:
            report(f'publisher {participant.hex()} {topic}')
        found |= publishers
    report('searched')
    node.destroy_node()
    context.try_shutdown()
