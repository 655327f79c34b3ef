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
"""A fleet: robots that drive in step.  Tested by test/fleet/test_fleet.py."""

from __future__ import annotations

from collections.abc import Mapping
import contextlib
import os
from typing import Any

from kachaka_simple_control.control.drive_requests import DriveRequest
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.files.library import find
from kachaka_simple_control.files.motion_file import MotionFile
from kachaka_simple_control.fleet.fleet_plan import fleet_of, FleetPlan, plan_fleet
from kachaka_simple_control.kachaka.bridge_process import (
    floor_option,
    require_floor,
    simulated_fleet,
)
from kachaka_simple_control.motion.steps import Motion
from kachaka_simple_control.ros.dds_transport import start_on_this_machine
from kachaka_simple_control.ros.drive_node import DriveNode
from rclpy.impl.rcutils_logger import RcutilsLogger

NODE = 'kachaka_fleet'
#: How often each simulated robot reports odometry [Hz], and how often all together, if the first
#: does not prevent it: more would take most of a core.
MIN_RATE, MAX_RATE, ODOMETRY = 10.0, 50.0, 500.0


class Fleet(contextlib.AbstractContextManager['Fleet']):
    """
    Robots that drive motions in step: all begin at one t = 0, or none moves.

    At the end of a ``with`` block, or after ``close``, the robots are stopped and released.

    :ivar plan: what each robot drives
    :ivar node: drives them; ``node.commander`` pauses, resumes and stops them
    :ivar round: the number of the current repetition, from 1; 0 before the first
    """

    def __init__(
            self, robots: FleetPlan | Mapping[str, Motion | MotionFile | str | os.PathLike[str]],
            parameters: Mapping[str, Any] | None = None, *, sim: bool = False,
            floor: str | os.PathLike[str] | None = None, **node_options: Any) -> None:
        """
        Create the node, and call ``rclpy.init()`` if ROS is not initialized yet.

        :param robots: a motion, its name, its file or what ``find`` returns for each robot, by its
            ROS namespace; or the plan of a fleet's file
        :param parameters: the parameters of each robot, as for ``KachakaSimpleControl``, but for
            ``robot``, ``rate`` and ``closed_loop``, which its motion says
        :param sim: whether to start simulated robots, which are visible only on this machine
        :param floor: the name or the file of their floor; None for an empty floor
        :raises InvalidMotionError: if a robot cannot drive its motion
        :raises UsageError: if a name, a parameter or the floor is invalid
        """
        require_floor(floor, sim)
        given = dict(parameters or {})
        if wrong := {'robot', 'rate', 'closed_loop'}.intersection(given):
            raise UsageError(
                f'{", ".join(sorted(wrong))}: the motion of each robot says it, in its file')
        self.plan = robots if isinstance(robots, FleetPlan) else plan_fleet(fleet_of({
            name: _motion_file(motion) for name, motion in robots.items()}),
            watch=given.get('watch'))
        self.round = 0
        self._parts = contextlib.ExitStack()
        with contextlib.ExitStack() as stack:
            if sim:
                start_on_this_machine(self)
            self.node = DriveNode(NODE, {
                robot.name: {**robot.parameters, **given}
                for robot in self.plan.robots}, **node_options)
            self.logger: RcutilsLogger = self.node.get_logger()  # type: ignore[no-untyped-call]
            stack.callback(self.node.destroy_node)
            if sim:
                self.simulate(stack, floor)
            self._parts = stack.pop_all()

    def simulate(
            self, stack: contextlib.ExitStack,
            floor: str | os.PathLike[str] | None = None) -> None:
        """
        Start simulated robots, and drive no others, until the stack is closed.

        :param floor: the name or the file of their floor; None for an empty floor
        """
        rate = max(MIN_RATE, min(MAX_RATE, ODOMETRY / len(self.plan.robots)))
        bridge = stack.enter_context(simulated_fleet(
            self.plan.simulated, ['--odometry-rate', f'{rate:g}', *floor_option(floor)]))
        for robot in self.node.robots.values():
            robot.discovery.require_participant(bridge.require_participant)

    def run(self, start: float | None = None) -> None:
        """
        Drive the motions, as often as the fleet's file says, and leave all robots at rest.

        :param start: t = 0 of the first time [s on the steady clock]; None: when all are ready
        :raises ControlError: if a robot could not be driven; then all were stopped, unless the
            file says that the others go on
        """
        self.drive(None, start)

    def start(self) -> str:
        """
        Call ``run`` in a thread of its own; from now on a stop ends it.

        :raises ControlError: if the robots cannot be driven now, for example as they are already
        """
        return self.node.commander.start(self.drive)

    def drive(self, request: DriveRequest | None, start: float | None = None) -> None:
        """
        Do the same as ``run``, for a drive that was requested before.

        :param request: from the commander; None for a new one
        """
        self.node.commander.drive(
            {self.node.robots[robot.name]: robot.order for robot in self.plan.robots},
            request, self.plan.file.goes_on, start, self.plan.file.repeat, self._on_round)

    def _on_round(self, number: int) -> None:
        self.round = number

    def close(self) -> None:
        """Stop and release the robots, and end the simulated ones; may be called again."""
        self._parts.close()

    def __exit__(self, *error: object) -> None:
        """Stop and release the robots."""
        self.close()


def _motion_file(motion: Motion | MotionFile | str | os.PathLike[str]) -> MotionFile:
    if isinstance(motion, MotionFile):
        return motion
    return MotionFile(motion, motion.name) if isinstance(motion, Motion) else find(motion)
