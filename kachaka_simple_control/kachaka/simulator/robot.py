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
"""The simulated robot."""

from __future__ import annotations

from enum import Enum
import math

from kachaka_simple_control.files.robot_profile import KACHAKA, RobotProfile
from kachaka_simple_control.kachaka.error_codes import (
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
    NoisyOdometry,
    ODOMETRY_PERIOD,
    SimulationParameters,
)
from kachaka_simple_control.kachaka.simulator.tasks import (
    Action,
    DriveStraight,
    plan_docking,
    Task,
    TaskQueue,
    TaskResult,
)
from kachaka_simple_control.motion.geometry import Pose, Velocity, ZERO


class TimedState(Enum):
    """What goes on for a time and then ends by itself."""

    #: manual control is on
    MANUAL_CONTROL = 'manual control'
    #: the last velocity holds
    HOLD = 'hold'
    #: the robot drives off its dock, whatever it is told
    UNDOCKING = 'undocking'
    #: the robot drives by itself, and looks next where it is
    ERRAND = 'errand'


__all__ = ['ERROR_NOT_A_VELOCITY', 'ERROR_NO_MANUAL_CONTROL', 'ODOMETRY_PERIOD', 'SUCCESS',
           'SimulatedKachaka']


class SimulatedKachaka:
    """
    The robot as its gRPC service shows it; told the time by each call, never asking for it.

    Times are of a steady clock [s], and should not run backwards: one that is earlier than one
    before it counts as that one.  Not for two threads at once.
    """

    def __init__(
            self,
            start: float = 0.0,
            fidelity: SimulationParameters = IDEAL,
            docked: bool = False,
            seed: int = 0,
            profile: RobotProfile = KACHAKA) -> None:
        """
        Stand still at the origin of odometry, with manual control off.

        :param start: the time now [s]
        :param fidelity: what keeps the robot from doing as it is told
        :param docked: whether it stands on its charging dock
        :param seed: of all noise: the same calls at the same times give the same answers
        :param profile: its limits, its hold and how long manual control lasts
        """
        self._profile = profile
        self._fidelity = fidelity
        self._drive = DriveModel(fidelity, start, seed)
        self._odometer = NoisyOdometry(fidelity, start, seed)
        self._now = start
        self._is_docked = docked
        self._is_paused = False
        self._errands = TaskQueue(profile.limits, fidelity)
        # Off its dock, it stands where it would be after having left it.
        self.dock = Pose(0.0 if docked else -fidelity.undock_distance)
        self._until: dict[TimedState, float] = {}

    def set_manual_control(self, enabled: bool, now: float) -> int:
        """
        Let the robot take velocities for a time from now on, or stop it and let it take none.

        On the dock, enabling makes the robot drive off first.  It ends all errands (chosen).

        :param enabled: whether velocities are taken from now on
        :param now: the time [s]
        :returns: 0, or the code of the error
        """
        now = self._pass(now)
        if enabled and self._is_paused:
            return ERROR_PAUSED
        if enabled:
            self._drop_tasks(ERROR_CANCELLED, now)
            self._until[TimedState.MANUAL_CONTROL] = now + self._profile.manual_control_timeout
            self._leave_dock(now)
        elif TimedState.MANUAL_CONTROL in self._until:
            self._end(TimedState.MANUAL_CONTROL, now)
        return SUCCESS

    def set_robot_velocity(self, linear: float, angular: float, now: float) -> int:
        """
        Drive with a velocity until the next one, or for the hold.

        Both parts go from -1 to 1.  What the robot does with more is not published; this one
        takes the most that it can do (chosen).  While it drives off its dock it takes nothing,
        without an error (chosen).

        :param linear: forward velocity, as a part of the largest
        :param angular: turning velocity, as a part of the largest
        :param now: the time [s]
        :returns: 0, or the code of the error; with an error nothing changes
        """
        now = self._pass(now)
        if not (math.isfinite(linear) and math.isfinite(angular)):
            return ERROR_NOT_A_VELOCITY
        if self._is_paused:
            return ERROR_PAUSED
        if TimedState.MANUAL_CONTROL not in self._until:
            return ERROR_NO_MANUAL_CONTROL
        if TimedState.UNDOCKING not in self._until:
            self._until[TimedState.HOLD] = now + self._profile.hold
            self._drive.set_target(self._demanded(linear, angular), now)
        return SUCCESS

    def start_task(self, errand: Task, now: float, drop_others: bool = True) -> int:
        """
        Send the robot to do something by itself; that ends manual control (chosen).

        On the dock, it drives off first if it has to move at all (chosen).

        :param task: what to do
        :param now: the time [s]
        :param drop_others: whether to drop what it was sent to do before, rather than to wait
        :returns: 0, or the code of the error; with an error nothing changes
        """
        now = self._pass(now)
        if self._is_paused and errand.moves:
            return ERROR_PAUSED
        if drop_others:
            self._drop_tasks(ERROR_CANCELLED, now)
        if TimedState.MANUAL_CONTROL in self._until:
            self._until.pop(TimedState.HOLD, None)
            self._end(TimedState.MANUAL_CONTROL, now)
        self._errands.add(errand)
        if TimedState.ERRAND not in self._until:
            # While it drives off its dock, it does nothing else.
            self._until[TimedState.ERRAND] = self._until.get(TimedState.UNDOCKING, now)
        self._pass(now)
        return SUCCESS

    def cancel_tasks(self, now: float) -> Task | None:
        """
        Stop, and drop all errands.

        :param now: the time [s]
        :returns: the errand that was under way; None if none was
        """
        now = self._pass(now)
        errand = self._errands.current
        self._drop_tasks(ERROR_CANCELLED, now)
        return errand

    def end_stay(self, now: float) -> int:
        """
        Let the robot go on, if it stays where somebody may tell it to go on.

        :param now: the time [s]
        :returns: 0, or the code of the error
        """
        now = self._pass(now)
        if not self._errands.end_stay(now):
            return ERROR_NOTHING_TO_DO
        self._until[TimedState.ERRAND] = now
        self._pass(now)
        return SUCCESS

    def set_emergency_stop(self, now: float) -> int:
        """
        Stop and stay, as if somebody pressed the power button.

        It ends whatever is under way, manual control and the way off the dock, too (chosen), so
        that nothing moves when the pause is over.

        :param now: the time [s]
        :returns: 0
        """
        now = self._pass(now)
        self._drop_tasks(ERROR_PAUSED, now)
        self._is_paused = True
        self._until.clear()
        self._drive.set_target(ZERO, now)
        return SUCCESS

    def press_power_button(self, now: float) -> None:
        """
        Pause the robot, or end its pause.

        :param now: the time [s]
        """
        if self._is_paused:
            self._is_paused = False
        else:
            self.set_emergency_stop(now)

    def task(self, now: float) -> Task | None:
        """
        Return what the robot does by itself.

        :param now: the time [s]
        :returns: the errand under way; None if none is
        """
        self._pass(now)
        return self._errands.current

    def task_results(self, now: float) -> tuple[TaskResult, ...]:
        """
        Return how the errands ended.

        :param now: the time [s]
        :returns: the last hundred outcomes, newest last
        """
        self._pass(now)
        return tuple(self._errands.results)

    def errors(self, now: float) -> tuple[int, ...]:
        """
        Return what is wrong with the robot.

        :param now: the time [s]
        :returns: codes of errors that last
        """
        self._pass(now)
        return (ERROR_PAUSED,) if self._is_paused else ()

    def manual_control(self, now: float) -> bool:
        """
        Return whether the robot takes velocities.

        :param now: the time [s]
        :returns: whether manual control is on
        """
        self._pass(now)
        return TimedState.MANUAL_CONTROL in self._until

    def way_home(self, now: float) -> tuple[Action, ...]:
        """
        Return how the robot drives onto its dock.

        :param now: the time [s]
        :returns: the legs of an errand that ends docked; none if it stands there
        """
        fidelity = self._fidelity
        return () if self.is_docked(now) else plan_docking(
            self.dock, fidelity.undock_distance, fidelity.undock_velocity)

    def is_docked(self, now: float) -> bool:
        """
        Return whether the robot stands on its charging dock.

        :param now: the time [s]
        :returns: whether it does; not any more once it drives off
        """
        self._pass(now)
        return self._is_docked

    def next_change(self, now: float) -> float:
        """
        Return when the robot changes next if nobody tells it anything.

        :param now: the time [s]
        :returns: the time [s]; infinite if nothing is under way
        """
        self._pass(now)
        return min(self._until.values(), default=math.inf)

    def state(self, now: float) -> tuple[Pose, Velocity]:
        """
        Return where the robot truly is, in the frame of its start, and how fast.

        :param now: the time [s]
        :returns: pose and velocity
        """
        return self._drive.state_at(self._pass(now))

    def odometry(self, now: float) -> tuple[Pose, Velocity]:
        """
        Return where the robot thinks it is, and how fast.

        :param now: the time [s]
        :returns: pose and velocity; the true ones but for the noise of odometry
        """
        pose, velocity = self.state(now)
        return self._odometer.read(pose, self._now), velocity

    def _pass(self, now: float) -> float:
        """Let time pass; what ends meanwhile ends at its own time, in order."""
        self._now = max(self._now, now)
        while self._until:
            phase, end = min(self._until.items(), key=lambda item: item[1])
            if end > self._now:
                break
            if phase is TimedState.ERRAND:
                self._attend(end)
            else:
                self._end(phase, end)
        return self._now

    def _end(self, phase: TimedState, now: float) -> None:
        # Whatever ends, the robot stops; but the way off the dock is driven to its end (chosen).
        del self._until[phase]
        if TimedState.UNDOCKING not in self._until:
            self._drive.set_target(ZERO, now)

    def _attend(self, now: float) -> None:
        """Go on with the errands at their time."""
        while (errand := self._errands.current) is not None:
            if self._is_docked and errand.moves:
                self._is_docked = False
                self._errands.prepend(DriveStraight(
                    self._fidelity.undock_distance, self._fidelity.undock_velocity))
            answer = self._errands.proceed(*self._drive.state_at(now), now)
            if not isinstance(answer, TaskResult):
                velocity, self._until[TimedState.ERRAND] = answer
                self._drive.set_target(velocity, now)
                return
            self._is_docked = self._is_docked or (answer.is_success and errand.ends_docked)
        self._end(TimedState.ERRAND, now)

    def _drop_tasks(self, code: int, now: float) -> None:
        self._errands.drop_all(code)
        if TimedState.ERRAND in self._until:
            self._end(TimedState.ERRAND, now)

    def _leave_dock(self, now: float) -> None:
        if self._is_docked:
            self._is_docked = False
            velocity = self._fidelity.undock_velocity
            self._until[TimedState.UNDOCKING] = now + self._fidelity.undock_distance / velocity
            self._drive.set_target(Velocity(linear_x=velocity), now)

    def _demanded(self, linear: float, angular: float) -> Velocity:
        limits = self._profile.limits
        return Velocity(
            max(-1.0, min(linear, 1.0)) * limits.max_linear_velocity,
            max(-1.0, min(angular, 1.0)) * limits.max_angular_velocity)
