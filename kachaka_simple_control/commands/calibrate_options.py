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
The command line options of ``kachaka_calibrate``, which calibrates a robot.

Tested by test/commands/test_calibrate.py.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from kachaka_simple_control.commands import cli
from kachaka_simple_control.process.exit_codes import HELP, OneLineParser
from kachaka_simple_control.text import quoted

NAME = 'kachaka_calibrate'
OUTPUT = Path('my_kachaka.yaml')
#: The names of the two measurements that need a tape measure.
FLOOR, UMBMARK = 'floor', 'umbmark'
#: Why a calibration motion is driven without corners.
NEEDS_RESTS = 'a calibration needs the rests between its steps; leave it out'
EPILOG = """\
Without a word it measures by odometry alone: what the robot makes of the velocities that it is
sent.  It drives to and fro and round, for three quarters of a minute on about a metre of floor.

With a tape measure it measures odometry itself.  `floor` drives 1 m and once round, and asks what
that was on the floor.  `umbmark` drives a square to each side, asks where each ended, and finds
how unequal the wheels are and how wide the track is (after J. Borenstein and L. Feng, 1996).

"""


@dataclass(frozen=True)
class CalibrateOptions(cli.Options):
    """
    The values of the options of ``kachaka_calibrate``, with those of the command that drives.

    :param plot: the image file; None for no plot
    :param calibrates: always True
    :param part: ``floor`` or ``umbmark``, or empty to measure with odometry only
    :param output: the file of the profile to write; None for the default file
    :param measured: the measurements with the tape, in the order of the questions; empty to ask
    :param side: of the squares, as text; None for the default
    :param squares: the number of squares in each direction; None for one
    :param track: the wheel separation of the odometry, as text; None for that of the robot
    """

    calibrates: bool = True
    part: str = ''
    output: Path | None = None
    floor: str = ''
    dry_run: bool = False
    measured: Sequence[str] = ()
    side: str | None = None
    squares: int | None = None
    track: str | None = None

    @property
    def file(self) -> Path:
        """Return the path of the profile to write: that of ``--output``, or the default path."""
        return OUTPUT if self.output is None else self.output


def parse(arguments: Sequence[str]) -> CalibrateOptions:
    """
    Parse the command line arguments of ``kachaka_calibrate``.

    :raises SystemExit: with code 2 after an error in one line, with code 0 after the help
    """
    parser = _parser()
    values = cli.parse_values(parser, arguments)
    part = values['part']
    if part not in ('', FLOOR, UMBMARK):
        parser.error(
            f'there is no part {quoted(part, 60)}; it is {FLOOR} or {UMBMARK}, or left out')
    for name in ('side', 'squares', 'track'):
        if values[name] is not None and part != UMBMARK:
            parser.error(f'--{name} is about {NAME} {UMBMARK}')
    if values['measured'] and not part:
        parser.error(f'--measured is about {NAME} {FLOOR} and {NAME} {UMBMARK}')
    if part and values['plot'] is not None:
        parser.error(f'--plot is not about {NAME} {part}')
    if (squares := values['squares']) is not None and not 1 <= squares <= 20:
        parser.error(f'--squares is {squares}; it must be from 1 to 20')
    if values['corners']:
        parser.error(f'--corners is {values["corners"]:g} m: {NEEDS_RESTS}')
    cli.take_simulation(parser, values)
    return CalibrateOptions(**values)


def _parser() -> OneLineParser:
    parser = OneLineParser(
        prog=NAME, allow_abbrev=False, epilog=EPILOG.replace('\n\n', ' ') + HELP.strip(),
        description='Measure what a robot makes of the velocities that it is sent, or by a tape '
                    'what odometry is worth, and write a file of the robot with it.')
    parser.takes_ros_arguments = True
    add = parser.add_argument
    add('part', nargs='?', default='', metavar=f'{FLOOR}|{UMBMARK}',
        help='what to measure with a tape; left out, odometry alone is used')
    add('--output', type=Path, metavar='FILE',
        help=f'the file of the robot to write (default: {OUTPUT}); it must not exist, or be the '
             'one of --robot, which then gets what a tape measured')
    add('--floor', default='', metavar='TEXT', help='on which floor it drives, for people')
    add('--plot', metavar='FILE',
        help='draw what was sent, what odometry reported and the fit, as .png, .svg or .pdf')
    add('--dry-run', action='store_true', help='show what would be driven, and drive nothing')
    tape = parser.add_argument_group('with a tape measure').add_argument
    tape('--measured', action='append', default=[], metavar='WHAT',
         help="an answer instead of asking, once for each question: of floor '0.985 m' and "
              "'358 deg'; of umbmark, for each square, '-0.12 m, 0.05 m, 3 deg'")
    tape('--side', metavar='LENGTH', help="of the squares (default: '4 m')")
    tape('--squares', type=int, metavar='N', help='how many to each side (default: 1)')
    tape('--track', metavar='LENGTH',
         help='the distance of the wheels that odometry uses (default: what its file says; of a '
              "kachaka '0.2 m')")
    cli.add_drive_options(parser)
    # Known only to be refused with its reason.
    add('--corners', type=cli.tolerance, help=argparse.SUPPRESS)
    return parser
