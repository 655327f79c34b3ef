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
A drive of one or more robots: all get ready, then all begin at one t = 0, or none moves.

Tested by test/ros/test_drive_of_several.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import contextlib
from dataclasses import dataclass
from functools import partial
import time

from kachaka_simple_control.control.drive_loop import DriveLoop, interpreter_prepared
from kachaka_simple_control.control.guardian import begin_heartbeat
from kachaka_simple_control.control.in_step import PlanInStep
from kachaka_simple_control.control.preparation import complete, Moment, Steps
from kachaka_simple_control.control.robot_drive import RobotDrive
from kachaka_simple_control.control.tick_scheduler import VelocitySource
from kachaka_simple_control.control.timing import FIRST_CHECK_TIME
from kachaka_simple_control.control.velocity_gate import PortTime
from kachaka_simple_control.errors import control_error, ControlError, MotionRefusedError
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.ros.robot import Robot


@dataclass(frozen=True)
class RobotTask:
    """
    What one robot does in a drive.

    :param period: the normal time between two velocities [s]
    :param corrected: the limits of corrected velocities; None without a closed loop
    """

    robot: Robot
    source: VelocitySource
    period: float
    corrected: Limits | None = None


class Drive:
    """
    A ``with`` block in which robots are driven; afterwards they are at rest.

    At its start all robots get ready, and none has moved if one cannot.  The block calls what it
    is given, which drives them.

    :param goes_on: whether a fault of one robot ends its drive alone, and not those of all
    :param start: t = 0, when all must be ready [s]; None for as soon as they are
    """

    def __init__(
            self, tasks: Sequence[RobotTask], goes_on: bool = False,
            start: float | None = None) -> None:
        self._tasks, self._goes_on, self._start = tasks, goes_on, start
        self._robots = {task.robot.drive: task.robot for task in tasks}
        self._failed: dict[Robot, Exception] = {}
        #: the robots that have ended their plans before the others
        self._ended: set[Robot] = set()
        self._interpreter = contextlib.ExitStack()

    def __enter__(self) -> Callable[[], None]:
        """
        Get all robots ready, and begin; return what drives them in the calling thread.

        :raises ControlError: if there is no control of a robot
        """
        for task in self._tasks:
            if task.robot.watch is not None:
                task.robot.watch.others = [
                    other.robot.speed_factor for other in self._tasks if other is not task]
        try:
            complete([partial(_prepare, task) for task in self._tasks], self._check)
            self._interpreter.enter_context(interpreter_prepared())
            # In the first round of the loop it would hold up the first velocity of the others.
            for number, task in enumerate(self._tasks):
                _check_graph(task)
                task.robot.monitor.share_graph(number, len(self._tasks))
            self._loop = DriveLoop(
                beat=begin_heartbeat(task.robot.guardian for task in self._tasks))
            port_time = PortTime()
            for task in self._tasks:
                gate = task.robot.gate
                gate.port_time = port_time
                gate.wake = partial(self._loop.wake, task.robot.drive)
            t0 = self._t0()
            # Velocities leave earlier by the delay of a robot, so that all move together.
            delays = [task.robot.settings.profile.delay for task in self._tasks]
            for task, delay in zip(self._tasks, delays):
                task.robot.begin(
                    task.source, t0 + max(delays) - delay, task.period, task.corrected)
            return partial(
                self._loop.run, [*self._robots], self._go_on if self._goes_on else None,
                self._on_end)
        except BaseException as error:
            self._interpreter.close()
            self._stop(error)
            raise

    def __exit__(
            self, kind: type[BaseException] | None, error: BaseException | None,
            traceback: object) -> None:
        """
        Stop the robots.

        :raises ControlError: if a drive ended early, and not by the error of the block
        """
        try:
            if error is None:
                complete([partial(_complete, task) for task in self._tasks
                          if task.robot not in self._failed])
        except BaseException as failure:
            self._stop(failure)
            raise
        finally:
            self._interpreter.close()
            self._loop.close()
        if error is not None:
            if self._loop.failed is not None and isinstance(error, ControlError):
                self._robots[self._loop.failed].named(error)
            self._stop(error)
            return
        for task in self._tasks:
            if task.robot not in self._failed:
                task.robot.finish()
        for robot, fault in self._failed.items():
            _end_early([robot], fault)
        for fault in self._failed.values():
            raise fault

    def _t0(self) -> float:
        """
        Return when the first velocity is due.

        :raises MotionRefusedError: if that was to be earlier
        """
        # The first round of the loop checks all for faults, so that the second, at t0, only sends.
        earliest = time.monotonic() + FIRST_CHECK_TIME * (len(self._tasks) - 1)
        if self._start is not None and self._start < earliest:
            raise MotionRefusedError(
                f'the robots were ready {earliest - self._start:.1f} s after the time at which '
                'they were to start: start later')
        return self._start or earliest

    def _check(self) -> None:
        for task in self._tasks:
            task.robot.require_wanted()

    def _stop(self, error: BaseException) -> None:
        """Stop the robots after an error, also KeyboardInterrupt; raise that of a guardian."""
        raised = _end_early(
            [task.robot for task in self._tasks if task.robot not in self._ended], error)
        for robot in self._ended:
            robot.finish()
        if raised is not error:
            raise raised from error

    def _on_end(self, drive: RobotDrive) -> None:
        robot = self._robots[drive]
        self._ended.add(robot)
        robot.end_before_others()

    def _go_on(self, drive: RobotDrive, error: Exception) -> None:
        robot = self._robots[drive]
        self._failed[robot] = robot.named(error) if isinstance(error, ControlError) else error
        for task in self._tasks:
            if task.robot is robot and isinstance(task.source, PlanInStep):
                task.source.is_over = True  # the others do not wait for it
        robot.record_end(self._failed[robot])
        robot.stop_later()


def _prepare(task: RobotTask, moment: Moment) -> Steps[None]:
    try:
        yield from task.robot.prepare(
            moment, task.source, is_closed_loop=task.corrected is not None)
    except ControlError as error:
        raise task.robot.named(error) from None


def _check_graph(task: RobotTask) -> None:
    try:
        task.robot.monitor.check_graph(time.monotonic())
    except ControlError as error:
        raise task.robot.named(error) from None


def _complete(task: RobotTask, moment: Moment) -> Steps[None]:
    try:
        yield from task.robot.complete(moment, task.period)
    except ControlError as error:
        raise task.robot.named(error) from None


def _end_early(robots: Sequence[Robot], error: BaseException) -> BaseException:
    """Stop robots after an error; return the one to raise, or that of a guardian."""
    failures = stop_all(robots, control_error(error))
    errors = [robot.end_early(error, failure) for robot, failure in zip(robots, failures)]
    return next((one for one in errors if one is not error), error)


def stop_all(robots: Sequence[Robot], reason: ControlError) -> list[str | None]:
    """Stop robots: first a zero to each, then all others; return why each stop has failed."""
    for robot in robots:
        # Another program may drive a robot that this one has stopped.
        if not robot.stopper.is_stopped:
            with contextlib.suppress(Exception):  # the steps below say why it could not be sent
                robot.drive.end(reason)
    return complete([partial(robot.stopper.steps, reason=reason) for robot in robots])
