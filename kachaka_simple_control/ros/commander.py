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
The door to the robots of a node: drive, stop, pause, resume and slow down.

Tested by test/ros/test_commander.py.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
import contextlib
from dataclasses import replace
from functools import partial
import threading
import time

from kachaka_simple_control import errors
from kachaka_simple_control.control.drive_requests import (
    DriveRequest,
    DriveRequests,
    ResumeConfirmation,
)
from kachaka_simple_control.control.events import MotionPlanned, RobotsApart
from kachaka_simple_control.control.in_step import InStep
from kachaka_simple_control.control.preparation import complete, Moment, Steps
from kachaka_simple_control.control.robot_drive import DriveProgress
from kachaka_simple_control.control.speed_factor import MOVED, OVERRIDE, PAUSE
from kachaka_simple_control.control.tick_scheduler import TickScheduler, VelocitySource
from kachaka_simple_control.control.timing import (
    BLIND_SPEED,
    DRIVE_END_TIMEOUT,
    RESUME_CONFIRM_TIMEOUT,
    RESUME_QUIET_TIME,
)
from kachaka_simple_control.control.velocity_gate import VelocityGate
from kachaka_simple_control.motion.drive_order import DriveOrder
from kachaka_simple_control.process.waiting import wait_until
from kachaka_simple_control.ros.drive import Drive, RobotTask, stop_all
from kachaka_simple_control.ros.hub import Hub
from kachaka_simple_control.ros.robot import Robot
from kachaka_simple_control.text import escaped
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.parameter import Parameter

#: The writable parameter: the speed factor that the user sets.
PARAMETER = 'speed_factor'


class Commander:
    """
    Drives the robots of a node, and stops, pauses, resumes and slows them down.

    Python code, services, keys, pipe and console call the methods, from any thread.  ``robots``
    are those of the node that are meant; None for all.  A refused request raises an error; the
    text that most methods return tells the user what was done.
    """

    def __init__(self, hub: Hub, robots: Sequence[Robot]) -> None:
        self._hub, self._robots = hub, robots
        self._logger = hub.node.get_logger()
        hub.on_error = self._on_callback_error
        self._requests = DriveRequests()
        #: how often somebody has paused or set a speed so far
        self.changes = 0
        # Reentrant: to set the parameter calls back in the same thread.
        self._changing = threading.RLock()
        self._confirmation = ResumeConfirmation()
        self._closing = threading.Lock()
        self._is_closed = False

    def states(self, robots: Sequence[Robot] | None = None) -> list[DriveProgress]:
        """Return the progress of the newest motion of each robot."""
        return [robot.drive.progress for robot in self._chosen(robots)]

    def is_driving(self, robots: Sequence[Robot] | None = None) -> bool:
        """Return whether one drives, or waits to be ready for a drive."""
        return self._requests.is_busy(_gates(self._chosen(robots)))

    @property
    def is_stopped_permanently(self) -> bool:
        """Whether a signal or the guardian has stopped a robot, so that no motion may start."""
        return self._hub.stopped_by is not None or any(
            robot.guardian.stopped_because is not None for robot in self._robots)

    def request(
            self, robots: Collection[Robot] | None = None,
            elsewhere: bool = False) -> DriveRequest:
        """
        Request a drive, so that a stop ends it even before ``drive`` runs.

        :param elsewhere: whether another thread will call ``drive``
        :raises ControlError: if another drive is under way, no motion may start any more, or the
            calling thread is the only one for callbacks of the node, and so cannot drive
        """
        if (reason := self._hub.stopped_by) is not None:
            raise type(reason)(f'{reason}: only a new node moves the robot again') from None
        chosen = [*self._chosen(robots)]
        for robot in chosen:
            robot.require_not_stopped()
        if not elsewhere and self._hub.executor.is_executor_thread():
            raise errors.MotionRefusedError(
                'a motion cannot run in a callback of its own node: it would wait for callbacks '
                'that wait for it. Start it in a thread, or from the main program, or let a '
                'MultiThreadedExecutor run the node')
        request = self._requests.accept(_gates(chosen))
        for robot in chosen:
            robot.request = request
        return request

    def drive(
            self, orders: Mapping[Robot, DriveOrder], request: DriveRequest | None = None,
            goes_on: bool = False, start: float | None = None, repeat: int = 1,
            on_round: Callable[[int], None] = lambda _: None) -> None:
        """
        Plan motions, drive the robots through them, all from one t = 0, and leave them at rest.

        :param goes_on: whether a fault of one robot ends its drive alone, and not those of all
        :param start: t = 0 of the first round, when all must be ready [s]; None for as soon as
            they are
        :param repeat: the number of rounds; all begin each together
        :param on_round: called before each round with its number, from 1
        :raises InvalidMotionError: if a robot cannot do its motion, or its obstacle watch cannot
            watch it; none has moved then
        :raises ControlError: if there is no control of a robot, or the drive ended early
        """
        with self._accepted(request, orders) as accepted:
            for robot, order in orders.items():
                robot.require_watchable(order.motion)
            accepted.period = min(order.plan.period for order in orders.values())
            for number in range(1, repeat + 1):
                if number > 1:
                    self._requests.renew(accepted)
                on_round(number)
                with self._round(orders, goes_on, start if number == 1 else None) as run:
                    run()

    def _round(
            self, orders: Mapping[Robot, DriveOrder], goes_on: bool,
            start: float | None) -> Drive:
        for robot, order in orders.items():
            robot.drive.request(time.monotonic(), order.motion.name, order.plan)
            robot.publish(MotionPlanned(
                order.motion, order.limits, order.rate, time.monotonic(), order.plan,
                order.motion_file))
        plans = [order.plan for order in orders.values()]
        sources: Sequence[VelocitySource] = [TickScheduler(plan) for plan in plans]
        if len(plans) > 1:
            sources = InStep(plans, self._on_apart).sources
        return Drive([
            RobotTask(robot, source, order.plan.period, order.corrected)
            for (robot, order), source in zip(orders.items(), sources)], goes_on, start)

    def _on_apart(self, event: RobotsApart) -> None:
        # Whoever keeps robots in step is told the time since t = 0.
        self._hub.event_bus.publish(replace(event, time=time.monotonic()))

    def drive_source(
            self, robot: Robot, title: str, source: VelocitySource, period: float,
            request: DriveRequest | None = None) -> None:
        """
        Send the velocities of a source until it has no more, and leave the robot at rest.

        :param period: the normal time between two velocities [s]
        :raises ControlError: if there is no control of the robot, or the drive ended early
        """
        with self._accepted(request, [robot]) as accepted:
            robot.drive.request(time.monotonic(), title)
            accepted.period = period
            with Drive([RobotTask(robot, source, period)]) as run:
                run()

    def start(
            self, drive: Callable[[DriveRequest], object],
            robots: Sequence[Robot] | None = None) -> str:
        """
        Start a thread that drives robots; from now on a stop ends the drive.

        :raises ControlError: if one may not drive now, for example because it does already
        """
        request = self.request(robots, elsewhere=True)

        def run() -> None:
            try:
                drive(request)
            except errors.MotionStoppedError as error:
                self._logger.info(str(error))
            except errors.ControlError as error:
                self._logger.error(str(error))

        # A drive in a callback would wait for other callbacks, which wait for this one.
        threading.Thread(target=run, name='drive', daemon=True).start()
        return 'started'

    def stop(self, caller: str, robots: Sequence[Robot] | None = None) -> str:
        """
        Stop robots, and wait until the stops are complete; return a text for the user.

        A drive ends with an error, even before its robots move; another may be requested then.
        Nothing is sent to a robot of which this node has no control, or that is stopped already.

        :param caller: who stops them, for the error that ends the drive
        :raises RunFaultError: if a stop could not be sent, or a robot still moves by odometry
        """
        chosen = self._chosen(robots)
        reason = errors.MotionStoppedError(f'the movement was ended by {caller}')
        self._requests.on_stop(reason, _gates(chosen))
        were_stopped = [robot.stopper.is_stopped for robot in chosen]
        failures = stop_all(chosen, reason)
        # The thread that drives sees the end of the stop some milliseconds later.
        wait_until(lambda: not self._requests.is_ending(_gates(chosen)), DRIVE_END_TIMEOUT)
        return _answer(chosen, [
            partial(robot.stopper.report, failure, was_stopped)
            for robot, failure, was_stopped in zip(chosen, failures, were_stopped)])

    def stop_permanently(self, reason: errors.ControlError) -> None:
        """Stop all robots for good: each later motion raises the first reason given."""
        self._hub.stop_permanently(reason)
        for robot in self._robots:
            robot.guardian.latch.trip()
        for robot, failure in zip(self._robots, stop_all(self._robots, reason)):
            if failure := failure or robot.stopper.unconfirmed():
                robot.stopper.log_once(failure)

    def _on_callback_error(self, error: BaseException) -> None:
        """Stop all robots for good after an error in a callback of the node."""
        self.stop_permanently(errors.RunFaultError(
            f'a callback failed: {type(error).__name__}: {escaped(error)}'))

    def close(self) -> None:
        """Stop and release all robots, and refuse later motions."""
        with self._closing:
            if not self._is_closed:
                self.stop_permanently(errors.MotionRefusedError(errors.ENDED))
                failed = [error for error in complete([
                    partial(_released, robot) for robot in self._robots]) if error is not None]
                self._is_closed = True
                if failed:
                    raise failed[0]
            self._hub.close()

    def serve_until_stopped(self) -> None:
        """Run callbacks in a background thread until ``stop_permanently``; raise its reason."""
        self._hub.serve_until_stopped()
        for robot in self._robots:
            robot.require_not_stopped()

    def pause(self, robots: Sequence[Robot] | None = None) -> str:
        """
        Bring robots to rest within their limits, and keep them there until ``resume`` is called.

        If no motion is under way, the next one is paused before the robot moves.

        :raises ControlError: if no motion may start any more, so that there is none to pause
        """
        chosen = self._chosen(robots)
        for robot in chosen:
            robot.require_not_stopped()
        with self._changing:
            self.changes += 1
            are_new = [robot.speed_factor.set(PAUSE, 0.0) for robot in chosen]
        if not any(are_new):
            return 'it was paused before'
        self._logger.info('Paused: resume to go on')
        return ('paused' if self.is_driving(chosen)
                else 'paused: the next motion is held at its start')

    def resume(
            self, even_if_moved: bool = False, robots: Sequence[Robot] | None = None) -> str:
        """
        Continue paused motions.

        :param even_if_moved: whether to continue from where a robot stands now if somebody moved
            it during the pause
        :raises ControlError: if no motion may start now, or a robot was moved; all stay paused
        """
        chosen = self._chosen(robots)
        for robot in chosen:
            robot.require_not_stopped()
            if self.is_driving([robot]):
                robot.check_resume(even_if_moved)
        are_blind = [robot for robot in chosen if robot.go_blind()]
        were_held = [robot.speed_factor.set(name, 1.0)
                     for robot in chosen for name in (PAUSE, MOVED)]
        if any(were_held):
            self._logger.info('Resumed')
        if are_blind:
            return f'resumed without a scan of the laser, at {100.0 * BLIND_SPEED:g} %'
        for robot in chosen:
            if robot.speed_factor.is_hold:
                return f'another holds the robot: {robot.speed_factor.describe()}'
        return 'resumed' if any(were_held) else 'nothing was paused'

    def resume_when_confirmed(self, robots: Sequence[Robot] | None = None) -> str:
        """
        Continue paused motions; if a robot was moved meanwhile, only at a second call.

        :raises RobotMovedError: if it was moved, unless the call before raised this 1 s to 10 s
            ago
        :raises ControlError: if no motion may start now
        """
        try:
            return self.resume(self._confirmation.on_request(), robots)
        except errors.RobotMovedError as error:
            self._confirmation.on_warning()
            raise errors.RobotMovedError(
                f'{error}. To go on all the same, resume once more, {RESUME_QUIET_TIME:g} to '
                f'{RESUME_CONFIRM_TIMEOUT:g} s from now') from None

    def change_speed(self, step: float) -> None:
        """Change the ROS parameter ``speed_factor`` by a step, between one step and 1."""
        factor = min(robot.speed_factor.factors.get(OVERRIDE, 1.0) for robot in self._robots)
        self.set_speed(min(1.0, max(abs(step), round(factor + step, 2))))

    def set_speed(self, factor: float, robots: Sequence[Robot] | None = None) -> None:
        """
        Set the ROS parameter ``speed_factor``, from 0.01 to 1.

        :raises ControlError: if the value is out of range, or no motion may start any more
        """
        chosen = self._chosen(robots)
        for robot in chosen:
            robot.require_not_stopped()
        try:
            results = self._hub.node.set_parameters([
                Parameter(robot.settings.full_name(PARAMETER), value=factor) for robot in chosen])
        except rclpy_implementation.InvalidHandle:  # the node was destroyed just now
            raise errors.MotionRefusedError(errors.ENDED) from None
        for result in results:
            if not result.successful:
                raise errors.MotionRefusedError(result.reason)

    def on_speed_set(self, robot: Robot, factor: float) -> None:
        """Apply the ROS parameter ``speed_factor`` of a robot, which somebody has set."""
        with self._changing:
            self.changes += 1
            robot.speed_factor.set(OVERRIDE, factor)

    def begin_anew(self, changes: int, factor: float) -> None:
        """
        End any pause, and set the speed factor.

        :param changes: ``changes`` when this was decided; what came later is kept
        """
        with self._changing:
            if changes != self.changes:
                return
            for robot in self._robots:
                for name in (PAUSE, MOVED):
                    robot.speed_factor.set(name, 1.0)
            self.set_speed(factor)

    def _chosen(self, robots: Collection[Robot] | None) -> Sequence[Robot]:
        return self._robots if robots is None else [*robots]

    @contextlib.contextmanager
    def _accepted(
            self, request: DriveRequest | None,
            robots: Collection[Robot]) -> Iterator[DriveRequest]:
        """Finish an accepted request at the end of a block, also if an error ends the block."""
        request, is_complete = request or self.request(robots), False
        try:
            yield request
            is_complete = True
        finally:
            self._requests.finish(request, is_complete)


def _gates(robots: Collection[Robot]) -> list[VelocityGate]:
    return [robot.gate for robot in robots]


def _answer(robots: Sequence[Robot], reports: Sequence[Callable[[], str]]) -> str:
    """Return the texts for the user, one a robot; raise the first error, after all reports."""
    texts: list[str] = []
    failed: errors.ControlError | None = None
    for robot, report in zip(robots, reports):
        try:
            texts.append(report())
        except errors.ControlError as error:  # noqa: PERF203 (few robots, each reports)
            failed = failed or robot.named(error)
    if failed is not None:
        raise failed
    if len({*texts}) == 1:
        return texts[0]
    return '; '.join(f'{robot.name}: {text}' for robot, text in zip(robots, texts))


def _released(robot: Robot, moment: Moment) -> Steps[Exception | None]:
    """Release a robot; return an error instead of raising it, which would keep the others."""
    try:
        yield from robot.release(moment)
    except Exception as error:
        return error
    return None
