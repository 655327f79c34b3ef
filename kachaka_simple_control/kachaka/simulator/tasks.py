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
Tasks of the simulated robot, the controller of their actions, and their queue.

Tested by test/kachaka/simulator/test_simulated_tasks.py.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
import math

from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.kachaka.robot_status import ERROR_STUCK, SUCCESS
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.motion.geometry import advance, Pose, Velocity, ZERO

# The manufacturer publishes none of these values; all are chosen.
#: The period of the controller of an action [s].
CONTROL_PERIOD = 0.02
#: An action ends when the robot is within this distance of the goal [m, rad].  The second value is
#: for a robot that is not ideal, which approaches the goal slowly.
TOLERANCE, TOLERANCE_WITH_LAG = 1e-6, 1e-4
#: A robot that is not ideal must also be slower than this at the end of an action [m/s, rad/s].
MAX_END_SPEED = 1e-3
#: An action fails at its time limit if the goal is farther away than this [m, rad].
FAILED_TOLERANCE = 1e-3
#: The time limit of an action is its duration at full speed times this factor, plus this margin
#: [s].
TIME_LIMIT_FACTOR, TIME_LIMIT_MARGIN = 3.0, 10.0
#: The robot does not turn towards a point that is closer than this [m].
SAME_POINT = 1e-4
#: The largest number of stored task results.
MAX_RESULTS = 100


@dataclass(frozen=True)
class MotionAction:
    """
    An action that moves the robot: one straight line or one turn in place.

    :param length: returns the distance [m] or angle [rad] from the pose at its start, signed
    :param speed: the largest speed [m/s or rad/s]; 0 for the largest speed of the robot
    """

    length: Callable[[Pose], float]
    is_turn: bool = False
    speed: float = 0.0


def drive_straight(distance: float, speed: float = 0.0) -> MotionAction:
    """
    Return an action that drives the robot straight.

    :param distance: negative backwards [m]
    :param speed: the largest speed [m/s]; 0 for the largest speed of the robot
    """
    return MotionAction(lambda _: distance, speed=speed)


def turn_in_place(angle: float) -> MotionAction:
    """Return an action that turns the robot in place by an angle [rad]."""
    return MotionAction(lambda _: angle, is_turn=True)


@dataclass(frozen=True)
class StandStill:
    """An action in which the robot stands still for a time; clients may be able to end it."""

    duration: float
    can_be_ended: bool = False


Action = MotionAction | StandStill


def plan_to_pose(pose: Pose) -> tuple[Action, ...]:
    """Return the actions to a pose: a turn, a straight line and a turn; the shorter way each."""
    def distance(start: Pose) -> float:
        return math.hypot(pose.x - start.x, pose.y - start.y)

    def angle_to_point(start: Pose) -> float:
        if distance(start) <= SAME_POINT:
            return 0.0
        direction = math.atan2(pose.y - start.y, pose.x - start.x)
        return math.remainder(direction - start.theta, math.tau)

    def angle_to_heading(start: Pose) -> float:
        return math.remainder(pose.theta - start.theta, math.tau)

    return (
        MotionAction(angle_to_point, is_turn=True), MotionAction(distance),
        MotionAction(angle_to_heading, is_turn=True))


def plan_docking(dock: Pose, distance: float, speed: float) -> tuple[Action, ...]:
    """
    Return the actions to dock: drive to a pose in front of the dock, then backwards onto it.

    :param dock: the pose of the docked robot, in the odometry frame
    :param distance: to drive backwards [m], with a speed [m/s]
    """
    return (*plan_to_pose(advance(dock, distance, 0.0)), drive_straight(-distance, speed))


class ActionController:
    """The controller of one action: a closed loop, which reaches its goal in spite of noise."""

    def __init__(
            self, action: Action, start: Pose, now: float,
            parameters: SimulationParameters) -> None:
        self._action = action
        self._start = start
        #: the latest time for a motion to end, or the time at which a standstill ends [s]
        self.end = now
        if isinstance(action, StandStill):
            self.end += action.duration
            return
        self._lag = parameters.lag
        self._tolerance, self._max_end_speed = (TOLERANCE, math.inf) if parameters.is_ideal else (
            TOLERANCE_WITH_LAG, MAX_END_SPEED)
        self._length = action.length(start)
        fastest, self._acceleration = (
            (KACHAKA.limits.max_angular_velocity, parameters.angular_acceleration)
            if action.is_turn
            else (KACHAKA.limits.max_linear_velocity, parameters.linear_acceleration))
        self._speed = min(abs(action.speed) or math.inf, fastest)
        self.end += TIME_LIMIT_FACTOR * abs(self._length) / self._speed + TIME_LIMIT_MARGIN

    def step(
            self, pose: Pose, velocity: Velocity, now: float) -> tuple[Velocity, float] | bool:
        """
        Return the next velocity and the time of the next step [s].

        :returns: once the action has ended, whether it was successful
        """
        action = self._action
        if isinstance(action, StandStill):
            return now >= self.end or (ZERO, self.end)
        remaining = self._remaining(pose, action.is_turn)
        speed = velocity.angular_z if action.is_turn else velocity.linear_x
        # A robot that moves too fast at the goal has not arrived.
        if abs(remaining) <= self._tolerance and abs(speed) <= self._max_end_speed:
            return True
        if now >= self.end:
            return abs(remaining) <= FAILED_TOLERANCE
        speed = self._speed_for(remaining)
        target = Velocity(angular_z=speed) if action.is_turn else Velocity(linear_x=speed)
        return target, now + CONTROL_PERIOD

    def _remaining(self, pose: Pose, is_turn: bool) -> float:
        if is_turn:
            return self._length - (pose.theta - self._start.theta)
        heading = self._start.theta
        return self._length - (
            (pose.x - self._start.x) * math.cos(heading)
            + (pose.y - self._start.y) * math.sin(heading))

    def _speed_for(self, remaining: float) -> float:
        # Without a lag, drive the remaining length within one period.  With a lag, a loop gain of
        # 1 / (4 lag) is critically damped, the fastest response without overshoot.
        duration = CONTROL_PERIOD + 4.0 * self._lag
        max_speed = self._speed
        if math.isfinite(self._acceleration):
            duration += 3.0 * CONTROL_PERIOD
            # Half of the possible deceleration leaves a margin for gains and lag.
            max_speed = min(max_speed, math.sqrt(self._acceleration * abs(remaining)))
        return max(-max_speed, min(remaining / duration, max_speed))


@dataclass(frozen=True)
class Task:
    """
    A task of the robot: a sequence of straight lines, turns in place and standstills.

    :param ends_docked: whether the robot is on its dock after the last action
    :param note: what the client stores with the task
    """

    identity: str
    actions: tuple[Action, ...]
    ends_docked: bool = False
    note: object = None

    @property
    def moves(self) -> bool:
        """Return whether at least one action of the task moves the robot."""
        return not all(isinstance(action, StandStill) for action in self.actions)


@dataclass(frozen=True)
class TaskResult:
    """The result of a task of the robot: code 0 for success, else the error code."""

    task: Task
    code: int

    @property
    def is_success(self) -> bool:
        """Return whether all actions of the task were successful."""
        return self.code == SUCCESS


class TaskQueue:
    """The tasks of one robot, executed one after another."""

    def __init__(self, parameters: SimulationParameters) -> None:
        self._parameters = parameters
        self._waiting: deque[Task] = deque()
        self._actions: deque[Action] = deque()
        self._controller: ActionController | None = None
        self.current: Task | None = None
        #: the results of the last tasks, newest last
        self.results: deque[TaskResult] = deque(maxlen=MAX_RESULTS)

    def add(self, task: Task) -> None:
        """Add a task at the end of the queue."""
        self._waiting.append(task)
        if self.current is None:
            self._start_next()

    def drop_all(self, code: int) -> None:
        """End all tasks with an error code."""
        dropped = [] if self.current is None else [self.current]
        self.results.extend(TaskResult(task, code) for task in (*dropped, *self._waiting))
        self._waiting.clear()
        self._start_next()

    def prepend(self, action: Action) -> None:
        """Insert an action before all remaining actions of the current task."""
        self._actions.appendleft(action)

    def end_standstill(self, now: float) -> bool:
        """End the standstill of the current task, if clients may; return whether there was one."""
        if self._controller is None or not isinstance(
                action := self._actions[0], StandStill) or not action.can_be_ended:
            return False
        self._controller.end = now
        return True

    def step(
            self, pose: Pose, velocity: Velocity,
            now: float) -> tuple[Velocity, float] | TaskResult:
        """Return the next velocity and the time of the next step [s], or the result at the end."""
        while self._actions:
            if self._controller is None:
                self._controller = ActionController(self._actions[0], pose, now, self._parameters)
            answer = self._controller.step(pose, velocity, now)
            if not isinstance(answer, bool):
                return answer
            if not answer:
                return self._finish(ERROR_STUCK)
            self._actions.popleft()
            self._controller = None
        return self._finish(SUCCESS)

    def _finish(self, code: int) -> TaskResult:
        assert self.current is not None, 'step() needs a current task'
        result = TaskResult(self.current, code)
        self.results.append(result)
        self._start_next()
        return result

    def _start_next(self) -> None:
        self.current = self._waiting.popleft() if self._waiting else None
        self._actions = deque(self.current.actions if self.current else ())
        self._controller = None
