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
Where a motion ends that goes through three processes: robot over gRPC, bridge, node.

Each is a process of its own, as with a real Kachaka: ``kachaka_sim``, ``kachaka_bridge --address``
and ``kachaka_simple_control``.  The robot's odometry before and after is compared with the pose at
the end of the plan.  ``python -m benchmarks.experiments.three_processes`` prints the table of
``docs/kachaka.md``.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
import math
import os
import subprocess
import sys
import time

from benchmarks import ROOT
from benchmarks.grpc_robot import GrpcRobot
from benchmarks.progress import show
from benchmarks.tables import number, Table
from kachaka_simple_control.analysis.message_timing import median
from kachaka_simple_control.control import processes
from kachaka_simple_control.files.library import find
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.motion.geometry import distance_between, Pose, relative_to
from kachaka_simple_control.motion.plan import Plan, plan
from kachaka_simple_control.ros.node_parameters import NodeParameters
from ros_domain import isolate_ros

MOTIONS, RUNS = ('lesson', 'square'), 10
#: The thresholds of the median errors: position [m] and heading [rad].
MAX_OFFSET, MAX_ANGLE = 0.003, math.radians(0.5)
#: The longest duration of a run beyond its motion: start, discovery, stop [s].
MAX_OVERHEAD = 60.0
#: The time from the end of a run until the robot is at rest [s].
REST_TIME = 0.5
HEAD = ('motion', 'runs to the end', 'position off [mm], median / worst',
        'heading off [degrees], median / worst')


@dataclass(frozen=True)
class Run:
    """
    The result of one run.

    :param motion: the name of the motion
    :param position: the distance from the planned end [m]
    :param heading: the absolute difference from the planned heading at the end [rad]
    :param failure: the reason why the run was not completed; empty if it was
    """

    motion: str
    position: float
    heading: float
    failure: str = ''


def measure(motions: Sequence[str] = MOTIONS, runs: int = RUNS) -> list[Run]:
    """Drive each library motion several times; return the results."""
    isolate_ros()
    robot = GrpcRobot('kachaka', int(os.environ['ROS_DOMAIN_ID']))
    found = []
    try:
        for motion in motions:
            planned = planned_as_driven(motion)
            for index in range(runs):
                found.append(_drive(robot, motion, planned))
                show(f'runs of {motion}', index + 1, runs)
    finally:
        robot.close()
    return found


def planned_as_driven(motion: str) -> Plan:
    """Plan a library motion for a Kachaka, like the command does."""
    file = find(motion)
    rate = file.rate or NodeParameters.rate
    return plan(file.motion, file.check(KACHAKA.limits, KACHAKA.name), rate)


def errors(start: Pose, end: Pose, planned: Pose) -> tuple[float, float]:
    """
    Return the error of a robot's end pose.

    :param start: the measured start pose
    :param end: the measured end pose
    :param planned: the planned end pose for a start at the origin
    :returns: the distance [m] and the heading difference [rad], both without sign
    """
    position, heading = distance_between(planned, relative_to(start, end))
    return position, abs(heading)


def table(runs: Sequence[Run]) -> Table:
    """Return the table of end errors, with a row for each motion."""
    return Table(
        'Where the robot ended, by its odometry', HEAD,
        tuple(_row(motion, [run for run in runs if run.motion == motion])
              for motion in dict.fromkeys(run.motion for run in runs)))


def missed(runs: Sequence[Run]) -> list[str]:
    """Return a sentence for each failed run and each missed threshold."""
    found = [f'{run.motion}: {run.failure}' for run in runs if run.failure]
    for motion in dict.fromkeys(run.motion for run in runs):
        ended = [run for run in runs if run.motion == motion and not run.failure]
        if ended and median([run.position for run in ended]) > MAX_OFFSET:
            found.append(f'{motion}: more than {1e3 * MAX_OFFSET:g} mm off at the median')
        if ended and median([run.heading for run in ended]) > MAX_ANGLE:
            found.append(
                f'{motion}: more than {math.degrees(MAX_ANGLE):g} degrees off at the median')
    return found


def _row(motion: str, runs: Sequence[Run]) -> tuple[str, ...]:
    ended = [run for run in runs if not run.failure]
    return (
        motion, f'{len(ended)} of {len(runs)}',
        _both([1e3 * run.position for run in ended]),
        _both([math.degrees(run.heading) for run in ended]))


def _both(values: Sequence[float]) -> str:
    return f'{number(median(values), 2)} / {number(max(values), 2)}' if values else '-'


def _drive(robot: GrpcRobot, motion: str, planned: Plan) -> Run:
    start = robot.pose()
    failure = _command(motion, planned.duration + MAX_OVERHEAD)
    time.sleep(REST_TIME)
    return Run(motion, *errors(start, robot.pose(), planned.pose), failure)


def _command(motion: str, timeout: float) -> str:
    """Run the command; return the reason of a failure, or an empty text."""
    command = [*processes.python_command('kachaka_simple_control.__main__'), motion, '--quiet']
    done = subprocess.run(
        command, cwd=ROOT, env=processes.child_environment(), stdin=subprocess.DEVNULL, text=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, timeout=timeout, check=False)
    if done.returncode == 0:
        return ''
    return f'exit code {done.returncode}: {"".join(done.stderr.splitlines()[-1:])}'


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print; return 1 if a threshold was missed or a run failed, else 0."""
    parser = argparse.ArgumentParser(prog='three_processes', description=__doc__)
    parser.add_argument('--runs', type=int, default=RUNS, help='of each motion (default: 10)')
    parser.add_argument('--motions', nargs='+', default=MOTIONS, metavar='NAME',
                        help='which of the library (default: lesson square)')
    options = parser.parse_args(arguments)
    runs = measure(options.motions, options.runs)
    print(table(runs).markdown())
    print(f'The threshold, at the median: {1e3 * MAX_OFFSET:g} mm '
          f'and {math.degrees(MAX_ANGLE):g} degrees')
    found = missed(runs)
    print('\n'.join(['Missed:', *found]) if found else 'Held')
    return 1 if found else 0


if __name__ == '__main__':
    sys.exit(main())
