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
"""What the command does when a robot is to be driven; needs ROS."""

from __future__ import annotations

import contextlib

from kachaka_simple_control.command_line import Options
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.kachaka_simple_control import KachakaSimpleControl, play_lesson
from kachaka_simple_control.report.table import table
from kachaka_simple_control.ros.isolation import stay_on_this_machine
import rclpy
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions


def drive(options: Options) -> None:
    """
    Drive a robot as the command was asked to.

    :param options: what was asked
    :raises ControlError: if it could not be done; the robot was stopped
    """
    # Started last, a simulated robot ends last: after it was stopped and given back.
    with contextlib.ExitStack() as helpers:
        if options.sim:
            stay_on_this_machine()
        start_ros(options.ros_arguments)
        robot_control = KachakaSimpleControl(parameter_overrides=[
            Parameter(name, value=value) for name, value in options.parameters.items()])
        try:
            if options.sim:
                from kachaka_simple_control.robot.simulation import simulation
                helpers.enter_context(simulation(robot_control.settings.robot_namespace))
            play_lesson(robot_control)
        except KeyboardInterrupt:
            robot_control.get_logger().info('Program was interrupted')
        finally:
            robot_control.stop_robot()
            still_after = robot_control.stop_confirmed_after
            robot_control.destroy_node()
            rclpy.try_shutdown()
    if options.sim:
        print(table(robot_control.record, still_after))


def start_ros(arguments: list[str]) -> None:
    """
    Initialise ROS, without the signal handlers of its own.

    :param arguments: what ROS is told, from ``--ros-args`` on
    :raises UsageError: if ROS does not understand it
    """
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        raise UsageError(str(error).splitlines()[0]) from None
