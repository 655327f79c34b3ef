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
"""The node of the lesson, and the lesson itself."""

from __future__ import annotations

import atexit
from collections.abc import Mapping
import signal
import sys
import time
from typing import Any

if __name__ == '__main__':
    # Run as a file, Python looks for packages beside it, and would find the file itself.
    sys.path[0] = __file__.rpartition('/kachaka_simple_control/')[0] or '..'

from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.control.drive_requests import DriveRequest
from kachaka_simple_control.control.events import OdometryReceived, SpeedFactorChanged
from kachaka_simple_control.control.output import discard_unread, make_log_nonblocking
from kachaka_simple_control.control.signals import signal_dispatcher
from kachaka_simple_control.control.timing import MAX_LATENESS
from kachaka_simple_control.errors import (
    MotionRefusedError,
    MotionRunningError,
    UsageError,
)
from kachaka_simple_control.kachaka.own_simulation import OwnSimulation, start_on_this_machine
from kachaka_simple_control.motion.drive_order import DriveOrder
from kachaka_simple_control.motion.geometry import Pose, Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.motion.steps import Motion, Move
from kachaka_simple_control.ros.commander import Commander
from kachaka_simple_control.ros.dds_transport import use_udp_transport
from kachaka_simple_control.ros.executors import before_shutdown, wake_main_thread
from kachaka_simple_control.ros.introspection import IntrospectionPublishers
from kachaka_simple_control.ros.names import INTROSPECTION_TOPICS, names_of
from kachaka_simple_control.ros.odometry import subscribe_to_odometry
from kachaka_simple_control.ros.parameters import declare_parameters
from kachaka_simple_control.ros.session import Session
from kachaka_simple_control.ros.startup import check_node_names, one_line_errors
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from kachaka_simple_control.run_command import run_command
from kachaka_simple_control.telemetry.event_bus import EventBus
from kachaka_simple_control.telemetry.subscriber_process import EventFile
from kachaka_simple_control.text import escaped, pluralize
import rclpy
from rclpy.node import Node
import rclpy.signals

NAME = 'kachaka_simple_control'
#: The node's own services, besides those that every node has.
SERVICES = ('~/stop', '~/run', '~/pause', '~/resume')


# Here, and not with the first node: a script may fail before it has one.
signal_dispatcher.handle_uncaught()


class KachakaSimpleControl(Node):
    """
    Drives a robot by exactly timed velocities, and stops it at the end.

    Control is feedforward, unless the parameter ``closed_loop`` is set.

    Positive ``linear_x`` is forward [m/s], positive ``angular_z`` turns left [rad/s] (REP-103).
    Whatever ends the program (its end, a signal, an exception), the robot is stopped first.

    :ivar profile: the kind of robot
    :ivar node_parameters: the values of the node's parameters
    :ivar event_bus: publishes the events of each drive
    :ivar session: the connection with the robot, for the command; a user needs the methods only
    :ivar commander: what services and keys call, for the command
    :ivar publisher: the publisher of velocities, to inspect; its ``publish()`` raises
    """

    def __init__(
            self, parameter_defaults: Mapping[str, Any] | None = None, *, sim: bool = False,
            **node_options: Any) -> None:
        """
        Make the node; nothing is sent before the first movement.

        Calls ``rclpy.init()`` if that is not done.

        :param parameter_defaults: values of parameters, for those that nothing else sets
        :param sim: whether to start a simulated robot, on this machine alone; at the end a table
            is printed
        :param node_options: options of ``rclpy.node.Node``, such as ``namespace``
        :raises UsageError: if the value of a parameter, or a name, cannot work
        """
        if sim:
            start_on_this_machine(self)
            parameter_defaults = {'summary': True, **(parameter_defaults or {})}
        self._simulation: OwnSimulation | None = None
        use_udp_transport()
        if not rclpy.ok(context=node_options.get('context')):
            rclpy.init(context=node_options.get('context'))
        make_log_nonblocking()
        with one_line_errors(NAME):
            super().__init__(NAME, **node_options)
        try:
            self._set_up(parameter_defaults or {}, sim)
        except BaseException:
            # A publisher that is left over would be taken for another program that drives.
            super().destroy_node()
            raise
        self.get_logger().info('Robot control node has started')
        for calibration, what in ((self.profile.calibration, 'Calibrated'),
                                  (self.profile.odometry_calibration, 'Odometry calibrated')):
            if calibration is not None:
                self.get_logger().info(f'{what}: {escaped(calibration.describe())}')

    def _set_up(self, defaults: Mapping[str, Any], sim: bool) -> None:
        self.profile, self.node_parameters = declare_parameters(self, defaults)
        self.robot_names = names_of(
            self.profile, self.node_parameters.robot_namespace,
            self.node_parameters.manual_control)
        check_node_names(self, self.robot_names, INTROSPECTION_TOPICS, SERVICES)
        self.publisher = VelocityPublisher(
            self, self.robot_names.velocity, self.profile.message_type, self.profile.frame)
        self._introspection = IntrospectionPublishers(self, self.publisher, self.profile)
        parameters = self.node_parameters
        if parameters.summary or parameters.odometry_timeout or parameters.closed_loop:
            is_subscribed = subscribe_to_odometry(
                self, self.robot_names, self._on_odometry, self._introspection.set_frame)
            if parameters.closed_loop and not is_subscribed:
                raise UsageError('a closed loop needs odometry, and nav_msgs is not installed')
        self.event_bus = EventBus(self.get_logger().warning)
        self.session = Session(
            self, self.publisher, self.profile, self.robot_names, self.node_parameters,
            self.event_bus.publish)
        if sim:
            self._simulation = OwnSimulation(
                self.profile, self.node_parameters.robot_namespace)
            self.session.require_robot(self._simulation.require_participant)
        self._event_file = EventFile() if self.node_parameters.summary else None
        if self._event_file is not None:
            self.event_bus.subscribe(self._event_file.send, self._event_file.fail)
        self._introspection.attach(self.event_bus, self.session.status_reader)
        self.session.speed_factor.on_change = self._on_speed_factor
        self.commander = Commander(self, self.session, self.node_parameters.speed_factor)
        self._signal_handler = _SignalHandler(self)
        self._stop_on_every_exit()

    def move_robot(self, linear_x: float, angular_z: float, duration: float) -> None:
        """
        Hold a velocity for a time, exactly, then send a zero; returns when that is done.

        The first movement waits for the robot and enables its manual control.  The next one may
        follow at once; when none does, a whole stop is sent.

        :param linear_x: forward velocity [m/s], negative backwards; no odometry corrects it
        :param angular_z: turning velocity [rad/s], positive to the left
        :param duration: how long [s]
        :raises InvalidMotionError: if a value is not finite or beyond the robot's limits;
            nothing has moved
        :raises RobotNotFoundError: if no robot listens; nothing has moved
        :raises ControlError: if the run could not go on; the robot was stopped
        """
        step = Move(linear_x, angular_z, duration)
        # The planner would name the step's place in a motion that the caller never wrote.
        self.profile.planning_limits.check(step.velocity)
        self.session.drive(DriveOrder.of(
            Motion('move_robot', (step,)), self.profile.planning_limits,
            self.node_parameters.rate))
        self.get_logger().info('Robot has stopped')
        self.get_logger().info(
            f'Movement completed: Forward={linear_x}, Rotation={angular_z}, '
            f'Time={duration} seconds')

    def run(self, motion: Motion, limits: Limits | None = None,
            request: DriveRequest | None = None) -> None:
        """
        Drive a motion, exactly timed; returns when its last zero was sent.

        With the parameter ``closed_loop`` odometry corrects the velocities, and at the end of the
        motion the heading.

        The first drive waits for the robot and enables its manual control.  The next one may
        follow at once; when none does, a whole stop is sent.

        :param motion: the motion
        :param limits: what to plan it with; None for the robot's limits
        :param request: a request that ``session.request`` accepted before, in another thread
        :raises UsageError: if it is no motion; nothing has moved
        :raises InvalidMotionError: if the robot cannot do it; nothing has moved
        :raises RobotNotFoundError: if no robot listens; nothing has moved
        :raises ControlError: if the run could not go on; the robot was stopped
        """
        if not isinstance(motion, Motion):
            raise UsageError(
                f'run() drives a Motion, not {escaped(repr(motion), 60)}: make one by '
                "Motion('name', steps), or take one of a file by find('square').motion, from "
                'kachaka_simple_control.files.library')
        driven = self.session.drive(DriveOrder.of(
            motion, self.profile.planning_limits, self.node_parameters.rate, limits,
            self.node_parameters.closed_loop), request)
        self.get_logger().info(
            f'Motion completed: {escaped(motion.name)}, {pluralize(len(driven.steps), "step")}, '
            f'{driven.duration:.3f} seconds{self._delay(driven)}')

    def stop_robot(self) -> None:
        """
        Stop the robot, and end the movement of another thread, running or waiting.

        Nothing is sent to a robot that this node has not taken: even a zero would take it.

        :raises RunFaultError: if the stop could not be sent, or odometry still sees the robot move
        """
        self.session.stop('stop_robot()')

    def pause(self) -> None:
        """
        Bring the robot to rest within its limits, and hold the motion there; from any thread.

        A pause is not a stop: it brakes gently and goes on when asked.  To stop, call
        ``stop_robot()``.  Without a motion the next one is held at its start.
        """
        self.commander.pause()

    def resume(self, even_if_moved: bool = False) -> None:
        """
        Go on with a motion that is paused; from any thread.

        :param even_if_moved: whether to go on from where somebody moved the robot to
        :raises ControlError: if a motion could not start now either, or the robot was moved by
            more than 2 cm or 2 degrees; it stays paused
        """
        self.commander.resume(even_if_moved)

    @property
    def speed_factor(self) -> float:
        """
        Return the speed relative to the plan, from 0 to 1: the product of all factors.

        Set it, above 0 and up to 1, to drive slower; from any thread.  The path stays the same.
        """
        return self.session.speed_factor.value

    @speed_factor.setter
    def speed_factor(self, factor: float) -> None:
        self.commander.set_speed(factor)

    @property
    def drive_log(self) -> DriveLog:
        """Return the log of all drives so far; it is empty without the parameter ``summary``."""
        log = DriveLog()
        if self._event_file is not None:
            self.event_bus.flush()
            for event in self._event_file.events():
                log.on_event(event)
        return log

    @property
    def is_heard(self) -> bool:
        """Whether the velocities of this node and of its guardian have a subscriber."""
        return self.session.has_subscriber

    @property
    def stop_confirmed_after(self) -> float | None:
        """
        Return how long after the start of the last stop odometry showed standstill [s].

        None if it still moves, or there is no odometry.
        """
        return self.session.stop_confirmed_after

    def destroy_node(self) -> None:
        """Stop the robot, release it, and destroy the node."""
        self._close()
        self._introspection.close()
        signal_dispatcher.unregister(self._signal_handler)
        atexit.unregister(self._close)
        super().destroy_node()

    def _delay(self, driven: Plan) -> str:
        """Return how long the newest run took, if it was slower than its plan."""
        assert self.session.gate.run is not None
        took = time.monotonic() - self.session.gate.run.began
        is_delayed = took > driven.duration + driven.period + MAX_LATENESS
        return f' planned, driven in {took:.3f}' if is_delayed else ''

    def _on_speed_factor(self, now: float, factors: Mapping[str, float]) -> None:
        self.event_bus.publish(SpeedFactorChanged(now, dict(factors)))

    def _on_odometry(self, now: float, pose: Pose, velocity: Velocity, is_new: bool) -> None:
        self.session.on_odometry(now, pose, velocity, is_new)
        self.event_bus.publish(OdometryReceived(now, pose, velocity))

    def _stop_on_every_exit(self) -> None:
        # rclpy's own handlers would shut the context down before anything could be published.
        rclpy.signals.uninstall_signal_handlers()
        if not signal_dispatcher.register(self._signal_handler):
            self.get_logger().warning(
                'Made outside the main thread, this node does not receive signals: make it in the '
                'main thread, or call stop_robot() on the way out')
        signal_dispatcher.reinstall()
        before_shutdown(self.context, self._release)
        # Called in reverse order: the robot is released first.
        atexit.unregister(_discard_if_stopped)
        atexit.register(_discard_if_stopped)
        atexit.register(self._close)

    def _release(self) -> None:
        """Stop the robot and release it, while something can be published."""
        self.session.close()
        self.event_bus.flush()

    def _close(self) -> None:
        """Stop the robot and release it; end the simulated one."""
        self.session.close()
        self.event_bus.close()
        if self._event_file is not None:
            self._event_file.close()
        if self._simulation is not None:
            self._simulation.end(self.drive_log, self.stop_confirmed_after)


class _SignalHandler:
    """Stops a node's robot when a signal or an exception ends the program."""

    def __init__(self, node: KachakaSimpleControl) -> None:
        self._node = node
        self._guard_condition = node.create_guard_condition(lambda: None)

    def on_signal(self, signum: int) -> None:
        """Stop at once and permanently; called in a thread of its own."""
        name = signal.Signals(signum).name
        self._node.session.stop_permanently(MotionRefusedError(f'stopped by {name}'))

    def wake(self) -> None:
        """Make a main thread that spins return to Python, whose signal handlers run there."""
        self._guard_condition.trigger()
        wake_main_thread()

    def uncaught(self, error: BaseException) -> None:
        """Stop: an exception ends the main thread, and other threads may still drive."""
        if isinstance(error, MotionRunningError):
            return
        if isinstance(error, KeyboardInterrupt):
            self._node.get_logger().info('Program was interrupted')
        self._node.session.stop_permanently(
            MotionRefusedError(f'the program ended by {error!r}'))


def _discard_if_stopped() -> None:
    if signal_dispatcher.signum is not None:
        discard_unread()


def play_lesson(robot_control: KachakaSimpleControl) -> None:
    """
    Drive the lesson's seven movements: forward, left and right, with a rest around each.

    The one definition of the lesson: ``--plan``, ``--list`` and a report follow from these lines.

    :param robot_control: the node to drive it with
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
    Drive the lesson from the first line of a program to its last.

    :param arguments: what ROS is told; None for the arguments of the process
    :raises ControlError: if it could not be driven to its end; the robot was stopped
    """
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
    Drive the lesson; the command of the same name can do more.

    :param args: what ROS is told; None for the arguments of the process
    :returns: the exit code
    """
    return run_command(lambda: lesson(args))


if __name__ == '__main__':
    sys.exit(main())
