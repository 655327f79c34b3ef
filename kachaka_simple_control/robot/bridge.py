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
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
import sys
import threading
import time
from typing import NoReturn, TYPE_CHECKING

from kachaka_simple_control.robot.ending import Ending
from kachaka_simple_control.robot.fidelity import Fidelity
from kachaka_simple_control.robot.simulated import SimulatedKachaka

if TYPE_CHECKING:
    from kachaka_simple_control.robot.bridge_node import KachakaBridge

PROGRAM = 'kachaka_bridge'
#: Of each option that is a figure of ``Fidelity``: name, unit, help.
FIGURES = (
    ('lag', 'S', 'time constant of the drive'),
    ('linear_acceleration', 'M/S2', 'largest change of the forward velocity'),
    ('angular_acceleration', 'RAD/S2', 'largest change of the turning velocity'),
    ('linear_gain', 'F', 'true over demanded forward velocity'),
    ('angular_gain', 'F', 'true over demanded turning velocity'),
    ('velocity_noise', 'F', 'standard deviation of the velocity, as a part of it'),
    ('odometry_noise', 'M', 'standard deviation of the position in odometry'),
    ('heading_noise', 'RAD', 'standard deviation of the heading in odometry'),
    ('undock_distance', 'M', 'how far the robot drives off its dock'),
    ('undock_velocity', 'M/S', 'how fast it does that'),
)


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        """
        End the program.

        :param message: what is wrong
        """
        self.exit(2, f'{PROGRAM}: {message}\n')


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the bridge until a signal comes.

    :param args: the arguments without the program's name; those of the command line by default
    :returns: the exit code
    """
    with Ending() as ending:
        return _main([*(sys.argv[1:] if args is None else args)], ending)


def _main(args: list[str], ending: Ending) -> int:
    try:
        from kachaka_simple_control.robot.bridge_node import KachakaBridge
        import rclpy
        from rclpy.exceptions import NameValidationException
        from rclpy.signals import SignalHandlerOptions
        from rclpy.utilities import remove_ros_args
        from rclpy.validate_namespace import validate_namespace
    except ImportError as error:
        return _failure(f'ROS 2 is missing here ({error})', 1)
    try:
        options, fidelity = _parse(remove_ros_args(args))
        namespace = '/' + options.namespace.strip('/')
        validate_namespace(namespace)
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        robot = SimulatedKachaka(time.monotonic(), fidelity, options.docked, options.seed)
        node = KachakaBridge(robot, namespace, options.frame_prefix)
    except (RuntimeError, NameValidationException) as error:
        return _failure(str(error), 2)
    try:
        _serve(node, ending, options.with_parent)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


def _failure(message: str, code: int) -> int:
    print(f"{PROGRAM}: {' '.join(message.split())}", file=sys.stderr)
    return code


def _parse(args: list[str]) -> tuple[argparse.Namespace, Fidelity]:
    parser = _parser()
    options = parser.parse_args(args)
    if not options.sim:
        parser.error('which robot? --sim shows a simulated one')
    try:
        return options, Fidelity(**{name: getattr(options, name) for name, _, _ in FIGURES})
    except ValueError as error:
        parser.error(str(error))


def _parser() -> _Parser:
    parser = _Parser(
        prog=PROGRAM, allow_abbrev=False,
        description="Show a robot to ROS 2 under the names of Kachaka's official bridge.",
        epilog='ROS arguments follow after --ros-args.')
    add = parser.add_argument
    add('--sim', action='store_true', help='show a simulated robot')
    add('--namespace', default='kachaka', help='of all its names (default: %(default)s)')
    add('--frame-prefix', default='', metavar='PREFIX', help='put before the names of frames')
    add('--docked', action='store_true', help='the robot starts on its charging dock')
    add('--seed', type=int, default=0, help='of all noise (default: %(default)s)')
    for name, unit, text in FIGURES:
        add(f"--{name.replace('_', '-')}", type=float, default=getattr(Fidelity, name),
            metavar=unit, help=f'{text} (default: %(default)s)')
    add('--with-parent', action='store_true', help='end when standard input does')
    return parser


def _serve(node: KachakaBridge, ending: Ending, with_parent: bool) -> None:
    # The node is served in a thread of its own: the main thread is the one that hears signals,
    # and sleeps until there is one, so it takes no time from the node.
    from rclpy.executors import SingleThreadedExecutor
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    over = threading.Event()

    def spin() -> None:
        while not over.is_set():
            executor.spin_once()

    with ThreadPoolExecutor(max_workers=1) as threads:
        spinning = threads.submit(spin)
        spinning.add_done_callback(lambda _: ending.end())
        node.get_logger().info(f'ready: {node.summary}')
        ending.wait(with_parent)
        # A task wakes the executor; shutting it down under way would pull away what it waits on.
        executor.create_task(over.set)
        spinning.result()
    executor.shutdown()


if __name__ == '__main__':
    sys.exit(main())
