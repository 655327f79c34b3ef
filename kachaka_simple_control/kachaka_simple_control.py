#!/usr/bin/env python3
#
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
"""The node that drives a robot, and the lesson.  Tested by test/ros/test_robot.py."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
import os
import sys
import time
from typing import Any

if __name__ == '__main__':
    # If this file is run directly, Python would import the file instead of the package.
    sys.path[0] = __file__.rpartition('/kachaka_simple_control/')[0] or '..'

from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.control.drive_requests import DriveRequest
from kachaka_simple_control.control.speed_factor import SpeedFactor
from kachaka_simple_control.control.timing import MAX_LATENESS, rate_problem
from kachaka_simple_control.errors import (
    InvalidMotionError,
    RobotMovedError,
    UsageError,
)
from kachaka_simple_control.files.motion_file import MotionFile
from kachaka_simple_control.files.watch_check import watch_errors
from kachaka_simple_control.kachaka.bridge_process import OwnSimulation, require_floor
from kachaka_simple_control.motion.drive_order import DriveOrder
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.motion.steps import Motion, Move, Step
from kachaka_simple_control.motion.units import require_number
from kachaka_simple_control.process.output import print_result
from kachaka_simple_control.process.run_command import run_command
from kachaka_simple_control.report.text_tables import drive_table, terminal_columns
from kachaka_simple_control.ros.dds_transport import start_on_this_machine, use_udp_transport
from kachaka_simple_control.ros.drive_node import DriveNode
from kachaka_simple_control.ros.node_parameters import require_no_parameter
from kachaka_simple_control.ros.parameters import warn_of_unknown
from kachaka_simple_control.telemetry.event_file import EventFile
from kachaka_simple_control.text import escaped, pluralize, quoted
import rclpy
import rclpy.signals

NAME = 'kachaka_simple_control'


class KachakaSimpleControl(DriveNode):
    """
    Drives a robot with exactly timed velocities, and stops it at the end.

    The velocities are sent as planned (feedforward), unless the parameter ``closed_loop`` is set.

    Positive ``linear_x`` is forward [m/s], positive ``angular_z`` turns left [rad/s] (REP-103).
    The robot is stopped before the program ends, also after a signal or an exception.

    :ivar robot: what this node has for its robot; for internal use in this package
    :ivar profile: what is known of the robot, such as its limits
    :ivar node_parameters: the values of the parameters at the start
    :ivar publisher: the publisher of velocities, for inspection only; its ``publish()`` always
        raises an error
    """

    def __init__(
            self, parameter_defaults: Mapping[str, Any] | None = None, *, sim: bool = False,
            floor: str | os.PathLike[str] | None = None, **node_options: Any) -> None:
        """
        Create the node, and call ``rclpy.init()`` if ROS is not initialized yet.

        No velocity is sent before the first movement.

        :param parameter_defaults: values that replace the usual default values of the node's
            parameters, by parameter name
        :param sim: whether to start a simulated robot, which is visible only on this machine; when
            the node is closed, a table with the results of the drive is printed
        :param floor: the name or the file of the floor of the simulated robot; None for an empty
            floor
        :raises UsageError: if the value of a parameter, a ROS name or the floor is invalid, or a
            parameter is among the options
        """
        require_no_parameter(node_options)
        require_floor(floor, sim)
        if sim:
            start_on_this_machine(self)
            parameter_defaults = {'summary': True, **(parameter_defaults or {})}
        self._simulation: OwnSimulation | None = None
        self._event_file: EventFile | None = None
        super().__init__(NAME, {'': parameter_defaults or {}}, **node_options)
        try:
            self._add_parts(sim, floor)
        except BaseException:
            self.destroy_node()
            raise
        self.log_start()

    def _add_parts(self, sim: bool, floor: str | os.PathLike[str] | None) -> None:
        if type(self) is KachakaSimpleControl:  # another class may declare more of them
            warn_of_unknown(self, self.robots)
        self.robot = self.robots['']
        self.profile, self.node_parameters = (
            self.robot.settings.profile, self.robot.settings.parameters)
        self.publisher = self.robot.publisher
        if sim:
            self._simulation = OwnSimulation(
                self.profile, self.node_parameters.robot_namespace, floor)
            self.robot.discovery.require_participant(self._simulation.require_participant)
        if self.node_parameters.summary:
            self._event_file = EventFile()
            self.event_bus.subscribe(self._event_file.send)

    def move_robot(self, linear_x: float, angular_z: float, duration: float) -> None:
        """
        Drive at a velocity for an exact duration, then send a zero velocity and return.

        Before the first movement, this method waits for the robot and enables its manual control.
        If no movement follows at once, more zero velocities are sent, to make sure that the robot
        stops.  Odometry does not correct this movement, even if the parameter ``closed_loop`` is
        set.

        :param linear_x: forward velocity [m/s], negative backwards
        :param angular_z: turning velocity [rad/s], positive to the left
        :param duration: the duration [s]
        :raises InvalidMotionError: if a value is not finite or beyond the robot's limits, or the
            parameter ``watch`` is set and the laser does not see where it drives; nothing has
            moved
        :raises RobotNotFoundError: if no robot receives the velocities; nothing has moved
        :raises ControlError: if the movement could not be completed; the robot was stopped
        """
        step = Move(linear_x, angular_z, duration)
        motion = Motion('move_robot', (step,))
        # Checked here, because the errors of a motion name a step that the caller cannot know.
        self.profile.planning_limits.check(step.velocity)
        if self.node_parameters.watch:
            for error in watch_errors(motion, self.profile.watching_laser(), self.profile.name):
                raise InvalidMotionError(f'{linear_x} m/s, {error.message}', name='linear_x')
        self.commander.drive({self.robot: DriveOrder.of(
            motion, self.profile.planning_limits, self.node_parameters.rate)})
        self.get_logger().info('Robot has stopped')
        self.get_logger().info(
            f'Movement completed: Forward={linear_x}, Rotation={angular_z}, '
            f'Time={duration} seconds')

    def run(self, motion: Motion | Iterable[Step] | str | os.PathLike[str] | MotionFile,
            limits: Limits | None = None, request: DriveRequest | None = None,
            rate: float | None = None) -> None:
        """
        Drive a motion with exact timing, and return after the zero velocity at its end.

        If the parameter ``closed_loop`` is set, the velocities are corrected with odometry during
        the motion.  At the end of the motion, the heading is corrected with odometry, too.  If the
        parameter ``corners`` is above 0, it replaces the motion's ``corners``.  If the parameter
        ``watch`` is set, the robot is held before obstacles on its planned path.

        Before the first drive, this method waits for the robot and enables its manual control.  If
        no drive follows at once, more zero velocities are sent, to make sure that the robot stops.

        :param motion: the motion, a list of steps, the name of a motion of the package such as
            ``square``, the path of a motion file, or what ``find('square', side='1 m')`` returns,
            with values of parameters; limits and rate of a file are then the defaults
        :param limits: the limits for the plan; None for the robot's limits
        :param request: the accepted request for this drive, if another thread has already called
            ``commander.request``; None to request the drive now
        :param rate: how often a velocity is sent [Hz]; None for the parameter ``rate``
        :raises UsageError: if ``motion`` is none of these, ``limits`` are not ``Limits``, or the
            rate is too low or too high for the robot; nothing has moved
        :raises InvalidMotionError: if the robot cannot drive the motion; nothing has moved
        :raises RobotNotFoundError: if no robot receives the velocities; nothing has moved
        :raises ControlError: if the motion could not be completed; the robot was stopped
        """
        motion_file = self._motion_file(motion)
        if motion_file is not None:
            motion, rate = motion_file.motion, motion_file.rate if rate is None else rate
            limits = limits or motion_file.check(
                self.profile.planning_limits, self.profile.name, self.node_parameters.closed_loop,
                self.profile.watching_laser() if self.node_parameters.watch else None)
        elif isinstance(motion, (list, tuple)):
            motion = Motion(motion)
        elif not isinstance(motion, Motion):
            raise UsageError(
                f'run() drives a Motion, not {escaped(repr(motion), 60)}: write a list of steps, '
                "as in run([Forward(0.5)]), or the name or path of a motion, as in run('square')")
        if not isinstance(limits, Limits | None):
            raise UsageError(
                f'limits are {escaped(repr(limits), 60)}: they must be Limits, as in '
                'dataclasses.replace(robot.profile.planning_limits, max_linear_velocity=0.1)')
        rate = self.node_parameters.rate if rate is None else require_number('rate', rate, 'Hz')
        if problem := rate_problem(rate, self.profile.command_timeout, self.profile.name):
            raise UsageError(f'rate is {problem}')
        if self.node_parameters.corners:
            motion = replace(motion, corners=self.node_parameters.corners)
        self.drive(DriveOrder.of(
            motion, self.profile.planning_limits, rate, limits,
            self.node_parameters.closed_loop,
            None if motion_file is None else motion_file.as_text()), request)

    def drive(self, order: DriveOrder, request: DriveRequest | None = None) -> None:
        """
        Drive as ``run`` does, with a motion whose limits and rate are known.

        :raises InvalidMotionError: if the robot cannot drive the motion; nothing has moved
        :raises ControlError: if the motion could not be completed; the robot was stopped
        """
        self.commander.drive({self.robot: order}, request)
        driven, name = order.plan, escaped(order.motion.name)
        self.get_logger().info(
            f'Motion completed: {name}, {pluralize(len(driven.steps), "step")}, '
            f'{driven.duration:.3f} seconds{self._delay(driven)}')

    def _motion_file(self, motion: object) -> MotionFile | None:
        """
        Return a motion from a file, given by its name, its path or as such; None for another.

        :raises MotionFileError: if there is no such motion, or it is made for another robot or
            kind of control
        """
        motion_file, used = motion, self.node_parameters
        if isinstance(motion, (str, os.PathLike)):
            # Imported here: the lesson reads no file.
            from kachaka_simple_control.files.library import find
            motion_file = find(motion)
        if not isinstance(motion_file, MotionFile):
            return None
        if motion_file.robot not in (None, used.robot):
            raise motion_file.error_at('robot', (
                f'{quoted(str(motion_file.robot), 60)}, and this node drives {self.profile.name}: '
                'leave it out, or set the parameter robot'))
        for name in ('closed_loop', 'watch'):
            wanted, has = getattr(motion_file, name), getattr(used, name)
            if wanted not in (None, has):
                raise motion_file.error_at(name, (
                    f'{str(wanted).lower()}, and the parameter {name} is {str(has).lower()}: '
                    'leave it out, or set the parameter'))
        return motion_file

    def stop_robot(self) -> None:
        """
        Stop the robot, and wait until the stop is complete.

        This also ends a movement that another thread has started, even if that thread still waits
        for the robot.  If this node does not control the robot yet, no velocity is sent.

        :raises RunFaultError: if the stop could not be sent, or odometry still shows motion
        """
        self.commander.stop('stop_robot()')

    def pause(self) -> None:
        """
        Pause the motion: brake within the robot's limits, and keep the robot at rest.

        A pause is not a stop: the robot brakes gently, and ``resume()`` continues the motion.  To
        stop, call ``stop_robot()``.  If no motion is running, the next motion is paused at its
        start.  Any thread may call this method.

        :raises ControlError: if no motion is allowed to start any more
        """
        self.commander.pause()

    def resume(self, even_if_moved: bool = False) -> None:
        """
        Resume a paused motion; any thread may call this method.

        :param even_if_moved: whether to resume even if the robot was moved during the pause
        :raises ControlError: if no motion is allowed to start now, or the robot was moved by more
            than 2 cm or 2 degrees; the motion stays paused
        """
        try:
            self.commander.resume(even_if_moved)
        except RobotMovedError as error:
            raise RobotMovedError(
                f'{error}. To go on all the same: resume(even_if_moved=True)') from None

    @property
    def speed_factor(self) -> float:
        """
        Return the speed of the robot relative to the planned speed, from 0 to 1.

        To drive the same path more slowly, set this property to a factor from 0.01 to 1.  Any
        thread may do this.  The returned value can be lower than the factor that was set; for
        example, it is 0 during a pause.
        """
        return self.speed.value

    @speed_factor.setter
    def speed_factor(self, factor: float) -> None:
        self.commander.set_speed(factor)

    @property
    def speed(self) -> SpeedFactor:
        """
        Return what the speed is made of: factors by name, of which the product counts.

        ``robot.speed.set('obstacle', 0.3, valid_for=0.5)`` slows down for a reason of your own.
        """
        return self.robot.speed_factor

    @property
    def drive_log(self) -> DriveLog:
        """Return the log of all drives so far; empty without the parameter ``summary``."""
        log = DriveLog()
        if self._event_file is not None:
            self.event_bus.flush()
            for event in self._event_file.events():
                log.on_event(event)
        return log

    @property
    def is_heard(self) -> bool:
        """Whether the publishers of this node and of the guardian both have a subscriber."""
        return self.robot.is_heard

    @property
    def stop_confirmed_after(self) -> float | None:
        """
        Return the time from the start of the last stop until odometry showed standstill [s].

        The value is None before the first stop, if odometry still shows motion, and without
        odometry.
        """
        return self.robot.stopper.confirmed_after

    def _delay(self, driven: Plan) -> str:
        """
        Return the duration of the last drive as a part of a log message.

        The text is empty, unless the drive was clearly longer than planned: by more than
        MAX_LATENESS plus the time between two velocity messages.
        """
        assert self.robot.gate.permit is not None
        took = time.monotonic() - self.robot.gate.permit.began
        is_delayed = took > driven.duration + driven.period + MAX_LATENESS
        return f' planned, driven in {took:.3f}' if is_delayed else ''

    def _close(self) -> None:
        """
        Stop and release the robot; end the simulated robot, if any, and print its table; once.

        It has requested, sent and reported distance or angle of each movement.

        :raises RunFaultError: if the table of a simulated robot cannot be printed
        """
        super()._close()
        if self._event_file is not None:
            self._event_file.close()
        simulation, self._simulation = self._simulation, None
        if simulation is not None:
            simulation.end()
            if (drive_log := self.drive_log).steps:
                print_result(drive_table(
                    drive_log, self.stop_confirmed_after, terminal_columns()), 'the table')


def play_lesson(robot_control: KachakaSimpleControl) -> None:
    """
    Drive the lesson's seven movements: forward, left and right, with a rest around each.

    A rest, in which the robot stands still for 1 s, also counts as a movement.

    The lesson is defined only here.  The options ``--plan`` and ``--list`` and the report read the
    movements from this function.
    """
    robot_control.move_robot(0.0, 0.0, 1.0)  # stand still for 1 s
    robot_control.move_robot(0.1, 0.0, 1.0)  # forward at 0.1 m/s for 1 s
    robot_control.move_robot(0.0, 0.0, 1.0)
    robot_control.move_robot(0.0, 0.5, 2.0)  # left at 0.5 rad/s for 2 s
    robot_control.move_robot(0.0, 0.0, 1.0)
    robot_control.move_robot(0.0, -0.5, 2.0)  # right at 0.5 rad/s for 2 s
    robot_control.move_robot(0.0, 0.0, 1.0)


def lesson(arguments: list[str] | None) -> None:
    """
    Initialize ROS, drive the lesson, and shut ROS down.

    :param arguments: the command-line arguments for ROS; None for those of this process
    :raises ControlError: if the lesson could not be completed; the robot was stopped
    """
    use_udp_transport()
    rclpy.init(args=arguments)
    robot_control = KachakaSimpleControl()
    try:
        play_lesson(robot_control)
    except KeyboardInterrupt:
        robot_control.get_logger().info('Program was interrupted')
    finally:
        try:
            robot_control.stop_robot()
        finally:
            robot_control.destroy_node()
            rclpy.try_shutdown()


def main(args: list[str] | None = None) -> int:
    """
    Drive the lesson, an example with seven movements, and return the exit code.

    This function is called if this file is run directly.  The command ``kachaka_simple_control``
    has more functions.

    :param args: the command-line arguments for ROS; None for those of this process
    """
    return run_command(lambda: lesson(args), motion_function=play_lesson.__name__)


if __name__ == '__main__':
    sys.exit(main())
