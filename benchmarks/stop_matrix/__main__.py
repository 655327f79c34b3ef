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
"""Make the stop matrix."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from datetime import datetime, timezone
import json
from pathlib import Path
import resource
import signal
import sys
import time
from typing import Any

from benchmarks.page import updated
from benchmarks.stop_matrix.expectation import broken, too_slow
from benchmarks.stop_matrix.rows import CORE, Row, ROWS
from benchmarks.stop_matrix.table import matrix
from benchmarks.stop_matrix.trial import Trial
from benchmarks.tables import Table

ROOT = Path(__file__).resolve().parent.parent.parent
RESULTS = ROOT / 'benchmarks' / 'results'
#: The matrix that the page shows, kept with it.
REFERENCE = RESULTS / 'stop_matrix.json'
PAGE = ROOT / 'docs' / 'safety.md'
BEGIN = '<!-- stop matrix: written by make stop-matrix, changes here are lost -->'
END = '<!-- stop matrix: end -->'


def measure(rows: Sequence[tuple[Row, int]], over_grpc: bool = False) -> dict[str, Any]:
    """
    Try rows.

    :param rows: the rows, and how often each is tried
    :param over_grpc: whether robots are to be reached over gRPC, by a bridge
    :returns: the matrix, plain data
    """
    from kachaka_simple_control.ros.dds_transport import use_localhost_only
    # Before anything loads rclpy: no robot elsewhere may hear this.
    use_localhost_only()
    # In the background of a shell Ctrl+C is ignored, and would be by all that is started here.
    for signum in (signal.SIGINT, signal.SIGQUIT, signal.SIGHUP):
        if signal.getsignal(signum) == signal.SIG_IGN:
            signal.signal(signum, signal.SIG_DFL)
    # What ends by SIGQUIT would leave a core behind.
    resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))
    from benchmarks import machine
    from benchmarks.stop_matrix.runner import run
    described, begin = machine.describe(), time.monotonic()
    seen = run(rows, over_grpc)
    print(f'tried in {(time.monotonic() - begin) / 60.0:.1f} minutes\n')
    return {
        'date': f'{datetime.now(timezone.utc):%Y-%m-%d}', 'machine': described,
        'rows': {what: [trial.data() for trial in trials] for what, trials in seen.items()}}


def second_try(
        rows: Sequence[Row], run: dict[str, Any], over_grpc: bool = False) -> dict[str, Any]:
    """
    Try rows again that did not keep their promise: the machine may have been busy.

    :param rows: the rows that were tried
    :param run: what was seen
    :param over_grpc: whether robots are to be reached over gRPC, by a bridge
    :returns: what was seen the second time; an empty matrix if all was kept
    """
    seen = trials_of(run)
    again = [row for row in rows if breaches([row], seen, wide=True)]
    if not again:
        return {**run, 'rows': {}}
    print('Tried again:', *breaches(again, seen, wide=True), sep='\n')
    return measure([(row, row.quick) for row in again], over_grpc)


def merged(old: dict[str, Any], new: dict[str, Any]) -> dict[str, Any]:
    """
    Put the rows of a new matrix in place of those of an old one.

    :param old: a matrix; empty for none
    :param new: a matrix, which may have some rows only
    :returns: the matrix of both
    """
    return {**new, 'rows': {**old.get('rows', {}), **new['rows']}}


def trials_of(matrix_data: dict[str, Any]) -> dict[str, list[Trial]]:
    """
    Return what was seen.

    :param matrix_data: a matrix
    :returns: the trials, by the name of the row
    """
    return {what: [Trial.of(data) for data in trials]
            for what, trials in matrix_data['rows'].items()}


def breaches(rows: Sequence[Row], seen: dict[str, list[Trial]], wide: bool) -> list[str]:
    """
    Tell what was not kept.

    :param rows: the rows that were tried
    :param seen: what was seen
    :param wide: whether bars are ten times as wide
    :returns: sentences; nothing if all was kept
    """
    found = []
    for row in rows:
        trials = seen.get(row.promise.what, [])
        found += broken(row.promise, trials) + too_slow(row.promise, trials, wide)
    return found


def write_page(table: Table, run: dict[str, Any]) -> None:
    """
    Put the matrix on the page.

    :param table: the matrix
    :param run: its data
    """
    machine = Table('Measured on', ('', ''), tuple(run['machine'].items()))
    head = f'Measured on {run["date"]}.'
    text = '\n'.join([head, '', table.markdown(), machine.markdown()])
    PAGE.write_text(updated(PAGE.read_text(), text, BEGIN, END))


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Do what the arguments say.

    :param arguments: the arguments without the program's name; None for those of the process
    :returns: the exit code: 1 if a promise was not kept
    """
    options = _parser().parse_args(arguments)
    over_grpc = options.robot == 'grpc'
    known = [row for row in ROWS if not over_grpc or row.promise.what in CORE]
    rows = [row for row in known if (row.quick if options.quick else row.full)
            and (not options.rows or any(part in row.promise.what for part in options.rows))]
    if options.of:
        run = json.loads(options.of.read_text())
    else:
        run = measure(
            [(row, row.quick if options.quick else row.full) for row in rows], over_grpc)
        if options.quick:
            run = merged(run, second_try(rows, run, over_grpc))
        if options.merge and REFERENCE.exists() and not over_grpc:
            run = merged(json.loads(REFERENCE.read_text()), run)
        kind = ('quick' if options.quick else 'full') + '-grpc' * over_grpc
        file = RESULTS / f'stops-{kind}-{datetime.now(timezone.utc):%Y%m%d-%H%M%S}.json'
        file.write_text(json.dumps(run, indent=1) + '\n')
    seen = trials_of(run)
    table = matrix([row.promise for row in ROWS], seen)
    print(table.markdown() if over_grpc else table.text())
    if options.quick:
        left_out = [row.promise.what for row in known if row.full and not row.quick]
        print(f'Left out of the quick form: {"; ".join(left_out) or "nothing"}. Bars are ten '
              'times as wide, for the machine may be busy with other things.')
    elif not over_grpc and (not options.rows or options.merge):
        write_page(table, run)
        REFERENCE.write_text(json.dumps(run) + '\n')
    found = breaches(rows, seen, wide=options.quick)
    print('\n'.join(['Not kept:', *found]) if found else 'Every promise is kept')
    return 1 if found else 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='benchmarks.stop_matrix', description=__doc__)
    add = parser.add_argument
    add('--quick', action='store_true', help='try each row once or twice; leaves docs alone')
    add('--rows', nargs='+', metavar='PART', help='only rows with a part of their name in these')
    add('--merge', action='store_true', help='keep the other rows of the reference')
    add('--robot', choices=('ros', 'grpc'), default='ros',
        help='ros: simulated within its bridge; grpc: simulated behind gRPC, shown by the bridge '
             'for a real one: core rows only, leaves docs alone (default: ros)')
    add('--of', type=Path, metavar='FILE', help='show this matrix, try nothing')
    return parser


if __name__ == '__main__':
    sys.exit(main())
