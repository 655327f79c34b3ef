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
"""The simulated robot: manual control, velocities, tasks, docking and pause."""

from __future__ import annotations

from enum import Enum
import math

from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.kachaka.robot_status import (
    ERROR_CANCELLED,
    ERROR_NO_MANUAL_CONTROL,
    ERROR_NOT_A_VELOCITY,
    ERROR_NOTHING_TO_DO,
    ERROR_PAUSED,
    SUCCESS,
)
from kachaka_simple_control.kachaka.simulator.drive_model import (
    DriveModel,
    IDEAL,
    SimulationParameters,
)
from kachaka_simple_control.kachaka.simulator.tasks import (
    Action,
    drive_straight,
    plan_docking,
    Task,
    TaskQueue,
    TaskResult,
)
from kachaka_simple_control.motion.geometry import Pose, Velocity, ZERO


class TimedState(Enum):
    """The states of the robot that end automatically after a time."""

    MANUAL_CONTROL = 'manual control'
    #: the robot keeps the last velocity until the command timeout
    VELOCITY = 'velocity'
    #: the robot leaves its dock and ignores velocities
    UNDOCKING = 'undocking'
    #: a task is running; the end time is that of the current control period
    TASK = 'task'


class SimulatedKachaka:
    """
    A simulated Kachaka that behaves like the real robot behind its gRPC service.

    The parameter ``now`` of each method is the time of a steady clock [s].  If it is earlier than
    in a previous call, the latest time so far is used.  Most methods that change the robot return
    0 or an error code.  Behaviour that is called assumed is not documented by the manufacturer.
    The class is not thread-safe.

    :param start: the current time [s, steady clock]
    :param parameters: the deviations of drive and odometry from an ideal robot
    :param docked: whether the robot starts on its charging dock
    :param seed: the seed of all noise; with the same seed, the same calls at the same times return
        the same values
    """

    def __init__(
            self, start: float = 0.0, parameters: SimulationParameters = IDEAL,
            docked: bool = False, seed: int = 0) -> None:
        self._parameters = parameters
        self._drive = DriveModel(parameters, start, seed)
        self._now = start
        self._is_docked = docked
        self._is_paused = False
        self._tasks = TaskQueue(parameters)
        # A robot that is not docked starts where its undocking motion would end.
        self.dock = Pose(0.0 if docked else -parameters.undock_distance)
        self._until: dict[TimedState, float] = {}

    def set_manual_control(self, enabled: bool, now: float) -> int:
        """
        Switch manual control on for 60 s, or off.

        Switching it on cancels all tasks.  This is assumed, not documented by the manufacturer.  A
        docked robot leaves its dock before it follows velocities.  Switching it off stops the
        robot, unless the robot is leaving its dock.

        :param enabled: whether to switch manual control on
        :param now: the time [s, steady clock]
        :returns: 0, or the error code if the robot is paused and must not switch it on
        """
        now = self._advance(now)
        if enabled and self._is_paused:
            return ERROR_PAUSED
        if enabled:
            self._drop_tasks(ERROR_CANCELLED, now)
            self._until[TimedState.MANUAL_CONTROL] = now + KACHAKA.manual_control_timeout
            self._leave_dock(now)
        elif TimedState.MANUAL_CONTROL in self._until:
            self._end_state(TimedState.MANUAL_CONTROL, now)
        return SUCCESS

    def set_robot_velocity(self, linear: float, angular: float, now: float) -> int:
        """
        Drive with a velocity until the next velocity, or until the command timeout.

        The velocity is clipped to the limits.  While the robot leaves its dock, it ignores the
        velocity without an error.  Both are assumed, not documented by the manufacturer.

        :param linear: the forward velocity as a fraction of the largest one, -1 to 1
        :param angular: the turning velocity as a fraction of the largest one, -1 to 1,
            counter-clockwise positive
        :param now: the time [s, steady clock]
        :returns: 0, or the error code if the robot refuses the velocity
        """
        now = self._advance(now)
        if not (math.isfinite(linear) and math.isfinite(angular)):
            return ERROR_NOT_A_VELOCITY
        if self._is_paused:
            return ERROR_PAUSED
        if TimedState.MANUAL_CONTROL not in self._until:
            return ERROR_NO_MANUAL_CONTROL
        if TimedState.UNDOCKING not in self._until:
            self._until[TimedState.VELOCITY] = now + KACHAKA.command_timeout
            limits = KACHAKA.limits
            self._drive.set_target(
                Velocity(max(-1.0, min(linear, 1.0)) * limits.max_linear_velocity,
                         max(-1.0, min(angular, 1.0)) * limits.max_angular_velocity), now)
        return SUCCESS

    def start_task(self, task: Task, now: float, drop_others: bool = True) -> int:
        """
        Start a task, and end manual control.

        If the task moves the robot, a docked robot leaves its dock first.  Both are assumed, not
        documented by the manufacturer.

        :param task: the task
        :param now: the time [s, steady clock]
        :param drop_others: whether to cancel all other tasks; if not, the task waits until they
            have ended
        :returns: 0, or the error code if the robot refuses the task
        """
        now = self._advance(now)
        if self._is_paused and task.moves:
            return ERROR_PAUSED
        if drop_others:
            self._drop_tasks(ERROR_CANCELLED, now)
        if TimedState.MANUAL_CONTROL in self._until:
            self._until.pop(TimedState.VELOCITY, None)
            self._end_state(TimedState.MANUAL_CONTROL, now)
        self._tasks.add(task)
        if TimedState.TASK not in self._until:
            # A robot that leaves its dock starts the task afterwards.
            self._until[TimedState.TASK] = self._until.get(TimedState.UNDOCKING, now)
        self._advance(now)
        return SUCCESS

    def cancel_tasks(self, now: float) -> Task | None:
        """Cancel all tasks, and return the task that was running, or None."""
        now = self._advance(now)
        task = self._tasks.current
        self._drop_tasks(ERROR_CANCELLED, now)
        return task

    def end_standstill(self, now: float) -> int:
        """
        End the current action early, if it is a standstill that a client may end.

        :param now: the time [s, steady clock]
        :returns: 0, or the error code if there is no such action
        """
        now = self._advance(now)
        if not self._tasks.end_standstill(now):
            return ERROR_NOTHING_TO_DO
        self._until[TimedState.TASK] = now
        self._advance(now)
        return SUCCESS

    def set_emergency_stop(self, now: float) -> int:
        """
        Stop and pause the robot, as its power button does.

        This ends manual control, all tasks and undocking, so that the robot does not move after
        the pause.  The end of undocking is assumed, not documented by the manufacturer.
        """
        now = self._advance(now)
        self._drop_tasks(ERROR_PAUSED, now)
        self._is_paused = True
        self._until.clear()
        self._drive.set_target(ZERO, now)
        return SUCCESS

    def press_power_button(self, now: float) -> None:
        """Pause the robot, or end the pause if the robot is paused."""
        if self._is_paused:
            self._is_paused = False
        else:
            self.set_emergency_stop(now)

    def task(self, now: float) -> Task | None:
        """Return the running task, or None if there is none."""
        self._advance(now)
        return self._tasks.current

    def task_results(self, now: float) -> tuple[TaskResult, ...]:
        """Return the results of the last 100 tasks, newest last."""
        self._advance(now)
        return tuple(self._tasks.results)

    def errors(self, now: float) -> tuple[int, ...]:
        """Return the codes of the current errors."""
        self._advance(now)
        return (ERROR_PAUSED,) if self._is_paused else ()

    def manual_control(self, now: float) -> bool:
        """Return whether manual control is on."""
        self._advance(now)
        return TimedState.MANUAL_CONTROL in self._until

    def actions_to_dock(self, now: float) -> tuple[Action, ...]:
        """Return the actions that drive the robot to its dock; empty if it is docked."""
        parameters = self._parameters
        return () if self.is_docked(now) else plan_docking(
            self.dock, parameters.undock_distance, parameters.undock_velocity)

    def is_docked(self, now: float) -> bool:
        """Return whether the robot stands on its charging dock; false during undocking."""
        self._advance(now)
        return self._is_docked

    def next_change(self, now: float) -> float:
        """Return the time of the robot's next automatic change [s]; infinity if none is due."""
        self._advance(now)
        return min(self._until.values(), default=math.inf)

    def state(self, now: float) -> tuple[Pose, Velocity]:
        """Return the true pose relative to the start pose, and the true velocity."""
        return self._drive.state_at(self._advance(now))

    def odometry(self, now: float) -> tuple[Pose, Velocity]:
        """Return the odometry pose with noise, and the odometry velocity."""
        return self._drive.odometry_at(self._advance(now))

    @property
    def has_wrong_odometry(self) -> bool:
        """Return whether the odometry pose differs from the true pose, even without noise."""
        return self._parameters.floor is not None

    def _advance(self, now: float) -> float:
        """
        Simulate until a time, and end each timed state at its end time.

        :returns: the time, or the latest time of all calls if that is later
        """
        self._now = max(self._now, now)
        while self._until:
            state, end = min(self._until.items(), key=lambda item: item[1])
            if end > self._now:
                break
            if state is TimedState.TASK:
                self._run_tasks(end)
            else:
                self._end_state(state, end)
        return self._now

    def _end_state(self, state: TimedState, now: float) -> None:
        # The end of a state stops the robot, unless the robot is undocking.  Undocking is always
        # completed (assumed, not documented by the manufacturer).
        del self._until[state]
        if TimedState.UNDOCKING not in self._until:
            self._drive.set_target(ZERO, now)

    def _run_tasks(self, now: float) -> None:
        """Run one control period of the current task, or of the next task if it has ended."""
        while (task := self._tasks.current) is not None:
            if self._is_docked and task.moves:
                self._is_docked = False
                self._tasks.prepend(drive_straight(
                    self._parameters.undock_distance, self._parameters.undock_velocity))
            answer = self._tasks.step(*self._drive.state_at(now), now)
            if not isinstance(answer, TaskResult):
                velocity, self._until[TimedState.TASK] = answer
                self._drive.set_target(velocity, now)
                return
            self._is_docked = self._is_docked or (answer.is_success and task.ends_docked)
        self._end_state(TimedState.TASK, now)

    def _drop_tasks(self, code: int, now: float) -> None:
        self._tasks.drop_all(code)
        if TimedState.TASK in self._until:
            self._end_state(TimedState.TASK, now)

    def _leave_dock(self, now: float) -> None:
        if self._is_docked:
            self._is_docked = False
            velocity = self._parameters.undock_velocity
            self._until[TimedState.UNDOCKING] = now + self._parameters.undock_distance / velocity
            self._drive.set_target(Velocity(linear_x=velocity), now)
