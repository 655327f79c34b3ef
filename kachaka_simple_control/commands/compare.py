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
"""The command ``kachaka_compare``, which compares drives of a motion by their reports."""

from __future__ import annotations

from collections.abc import Sequence
import os
from pathlib import Path
import sys

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.process.exit_codes import OneLineParser
from kachaka_simple_control.process.output import print_result
from kachaka_simple_control.process.run_command import run_command
from kachaka_simple_control.report import comparison
from kachaka_simple_control.report.output_file import check_plot_file
from kachaka_simple_control.report.text_tables import terminal_columns, WIDEST
from kachaka_simple_control.text import escaped

NAME = 'kachaka_compare'


def compare(directories: Sequence[Path], plot: str | None) -> None:
    """
    Print a table that compares the end poses of several drives, and save a plot of their paths.

    :param plot: the image file for the plot; None for no plot
    :raises UsageError: if the drives cannot be compared, or the plot cannot be written
    """
    file = None if plot is None else check_plot_file(plot)
    places = [os.path.realpath(directory) for directory in directories]
    if twice := [one for one, place in zip(directories, places) if places.count(place) > 1]:
        raise UsageError(
            f'{escaped(str(twice[0]), 60)} is named twice: a drive is always like itself')
    drives = [comparison.read_drive(directory) for directory in directories]
    comparison.require_same(drives)
    width = min(terminal_columns() or WIDEST, WIDEST)
    print_result(comparison.comparison_table(drives, width), 'the table')
    if file is not None:
        comparison.save_comparison(drives, file)


def main(args: Sequence[str] | None = None) -> int:
    """Run the command ``kachaka_compare``."""
    parser = OneLineParser(
        prog=NAME, allow_abbrev=False,
        description='Compare drives of the same motion by their reports: how exactly it ends by '
                    'odometry, and how alike the drives are.',
        epilog='exit codes: 0 done; 2 the drives cannot be compared')
    parser.add_argument('reports', nargs='+', type=Path, metavar='REPORT',
                        help='the directory of a report, which --report left')
    parser.add_argument('--plot', metavar='FILE',
                        help='draw all paths over the planned one, as .png, .svg or .pdf')
    options = parser.parse_args(args)
    return run_command(
        lambda: compare(options.reports, options.plot), NAME, moves_robot=False)


if __name__ == '__main__':
    sys.exit(main())
