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
"""Other nodes, of which some are restarted each second, so that discovery is always busy."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
import os
import random
import subprocess
import sys
import time

from benchmarks import ROOT
from geometry_msgs.msg import Twist
from kachaka_simple_control.ros.dds_transport import CHOICES, LOCALHOST_ONLY, RANGE
import rclpy
from rclpy.node import Node

#: The number of processes of the other nodes; each has its own context and participant.
PROCESSES = 4


def restart_nodes(count: int, rate: float, seconds: float) -> None:
    """Start nodes, and restart them one after the other."""
    end = time.monotonic() + seconds
    stop = [_start_node(number) for number in range(count)]
    due = time.monotonic()
    for number in range(count, count + round(seconds * rate)):
        # Late restarts are not made up for.
        due = max(due + 1.0 / rate, time.monotonic())
        if due >= end:
            return
        time.sleep(max(0.0, due - time.monotonic()))
        stop.pop(random.randrange(count))()
        stop.append(_start_node(number))


def _start_node(number: int) -> Callable[[], None]:
    """Start a node; return a function that stops it."""
    context = rclpy.Context()
    context.init(args=[])
    node = Node(
        f'other_{os.getpid()}_{number}', context=context, start_parameter_services=False,
        enable_rosout=False)
    node.create_publisher(Twist, f'other_{number % 5}', 10)
    node.create_subscription(Twist, f'other_{(number + 1) % 5}', lambda _: None, 10)

    def stop() -> None:
        node.destroy_node()
        context.try_shutdown()
    return stop


@contextlib.contextmanager
def others(
        nodes: int, restarts: float, longest: float, domain: int | None = None) -> Iterator[None]:
    """
    Run and restart other nodes during the ``with`` block, which begins at once.

    The nodes use ROS's default transports on this machine only.

    :param domain: their ROS domain; None for the domain of the environment
    """
    variables = {name: value for name, value in os.environ.items() if name not in CHOICES}
    # Humble has no discovery range.
    if os.environ.get('ROS_DISTRO') == 'humble':
        variables[LOCALHOST_ONLY] = '1'
    else:
        variables[RANGE] = 'LOCALHOST'
    if domain is not None:
        variables['ROS_DOMAIN_ID'] = str(domain)
    share = (str(nodes // PROCESSES), str(restarts / PROCESSES), str(longest))
    started = [
        subprocess.Popen([sys.executable, '-m', 'benchmarks.stop_matrix.restarting_nodes', *share],
                         cwd=ROOT, env=variables) for _ in range(PROCESSES)]
    try:
        yield
    finally:
        # Killed nodes would leave locked shared memory behind.
        for process in started:
            process.terminate()
        for process in started:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(10.0)
            process.kill()
            process.wait()


if __name__ == '__main__':
    restart_nodes(int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3]))
