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
"""The options of ``kachaka_fleet``.  Tested by test/commands/test_kachaka_fleet.py."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, field
import os

from kachaka_simple_control.commands.cli import (
    complete,
    count_argument,
    directory_argument,
    parse_values,
    paths,
    speed_argument,
    WATCH_HELP,
)
from kachaka_simple_control.kachaka.program import add_floor_option
from kachaka_simple_control.process.exit_codes import DONE, HELP, OneLineParser

NAME = 'kachaka_fleet'
EXAMPLES = """
examples:
  kachaka_fleet minuet --sim                 two simulated robots
  kachaka_fleet ./mine.yaml --plan           what each robot will do, and where two come near
  kachaka_fleet ./mine.yaml --report run1    drive the robots, and write a report
"""


@dataclass(frozen=True)
class FleetOptions:
    """
    The values of the command line options of ``kachaka_fleet``; None if not given.

    :param file: the name or the path of the fleet's file; empty with ``--list``
    :param speed: of all robots, as a part of the planned speed
    :param watch: whether robots are held before obstacles
    :param floor_file: the name or file of the floor of the simulated robots
    :param on_fault: ``stop_all`` or ``go_on``
    :param start_at: the time of day, or date and time, at which the robots begin, as text
    """

    file: str = ''
    list: bool = False  # noqa: A003
    plan: bool = False
    plot: str | None = None
    sim: bool = False
    wait: bool = False
    repeat: int | None = None
    speed: float | None = None
    watch: bool | None = None
    floor_file: str | None = None
    on_fault: str | None = None
    allow_near: bool = False
    start_at: str | None = None
    report: str | None = None
    quiet: bool = False
    pipe: bool = False
    ros_arguments: tuple[str, ...] = ()
    command: str = field(default=NAME, compare=False)

    @property
    def is_preview(self) -> bool:
        """Whether the command only shows what would be driven."""
        return self.list or self.plan or self.plot is not None


def parse(arguments: Sequence[str] | None = None) -> FleetOptions:
    """
    Parse the command line arguments of ``kachaka_fleet``.

    :raises SystemExit: with code 2 after an error in one line, with code 0 after help or version
    """
    parser = _parser()
    if '_ARGCOMPLETE' in os.environ:
        from kachaka_simple_control.files.fleet_file import fleets
        complete(parser, {
            'file': lambda prefix, **_: [*fleets(), *paths(prefix, '.yaml', '.yml')],
            'plot': lambda prefix, **_: paths(prefix, '.png', '.svg', '.pdf'),
            'report': lambda prefix, **_: paths(prefix)})
    values = parse_values(parser, arguments)
    if values.pop('version'):
        from kachaka_simple_control.process.version import installed_version
        print(f'{NAME} {installed_version()}')
        raise SystemExit(DONE)
    options = FleetOptions(**{**values, 'file': values['file'] or ''})
    _check_combination(parser, options)
    return options


def _check_combination(parser: OneLineParser, options: FleetOptions) -> None:
    if options.list == bool(options.file):
        parser.error(
            '--list lists all fleets: leave out FILE' if options.list else
            'name a fleet (see --list), or the file of one')
    if options.is_preview:
        for name in ('sim', 'wait', 'repeat', 'on_fault', 'allow_near', 'start_at', 'report',
                     'quiet', 'pipe'):
            if getattr(options, name) != getattr(FleetOptions, name):
                parser.error(f'--{name.replace("_", "-")} is about a drive; --list, --plan and '
                             '--plot drive nothing')
    if options.floor_file is not None and not (options.sim or options.plot):
        parser.error('--floor is about the simulated robots of --sim')
    if options.pipe and options.wait:
        parser.error('--pipe waits for commands already: leave out --wait')
    if options.start_at is not None and (options.wait or options.pipe):
        parser.error('--start-at begins by itself: leave out --wait and --pipe')


def _parser() -> OneLineParser:
    parser = OneLineParser(
        prog=NAME, epilog=f'{EXAMPLES}{HELP}', allow_abbrev=False,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description='Drive many robots in step, all from one t = 0.')
    parser.takes_ros_arguments = True
    add = parser.add_argument
    add('file', nargs='?', metavar='FILE',
        help='the file of a fleet, or the name of one that comes with the package (see --list)')
    add('--list', action='store_true', help='list the fleets that come with the package')
    add('--plan', action='store_true',
        help='print what each robot will do, and where two come near; nothing moves, and no ROS '
             'is needed')
    add('--plot', metavar='FILE',
        help='draw what the robots will do on their floor, as .png, .svg or .pdf; likewise')
    add('--sim', action='store_true', help='start simulated robots, and drive them')
    add_floor_option(parser, 'a simulated robot')
    add('--wait', action='store_true',
        help='stand by: Enter, or the service ~/run, starts the motions; ~/stop ends them')
    add('--repeat', type=count_argument, metavar='N',
        help='drive N times (default: what the file says, or 1)')
    add('--speed', type=speed_argument, metavar='PERCENT',
        help='drive all robots slower than planned, as in --speed 50%%, on the same paths')
    add('--watch', action=argparse.BooleanOptionalAction, help=WATCH_HELP)
    add('--on-fault', choices=('stop_all', 'go_on'),
        help='what a fault of one robot does to the others (default: what the file says, or '
             'stop_all)')
    add('--allow-near', action='store_true',
        help='drive also where two robots come closer than the margin')
    add('--start-at', metavar='TIME',
        help='begin at this time, as in 14:30:00 or 2026-11-28T14:30:00; for fleets on several '
             'machines, whose clocks chrony keeps')
    add('--report', type=directory_argument, metavar='DIR',
        help='write a report and a recording of the drive to this new directory')
    add('--quiet', action='store_true',
        help='show nothing while the robots drive but the log lines')
    add('--pipe', action='store_true',
        help='for programs: take commands from standard input, and write reports to standard '
             'output, one JSON object a line')
    add('--version', action='store_true', help='print the version')
    add('--ros-args', action='store_true', default=argparse.SUPPRESS,
        help='everything after it is for ROS: parameters (-p r1.robot_timeout:=30), ...')
    return parser
