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
"""Measure over a bad link, and print the tables; ``make lossy-link`` runs this."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import json
from pathlib import Path
import signal
import sys
import time
from typing import Any

from benchmarks import machine, ROOT
from benchmarks.lossy_link.network import unavailable_reason
from benchmarks.lossy_link.tables import find_violations, tables
from benchmarks.run import save, today, write_measured
from ros_domain import use_own_domain

PAGE = ROOT / 'docs' / 'lossy_link.md'
BEGIN = '<!-- measured: written by make lossy-link, changes here are lost -->'
PARTS = ('stops', 'moves', 'answers', 'cable')
#: The packet losses [%].
LOSSES = (0, 10, 30, 50)
#: The number of measurements of each part.
FULL = {'stops': 200, 'moves': 20, 'answers': 15, 'cable': 5}
QUICK = {'stops': 5, 'moves': 3, 'answers': 2, 'cable': 1}


def measure(parts: Sequence[str], losses: Sequence[int], counts: dict[str, int]) -> dict[str, Any]:
    """
    Run the measurements.

    :param parts: the names of the parts to measure
    :param losses: the packet losses [%]
    :param counts: the number of measurements of each part
    :returns: the results as plain data
    """
    # Called before any process that imports rclpy starts.
    use_own_domain()
    from benchmarks.lossy_link.disconnects import measure_disconnects
    from benchmarks.lossy_link.fixture import fixture
    from benchmarks.lossy_link.manual_control import measure_requests
    from benchmarks.lossy_link.motions import measure_motions, RATES
    from benchmarks.lossy_link.stops import measure_stops
    run: dict[str, Any] = {
        'date': today(), 'machine': machine.describe(), **{part: [] for part in PARTS}}
    for percent in losses:
        if 'stops' in parts:
            with fixture() as made:
                run['stops'].append(measure_stops(made, percent, counts['stops']))
        for rate in RATES if 'moves' in parts else ():
            with fixture() as made:
                run['moves'].append(measure_motions(made, percent, rate, counts['moves']))
        if 'answers' in parts:
            with fixture() as made:
                run['answers'].append(measure_requests(made, percent, counts['answers']))
    if 'cable' in parts:
        with fixture() as made:
            run['cable'] = measure_disconnects(made, counts['cable'])
    return run


def joined(runs: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Join runs of several parts into one run, with the date and the machine of the last."""
    found = {part: [one for run in runs for one in run[part]] for part in PARTS}
    for part in PARTS[:-1]:
        found[part].sort(key=lambda one: (one['percent'], one.get('rate', 0)))
    return {**runs[-1], **found}


def write_page(run: dict[str, Any]) -> None:
    """Write the tables of a run to the documentation page."""
    text = '\n'.join([
        f'Measured on {run["date"]}.', '', *(table.markdown() for table in tables(run))])
    write_measured(PAGE, text, BEGIN)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure according to the arguments; return 1 if a result is not as expected, else 0."""
    options = _options(arguments)
    if options.of:
        run = joined([json.loads(file.read_text()) for file in options.of])
        write_page(run)
    else:
        if (reason := unavailable_reason()) is not None:
            print(f'skipped: {reason}')
            return 0
        # The network must be removed after these signals, too.
        for signum in (signal.SIGTERM, signal.SIGHUP):
            signal.signal(signum, lambda number, _: sys.exit(128 + number))
        run = _measured(options)
    print('\n'.join(table.text() for table in tables(run)))
    lines = find_violations(run)
    print('\n'.join(lines) if lines else 'Every promise was kept')
    return 1 if lines else 0


def _measured(options: argparse.Namespace) -> dict[str, Any]:
    begin = time.monotonic()
    counts = QUICK if options.quick else FULL
    run = measure(options.part or PARTS, options.loss or LOSSES, counts)
    file = save(run, f'lossy-{"quick" if options.quick else "full"}')
    print(f'measured in {(time.monotonic() - begin) / 60.0:.1f} minutes: '
          f'{file.relative_to(ROOT)}\n')
    if not (options.quick or options.part or options.loss):
        write_page(run)
    return run


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog='benchmarks.lossy_link', description=__doc__)
    parser.add_argument('--quick', action='store_true', help='measure little')
    parser.add_argument('--part', action='append', choices=PARTS, help='this part alone')
    parser.add_argument(
        '--loss', action='append', type=int, metavar='PERCENT', help='this loss alone')
    parser.add_argument(
        '--of', type=Path, nargs='+', metavar='FILE',
        help='show these runs together, on the page too; measure nothing')
    return parser.parse_args(arguments)


if __name__ == '__main__':
    sys.exit(main())
