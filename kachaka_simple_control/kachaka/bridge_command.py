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
"""The command ``kachaka_bridge``: shows a robot to ROS 2 under the official bridge's names."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
import contextlib
import sys
import time
from typing import TYPE_CHECKING

from kachaka_simple_control.control.output import make_log_nonblocking
from kachaka_simple_control.control.signals import ShutdownEvent
from kachaka_simple_control.errors import RobotTakenError
from kachaka_simple_control.escaping import escaped
from kachaka_simple_control.kachaka.bridge_process import PARTICIPANT
from kachaka_simple_control.kachaka.grpc_client.address import Address, PORT, UnreachableError
from kachaka_simple_control.kachaka.simulator.command import (
    add_parameter_options,
    MISSING,
    simulation_parameters,
)
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
from kachaka_simple_control.one_line_parser import OneLineParser
from kachaka_simple_control.ros.dds_transport import (
    is_localhost_requested,
    use_localhost_only,
    use_udp_transport,
)
from kachaka_simple_control.ros.names import MAX_NAMESPACE_LENGTH, require_namespace

if TYPE_CHECKING:
    from kachaka_simple_control.kachaka.bridge_node import BridgeNode
    from kachaka_simple_control.ros.executors import ExecutorLoop

PROGRAM = 'kachaka_bridge'
DONE, FAULTED, BAD_USAGE, NO_ROBOT = 0, 1, 2, 3


class _EndedError(Exception):
    """The program ends early: with an exit code, and a line that says why."""

    def __init__(self, code: int, text: object) -> None:
        super().__init__(str(text))
        self.code = code


class _FaultReason:
    """Why the bridge gave up, if it did."""

    def __init__(self, ending: ShutdownEvent) -> None:
        self._ending = ending
        self.text = ''

    def give_up(self, text: str) -> None:
        self.text = self.text or text
        self._ending.end()

    def rival_found(self, rival: str) -> None:
        self.give_up(f'another bridge shows a robot under the same names: {rival}; both end')


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the bridge until a signal comes.

    :param args: the arguments without the program's name; those of the command line by default
    :returns: the exit code
    """
    make_log_nonblocking()
    with ShutdownEvent() as ending:
        try:
            _main([*(sys.argv[1:] if args is None else args)], ending)
        except _EndedError as ended:
            print(f"{PROGRAM}: {escaped(' '.join(str(ended).split()), 400)}", file=sys.stderr)
            return ended.code
        return DONE


def _main(args: list[str], ending: ShutdownEvent) -> None:
    try:
        import rclpy
        from rclpy.utilities import remove_ros_args
    except ImportError as error:
        raise _EndedError(FAULTED, f'ROS 2 is missing here ({error})') from None
    verdict = _FaultReason(ending)
    try:
        from kachaka_simple_control.ros.startup import check_arguments, start_ros
        options, how = _parse(check_arguments(args, remove_ros_args))
        namespace = '/' + options.namespace.strip('/')
        require_namespace(namespace, '--namespace', MAX_NAMESPACE_LENGTH)
        make = (_real(options, verdict) if options.address
                else _simulated(options, how, verdict))
        if is_localhost_requested():
            use_localhost_only()
        use_udp_transport()
        start_ros(args)
        node = make(namespace)
    except (UnreachableError, RobotTakenError) as error:
        raise _EndedError(NO_ROBOT, error) from None
    except (RuntimeError, UnicodeError) as error:
        raise _EndedError(BAD_USAGE, error) from None
    try:
        _serve(node, ending, options.with_parent)
    finally:
        node.close()
        node.destroy_node()
        rclpy.try_shutdown()
    if verdict.text:
        raise _EndedError(FAULTED, verdict.text)


def _simulated(
        options: argparse.Namespace, how: SimulationParameters,
        verdict: _FaultReason) -> Callable[[str], BridgeNode]:
    """Return what makes the node of a simulated robot, told the namespace."""
    try:
        from kachaka_simple_control.kachaka.bridge_node import SimulatedBridge
    except ImportError as error:
        raise _EndedError(FAULTED, f'ROS 2 is missing here ({error})') from None

    def make(namespace: str) -> BridgeNode:
        robot = SimulatedKachaka(time.monotonic(), how, options.docked, options.seed)
        return SimulatedBridge(robot, namespace, options.frame_prefix, verdict.rival_found)

    return make


def _real(options: argparse.Namespace, verdict: _FaultReason) -> Callable[[str], BridgeNode]:
    """Meet the real robot, and return what makes its node, told the namespace."""
    try:
        from kachaka_simple_control.kachaka.grpc_client.connection import connect
    except (ImportError, RuntimeError) as error:  # its SDK refuses an older gRPC so
        raise _EndedError(FAULTED, MISSING.format(error=error)) from None
    try:
        from kachaka_simple_control.kachaka.grpc_client.bridge import RealBridge
    except ImportError as error:
        raise _EndedError(FAULTED, f'ROS 2 is missing here ({error})') from None
    meeting = connect(options.address)

    def make(namespace: str) -> BridgeNode:
        return RealBridge(
            meeting, namespace, options.frame_prefix,
            verdict.give_up if options.give_up else lambda _: None, verdict.rival_found)

    return make


def _parse(args: list[str]) -> tuple[argparse.Namespace, SimulationParameters]:
    parser = _parser()
    options = parser.parse_args(args)
    if not options.sim and options.address is None:
        parser.error('which robot? --sim shows a simulated one, --address HOST a real one')
    if options.sim and options.address is not None:
        parser.error('one robot at a time: --sim or --address')
    try:
        return options, simulation_parameters(options)
    except ValueError as error:
        parser.error(str(error))


def _address(text: str) -> Address:
    try:
        return Address.parse(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _parser() -> OneLineParser:
    parser = OneLineParser(
        prog=PROGRAM, allow_abbrev=False,
        description="Show a robot to ROS 2 under the names of Kachaka's official bridge.",
        epilog='ROS arguments follow after --ros-args.')
    add = parser.add_argument
    add('--sim', action='store_true', help='show a simulated robot')
    add('--address', type=_address, metavar='HOST',
        help=f'show the real robot at this address, HOST or HOST:PORT (default: {PORT})')
    add('--namespace', default='kachaka', help='of all its names (default: %(default)s)')
    add('--frame-prefix', default='', metavar='PREFIX', help='put before the names of frames')
    add('--give-up', action='store_true',
        help='end with code 1 when a real robot refuses to move, or is lost while it moves')
    add('--docked', action='store_true', help='the simulated robot starts on its charging dock')
    add('--seed', type=int, default=0, help='of all noise (default: %(default)s)')
    add_parameter_options(parser)
    add('--with-parent', action='store_true', help='end when standard input does')
    return parser


def _serve(node: BridgeNode, ending: ShutdownEvent, with_parent: bool) -> None:
    if with_parent:
        from kachaka_simple_control.ros.participants import own_participant
        print(f'{PARTICIPANT}{own_participant(node).hex()}', file=sys.stderr, flush=True)
    # Served in threads of their own: the main thread is the one that hears signals, and sleeps
    # until there is one, so it takes no time from them.
    with contextlib.ExitStack() as stack:
        for spinner in node.spinners():
            stack.enter_context(_spinning(spinner, ending))
        node.get_logger().info(f'ready: {node.summary}')
        ending.wait(with_parent)


@contextlib.contextmanager
def _spinning(spinner: ExecutorLoop, ending: ShutdownEvent) -> Iterator[None]:
    with ThreadPoolExecutor(max_workers=1) as threads:
        spinning = threads.submit(spinner.run)
        spinning.add_done_callback(lambda _: ending.end())
        try:
            yield
        finally:
            spinner.stop()
        spinning.result()


if __name__ == '__main__':
    sys.exit(main())
