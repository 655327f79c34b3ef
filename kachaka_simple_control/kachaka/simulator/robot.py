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
The simulated Kachaka: velocities, tasks, manual control, dock and power button.

Tested by test/kachaka/simulator/test_simulated_robot.py.
"""

from __future__ import annotations

from enum import Enum
import math

from kachaka_simple_control.files.cdr import Scan
from kachaka_simple_control.files.floor_file import LaserParameters
from kachaka_simple_control.files.robot_profile import KACHAKA, KACHAKA_LASER
from kachaka_simple_control.kachaka.robot_status import (
    ERROR_CANCELLED,
    ERROR_NO_MANUAL_CONTROL,
    ERROR_NOT_A_VELOCITY,
    ERROR_NOTHING_TO_DO,
    ERROR_OUT_OF_RANGE,
    ERROR_PAUSED,
    SUCCESS,
)
from kachaka_simple_control.kachaka.simulator.contact import Contact, ContactFinder
from kachaka_simple_control.kachaka.simulator.drive_model import (
    DriveModel,
    IDEAL,
    SimulationParameters,
)
from kachaka_simple_control.kachaka.simulator.laser import SimulatedLaser
from kachaka_simple_control.kachaka.simulator.tasks import (
    Action,
    drive_straight,
    plan_docking,
    Task,
    TaskQueue,
    TaskResult,
)
from kachaka_simple_control.motion.floor import Floor
from kachaka_simple_control.motion.geometry import compose, ORIGIN, Pose, Velocity, ZERO

#: A laser as it is if nobody says otherwise.
USUAL_LASER = LaserParameters()


class TimedState(Enum):
    """The states that end at a stored time: manual control, a velocity, undocking, a task."""

    MANUAL_CONTROL = 'manual control'
    #: the robot keeps the last velocity until the command timeout
    VELOCITY = 'velocity'
    #: the robot leaves its dock and ignores velocities
    UNDOCKING = 'undocking'
    #: a task is running; the end time is that of the current control period
    TASK = 'task'


class SimulatedKachaka:
    """
    A simulated Kachaka that behaves as the real robot does when it is controlled over gRPC.

    It follows velocities while manual control is on; otherwise it can execute tasks.  "Assumed"
    marks behaviour that the manufacturer does not document.  ``now`` never goes back: an earlier
    one counts as the latest so far.  Methods that change the robot return 0 or an error code.  Not
    thread-safe.

    :param start: when it starts, and its floor is set up [s]
    :param seed: of all random noise: the same calls at the same times return the same
    :param floor: what it can touch, and its laser sees; None for an empty floor
    :param place: where it starts on the floor
    """

    def __init__(
            self, start: float = 0.0, parameters: SimulationParameters = IDEAL,
            docked: bool = False, seed: int = 0, floor: Floor | None = None,
            laser: LaserParameters = USUAL_LASER, place: Pose = ORIGIN) -> None:
        assert KACHAKA.footprint is not None
        self.parameters = parameters
        self.floor = floor
        self.laser = laser
        self._place = place
        self._drive = DriveModel(
            parameters, start, seed, None if floor is None else ContactFinder(
                floor, KACHAKA.footprint, start, place))
        self._laser = SimulatedLaser(laser, KACHAKA_LASER.pose, floor or Floor(), start, seed)
        self._now = start
        self._is_docked = docked
        self._is_paused = False
        self._tasks = TaskQueue(parameters)
        # A robot that is not docked starts where its undocking motion would end.
        self.dock = Pose(0.0 if docked else -parameters.undock_distance)
        self._until: dict[TimedState, float] = {}

    def set_manual_control(self, enabled: bool, now: float) -> int:
        """
        Switch manual control on for 60 s, or switch it off.

        On: all tasks are cancelled (assumed), a docked robot leaves its dock, and, if it was off,
        the laser turns as after a motion.  Off: the robot stops, unless it is just leaving its
        dock.

        :returns: an error code if the robot is paused
        """
        now = self._advance(now)
        if enabled and self._is_paused:
            return ERROR_PAUSED
        if enabled:
            self._drop_tasks(ERROR_CANCELLED, now)
            if TimedState.MANUAL_CONTROL not in self._until:
                self._laser.activate(self.laser.off_after, now)
            self._until[TimedState.MANUAL_CONTROL] = now + KACHAKA.manual_control_timeout
            self._leave_dock(now)
        elif TimedState.MANUAL_CONTROL in self._until:
            self._end_state(TimedState.MANUAL_CONTROL, now)
        return SUCCESS

    def set_robot_velocity(self, linear: float, angular: float, now: float) -> int:
        """
        Drive with a velocity until the next one, or until the command timeout of 0.3 s.

        It is clipped to the limits, and ignored while the robot leaves its dock (both assumed).

        :param linear: a fraction of the largest forward velocity, -1 to 1
        :param angular: of the largest turning velocity, -1 to 1, counter-clockwise positive
        :returns: an error code if manual control is off, the robot is paused, or the velocity is
            infinite or NaN
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
        Start a task, and end manual control (assumed); a docked robot leaves its dock (assumed).

        :param drop_others: whether to cancel all other tasks, or to start after them
        :returns: an error code if the robot is paused and the task would move it
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
        """Cancel all tasks; return the running one, or None."""
        now = self._advance(now)
        task = self._tasks.current
        self._drop_tasks(ERROR_CANCELLED, now)
        return task

    def end_standstill(self, now: float) -> int:
        """
        End the standstill of a running task, if clients may; the next action follows.

        :returns: an error code if there is no such standstill
        """
        now = self._advance(now)
        if not self._tasks.end_standstill(now):
            return ERROR_NOTHING_TO_DO
        self._until[TimedState.TASK] = now
        self._advance(now)
        return SUCCESS

    def set_emergency_stop(self, now: float) -> int:
        """
        Stop and pause the robot, as its power button does: it refuses to move; return 0.

        Manual control, all tasks and undocking (assumed) end, so it does not move again after the
        pause.
        """
        now = self._advance(now)
        self._drop_tasks(ERROR_PAUSED, now)
        self._is_paused = True
        self._until.clear()
        self._drive.set_target(ZERO, now)
        return SUCCESS

    def press_power_button(self, now: float) -> None:
        """Stop and pause the robot, or end its pause."""
        if self._is_paused:
            self._is_paused = False
        else:
            self.set_emergency_stop(now)

    def task(self, now: float) -> Task | None:
        """Return the task that the robot executes, or None if it executes none."""
        self._advance(now)
        return self._tasks.current

    def task_results(self, now: float) -> tuple[TaskResult, ...]:
        """Return the results of the last 100 tasks that have ended, newest last."""
        self._advance(now)
        return tuple(self._tasks.results)

    def errors(self, now: float) -> tuple[int, ...]:
        """Return the codes of the robot's current errors; the only one is that it is paused."""
        self._advance(now)
        return (ERROR_PAUSED,) if self._is_paused else ()

    def manual_control(self, now: float) -> bool:
        """Return whether manual control is on."""
        self._advance(now)
        return TimedState.MANUAL_CONTROL in self._until

    def actions_to_dock(self, now: float) -> tuple[Action, ...]:
        """Return the motions that bring the robot to its charging dock; none if it is docked."""
        parameters = self.parameters
        return () if self.is_docked(now) else plan_docking(
            self.dock, parameters.undock_distance, parameters.undock_velocity)

    def is_docked(self, now: float) -> bool:
        """Return whether the robot is on its charging dock; false once it begins to leave."""
        self._advance(now)
        return self._is_docked

    def next_change(self, now: float) -> float:
        """Return when the robot will change without a request [s]; infinity if never."""
        self._advance(now)
        return min(self._until.values(), default=math.inf)

    def state(self, now: float) -> tuple[Pose, Velocity]:
        """Return the robot's true pose relative to its start pose, and its true velocity."""
        return self._drive.state_at(self._advance(now))

    def odometry(self, now: float) -> tuple[Pose, Velocity]:
        """Return the pose and the velocity in the robot's odometry; the pose has random noise."""
        return self._drive.odometry_at(self._advance(now))

    def contact(self, now: float) -> Contact | None:
        """Return where the robot has touched something, after which it stands still; or None."""
        self._drive.state_at(self._advance(now))
        return self._drive.contact

    def activate_laser(self, duration: float, now: float) -> int:
        """
        Let the laser turn for a time [s], also while the robot stands still.

        :returns: an error code if the time is negative, infinite or NaN
        """
        if not 0.0 <= duration < math.inf:
            return ERROR_OUT_OF_RANGE
        self._laser.activate(duration, self._advance(now))
        return SUCCESS

    def is_scanning(self, now: float) -> bool:
        """Return whether the laser turns; on the dock it does not."""
        now = self._advance(now)
        return not self._is_docked and self._laser.is_on(self._drive.last_motion(now), now)

    def take_scan(self, now: float) -> Scan | None:
        """
        Take a scan, with the time [ns] as its stamp, if one is due and the laser turns; or None.

        One is due in each period of the laser, for one caller.
        """
        now = self._advance(now)
        if not (self._laser.is_due(now) and self.is_scanning(now)):
            return None
        return self._laser.scan(compose(self._place, self._drive.state_at(now)[0]), now)

    def _advance(self, now: float) -> float:
        """Simulate the robot until a time; return the latest time so far."""
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
        """Compute the velocity of the running task, or of the next one, after leaving the dock."""
        while (task := self._tasks.current) is not None:
            if self._is_docked and task.moves:
                self._is_docked = False
                self._tasks.prepend(drive_straight(
                    self.parameters.undock_distance, self.parameters.undock_velocity))
            answer = self._tasks.step(*self._drive.reported_at(now), now)
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
            velocity = self.parameters.undock_velocity
            self._until[TimedState.UNDOCKING] = now + self.parameters.undock_distance / velocity
            self._drive.set_target(Velocity(linear_x=velocity), now)
