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
A node that drives robots, and stops them whatever ends the program.

Tested by test/ros/test_robot.py and test/ros/test_several_robots.py.
"""

from __future__ import annotations

import atexit
from collections.abc import Mapping
from dataclasses import replace
import signal
import sys
from typing import Any

from kachaka_simple_control.control.timing import DISCOVERY_TIMEOUT
from kachaka_simple_control.errors import (
    MotionRefusedError,
    MotionRunningError,
    MotionStoppedError,
    RunFaultError,
)
from kachaka_simple_control.files.robot_profile import ANY_TYPE
from kachaka_simple_control.process.closing import Closers
from kachaka_simple_control.process.output import discard_unread, make_log_nonblocking
from kachaka_simple_control.process.signals import signal_dispatcher
from kachaka_simple_control.ros.commander import Commander
from kachaka_simple_control.ros.drive_services import DriveServices
from kachaka_simple_control.ros.executors import before_shutdown, wake_main_thread
from kachaka_simple_control.ros.hub import Hub
from kachaka_simple_control.ros.introspection import IntrospectionPublishers
from kachaka_simple_control.ros.names import INTROSPECTION_TOPICS, of_robot
from kachaka_simple_control.ros.parameters import (
    declare_parameters,
    RobotSettings,
)
from kachaka_simple_control.ros.robot import Robot
from kachaka_simple_control.ros.startup import check_node_names, ensure_started, one_line_errors
from kachaka_simple_control.ros.velocity_publisher import taken_type
from kachaka_simple_control.text import escaped
from rclpy.node import Node
import rclpy.signals

#: The services of a robot, beside ``~/run``.
SERVICES = ('~/stop', '~/pause', '~/resume')

#: All nodes, so that their robots stop at the same time when the program ends.
_nodes = Closers()
# Called at import, because a script may fail before it creates a node.
signal_dispatcher.handle_uncaught()


class DriveNode(Node):
    """
    A node that drives robots; they are stopped before the program ends, however it ends.

    :ivar robots: by name
    :ivar event_bus: passes the events of each drive, such as sent velocities, to displays and logs
    :ivar commander: drives, stops, pauses and resumes; for internal use in this package
    :ivar drive_services: the services of this node; for internal use in this package
    """

    def __init__(
            self, node_name: str, robots: Mapping[str, Mapping[str, Any]],
            **node_options: Any) -> None:
        """
        Create the node, and call ``rclpy.init()`` if ROS is not initialized yet.

        No velocity is sent before the first movement.

        :param robots: defaults of the parameters of each robot, by its name, which prefixes its
            parameters, services and debug topics, and is its namespace if no parameter names one;
            a node with one robot may leave the name empty
        :raises UsageError: if the value of a parameter, or a ROS name, is invalid
        """
        warnings = ensure_started(node_options.get('context'))
        make_log_nonblocking()
        with one_line_errors(node_name):
            super().__init__(node_name, **node_options)
        for warning in warnings:
            self.get_logger().warning(warning)
        self._hub = hub = Hub(self)
        self.event_bus = hub.event_bus
        self.robots: dict[str, Robot] = {}
        made: list[Robot] = []
        # First: if a robot cannot be made, it releases those that were.
        self.commander = Commander(hub, made)
        try:
            self._set_up(robots, made)
        except BaseException:
            self.commander.close()
            self.event_bus.close()
            # A remaining publisher would be mistaken for another driving program.
            super().destroy_node()
            raise

    def _set_up(
            self, defaults: Mapping[str, Mapping[str, Any]], robots: list[Robot]) -> None:
        every = [declare_parameters(self, name, given) for name, given in defaults.items()]
        check_node_names(
            self, [settings.names for settings in every],
            *([of_robot(name, robot) for robot in defaults for name in names]
              for names in (INTROSPECTION_TOPICS, (*SERVICES, '~/run'))))
        for settings in every:
            robot = Robot(self._hub, self._with_type(settings))
            self.robots[robot.name] = robot
            robots.append(robot)
        self._introspection = IntrospectionPublishers(self, robots, self.event_bus)
        self._hub.start_reading([reader for robot in robots for reader in robot.readers])
        self.drive_services = DriveServices(self, self.commander, robots)
        self._signal_handler = _SignalHandler(self, self.commander)
        self._stop_on_every_exit()

    def _with_type(self, settings: RobotSettings) -> RobotSettings:
        """Choose the message type that the robot takes, if its profile leaves it open."""
        # Here, not at the first movement: guardian, recording and topics are made for one type.
        if settings.profile.message_type != ANY_TYPE:
            return settings
        topic = settings.names.velocity
        found = taken_type(
            self, topic, min(settings.parameters.robot_timeout, DISCOVERY_TIMEOUT))
        how = 'as its subscriber takes' if found else 'for nobody subscribes yet'
        self.get_logger().info(f'Sending {found or "Twist"} on {topic}, {how}')
        return replace(
            settings, profile=replace(settings.profile, message_type=found or 'Twist'))

    def log_start(self) -> None:
        """Log that the node is ready, and which robots are calibrated."""
        self.get_logger().info('Robot control node has started')
        for robot in self.robots.values():
            profile = robot.settings.profile
            for calibration, what in ((profile.calibration, 'Calibrated'),
                                      (profile.odometry_calibration, 'Odometry calibrated')):
                if calibration is not None:
                    self.get_logger().info(f'{what}: {escaped(calibration.describe())}')

    def destroy_node(self) -> None:
        """Stop the robots, release them for other programs, and destroy the node."""
        try:
            self._close()
        finally:
            self._introspection.close()
            signal_dispatcher.unregister(self._signal_handler)
            _nodes.remove(self.commander.close)
            self._allow_shutdown()
            atexit.unregister(self._close_at_exit)
            super().destroy_node()

    def _stop_on_every_exit(self) -> None:
        # rclpy's handlers would shut the context down before the stop could be published.
        rclpy.signals.uninstall_signal_handlers()
        if not signal_dispatcher.register(self._signal_handler):
            self.get_logger().warning(
                'Made outside the main thread, this node does not receive signals: make it in the '
                'main thread, or call stop_robot() on the way out')
        signal_dispatcher.reinstall()
        _nodes.add(self.commander.close, self.context)
        self._allow_shutdown = before_shutdown(self.context, self._release)
        # atexit calls in reverse order, so the robots are released first.
        atexit.unregister(_discard_if_stopped)
        atexit.register(_discard_if_stopped)
        atexit.register(self._close_at_exit)

    def _release(self) -> None:
        """Stop and release the robots of all nodes of this context, before it shuts down."""
        _nodes.close_all(self.context)
        self.commander.close()
        self.event_bus.flush()

    def _close_at_exit(self) -> None:
        """Stop and release the robots of all nodes, then close this node; called at exit."""
        _nodes.close_all()
        try:
            self._close()
        except RunFaultError as error:  # a traceback would be printed
            print(f'{self.get_name()}: {escaped(error)}', file=sys.stderr)

    def _close(self) -> None:
        """Stop and release the robots; may be called again."""
        self.commander.close()
        self.event_bus.close()


class _SignalHandler:
    """Stops the robots of a node when a signal or an exception ends the program."""

    def __init__(self, node: Node, commander: Commander) -> None:
        self._node, self._commander = node, commander
        self._guard_condition = node.create_guard_condition(lambda: None)

    def on_signal(self, signum: int) -> None:
        """Stop the robots at once, and refuse all later motions; called in a separate thread."""
        name = signal.Signals(signum).name
        self._commander.stop_permanently(MotionStoppedError(f'stopped by {name}'))

    def wake(self) -> None:
        """
        Wake the main thread if it waits in an executor of rclpy.

        Python runs its signal handlers only in the main thread, and only if that thread does not
        wait in C++ code.
        """
        self._guard_condition.trigger()
        wake_main_thread()

    def uncaught(self, error: BaseException) -> None:
        """
        Stop the robots after an uncaught exception: another thread may still drive them.

        But not after a ``MotionRunningError``: the motion of another thread goes on.
        """
        if isinstance(error, MotionRunningError):
            return
        if isinstance(error, KeyboardInterrupt):
            self._node.get_logger().info('Program was interrupted')
        self._commander.stop_permanently(
            MotionRefusedError(f'the program ended by {error!r}'))


def _discard_if_stopped() -> None:
    if signal_dispatcher.signum is not None:
        discard_unread()
