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
Plan what each robot of a fleet drives, and find where two come too near to each other.

This module needs no ROS.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from kachaka_simple_control.analysis.clearance import (
    FleetView,
    FloorRobot,
    MAX_ROUNDS,
    near_passes,
    NearPass,
)
from kachaka_simple_control.control.timing import rate_problem
from kachaka_simple_control.errors import InvalidMotionError, UsageError
from kachaka_simple_control.files.document import FileError, format_path
from kachaka_simple_control.files.fleet_file import (
    count_problem,
    FleetFile,
    FleetRobot,
    name_problem,
)
from kachaka_simple_control.files.motion_file import MotionFile
from kachaka_simple_control.files.robot_profile import find_robot, KACHAKA, RobotProfile
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.motion.drive_order import DriveOrder
from kachaka_simple_control.motion.geometry import compose, distance_between, ORIGIN, Pose
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.motion.time_scale import require_factor
from kachaka_simple_control.ros.node_parameters import NodeParameters

#: What to do about a near pass.
ADVICE = 'let one of them start elsewhere, take a smaller margin, or pass --allow-near'
#: The name of a fleet that no file describes.
UNNAMED = 'fleet'
#: A robot that ends so near to its start has come back to it [m, rad].
SAME = 1e-6
#: A problem of a fleet's file: the path of the value, and the text.
PathProblem = tuple[str, str]


@dataclass(frozen=True)
class PlannedRobot:
    """
    A robot of a fleet, and what it drives.

    :param order: one object for all robots that drive the same
    :param watch: whether it is held before obstacles
    :param simulation: its errors, if it is simulated
    """

    name: str
    fleet_robot: FleetRobot
    order: DriveOrder
    simulation: SimulationParameters
    watch: bool = False

    @property
    def plan(self) -> Plan:
        """Return the plan of its motion, for one round."""
        return self.order.plan

    @property
    def profile(self) -> RobotProfile:
        """Return what is known of this kind of robot."""
        return self.fleet_robot.profile

    @property
    def parameters(self) -> dict[str, Any]:
        """Return its parameters in a node, but for those that no file says."""
        return {'robot': self.fleet_robot.robot, 'rate': self.order.rate,
                'closed_loop': self.order.corrected is not None, 'watch': self.watch}

    @property
    def end(self) -> Pose:
        """Return where it stands after one round, on the floor of all."""
        return compose(self.fleet_robot.start, self.plan.pose)


@dataclass(frozen=True)
class FleetPlan:
    """
    What the robots of a fleet drive.

    :param robots: in the order of the file
    :param speed: relative to the motions, from 0.01 to 1: the time scale of all plans
    """

    file: FleetFile
    robots: tuple[PlannedRobot, ...]
    speed: float = 1.0

    @property
    def duration(self) -> float:
        """Return how long one round takes, which is that of the longest plan [s]."""
        return max(robot.plan.duration for robot in self.robots)

    @cached_property
    def floor(self) -> tuple[FloorRobot, ...]:
        """Return the robots on the floor that they share."""
        return tuple(
            FloorRobot(
                robot.name, robot.plan, robot.fleet_robot.start, robot.profile.footprint)
            for robot in self.robots)

    @cached_property
    def nearest(self) -> tuple[NearPass, ...]:
        """
        Return where two outlines come nearer than the margin of the file; computed once.

        Start poses are those of the file, and robots drive exactly as planned.
        """
        return tuple(near_passes(self.floor, self.file.margin, self.file.repeat))

    @property
    def view(self) -> FleetView:
        """Return the fleet as plots show it."""
        return FleetView(self.file.name, self.floor, self.file.margin, self.nearest)

    @property
    def simulated(self) -> dict[str, tuple[Pose, SimulationParameters]]:
        """Return where each robot begins, and its errors, for a simulation of them."""
        return {robot.name: (robot.fleet_robot.start, robot.simulation) for robot in self.robots}

    @property
    def are_all_rounds_checked(self) -> bool:
        """Return whether ``nearest`` is about all rounds; of many that differ, some are left."""
        apart = [distance_between(robot.fleet_robot.start, robot.end) for robot in self.robots]
        return self.file.repeat <= MAX_ROUNDS or all(
            max(distance, abs(angle)) < SAME for distance, angle in apart)


def fleet_of(robots: Mapping[str, MotionFile]) -> FleetFile:
    """
    Return a fleet that no file describes, of robots by name; all start at 0, 0, 0.

    :raises FleetFileError: if there are no robots or too many, or a name is no ROS namespace
    :raises RobotFileError: if a motion is for a robot whose profile cannot be read
    """
    kinds = {name: file.robot or KACHAKA.name for name, file in robots.items()}
    problems = [(format_path(['robots', name]), text)
                for name in robots if (text := name_problem(name))]
    if text := count_problem(len(robots)):
        problems.append(('robots', text))
    fleet = FleetFile(UNNAMED, '', tuple(
        FleetRobot(name, file, kinds[name], find_robot(kinds[name]), ORIGIN, file.rate)
        for name, file in robots.items()), source=UNNAMED)
    if problems:
        raise fleet.error(problems)
    return fleet


def plan_fleet(file: FleetFile, speed: float = 1.0, watch: bool | None = None) -> FleetPlan:
    """
    Plan what each robot of a fleet drives.

    :param speed: relative to the motions, from 0.01 to 1: a time scale for all
    :param watch: whether each robot is held before obstacles; None for what its motion says
    :raises FleetFileError: if a robot cannot drive its motion, or a value is out of its range; a
        line for each problem
    :raises InvalidMotionError: if the speed is out of range
    """
    require_factor(speed)
    problems: list[PathProblem] = []
    known: dict[tuple[MotionFile, RobotProfile, float, bool], DriveOrder | list[str]] = {}
    robots = []
    for robot in file.robots:
        path = f'robots.{robot.name}'
        rate = NodeParameters.rate if robot.rate is None else robot.rate
        problems += _rate_problems(file, robot, rate)
        try:
            simulation = SimulationParameters(**robot.simulation)
        except InvalidMotionError as error:
            problems.append((f'{path}.simulation.{error.name}', error.message))
            simulation = SimulationParameters()
        watched = bool(robot.motion_file.watch if watch is None else watch)
        key = (robot.motion_file, robot.profile, rate, watched)
        if key not in known:
            known[key] = _order(*key, speed)
        order = known[key]
        if isinstance(order, DriveOrder):
            robots.append(PlannedRobot(robot.name, robot, order, simulation, watched))
        else:
            problems += [(f'{path}.motion', text) for text in order]
    if problems:
        raise file.error(problems)
    return FleetPlan(file, tuple(robots), speed)


def require_clear(plan: FleetPlan) -> None:
    """
    Check that no two robots come nearer to each other than the margin.

    :raises FleetFileError: if two do; a line for each pair, at the second of them
    """
    if plan.nearest:
        margin = f'the margin is {100.0 * plan.file.margin:g} cm'
        raise plan.file.error([
            (f'robots.{near.names[1]}', f'{near.text}; {margin}: {ADVICE}')
            for near in plan.nearest])


def _order(
        motion_file: MotionFile, profile: RobotProfile, rate: float, watch: bool,
        speed: float) -> DriveOrder | list[str]:
    """Return what a robot drives, with its plan; or the problems, each with its file and line."""
    closed_loop, key = bool(motion_file.closed_loop), 'closed_loop'
    try:
        if closed_loop:
            profile.feedback_delay()
        key = 'watch'
        order = motion_file.order(profile, rate, closed_loop, speed, watch)
        order.plan  # noqa: B018
    except FileError as error:
        return [problem.describe(error.source) for problem in error.problems]
    except InvalidMotionError as error:
        # From here on it is not the motion as written: a long one may be too long for this speed.
        problem, = motion_file.error_at(
            error.path or '', error.message if error.path else str(error)).problems
        slow = '' if speed == 1.0 else f', at {100.0 * speed:g} % of its speed'
        return [problem.describe(motion_file.source) + slow]
    except UsageError as error:
        return [f'{motion_file.where(key)}: {key}: {error}']
    return order


def _rate_problems(file: FleetFile, robot: FleetRobot, rate: float) -> Iterator[PathProblem]:
    """Yield why a robot cannot be driven at its rate, at the place that says the rate."""
    text = rate_problem(rate, robot.profile.command_timeout, robot.profile.name)
    if not text:
        return
    path = f'robots.{robot.name}'
    if file.has(f'{path}.rate'):
        yield f'{path}.rate', text
    elif robot.motion_file.rate is not None:
        yield f'{path}.motion', f'{robot.motion_file.where("rate")}: rate: {text}'
    else:
        yield path, f'its rate, which no file says, is {text}'
