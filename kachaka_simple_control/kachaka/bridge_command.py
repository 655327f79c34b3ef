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
The command ``kachaka_bridge``, which connects a real or simulated Kachaka to ROS 2.

Topics and service have the names of the manufacturer's own bridge.

Tested by test/kachaka/test_bridge_node.py.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
import contextlib
from functools import partial
import sys
import time
from typing import TYPE_CHECKING

from kachaka_simple_control.control.timing import MAX_RATE, SHUTDOWN_TIMEOUT
from kachaka_simple_control.errors import RobotNotFoundError, RobotTakenError
from kachaka_simple_control.files.floor_file import FloorFileError
from kachaka_simple_control.kachaka.bridge_process import PARTICIPANT
from kachaka_simple_control.kachaka.program import (
    add_floor_option,
    add_parent_option,
    add_simulation_options,
    address_argument,
    ExitError,
    find_option_floor,
    FLOOR,
    number_argument,
    option_of,
    PORT,
    run_until_shutdown,
    SDK_MISSING,
    SIMULATION_NAMES,
    simulation_parameters,
)
from kachaka_simple_control.kachaka.simulator.drive_model import (
    ODOMETRY_PERIOD,
    SimulationParameters,
)
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka, USUAL_LASER
from kachaka_simple_control.process.exit_codes import BAD_USAGE, FAULTED, NO_ROBOT, OneLineParser
from kachaka_simple_control.process.output import make_log_nonblocking
from kachaka_simple_control.process.processes import ended_after
from kachaka_simple_control.process.signals import ShutdownEvent
from kachaka_simple_control.ros.dds_transport import use_udp_transport
from kachaka_simple_control.ros.environment import require_middleware
from kachaka_simple_control.ros.names import MAX_NAMESPACE_LENGTH, require_namespace

if TYPE_CHECKING:
    from kachaka_simple_control.kachaka.bridge_node import BridgedRobot, BridgeNode

PROGRAM = 'kachaka_bridge'
#: How often a simulated robot publishes odometry, unless ``--odometry-rate`` says [Hz].
ODOMETRY_RATE = 1.0 / ODOMETRY_PERIOD


class _Fault:
    """
    Ends the bridge after a fault: an aborted motion, or another bridge with the same names.

    ``text`` describes the first fault; empty without one.
    """

    def __init__(self, shutdown: ShutdownEvent) -> None:
        self._shutdown = shutdown
        self.text = ''

    def give_up(self, text: str) -> None:
        self.text = self.text or text
        self._shutdown.end()

    def on_conflict(self, robot: str, holder: str) -> None:
        names = f'the names of {robot}' if robot else 'the same names'
        self.give_up(f'another bridge shows a robot under {names}: {holder}; both end')


def main(args: Sequence[str] | None = None) -> int:
    """Run the bridge until a signal or a fault ends it."""
    make_log_nonblocking()
    return run_until_shutdown(
        PROGRAM, lambda shutdown: _run([*(sys.argv[1:] if args is None else args)], shutdown))


def _run(args: list[str], shutdown: ShutdownEvent) -> None:
    fault = _Fault(shutdown)
    try:
        require_middleware()
        from kachaka_simple_control.ros.startup import start_ros, strip_ros_arguments
        import rclpy
        options, parameters = _parse(strip_ros_arguments(args))
        # Robots of a fleet have their names before their topics.
        namespace = '/' if options.robots is not None else '/' + (
            'kachaka' if options.namespace is None else options.namespace).strip('/')
        require_namespace(namespace, '--namespace', MAX_NAMESPACE_LENGTH)
        robots = _simulated(options, parameters) if options.sim else _real(options, fault)
        use_udp_transport()
        start_ros(args)
        from kachaka_simple_control.kachaka.bridge_node import BridgeNode
        node = BridgeNode(
            namespace, robots, 1.0 / options.odometry_rate if options.sim else None,
            fault.on_conflict)
    except ImportError as error:
        raise ExitError(FAULTED, f'ROS 2 is missing here ({error})') from None
    except RobotTakenError as error:
        raise ExitError(NO_ROBOT, f'{error}; {_advice(options)}') from None
    except RobotNotFoundError as error:
        raise ExitError(NO_ROBOT, error) from None
    except FloorFileError:
        raise
    except (RuntimeError, UnicodeError) as error:
        raise ExitError(BAD_USAGE, error) from None
    try:
        _serve(node, shutdown, options.with_parent)
    finally:
        with ended_after(SHUTDOWN_TIMEOUT):
            node.close()
            node.destroy_node()
            rclpy.try_shutdown()
    if fault.text:
        raise ExitError(FAULTED, fault.text)


def _advice(options: argparse.Namespace) -> str:
    """Return what a user can do if another bridge already uses the same ROS names."""
    if not options.with_parent:
        other = 'another name in --robots' if options.robots is not None else 'another --namespace'
        return f'stop it, or choose {other}'
    mine = '--address' if options.address else '--sim (in a script, sim=True)'
    return f'to drive that one, leave out {mine}; or stop it'


def _simulated(
        options: argparse.Namespace,
        parameters: SimulationParameters) -> Mapping[str, Callable[..., BridgedRobot]]:
    """
    Return what makes each simulated robot, by its name; empty for the only one.

    :raises FleetFileError: if the file of ``--robots`` cannot be used
    :raises FloorFileError: if that of ``--floor`` cannot be used
    """
    from kachaka_simple_control.kachaka.simulated_robot import SimulatedRobot
    now, seed, file = time.monotonic(), options.seed or 0, find_option_floor(options)
    floor, laser = (None, USUAL_LASER) if file is None else (file.floor, file.laser)
    if options.robots is None:
        robot = SimulatedKachaka(now, parameters, bool(options.docked), seed, floor, laser)
        return {'': partial(
            SimulatedRobot, robot=robot, frame_prefix=options.frame_prefix or '')}
    from kachaka_simple_control.files.fleet_file import find_fleet
    from kachaka_simple_control.kachaka.simulated_fleet import simulated_robots
    robots = simulated_robots(find_fleet(options.robots))
    return {
        name: partial(
            SimulatedRobot, robot=SimulatedKachaka(
                now, errors, seed=seed + index, floor=floor, laser=laser, place=start),
            start=start, frame_prefix=f'{name}/' if len(robots) > 1 else '')
        for index, (name, (start, errors)) in enumerate(robots.items())}


def _real(
        options: argparse.Namespace, fault: _Fault) -> Mapping[str, Callable[..., BridgedRobot]]:
    """
    Connect the real robot, and return what makes it on a node.

    :raises ExitError: if its SDK is not installed
    :raises RobotNotFoundError: if it does not respond
    """
    try:
        from kachaka_simple_control.kachaka.grpc_client.client import connect
    except (ImportError, RuntimeError) as error:  # RuntimeError: the SDK needs a newer gRPC
        raise ExitError(FAULTED, SDK_MISSING.format(error=error)) from None
    from kachaka_simple_control.kachaka.grpc_client.bridge import GrpcRobot
    return {'': partial(
        GrpcRobot, robot=connect(options.address), frame_prefix=options.frame_prefix or '',
        give_up=fault.give_up if options.give_up else lambda _: None)}


def _parse(args: list[str]) -> tuple[argparse.Namespace, SimulationParameters]:
    parser = OneLineParser(
        prog=PROGRAM, allow_abbrev=False,
        description="Show a robot to ROS 2 under the names of Kachaka's official bridge.",
        epilog='ROS arguments follow after --ros-args.')
    parser.takes_ros_arguments = True
    add = parser.add_argument
    add('--sim', action='store_true', help='show a simulated robot')
    add('--robots', metavar='FILE',
        help='with --sim: show the robots of a fleet, each under its name, with the start and the '
        'errors that its file says')
    add('--address', type=address_argument, metavar='HOST',
        help=f'show the real robot at this address, HOST or HOST:PORT (default: {PORT})')
    add('--namespace', help='of all its names (default: kachaka)')
    add('--frame-prefix', metavar='PREFIX', help='put before the names of frames')
    add('--odometry-rate', type=number_argument('Hz'), metavar='HZ',
        help=f'how often a simulated robot publishes odometry (default: {ODOMETRY_RATE:g} Hz)')
    add('--give-up', action='store_true',
        help='end with code 1 when a real robot refuses to move, or is lost while it moves')
    add_simulation_options(parser, 'the simulated robot')
    add_floor_option(parser, 'a simulated robot')
    add_parent_option(parser)
    options = parser.parse_args(args)
    if not options.sim and options.address is None:
        parser.error('which robot? --sim shows a simulated one, --address HOST a real one')
    if options.sim and options.address is not None:
        parser.error('one robot at a time: --sim or --address')
    _require_fitting(parser, options)
    return options, simulation_parameters(parser, options)


def _require_fitting(parser: OneLineParser, options: argparse.Namespace) -> None:
    """End the program, with a message, if an option does not fit the robots; fill the rate in."""
    for name in ('robots', 'odometry_rate'):
        if not options.sim and getattr(options, name) is not None:
            parser.error(f'{option_of(name)} is for simulated robots: it needs --sim')
    if not options.sim and getattr(options, FLOOR) is not None:
        parser.error('--floor is for simulated robots: it needs --sim')
    for name in ('namespace', 'frame_prefix', *SIMULATION_NAMES):
        if options.robots is not None and name != 'seed' and getattr(options, name) is not None:
            parser.error(
                f'{option_of(name)} is for one robot; what the robots of --robots have is in '
                'their file')
    if options.odometry_rate is None:
        options.odometry_rate = ODOMETRY_RATE
    if not 0.0 < options.odometry_rate <= MAX_RATE:
        parser.error(f'--odometry-rate is {options.odometry_rate:g} Hz; it must be above 0 Hz, '
                     f'and {MAX_RATE:g} Hz at most')


def _serve(node: BridgeNode, shutdown: ShutdownEvent, with_parent: bool) -> None:
    if shutdown.is_set:
        return
    if with_parent:
        print(f'{PARTICIPANT}{node.graph.participant.hex()}', file=sys.stderr, flush=True)
    # Each executor runs in its own thread.  The main thread sleeps until a signal is received, so
    # it does not slow the executors down.
    from kachaka_simple_control.ros.executors import running
    with contextlib.ExitStack() as stack:
        for executor in node.executors():
            stack.enter_context(running(executor, shutdown.end))
        node.get_logger().info(f'ready: {node.summary}')
        shutdown.wait(with_parent)


if __name__ == '__main__':
    sys.exit(main())
