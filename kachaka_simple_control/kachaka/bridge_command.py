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
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
import contextlib
from functools import partial
import sys
import time
from typing import TYPE_CHECKING

from kachaka_simple_control.control.timing import SHUTDOWN_TIMEOUT
from kachaka_simple_control.errors import RobotNotFoundError, RobotTakenError
from kachaka_simple_control.kachaka.bridge_process import PARTICIPANT
from kachaka_simple_control.kachaka.program import (
    add_parent_option,
    add_simulation_options,
    address_argument,
    ExitError,
    PORT,
    run_until_shutdown,
    SDK_MISSING,
    simulation_parameters,
)
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
from kachaka_simple_control.process.exit_codes import BAD_USAGE, FAULTED, NO_ROBOT, OneLineParser
from kachaka_simple_control.process.output import make_log_nonblocking
from kachaka_simple_control.process.processes import ended_after
from kachaka_simple_control.process.signals import ShutdownEvent
from kachaka_simple_control.ros.dds_transport import use_udp_transport
from kachaka_simple_control.ros.environment import require_middleware
from kachaka_simple_control.ros.names import MAX_NAMESPACE_LENGTH, require_namespace

if TYPE_CHECKING:
    from kachaka_simple_control.kachaka.bridge_node import BridgeNode
    from kachaka_simple_control.ros.executors import ExecutorLoop

PROGRAM = 'kachaka_bridge'


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

    def on_conflict(self, holder: str) -> None:
        self.give_up(f'another bridge shows a robot under the same names: {holder}; both end')


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
        namespace = '/' + options.namespace.strip('/')
        require_namespace(namespace, '--namespace', MAX_NAMESPACE_LENGTH)
        make_node = _bridge(options, parameters, fault)
        use_udp_transport()
        start_ros(args)
        node = make_node(
            namespace=namespace, frame_prefix=options.frame_prefix, on_conflict=fault.on_conflict)
    except ImportError as error:
        raise ExitError(FAULTED, f'ROS 2 is missing here ({error})') from None
    except RobotTakenError as error:
        raise ExitError(NO_ROBOT, f'{error}; {_advice(options)}') from None
    except RobotNotFoundError as error:
        raise ExitError(NO_ROBOT, error) from None
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
        return 'stop it, or choose another --namespace'
    mine = '--address' if options.address else '--sim (in a script, sim=True)'
    return f'to drive that one, leave out {mine}; or stop it'


def _bridge(
        options: argparse.Namespace, parameters: SimulationParameters,
        fault: _Fault) -> Callable[..., BridgeNode]:
    """
    Return a function that creates the ROS node of the bridge; a real robot is connected before.

    :raises ExitError: if the SDK of the real robot is not installed
    :raises RobotNotFoundError: if the real robot does not respond
    """
    if options.sim:
        from kachaka_simple_control.kachaka.bridge_node import SimulatedBridge
        return partial(SimulatedBridge, SimulatedKachaka(
            time.monotonic(), parameters, bool(options.docked), options.seed or 0))
    try:
        from kachaka_simple_control.kachaka.grpc_client.client import connect
    except (ImportError, RuntimeError) as error:  # RuntimeError: the SDK needs a newer gRPC
        raise ExitError(FAULTED, SDK_MISSING.format(error=error)) from None
    from kachaka_simple_control.kachaka.grpc_client.bridge import GrpcBridge
    give_up = fault.give_up if options.give_up else lambda _: None
    return partial(GrpcBridge, connect(options.address), give_up=give_up)


def _parse(args: list[str]) -> tuple[argparse.Namespace, SimulationParameters]:
    parser = OneLineParser(
        prog=PROGRAM, allow_abbrev=False,
        description="Show a robot to ROS 2 under the names of Kachaka's official bridge.",
        epilog='ROS arguments follow after --ros-args.')
    parser.takes_ros_arguments = True
    add = parser.add_argument
    add('--sim', action='store_true', help='show a simulated robot')
    add('--address', type=address_argument, metavar='HOST',
        help=f'show the real robot at this address, HOST or HOST:PORT (default: {PORT})')
    add('--namespace', default='kachaka', help='of all its names (default: %(default)s)')
    add('--frame-prefix', default='', metavar='PREFIX', help='put before the names of frames')
    add('--give-up', action='store_true',
        help='end with code 1 when a real robot refuses to move, or is lost while it moves')
    add_simulation_options(parser, 'the simulated robot')
    add_parent_option(parser)
    options = parser.parse_args(args)
    if not options.sim and options.address is None:
        parser.error('which robot? --sim shows a simulated one, --address HOST a real one')
    if options.sim and options.address is not None:
        parser.error('one robot at a time: --sim or --address')
    return options, simulation_parameters(parser, options)


def _serve(node: BridgeNode, shutdown: ShutdownEvent, with_parent: bool) -> None:
    if shutdown.is_set:
        return
    if with_parent:
        print(f'{PARTICIPANT}{node.graph.participant.hex()}', file=sys.stderr, flush=True)
    # Each executor runs in its own thread.  The main thread sleeps until a signal is received, so
    # it does not slow the executors down.
    with contextlib.ExitStack() as stack:
        for executor in node.executors():
            stack.enter_context(_spinning(executor, shutdown))
        node.get_logger().info(f'ready: {node.summary}')
        shutdown.wait(with_parent)


@contextlib.contextmanager
def _spinning(executor: ExecutorLoop, shutdown: ShutdownEvent) -> Iterator[None]:
    """Run an executor in a thread during a ``with`` block; raise what it raised at its end."""
    with ThreadPoolExecutor(max_workers=1) as threads:
        spinning = threads.submit(executor.run)
        spinning.add_done_callback(lambda _: shutdown.end())
        try:
            yield
        finally:
            executor.stop()
        spinning.result()


if __name__ == '__main__':
    sys.exit(main())
