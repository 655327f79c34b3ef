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
"""The lesson's node, and the lesson's movements played with it."""

from __future__ import annotations

import atexit
from collections.abc import Callable
import signal
import sys
import threading
import time
from typing import Any

if __name__ == '__main__':
    # Run as a file, Python looks for packages beside it, and would find the file itself.
    sys.path[0] = __file__.rpartition('/kachaka_simple_control/')[0] or '..'

from kachaka_simple_control import cli
from kachaka_simple_control.control.drive_requests import DriveRequest
from kachaka_simple_control.control.output import discard_unread, make_log_nonblocking
from kachaka_simple_control.control.signals import signal_dispatcher
from kachaka_simple_control.errors import MotionRefusedError
from kachaka_simple_control.files.robot_profile import profile_of
from kachaka_simple_control.motion.geometry import Pose, Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import Plan, plan
from kachaka_simple_control.motion.steps import Motion, Move
from kachaka_simple_control.report.drive_log import DriveLog
from kachaka_simple_control.ros.dds_transport import use_udp_transport
from kachaka_simple_control.ros.debug_topics import IntrospectionPublishers
from kachaka_simple_control.ros.executors import before_shutdown, wake_main_thread
from kachaka_simple_control.ros.names import names_of
from kachaka_simple_control.ros.odometry import listen_to_odometry
from kachaka_simple_control.ros.parameters import (
    declare_parameters,
    declare_robot,
    session_started,
)
from kachaka_simple_control.ros.qos import SERVICE_QOS
from kachaka_simple_control.ros.session import Session
from kachaka_simple_control.ros.startup import check_node_names, one_line_errors
from kachaka_simple_control.ros.velocity_publisher import VelocityMessage, VelocityPublisher
from kachaka_simple_control.telemetry.events import (
    EventBus,
    MotionEnded,
    MotionPlanned,
    MotionStarted,
    OdometryReceived,
    VelocitySent,
)
import rclpy
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
import rclpy.signals
from rclpy.task import Future
from std_srvs.srv import Trigger

NAME = 'kachaka_simple_control'
#: What the node has of its own, beside what every node has.
TOPICS = ('~/planned_path', '~/driven_path', '~/commanded_velocity', '/diagnostics')
SERVICES = ('~/stop', '~/run')


class KachakaSimpleControl(Node):
    """
    Drives a robot by feedforward control: velocities, exactly timed, and a stop at the end.

    Positive ``linear_x`` is forward [m/s], positive ``angular_z`` turns left [rad/s] (REP-103).
    Whatever ends the program (its end, a signal, an exception), the robot is stopped first.
    """

    def __init__(self, **node_options: Any) -> None:
        """
        Make the node; nothing is sent before the first movement.

        :param node_options: options of ``rclpy.node.Node``, such as ``namespace``
        :raises UsageError: if a parameter has a value, or something a name, that cannot work
        """
        use_udp_transport()
        make_log_nonblocking()
        with one_line_errors(NAME):
            super().__init__(NAME, **node_options)
        try:
            self._set_up()
        except BaseException:
            # Nobody else has it; its publisher would be taken for somebody who drives the robot.
            super().destroy_node()
            raise
        self.get_logger().info('Robot control node has started')

    def _set_up(self) -> None:
        self.profile = profile_of(declare_robot(self))
        self.settings = declare_parameters(self, self.profile)
        self.names = names = names_of(
            self.profile, self.settings.robot_namespace, self.settings.manual_control)
        check_node_names(self, names, TOPICS, SERVICES)
        message = VelocityMessage(
            self.profile.message_type, self.profile.frame,
            lambda: self.get_clock().now().to_msg())
        self.publisher = VelocityPublisher(self, names.velocity, message)
        self._showing = IntrospectionPublishers(self, self.publisher, self.profile)
        if self.settings.summary or self.settings.odometry_timeout:
            listen_to_odometry(self, names, self._on_odometry, self._showing.in_frame)
        self._session = Session(self, self.publisher, self.profile, names, self.settings)
        #: who is told what happens
        self.audience = EventBus()
        self.record = DriveLog()
        if self.settings.summary:
            self.audience.subscribe(self.record.on_event)
        self._showing.attach(self.audience, self._session.status_reader)
        self._session.gate.on_sent = self._on_sent
        self._session.gate.on_began = self._on_began
        # In a group of its own: its callback waits for the stop, and others go on meanwhile.
        self.create_service(
            Trigger, '~/stop', self._on_stop, qos_profile=SERVICE_QOS,
            callback_group=MutuallyExclusiveCallbackGroup())
        self._wake = self.create_guard_condition(lambda: None)
        self._leave_nothing_moving()

    def move_robot(self, linear_x: float, angular_z: float, duration: float) -> None:
        """
        Hold a velocity for a time, exactly, then send a zero; returns when that is done.

        The first movement waits for the robot and switches its manual control on.  The next one
        may follow at once; when none does, a whole stop is sent.

        :param linear_x: forward velocity [m/s], negative backwards
        :param angular_z: turning velocity [rad/s], positive to the left
        :param duration: how long [s]
        :raises InvalidMotionError: if a value is not finite or beyond the robot's limits;
            nothing has moved
        :raises RobotNotFoundError: if no robot listens; nothing has moved
        :raises ControlError: if the run could not go on; the robot was stopped
        """
        step = Move(linear_x, angular_z, duration)
        # The planner would name the step's place in a motion that nobody has seen.
        self.profile.limits.check(step.velocity)
        self._drive(Motion('move_robot', (step,)), None, self._session.request())
        self.get_logger().info('Robot has stopped')
        self.get_logger().info(
            f'Movement completed: Forward={linear_x}, Rotation={angular_z}, '
            f'Time={duration} seconds')

    def run(self, motion: Motion, limits: Limits | None = None) -> None:
        """
        Drive a motion, exactly timed; returns when its last zero was sent.

        The first drive waits for the robot and switches its manual control on.  The next one may
        follow at once; when none does, a whole stop is sent.

        :param motion: what to do
        :param limits: what to plan it with; None for what the robot can do
        :raises InvalidMotionError: if the robot cannot do it; nothing has moved
        :raises RobotNotFoundError: if no robot listens; nothing has moved
        :raises ControlError: if the run could not go on; the robot was stopped
        """
        self._run(motion, limits, self._session.request())

    def prepare(self, motion: Motion, limits: Limits | None = None) -> Callable[[], None]:
        """
        Accept a drive that another thread is to begin; a stop ends it from now on.

        May be called in a callback of the node, where a drive itself cannot run.

        :param motion: what to do
        :param limits: what to plan it with; None for what the robot can do
        :returns: what drives the motion, as ``run`` does; to be called once
        :raises ControlError: if a motion is running already, or nothing may move any more
        """
        request = self._session.request(elsewhere=True)
        return lambda: self._run(motion, limits, request)

    def _run(self, motion: Motion, limits: Limits | None, request: DriveRequest) -> None:
        driven = self._drive(motion, limits, request)
        self.get_logger().info('Robot has stopped')
        self.get_logger().info(
            f'Motion completed: {motion.name}, {len(driven.steps)} steps, '
            f'{driven.duration:.3f} seconds')

    def stop_robot(self) -> None:
        """
        Stop the robot, and end the movement that another thread is in, if one is.

        A robot that this node never met is left alone: even a zero would take it.  A movement
        that still waits for its robot is ended as well.

        :raises RunFaultError: if the stop could not be sent, or odometry still sees the robot move
        """
        if self._session.stop(MotionRefusedError('the movement was ended by stop_robot()')):
            self.get_logger().info('Robot has stopped')

    def serve_until_halted(self) -> None:
        """
        Serve callbacks in the background, and wait until nothing may move any more.

        :raises ControlError: why that is so
        """
        self._session.serve_until_halted()

    def introduce(self, title: str) -> None:
        """
        Tell the audience what begins now; the first event of all.

        :param title: what people call what is driven
        """
        self.audience.publish(
            session_started(self, title, self.profile, self.names, self.settings))

    def expect(self, brought: Callable[[], bytes | None]) -> None:
        """
        Meet no other robot than one that was brought along.

        :param brought: returns its DDS participant; None as long as it is not known
        """
        self._session.require_robot(brought)

    @property
    def is_heard(self) -> bool:
        """Whether somebody subscribes to the velocities of this node and of its guardian."""
        return self._session.has_subscriber

    @property
    def stop_confirmed_after(self) -> float | None:
        """
        Return how long after the last stop began odometry saw the robot still [s].

        None if it still moves, or nobody can tell.
        """
        return self._session.stop_confirmed_after

    def destroy_node(self) -> None:
        """Stop the robot, give it back, and destroy the node."""
        self._session.close()
        self._showing.close()
        signal_dispatcher.unregister(self)
        atexit.unregister(self._session.close)
        super().destroy_node()

    def on_signal(self, signum: int) -> None:
        """
        Stop at once and for good; called in a thread of its own.

        :param signum: the signal that asks the program to end
        """
        self._session.stop_permanently(
            MotionRefusedError(f'stopped by {signal.Signals(signum).name}'))

    def wake(self) -> None:
        """Make a main thread that spins return to Python, whose signal handlers run there."""
        self._wake.trigger()
        wake_main_thread()

    def uncaught(self, error: BaseException) -> None:
        """
        Stop, for the main thread ends by an exception; others may still be driving.

        :param error: what nobody caught
        """
        if isinstance(error, KeyboardInterrupt):
            self.get_logger().info('Program was interrupted')
        self._session.stop_permanently(MotionRefusedError(f'the program ended by {error!r}'))

    def _drive(self, motion: Motion, limits: Limits | None, request: DriveRequest) -> Plan:
        limits = limits or self.profile.limits
        with self._session.exclusive(request):
            planned = plan(motion, limits, self.settings.rate)
            self._showing.on_plan(planned)
            self.audience.publish(MotionPlanned(motion, limits, self.settings.rate))
            try:
                self._session.drive(planned, request)
            except BaseException as error:
                is_fault = not isinstance(error, (MotionRefusedError, KeyboardInterrupt))
                self.audience.publish(MotionEnded(time.monotonic(), _reason(error), is_fault))
                raise
            self.audience.publish(MotionEnded(time.monotonic()))
        return planned

    def _on_sent(self, now: float, velocity: Velocity) -> None:
        if self.audience:
            self.audience.publish(VelocitySent(now, velocity))

    def _on_began(self, now: float) -> None:
        self.audience.publish(MotionStarted(now))

    async def _on_stop(
            self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        del request
        stopped = Future()

        def stop() -> None:
            try:
                self.stop_robot()
                response.success = True
            except Exception as error:  # whoever asked must have an answer
                response.message = str(error)
            stopped.set_result(None)
            self._wake.trigger()

        # In a thread of its own: odometry is heard meanwhile, and tells whether the robot obeys.
        try:
            threading.Thread(target=stop, name='stop', daemon=True).start()
        except RuntimeError:  # no thread can start, as at Python's end from 3.12 on
            stop()
        await stopped
        return response

    def _on_odometry(self, now: float, pose: Pose, velocity: Velocity) -> None:
        self._session.odometry.on_odometry(now, velocity)
        if self.audience:
            self.audience.publish(OdometryReceived(now, pose, velocity))

    def _leave_nothing_moving(self) -> None:
        # rclpy's own handlers would shut the context down before anything could be published.
        rclpy.signals.uninstall_signal_handlers()
        if not signal_dispatcher.register(self):
            self.get_logger().warning(
                'Made outside the main thread, this node does not hear signals: make it in the '
                'main thread, or call stop_robot() on the way out')
        signal_dispatcher.reinstall()
        before_shutdown(self.context, self._session.close)
        # The last registered is the first called: the robot is given back before.
        atexit.unregister(_discard_if_stopped)
        atexit.register(_discard_if_stopped)
        atexit.register(self._session.close)


def _discard_if_stopped() -> None:
    if signal_dispatcher.signum is not None:
        discard_unread()


def _reason(error: BaseException) -> str:
    if signal_dispatcher.signum is not None:
        return f'stopped by {signal.Signals(signal_dispatcher.signum).name}'
    return str(error) or type(error).__name__


def play_lesson(robot_control: KachakaSimpleControl) -> None:
    """
    Play the lesson's movement sequence.

    :param robot_control: the node to play it with
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
    Play the lesson from the first line of a program to its last.

    :param arguments: what ROS is told; None for the arguments of the process
    :raises ControlError: if it could not be played; the robot was stopped
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
    Play the lesson; the command of the same name can do more.

    :param args: what ROS is told; None for the arguments of the process
    :returns: the exit code
    """
    return cli.exit_code(lambda: lesson(args))


if __name__ == '__main__':
    sys.exit(main())
