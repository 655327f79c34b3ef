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
"""Arguments and exit codes of the ``kachaka_simple_control`` command; needs no ROS."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
import sys
import traceback

from kachaka_simple_control.errors import ControlError, RobotNotFoundError, UsageError
from kachaka_simple_control.execution.signals import WATCH
from kachaka_simple_control.motion.errors import InvalidMotionError
from kachaka_simple_control.robot.real.address import Address

NAME = 'kachaka_simple_control'
DONE, FAULTED, BAD_USAGE, NO_ROBOT, SIGNALLED = 0, 1, 2, 3, 128

EPILOG = """
exit codes: 0 done; 1 faulted; 2 bad usage or motion; 3 no robot listens;
128 + N stopped by signal N (130 after Ctrl+C)
"""


@dataclass(frozen=True)
class Options:
    """
    What the command was asked to do.

    :param sim: whether to start a simulated robot beside the node
    :param parameters: parameters of the node that the arguments set
    :param ros_arguments: what ROS itself is told, from ``--ros-args`` on
    :param address: of the real robot to start a bridge to beside the node; None for no bridge
    """

    sim: bool
    parameters: dict[str, object]
    ros_arguments: list[str]
    address: str | None = None

    @property
    def brings_robot(self) -> bool:
        """Whether the command starts a robot's bridge, simulated or not, beside the node."""
        return self.sim or self.address is not None


def parse(arguments: Sequence[str] | None = None) -> Options:
    """
    Read the command's arguments.

    :param arguments: the arguments without the program's name; None for those of the process
    :returns: the options
    :raises SystemExit: with code 2 and one line for bad ones; with 0 after ``--help``
    """
    own, ros = split_ros_arguments(sys.argv[1:] if arguments is None else arguments)
    parser = argparse.ArgumentParser(
        prog=NAME, epilog=EPILOG, allow_abbrev=False,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Play the lesson's seven movements: forward, left and right, exactly timed.")
    robot = parser.add_mutually_exclusive_group()
    robot.add_argument(
        '--sim', action='store_true',
        help='start a simulated Kachaka, drive it, and print what was asked, sent and driven')
    robot.add_argument(
        '--address', type=_address, metavar='HOST',
        help='do the same with the real Kachaka at this address, HOST or HOST:PORT')
    parser.add_argument(
        '--rate', type=float, metavar='HZ', help='how often a velocity is sent (default: 10)')
    parser.add_argument(
        '--ros-args', action='store_true', default=argparse.SUPPRESS,
        help='everything after it is for ROS: remaps, parameters (-p robot_timeout:=30), ...')
    options = parser.parse_args(own)
    parameters: dict[str, object] = {} if options.rate is None else {'rate': options.rate}
    answer = Options(options.sim, parameters, ros, options.address)
    if answer.brings_robot:
        parameters['summary'] = True
    return answer


def split_ros_arguments(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """
    Tell our arguments from those of ROS, which stand between ``--ros-args`` and ``--``.

    :param arguments: all of them
    :returns: ours, and those of ROS with their marks
    """
    own: list[str] = []
    ros: list[str] = []
    inside = False
    for argument in arguments:
        inside = inside or argument == '--ros-args'
        (ros if inside else own).append(argument)
        inside = inside and argument != '--'
    return own, ros


def exit_code(body: Callable[[], None]) -> int:
    """
    Run a program's body, and turn how it ends into an exit code and at most one line.

    :param body: what to run
    :returns: the exit code
    """
    code = DONE
    try:
        body()
    except KeyboardInterrupt:
        code = SIGNALLED + 2
    except Exception as error:
        if WATCH.signum is None:
            code = _code_of(error)
            print(f'{NAME}: {_text(error)}', file=sys.stderr)
    return code if WATCH.signum is None else SIGNALLED + WATCH.signum


def _address(text: str) -> str:
    try:
        return str(Address.parse(text))
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _code_of(error: Exception) -> int:
    if isinstance(error, (InvalidMotionError, UsageError)):
        return BAD_USAGE
    return NO_ROBOT if isinstance(error, RobotNotFoundError) else FAULTED


def _text(error: Exception) -> str:
    if isinstance(error, (InvalidMotionError, ControlError)):
        return str(error)
    where = traceback.extract_tb(error.__traceback__)[-1]
    return (f'unexpected {type(error).__name__}: {error} ({where.filename}:{where.lineno}); the '
            'robot was stopped')
