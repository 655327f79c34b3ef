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
"""Drive a fleet as the options request.  Tested by test/commands/test_kachaka_fleet.py."""

from __future__ import annotations

import contextlib
import sys
from typing import TYPE_CHECKING

from kachaka_simple_control.commands.drive import Keys, reports_to_stdout, wait_for_requests
from kachaka_simple_control.commands.fleet_options import FleetOptions, NAME
from kachaka_simple_control.control.events import FleetMember, FleetStarted, OVERVIEW
from kachaka_simple_control.control.timing import SHUTDOWN_TIMEOUT
from kachaka_simple_control.display import terminal
from kachaka_simple_control.errors import RunFaultError
from kachaka_simple_control.files.floor_file import find_floor
from kachaka_simple_control.fleet.fleet import Fleet
from kachaka_simple_control.fleet.fleet_plan import FleetPlan
from kachaka_simple_control.fleet.start_time import start_time
from kachaka_simple_control.process.output import make_nonblocking, STDERR, STDOUT
from kachaka_simple_control.process.processes import ended_after
from kachaka_simple_control.report import output_file
from kachaka_simple_control.ros.dds_transport import use_localhost_only, use_udp_transport
from kachaka_simple_control.ros.environment import leave_discovery_server
from kachaka_simple_control.ros.parameter_files import without_effect
from kachaka_simple_control.ros.parameters import session_started
from kachaka_simple_control.ros.startup import start_ros
from kachaka_simple_control.telemetry import subscriber_process
import rclpy

if TYPE_CHECKING:
    from kachaka_simple_control.commands.fleet_remote import FleetRemote
    from kachaka_simple_control.commands.remote_reports import ReportWriter
    from kachaka_simple_control.motion.floor import Floor

STDIN = 0


def drive(options: FleetOptions, plan: FleetPlan) -> None:
    """
    Drive the robots of a fleet; with ``--wait`` or ``--pipe`` at each request.

    :raises ControlError: if a robot could not be driven; the robots were stopped
    :raises FloorFileError: if the floor of the simulated robots cannot be read
    """
    reports = reports_to_stdout() if options.pipe else None
    make_nonblocking(STDOUT, STDERR)
    # Its errors, before a robot is started.
    floor = None if options.floor_file is None else find_floor(options.floor_file).floor
    with contextlib.ExitStack() as stack:
        if options.report is not None:
            stack.enter_context(output_file.prepare_report_dir(options.report))
        start = None if options.start_at is None else start_time(options.start_at)
        if options.sim:
            if text := leave_discovery_server():
                print(f'{NAME}: {text}', file=sys.stderr)
            use_localhost_only()
        use_udp_transport()
        start_ros(options.ros_arguments)
        fleet = Fleet(plan)
        node, commander, logger = fleet.node, fleet.node.commander, fleet.logger
        subscribers = subscriber_process.SubscriberProcesses(node.event_bus)
        stack.enter_context(subscribers)
        remote = _remote_control(stack, fleet, reports)
        if reports is not None:
            reports.floor = floor
        try:
            reporter = subscribers.required = _start_subscribers(subscribers, options, fleet)
            for line in without_effect(options.ros_arguments, node.get_fully_qualified_name()):
                logger.warning(line)
            is_shown = not (options.quiet or options.pipe) and terminal.is_terminal(STDERR)
            keys: Keys = {' ': commander.pause, 'r': commander.resume_when_confirmed} if (
                is_shown) else {}
            _publish_start(fleet, options, bool(keys) and terminal.is_keyboard(), floor)
            if options.sim:
                fleet.simulate(stack, options.floor_file)
            else:
                logger.info(
                    'Each robot is trusted to stand where the fleet says it starts')
            _run(fleet, options, keys, remote, start)
        except KeyboardInterrupt:
            logger.info('Program was interrupted')
        finally:
            try:
                commander.stop('the end of the program')
                logger.info('The robots have stopped')
            finally:
                stops = 2.0 * max(robot.profile.command_timeout for robot in plan.robots)
                with ended_after(SHUTDOWN_TIMEOUT + stops):
                    fleet.close()
                    rclpy.try_shutdown()
    if reporter is not None and (reporter.exit_code or reporter.failure is not None):
        reason = '' if reporter.failure is None else f': {reporter.failure}'
        raise RunFaultError(f'the report in {options.report} is incomplete{reason}')


def _start_subscribers(
        subscribers: subscriber_process.SubscriberProcesses, options: FleetOptions,
        fleet: Fleet) -> subscriber_process.SubscriberProcess | None:
    """Start display and report, if the options request them; return that of the report."""
    if not (options.quiet or options.pipe):
        subscribers.add(terminal.DisplayProcess(), OVERVIEW)
    if options.report is None:
        return None
    for missing in output_file.missing_libraries():
        print(f'report: {missing}', file=sys.stderr)
    # Where to see that the guardian has stopped a robot, in the order of ``FleetStarted``.
    shared = [memory for robot in fleet.node.robots.values()
              if (memory := robot.guardian.shared_memory) is not None]
    return subscribers.start(
        output_file.REPORT_MODULE, options.report, *(str(shared[0][0]) for _ in shared[:1]),
        *(str(slot) for _, slot in shared), pass_fds=[file for file, _ in shared[:1]])


def _publish_start(
        fleet: Fleet, options: FleetOptions, has_keys: bool, floor: Floor | None) -> None:
    """Publish the first events: what the fleet is, and each robot of it."""
    plan, node = fleet.plan, fleet.node
    node.event_bus.publish(FleetStarted(
        plan.file.name, tuple(
            FleetMember(
                robot.name, robot.fleet_robot.start, robot.fleet_robot.motion_file.title)
            for robot in plan.robots),
        plan.file.repeat, plan.file.goes_on, plan.file.source, plan.file.text,
        tuple(near.text for near in plan.nearest)))
    for robot in plan.robots:
        driven = node.robots[robot.name]
        driven.publish(session_started(
            node, robot.order.motion.name, driven.settings, robot.fleet_robot.motion_file,
            command=options.command, has_keys=has_keys, movement_count=plan.file.repeat,
            floor=floor))


def _remote_control(
        stack: contextlib.ExitStack, fleet: Fleet,
        reports: ReportWriter | None) -> FleetRemote | None:
    """Return what drives as standard input says; its last report follows the robots' release."""
    if reports is None:
        return None
    from kachaka_simple_control.commands.fleet_remote import FleetRemote
    remote = FleetRemote(fleet, STDIN, reports)
    stack.callback(remote.finish)
    return remote


def _run(
        fleet: Fleet, options: FleetOptions, keys: Keys, remote: FleetRemote | None,
        start: float | None) -> None:
    if remote is not None:
        remote.serve()
    elif options.wait:
        wait_for_requests(fleet.node, fleet.drive, keys)
    else:
        with terminal.Keyboard(keys, fleet.logger.warning):
            fleet.run(start)
