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
Start two fleets at one time in two network namespaces, which find all by a discovery server.

Multicast is blocked.  Each fleet drives robots at the other end.  The clock of the second fleet's
end is 3 ms behind, as its program sees it; timestamps of DDS are those of the one machine.
"""

from __future__ import annotations

import contextlib
from datetime import datetime, timezone
import math
import os
from pathlib import Path
import signal
import sys
import tempfile
import time
from typing import Any

from benchmarks import ROOT
from benchmarks.fleet.drives import rounded, timing
from benchmarks.fleet.fleet_files import names_of, write_fleet, write_moves
from benchmarks.fleet.observer import Observer
from benchmarks.fleet.scale import Scale
from benchmarks.fleet.stage import (
    Bridge,
    DriveProgram,
    EXIT_TIMEOUT,
    FLEET,
    network_environment,
    START_TIMEOUT,
)
from benchmarks.run import show
from benchmarks.stop_matrix.network import ADDRESSES, Network, NODE, ROBOT, unavailable_reason
from kachaka_simple_control.ros.dds_transport import TRANSPORTS
from program import Program
from ros_domain import claim_domain, release_domain

#: By how much the clock of the second fleet is behind [s].
OFFSET = 0.003
#: The time from the start of the programs to that of the drive; for how long nothing happens; how
#: long a program may take to join [s].
LEAD, TOGETHER, JOIN_TIME = 8.0, 3.0, 8.0
#: How many movements of a second the fleets drive.
MOVES = 10
#: What somebody else sends [m/s].
FOREIGN_VELOCITY = 0.05
PORT = 11811
#: What ``chronyc -c tracking`` says of a good clock; its columns are in the manual of chronyc.
CHRONYC = """#!/bin/sh
echo C0000201,192.0.2.1,2,0.0,0.000012,0.000003,0.000040,1.5,0.001,0.02,0.0008,0.0002,64.4,Normal
"""
#: The command ``kachaka_fleet`` on a machine whose clock is behind.
BEHIND = f"""
import sys, time
from types import SimpleNamespace
from kachaka_simple_control.fleet import start_time
start_time.time = SimpleNamespace(
    monotonic=time.monotonic, time=lambda: time.time() - {OFFSET})
from kachaka_simple_control.entry_points import fleet
sys.exit(fleet())
"""
#: A program of somebody else that sends velocities to a robot until it is ended.
FOREIGN = f"""
import sys, time
import rclpy
from geometry_msgs.msg import Twist
rclpy.init()
node = rclpy.create_node('somebody_else')
publisher = node.create_publisher(Twist, sys.argv[1], 10)
message = Twist()
message.linear.x = {FOREIGN_VELOCITY}
while True:
    publisher.publish(message)
    time.sleep(0.1)
"""


class Halves:
    """
    A context manager for two ends of a network with a fleet's robots at each.

    :ivar names: of the robots of the first fleet, which are at the end ROBOT, and of the second
    """

    def __init__(self, count: int) -> None:
        self.names = names_of(count, 'a'), names_of(count, 'b')
        self._parts = contextlib.ExitStack()

    def __enter__(self) -> Halves:
        """Make the network, and start server, robots and observer."""
        with contextlib.ExitStack() as parts:
            self._network = parts.enter_context(Network())
            self._network.block_multicast()
            self.folder = Path(parts.enter_context(
                tempfile.TemporaryDirectory(prefix='fleet_bench_')))
            domain = claim_domain()
            parts.callback(release_domain, domain)
            self._variables = self._environment(domain)
            self.server = parts.enter_context(self._server())
            # Plain nodes take the transport from the variable, and are no super clients by
            # themselves.
            self._plain = {**self._variables, TRANSPORTS: 'UDPv4', 'ROS_SUPER_CLIENT': 'TRUE'}
            for end_name, names in zip((ROBOT, NODE), self.names):
                robots = write_fleet(
                    self.folder / f'{end_name}.yaml', names, 'straight', 10.0)
                parts.enter_context(Bridge(
                    ['--robots', str(robots)], self._variables,
                    self._network.command(end_name, []))).wait_until_ready()
            self.observer = parts.enter_context(Observer(
                [name for names in self.names for name in names], self._plain,
                lambda command: self._network.command(NODE, command)))
            self._parts = parts.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        """End all, and remove the network."""
        self._parts.close()

    def fleet(self, number: int, motion: str, *options: str) -> DriveProgram:
        """Start the first (0) or the second (1) fleet, at the other end than its robots."""
        names = self.names[number]
        file = write_fleet(self.folder / f'fleet_{number}.yaml', names, motion, 10.0)
        command = [sys.executable, '-c', BEHIND] if number else FLEET
        waits = [word for name in names
                 for word in ('-p', f'{name}.robot_timeout:={START_TIMEOUT:g}')]
        return DriveProgram(
            self._network.command((NODE, ROBOT)[number], [
                *command, str(file), '--quiet', *options, '--ros-args', *waits]),
            self.folder, self._variables)

    def foreign(self, robot: str) -> Program:
        """Start a program of somebody else, at the end of the first fleet's robots."""
        command = [sys.executable, '-c', FOREIGN, f'/{robot}/manual_control/cmd_vel']
        return Program(self._network.command(ROBOT, command), env=self._plain)

    def _environment(self, domain: int) -> dict[str, str]:
        chronyc = self.folder / 'chronyc'
        chronyc.write_text(CHRONYC)
        chronyc.chmod(0o755)
        return {
            **network_environment(self._network), 'ROS_DOMAIN_ID': str(domain),
            'ROS_DISCOVERY_SERVER': f'{ADDRESSES[NODE]}:{PORT}',
            'PATH': os.pathsep.join([str(self.folder), os.environ['PATH']])}

    def _server(self) -> Program:
        server = Program(self._network.command(NODE, [
            'tools/discovery_server.sh', sys.prefix, ADDRESSES[NODE], str(PORT)]), cwd=ROOT,
            env=self._variables)
        server.wait_for_text('running')
        return server


def measure_two_fleets(scale: Scale) -> dict[str, Any]:
    """Return what two fleets in two namespaces did; only a reason where that is not possible."""
    if reason := unavailable_reason():
        return {'reason': reason}
    show('two fleets in two namespaces', 1, 1)
    with Halves(scale.halves) as halves:
        return _together(halves)


def _together(halves: Halves) -> dict[str, Any]:
    """Start both; then somebody else sends to a robot of the first, and the server is killed."""
    motion = write_moves(halves.folder, MOVES)
    start = math.ceil(time.time() + LEAD)
    text = datetime.fromtimestamp(start, timezone.utc).isoformat()
    with contextlib.ExitStack() as stack:
        first, second = (stack.enter_context(halves.fleet(number, motion, '--start-at', text))
                         for number in range(2))
        time.sleep(max(0.0, start + TOGETHER - time.time()))
        robot = halves.names[0][0]
        stack.enter_context(halves.foreign(robot))
        foreign_code = first.code_within(JOIN_TIME)
        killed = time.time()
        os.killpg(halves.server.process.pid, signal.SIGKILL)
        code = second.code_within(MOVES + EXIT_TIMEOUT)
        records = halves.observer.records()
        said = [first.last_line(), second.last_line()]
    last = max((one.time for name in halves.names[1] for one in records[name] if one.moves),
               default=killed)
    return {
        'robots': len(records), 'code': code, 'said': said[1],
        'after_kill': rounded(last - killed),
        'foreign_code': foreign_code, 'foreign_said': said[0],
        'foreign_seen': foreign_code == 1 and robot in said[0],
        **timing(halves.folder / 'fleet_0.yaml', records, TOGETHER)}
