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
"""The command line options of ``kachaka_simple_control``; this module needs no ROS."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
import contextlib
from dataclasses import dataclass, field
from glob import escape, glob
import os
from pathlib import Path
import re
import shlex
import sys
from typing import Any, NoReturn

from kachaka_simple_control.commands.motion_values import (
    parameter_words,
    value_argument,
    values_problem,
    WITH_HELP,
)
from kachaka_simple_control.control.end_check import EndTolerance
from kachaka_simple_control.control.speed_factor import MIN_SPEED_FACTOR
from kachaka_simple_control.kachaka.program import (
    add_floor_option,
    add_simulation_options,
    address_argument,
    floor_words,
    number_argument,
    SIMULATION_NAMES,
    simulation_parameters,
    simulation_words,
)
from kachaka_simple_control.motion.units import MINUS, point_advice, TOLERANCE, UnitError
from kachaka_simple_control.process.exit_codes import DONE, FAULTED, HELP, OneLineParser
from kachaka_simple_control.text import escaped, quoted

NAME = 'kachaka_simple_control'
EXAMPLES = """
examples:
  kachaka_simple_control --sim                   the lesson, on a simulated robot
  kachaka_simple_control square --plan           what a motion will do
  kachaka_simple_control square --with side=1m --plan
  kachaka_simple_control ./mine.yaml --sim --report run1
  kachaka_simple_control square --ros-args -p robot_timeout:=30
"""
#: Matches a time that a user typed after ``--wait`` by mistake, because ``--wait`` takes no value.
TIME = re.compile(r'\d+(\.\d*)?(s|min)?|inf|forever')
MAX_REPEATS = 1000
#: What the option ``--watch`` does.
WATCH_HELP = (
    'hold before obstacles that the laser sees on the planned path, and go on when they are gone; '
    'no safety device (default: what the motion says, or not)')
PRECEDENCE = """
what wins: an option or -p (they must not differ), then the motion's file, then the
default of the parameter
"""


@dataclass(frozen=True)
class Options:
    """
    The values of the command line options of ``kachaka_simple_control``; None if not given.

    :param motions: the names or files of motions; empty for the lesson
    :param values: of parameters of the motions: names and texts
    :param robot: the name or file of the robot's profile
    :param closed_loop: whether odometry corrects the velocities
    :param watch: whether the robot is held before obstacles
    :param corners: how far the robot may pass the corners between steps [m]
    :param within: how far from the plan the drive may end, as text
    :param speed: the initial speed as a fraction of the planned speed, up to 1
    :param plot: the image file for a plot of the plans
    :param wait: whether to start the motion only at the service ``~/run`` or Enter
    :param report: the directory for a report
    :param quiet: whether to print only the node's log lines while the robot drives
    :param address: of a real robot, for which to start a bridge
    :param simulation: the options of the simulated robot, as command line arguments
    :param floor_file: the name or file of the floor of the simulated robot
    :param yes: whether to drive a real robot without asking the user
    :param calibrates: whether the drive is for a calibration: recorded, without a table
    """

    motions: tuple[str, ...] = ()
    values: tuple[tuple[str, str], ...] = ()
    sim: bool = False
    robot: str | None = None
    rate: float | None = None
    closed_loop: bool | None = None
    watch: bool | None = None
    corners: float | None = None
    within: str | None = None
    speed: float | None = None
    list: bool = False  # noqa: A003
    plan: bool = False
    plot: str | None = None
    wait: bool = False
    ros_arguments: tuple[str, ...] = ()
    address: str | None = None
    report: str | None = None
    repeat: int = 1
    quiet: bool = False
    simulation: tuple[str, ...] = ()
    floor_file: str | None = None
    yes: bool = False
    pipe: bool = False
    console: bool = False
    calibrates: bool = False
    command: str = field(default=NAME, compare=False)

    @property
    def is_preview(self) -> bool:
        """Whether the command only lists motions or shows their plans, and does not drive."""
        return self.list or self.plan or self.plot is not None

    @property
    def is_quiet(self) -> bool:
        """Whether nothing but log lines is shown while the robot drives."""
        return self.quiet or self.pipe

    @property
    def prints_table(self) -> bool:
        """Whether the command prints a table with the results of the drive."""
        return self.starts_bridge and not (self.calibrates or self.pipe)

    @property
    def starts_bridge(self) -> bool:
        """Whether the command starts a bridge, of a simulated or a real robot."""
        return self.sim or self.address is not None


def parse(arguments: Sequence[str] | None = None) -> Options:
    """
    Parse the command line arguments of ``kachaka_simple_control``.

    :raises SystemExit: with code 2 after an error in one line, with code 0 after help or version
    """
    parser = _parser()
    if '_ARGCOMPLETE' in os.environ:
        from kachaka_simple_control.files.floor_file import floors
        from kachaka_simple_control.files.library import library
        from kachaka_simple_control.files.robot_profile import robots
        complete(parser, {
            'motions': lambda prefix, **_: [*library(), *paths(prefix, '.yaml', '.yml')],
            'values': lambda parsed_args, **_: parameter_words(parsed_args.motions or ()),
            'robot': lambda prefix, **_: [*robots(), *paths(prefix, '.yaml', '.yml')],
            'floor_file': lambda prefix, **_: [*floors(), *paths(prefix, '.yaml', '.yml')],
            'plot': lambda prefix, **_: paths(prefix, '.png', '.svg', '.pdf'),
            'report': lambda prefix, **_: paths(prefix)})
    values = parse_values(parser, arguments)
    take_simulation(parser, values)
    if values.pop('version'):
        from kachaka_simple_control.process.version import installed_version
        print(f'{NAME} {installed_version()}')
        raise SystemExit(DONE)
    options = Options(
        motions=tuple(values.pop('motions')), values=tuple(values.pop('values')), **values)
    _check_combination(parser, options)
    return options


def _check_combination(parser: OneLineParser, options: Options) -> None:
    """End the program with a message if two options contradict each other."""
    if options.wait and any(map(TIME.fullmatch, options.motions)):
        parser.error('--wait takes no time; -p robot_timeout:=30, after --ros-args, sets how '
                     'long to wait for a robot')
    if options.wait and options.repeat > 1:
        parser.error('--wait drives as often as it is asked to: leave out --repeat')
    if options.pipe and (
            options.motions or options.values or options.wait or options.repeat > 1):
        parser.error('--pipe takes its motions from standard input: leave out MOTION, --with, '
                     '--wait and --repeat')
    if options.pipe and options.console:
        parser.error('--pipe is for another program; leave out --console, or use kachaka_console')
    _check_motions(parser, options)
    if options.is_preview:
        for name in (
                'report', 'repeat', 'sim', 'address', 'wait', 'quiet', 'speed', 'within', 'yes',
                'pipe', 'console'):
            if getattr(options, name) != getattr(Options, name):
                parser.error(f'--{name} is about a drive; --list, --plan and --plot drive nothing')


def _check_motions(parser: OneLineParser, options: Options) -> None:
    """End the program with a message if a motion is none, or there are too many of them."""
    if ros := [word for word in options.motions if ':=' in word]:
        parser.error(f'{quoted(ros[0], 60)} is no motion; write ROS arguments after --ros-args')
    if problem := values_problem(options.values, options.motions):
        parser.error(problem)
    if options.motions and options.list and not options.plan and options.plot is None:
        parser.error('--list lists all motions: leave out MOTION, or show its plan with --plan')
    if len(options.motions) > 1 and not options.is_preview:
        parser.error('one motion can be driven at a time; --plan and --plot take several')


def parse_values(parser: OneLineParser, arguments: Sequence[str] | None) -> dict[str, Any]:
    """
    Parse the command line arguments of a program that drives robots.

    :param arguments: None for those of this process
    :returns: by name; ``ros_arguments`` for ROS, and ``command``, the whole command line
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    own, ros = split_ros_arguments(arguments)
    return {**vars(parser.parse_args(own)), 'ros_arguments': tuple(ros),
            'command': shlex.join([parser.prog, *arguments])}


def take_simulation(parser: OneLineParser, values: dict[str, Any]) -> None:
    """
    Check the options of the simulated robot, and combine them in the key ``simulation``.

    :param values: of all options, by name; changed in place
    """
    floor = floor_words(values)
    simulation = (*simulation_words(values), *floor)
    if simulation and not values['sim'] and not (values.get('plot') and simulation == floor):
        parser.error(f'{simulation[0].partition("=")[0]} is about the simulated robot of --sim')
    simulation_parameters(parser, argparse.Namespace(**values))
    for name in SIMULATION_NAMES:
        values.pop(name)
    values['simulation'] = simulation


def _parser() -> OneLineParser:
    parser = OneLineParser(
        prog=NAME, epilog=f'{EXAMPLES}{PRECEDENCE}{HELP}', allow_abbrev=False,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description='Drive a motion, exactly timed; without a name, the seven movements of the '
                    'lesson.')
    parser.takes_ros_arguments, parser.value_option = True, '--with'
    add = parser.add_argument
    add('motions', nargs='*', metavar='MOTION',
        help='a motion that comes with the package (see --list), or the path of a file')
    add('--with', action='append', type=value_argument, default=[], dest='values',
        metavar='NAME=VALUE', help=WITH_HELP)
    add('--list', action='store_true',
        help='list the motions and robots that come with the package')
    add('--plan', action='store_true',
        help='print what the motions will do, step by step; nothing moves, and no ROS is needed')
    add('--plot', metavar='FILE',
        help='draw what the motions will do, as .png, .svg or .pdf; likewise')
    add('--wait', action='store_true',
        help='stand by: Enter, or the service ~/run, starts the motion; ~/stop ends it')
    add('--quiet', action='store_true',
        help="show nothing while the robot drives but the node's log lines")
    add('--speed', type=speed_argument, metavar='PERCENT',
        help='drive slower than planned, as in --speed 50%%, on the same path; for a careful '
             'first drive')
    add('--repeat', type=count_argument, default=1, metavar='N',
        help='drive so many times, with --report DIR into DIR/1, DIR/2, ..., for kachaka_compare')
    add_drive_options(parser)
    add_floor_option(parser, 'the simulated robot of --sim')
    add('--closed-loop', action=argparse.BooleanOptionalAction,
        help='correct the velocities by odometry; needs a robot that kachaka_calibrate has '
             'measured (default: what the motion says, or not)')
    add('--watch', action=argparse.BooleanOptionalAction, help=WATCH_HELP)
    add('--corners', type=tolerance, metavar='LENGTH',
        help='drive through corners without a stop, and pass each by this length at most, as in '
             '--corners 5cm; 0 stops at each (default: what the motion says, or 0)')
    add('--within', type=_end_tolerance, metavar='TOLERANCE',
        help='fail (exit code 1) if the robot ends farther from the plan by odometry, as in 2cm '
             'or 2cm,3deg (default: a warning beyond 2 cm or 3 deg)')
    add('--pipe', action='store_true',
        help='for programs: take commands from standard input, and write reports to standard '
             'output, one JSON object a line')
    add('--console', action='store_true',
        help='serve a page for a browser of this machine, which shows the drive and can stop, '
             'pause, resume and slow it down')
    add('--version', action='store_true', help='print the version')
    return parser


def add_drive_options(parser: OneLineParser) -> None:
    """Add the common options of all programs for driving, such as ``--robot`` and ``--rate``."""
    robot = parser.add_mutually_exclusive_group().add_argument
    robot('--sim', action='store_true',
          help='start a simulated Kachaka, drive it, and print what was requested, sent and '
               'driven')
    robot('--address', type=lambda text: str(address_argument(text)), metavar='HOST',
          help='do the same with the real Kachaka at this address, HOST or HOST:PORT; it moves '
               'when somebody has confirmed')
    add = parser.add_argument
    add('--yes', action='store_true',
        help='drive a real robot without asking; needed without a terminal')
    add('--robot', metavar='NAME',
        help='kachaka, turtlebot3, generic, or the path of a profile (default: what the motion '
             'says, or kachaka)')
    add('--rate', type=number_argument('Hz'), metavar='HZ',
        help='how often a velocity is sent (default: what the motion says, or 10)')
    add('--report', type=directory_argument, metavar='DIR',
        help='write a report and a recording of the drive to this new directory')
    group = parser.add_argument_group('errors of the simulated robot, with --sim')
    add_simulation_options(group, 'the simulated robot')
    add('--ros-args', action='store_true', default=argparse.SUPPRESS,
        help='everything after it is for ROS: remaps, parameters (-p robot_timeout:=30), ...')


def speed_argument(text: str) -> float:
    """Return the value of ``--speed`` as a fraction: from 1% to 100%."""
    number = text.strip().removesuffix('%')
    with contextlib.suppress(ValueError):
        # A decimal comma is accepted here only to print the corrected number.
        percent = float(number.replace(',', '.', 1))
        has_sign = number != text.strip()
        if (100.0 * MIN_SPEED_FACTOR if has_sign else 2.0) <= percent <= 100.0:
            if advice := point_advice(text.strip()):
                raise argparse.ArgumentTypeError(f'{escaped(text, 60)!r}; {advice}')
            return percent / 100.0
        if not has_sign and MIN_SPEED_FACTOR <= percent < 2.0:
            # A number without % is ambiguous: it may be a fraction or a percentage.
            meant = f'{100.0 * percent:g}%' if percent < 1.0 else f'{percent:g}%'
            meant += ' or 100%' if percent == 1.0 else ''
            raise argparse.ArgumentTypeError(f'{escaped(text, 60)!r} has no %: write {meant}')
    problem = 'has a minus, U+2212; it must be' if MINUS in text else 'is not'
    raise argparse.ArgumentTypeError(
        f'{escaped(text, 60)!r} {problem} from 1% to 100%, as in 50%; to stop, pause')


def tolerance(text: str) -> float:
    """Return the value of ``--corners`` [m]: a length from 0 to 1 m, as in ``5cm``, or 0."""
    with contextlib.suppress(ValueError):
        if float(text) == 0.0:
            return 0.0
    try:
        return TOLERANCE.parse(text.strip())
    except UnitError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _end_tolerance(text: str) -> str:
    try:
        EndTolerance.parse(text)
    except UnitError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return text


def directory_argument(text: str) -> str:
    """Return the path of a new directory for a report."""
    if not text:
        # It would mean the current directory.
        raise argparse.ArgumentTypeError("'' is no directory; write the path of a new one")
    return text


def count_argument(text: str) -> int:
    """Return the value of ``--repeat``."""
    with contextlib.suppress(ValueError):
        if 1 <= (count := int(text)) <= MAX_REPEATS:
            return count
    raise argparse.ArgumentTypeError(
        f'{escaped(text, 60)!r} is not a whole number from 1 to {MAX_REPEATS}')


def complete(
        parser: OneLineParser, completers: Mapping[str, Callable[..., list[str]]]) -> NoReturn:
    """
    Print the possible completions of a word for the shell, at Tab, and exit.

    :param completers: for arguments, by name
    """
    try:
        from argcomplete import autocomplete
    except ModuleNotFoundError:
        parser.exit(FAULTED, (
            f'{parser.prog}: completion needs argcomplete in the environment of this command: '
            '`pip install argcomplete` or `apt install python3-argcomplete`\n'))
    parser.set_completers(completers)
    autocomplete(parser, always_complete_options=False)
    parser.exit()


def paths(prefix: str, *suffixes: str) -> list[str]:
    """Return the paths that complete a partly typed path, for completion in a shell."""
    found = glob(f'{escape(prefix)}*')  # noqa: PTH207 (a path keeps its ./)
    return [f'{path}/' if Path(path).is_dir() else path
            for path in found if path.endswith(suffixes) or Path(path).is_dir()]


def split_ros_arguments(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Split arguments into the program's own and those from ``--ros-args`` to ``--``, for ROS."""
    own: list[str] = []
    ros: list[str] = []
    is_for_ros = False
    for argument in arguments:
        is_for_ros = is_for_ros or argument == '--ros-args'
        (ros if is_for_ros else own).append(argument)
        is_for_ros = is_for_ros and argument != '--'
    return own, ros
