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
"""Drive a robot as the options of ``kachaka_simple_control`` request; this module needs ROS."""

from __future__ import annotations

from collections.abc import Callable
import contextlib
from functools import partial
import os
import signal
import sys
import time
from typing import TYPE_CHECKING

from kachaka_simple_control.commands.cli import NAME, Options
from kachaka_simple_control.commands.settings import (
    choose_settings,
    chosen_speed,
    describe_overrides,
    in_file,
    order_of,
)
from kachaka_simple_control.control.events import SpeedFactorChanged
from kachaka_simple_control.control.timing import SHUTDOWN_TIMEOUT
from kachaka_simple_control.display import terminal
from kachaka_simple_control.errors import RunFaultError, UsageError
from kachaka_simple_control.files.floor_file import find_floor
from kachaka_simple_control.files.library import find, lesson_motion
from kachaka_simple_control.kachaka_simple_control import KachakaSimpleControl, play_lesson
from kachaka_simple_control.process.output import make_nonblocking, print_result, STDERR, STDOUT
from kachaka_simple_control.process.processes import ended_after
from kachaka_simple_control.report import output_file
from kachaka_simple_control.report.text_tables import drive_table, terminal_columns
from kachaka_simple_control.ros.dds_transport import use_localhost_only, use_udp_transport
from kachaka_simple_control.ros.environment import leave_discovery_server
from kachaka_simple_control.ros.parameter_files import without_effect
from kachaka_simple_control.ros.parameters import session_started
from kachaka_simple_control.ros.startup import start_ros
from kachaka_simple_control.telemetry import subscriber_process
import rclpy
from rclpy.parameter import Parameter

if TYPE_CHECKING:
    from kachaka_simple_control.analysis.drive_log import DriveLog
    from kachaka_simple_control.commands.remote_control import RemoteControl
    from kachaka_simple_control.commands.remote_reports import ReportWriter
    from kachaka_simple_control.control.drive_requests import DriveRequest
    from kachaka_simple_control.files.motion_file import MotionFile
    from kachaka_simple_control.motion.drive_order import DriveOrder
    from kachaka_simple_control.motion.floor import Floor
    from kachaka_simple_control.ros.drive_node import DriveNode

#: The function that each key calls, by the character of the key.
Keys = dict[str, Callable[[], object]]
STDIN = 0
#: How much one key press changes the speed factor.
KEY_STEP = 0.1


def drive(options: Options) -> DriveLog:
    """
    Drive a motion as the options request, with ``--wait`` at each request; return the record.

    :returns: empty if the drive was not recorded
    :raises ControlError: if the drive could not be completed; the robot was stopped
    :raises InvalidMotionError: if the robot cannot drive the motion; the robot has not moved
    :raises FloorFileError: if the floor of the simulated robot cannot be read
    """
    reports = reports_to_stdout() if options.pipe else None
    make_nonblocking(STDOUT, STDERR)
    motion_file = _motion_file(options)
    # Its errors, before the robot is started.
    floor = None if options.floor_file is None else find_floor(options.floor_file).floor
    # The stack closes a bridge last, after the robot is stopped and released.
    with contextlib.ExitStack() as stack:
        if options.report is not None:
            stack.enter_context(output_file.prepare_report_dir(options.report))
        if options.starts_bridge:
            if text := leave_discovery_server():
                print(f'{NAME}: {text}', file=sys.stderr)
            use_localhost_only()
        use_udp_transport()
        start_ros(options.ros_arguments)
        robot_control = KachakaSimpleControl(
            in_file(motion_file), parameter_overrides=_parameters(options))
        subscribers = subscriber_process.SubscriberProcesses(robot_control.event_bus)
        if options.prints_table:
            # Printed when the bridge has ended and the report is written, also after a fault.
            stack.callback(_print_table, robot_control, subscribers)
        stack.enter_context(subscribers)
        remote = _remote_control(stack, robot_control, reports, options, floor)
        try:
            reporter = subscribers.required = _start_subscribers(
                subscribers, options, motion_file is None,
                robot_control.robot.guardian.shared_memory)
            is_shown = not options.is_quiet and terminal.is_terminal(STDERR)
            keys = _keys(robot_control) if is_shown else {}
            _log_settings(robot_control, options, motion_file)
            stack.enter_context(_console(robot_control, options, motion_file, floor))
            order = None if motion_file is None else order_of(
                options, motion_file, robot_control.node_parameters, robot_control.profile)
            robot_control.event_bus.publish(session_started(
                robot_control, _title(options, motion_file),
                robot_control.robot.settings, motion_file, command=options.command,
                has_keys=bool(keys) and terminal.is_keyboard(),
                movement_count=_count_movements() if motion_file is None else None,
                floor=floor))
            if factors := robot_control.speed.factors:
                robot_control.event_bus.publish(
                    SpeedFactorChanged(time.monotonic(), dict(factors)))
            if options.starts_bridge:
                _start_bridge(stack, options, robot_control)
            _run(robot_control, order, options.wait, keys, remote)
        except KeyboardInterrupt:
            robot_control.get_logger().info('Program was interrupted')
        finally:
            try:
                robot_control.stop_robot()
            finally:
                subscribers.stop_confirmed_after = robot_control.stop_confirmed_after
                # If the stop above failed, the node and its guardian send one more each.
                stops = 2.0 * robot_control.profile.command_timeout
                with ended_after(SHUTDOWN_TIMEOUT + stops):
                    robot_control.destroy_node()
                    rclpy.try_shutdown()
    if reporter is not None and (reporter.exit_code or reporter.failure is not None):
        # Without a reason here, the process itself has printed one.
        reason = '' if reporter.failure is None else f': {reporter.failure}'
        raise RunFaultError(f'the report in {options.report} is incomplete{reason}')
    return robot_control.drive_log


def _log_settings(
        robot_control: KachakaSimpleControl, options: Options,
        motion_file: MotionFile | None) -> None:
    """Log which settings have no effect, or win over those of the motion's file."""
    logger = robot_control.get_logger()
    for line in without_effect(options.ros_arguments, robot_control.get_fully_qualified_name()):
        logger.warning(line)
    for line in describe_overrides(options, motion_file, robot_control.node_parameters):
        logger.info(line)


def _print_table(
        robot_control: KachakaSimpleControl,
        subscribers: subscriber_process.SubscriberProcesses) -> None:
    """
    Print what was requested, sent and driven; print nothing if no step was started.

    :raises RunFaultError: if the table cannot be printed
    """
    log = robot_control.drive_log
    if log.steps:
        print_result(drive_table(
            log, subscribers.stop_confirmed_after, terminal_columns()), 'the table')


def reports_to_stdout() -> ReportWriter:
    """
    Return an object that writes reports to standard output.

    Everything else that this process writes there goes to standard error from now on.
    """
    # Imported here, because a drive without the console needs nothing of it.
    from kachaka_simple_control.commands.remote_reports import ReportWriter
    file = os.dup(STDOUT)
    os.dup2(STDERR, STDOUT)
    return ReportWriter(file)


def _remote_control(
        stack: contextlib.ExitStack, robot_control: KachakaSimpleControl,
        reports: ReportWriter | None, options: Options,
        floor: Floor | None) -> RemoteControl | None:
    """Return an object that drives as lines on standard input command; None without reports."""
    if reports is None:
        return None
    reports.floor = floor
    from kachaka_simple_control.commands.remote_control import RemoteControl
    remote = RemoteControl(robot_control, STDIN, reports, partial(choose_settings, options))
    stack.callback(remote.finish)
    return remote


def _console(
        robot_control: KachakaSimpleControl, options: Options,
        motion_file: MotionFile | None,
        floor: Floor | None) -> contextlib.AbstractContextManager[object]:
    """Return a context manager for the page beside the drive, if the options request one."""
    if not options.console:
        return contextlib.nullcontext()
    from kachaka_simple_control.commands.console_beside import ConsoleBeside
    return ConsoleBeside(robot_control, options.robot, motion_file, floor)


def _start_subscribers(
        subscribers: subscriber_process.SubscriberProcesses, options: Options, is_lesson: bool,
        guardian_memory: tuple[int, int] | None) -> subscriber_process.SubscriberProcess | None:
    """
    Start the processes that display a drive and write its report, if the options request them.

    :param guardian_memory: where to see that the guardian has stopped the robot; None without one
    :returns: the process that writes the report; None without a report
    """
    # A lesson without a terminal needs no display, because the node logs each of its movements.
    if not options.is_quiet and (not is_lesson or terminal.is_terminal(STDERR)):
        subscribers.add(terminal.DisplayProcess())
    if options.report is not None:
        for missing in output_file.missing_libraries():
            print(f'report: {missing}', file=sys.stderr)
        shared = guardian_memory or ()
        return subscribers.start(
            output_file.REPORT_MODULE, options.report, *map(str, shared), pass_fds=shared[:1])
    return None


def _start_bridge(
        stack: contextlib.ExitStack, options: Options,
        robot_control: KachakaSimpleControl) -> None:
    """
    Start the bridge of a robot; from now on the node drives only the robot of this bridge.

    It ends when the stack is closed.
    """
    from kachaka_simple_control.kachaka.bridge_process import real_bridge, simulated_bridge
    namespace = robot_control.node_parameters.robot_namespace
    bridge = stack.enter_context(
        simulated_bridge(namespace, options.simulation) if options.address is None
        else real_bridge(options.address, namespace))
    robot_control.robot.discovery.require_participant(bridge.require_participant)


def _motion_file(options: Options) -> MotionFile | None:
    """
    Read the motion that the options name, and check that the robot can drive it.

    :returns: the lesson if none is named, with ``--wait``; without it None: the lesson's Python
        function is called
    :raises UsageError: if two options contradict each other
    :raises InvalidMotionError: if the motion is not found, or the robot cannot drive it
    """
    motion_file = None
    if options.motions or options.wait:
        motion_file = find(
            options.motions[0] if options.motions else 'lesson', **dict(options.values))
    settings = choose_settings(options, motion_file)
    profile = settings.profile
    if options.starts_bridge and not profile.is_kachaka:
        raise UsageError(
            f'--sim and --address start a kachaka, not a {profile.name}: leave out that '
            'option, or --robot')
    if motion_file is not None:
        order_of(options, motion_file, settings, profile)
    elif options.corners is not None or settings.corners:
        raise UsageError(
            'corners are for motions: the lesson calls move_robot(), which ends each movement '
            'with a stop; leave them out, or name a motion')
    elif settings.closed_loop:
        raise UsageError(
            'a closed loop is for motions: the lesson calls move_robot(), which odometry '
            'never corrects; `lesson --closed-loop` drives its movements as a motion')
    return motion_file


def _title(options: Options, motion_file: MotionFile | None) -> str:
    """Return the name of the drive, for reports."""
    if options.pipe:
        return 'remote control'
    return 'lesson' if motion_file is None else motion_file.motion.name


def _count_movements() -> int | None:
    """Return the number of movements in the lesson; None if it takes a robot to count them."""
    try:
        return len(lesson_motion().steps)
    except Exception:  # an edited lesson may call methods that only a node has
        return None


def _parameters(options: Options) -> list[Parameter]:
    # The table and the report need the odometry that the parameter ``summary`` records.
    summary = options.starts_bridge or options.calibrates or options.report is not None or None
    # A calibration needs its rests, whatever a parameter file says.
    corners = 0.0 if options.calibrates else options.corners
    values = {'robot': options.robot, 'rate': options.rate, 'summary': summary,
              'closed_loop': options.closed_loop, 'watch': options.watch, 'corners': corners,
              'within': options.within, 'speed_factor': chosen_speed(options)}
    return [Parameter(name, value=value) for name, value in values.items() if value is not None]


def _run(
        robot_control: KachakaSimpleControl, order: DriveOrder | None, wait: bool,
        keys: Keys, remote: RemoteControl | None) -> None:
    if remote is not None:
        remote.serve()
        return
    if order is None:
        with terminal.Keyboard(keys, robot_control.get_logger().warning):
            play_lesson(robot_control)
    elif wait:
        wait_for_requests(robot_control, partial(robot_control.drive, order), keys)
    else:
        with terminal.Keyboard(keys, robot_control.get_logger().warning):
            robot_control.drive(order)


def wait_for_requests(
        node: DriveNode, drive: Callable[[DriveRequest], object], keys: Keys) -> None:
    """Call a function that drives at each ``~/run`` and each Enter, until a stop for good."""
    name = node.drive_services.serve('~/run', partial(node.drive_services.start, drive))
    how = f'`ros2 service call {name} std_srvs/srv/Trigger` starts the motion'
    start = {'\n': partial(node.commander.start, drive)}
    with terminal.Keyboard({**keys, **start}, node.get_logger().warning):
        # Logged after the keyboard has started, because earlier keys are ignored.
        if terminal.is_keyboard():
            how = f'Enter starts the motion, Ctrl+C ends this program; {how}, too'
        node.get_logger().info(f'Standing by: {how}')
        node.commander.serve_until_stopped()


def _keys(robot_control: KachakaSimpleControl) -> Keys:
    """Return a function for each key that controls the robot while it drives."""
    commander = robot_control.commander
    faster = partial(commander.change_speed, KEY_STEP)
    return {
        ' ': commander.pause, 'r': commander.resume_when_confirmed,
        '-': partial(commander.change_speed, -KEY_STEP), '+': faster, '=': faster,
        # The same as Ctrl+C.
        'q': lambda: os.kill(os.getpid(), signal.SIGINT),
    }
