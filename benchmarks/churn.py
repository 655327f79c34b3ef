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
Drive while other nodes are restarted, which must not end a run.

Beside a simulated robot there are many other ROS nodes, of which some are restarted each second,
so that discovery is always busy.  ``python -m benchmarks.churn`` drives there, and prints how many
runs reached their end, and what ended the others.  Forty such nodes take all the time of two
processors: with ``--nice -10`` (as root) the drive has priority.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
import contextlib
import os
import random
import subprocess
import sys
import time

from benchmarks import ROOT
from benchmarks.machine import describe
from benchmarks.progress import show
from geometry_msgs.msg import Twist
from kachaka_simple_control.control import processes
from kachaka_simple_control.kachaka.bridge_process import simulated_bridge
from kachaka_simple_control.ros.dds_transport import CHOICES, LOCALHOST_ONLY, RANGE
import rclpy
from rclpy.node import Node
from ros_domain import isolate_ros

#: The number of processes of the other nodes; each has its own context and participant.
PROCESSES = 4
#: The time for discovery before the first run [s].
SETTLING_TIME = 15.0
#: The longest duration of a run, with start, discovery and stop [s].
MAX_RUN_TIME = 120.0


def restart_nodes(count: int, rate: float, seconds: float) -> None:
    """
    Start nodes, and restart them one after the other.

    :param count: the number of nodes
    :param rate: the restarts per second
    :param seconds: the duration [s]
    """
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

    :param nodes: the number of nodes
    :param restarts: the restarts per second
    :param longest: the time after which the nodes end by themselves [s]
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
        subprocess.Popen([sys.executable, '-m', 'benchmarks.churn', '--be-others', *share],
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


def measure(motion: str, rate: float, runs: int, nice: int) -> Counter[str]:
    """
    Drive several runs, and count how they ended.

    :param motion: the name of a library motion
    :param rate: the rate of velocity messages [Hz]
    :param runs: the number of runs
    :param nice: a number added to the niceness of each run
    :returns: the count of each last message; the message is empty for a completed run
    """
    command = [*processes.python_command('kachaka_simple_control.__main__'), motion, '--quiet',
               '--rate', str(rate)]
    ends: Counter[str] = Counter()
    for index in range(runs):
        done = subprocess.run(
            ['nice', '-n', str(nice), *command] if nice else command, cwd=ROOT,
            env=processes.child_environment(), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE, text=True, timeout=MAX_RUN_TIME, check=False)
        message = ''.join(done.stderr.splitlines()[-1:]) or f'exit code {done.returncode}'
        ends[message if done.returncode else ''] += 1
        show('runs', index + 1, runs)
    return ends


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print; return 1 if a run was not completed, else 0."""
    parser = argparse.ArgumentParser(prog='benchmarks.churn', description=__doc__)
    parser.add_argument('--motion', default='square', help='of the library (default: square)')
    parser.add_argument('--rate', type=float, default=50.0, help='[Hz] (default: 50)')
    parser.add_argument('--runs', type=int, default=5, help='(default: 5)')
    parser.add_argument('--nodes', type=int, default=40, help='other nodes (default: 40)')
    parser.add_argument('--restarts', type=float, default=3.0, help='a second (default: 3)')
    parser.add_argument('--nice', type=int, default=0, help='of the drive (default: 0)')
    parser.add_argument('--be-others', nargs=3, type=float, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.be_others:
        restart_nodes(int(options.be_others[0]), *options.be_others[1:])
        return 0
    isolate_ros()
    with others(options.nodes, options.restarts, SETTLING_TIME + MAX_RUN_TIME * options.runs):
        time.sleep(SETTLING_TIME)
        with simulated_bridge():
            ends = measure(options.motion, options.rate, options.runs, options.nice)
    print(f'{ends.pop("", 0)} of {options.runs} runs reached their end, beside {options.nodes} '
          f'nodes of which {options.restarts:g} a second are restarted '
          f'({describe()["cores"]} processors)')
    for message, count in ends.most_common():
        print(f'{count} of {options.runs}: {message}')
    return 1 if ends else 0


if __name__ == '__main__':
    sys.exit(main())
