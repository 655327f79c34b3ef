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
"""Run the trials of the stop matrix, and print the table; ``make stop-matrix`` runs this."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
import itertools
import json
from pathlib import Path
import resource
import sys
import tempfile
import time
from typing import Any

from benchmarks import ROOT
from benchmarks.run import measured_on, RESULTS, save, today, write_measured
from benchmarks.stop_matrix.expectation import find_late_stops, find_violations, matrix, Trial
from benchmarks.stop_matrix.network import unavailable_reason
from benchmarks.stop_matrix.rows import CORE, ROWS
from benchmarks.stop_matrix.trial_setup import Row
from benchmarks.tables import Table
from program import restore_signals
from stall_observer import describe, MAX_REPEATED, Stall, StallObservers, too_many

#: The results that the documentation shows.
REFERENCE = RESULTS / 'stop_matrix.json'
PAGE = ROOT / 'docs' / 'safety.md'
BEGIN = '<!-- stop matrix: written by make stop-matrix, changes here are lost -->'
END = '<!-- stop matrix: end -->'


def measure(rows: Sequence[tuple[Row, int]], over_grpc: bool = False) -> dict[str, Any]:
    """Run trials."""
    from kachaka_simple_control.ros.dds_transport import use_localhost_only
    # Called before rclpy is imported, so that no other robot receives these messages.
    use_localhost_only()
    restore_signals()
    # A program that SIGQUIT ends would leave a core file.
    resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))
    from benchmarks import machine
    from benchmarks.stop_matrix.runner import run
    described, begin = machine.describe(), time.monotonic()
    results = run(rows, over_grpc)
    print(f'tried in {(time.monotonic() - begin) / 60.0:.1f} minutes\n')
    return {
        'date': today(), 'machine': described,
        'rows': {what: [*map(asdict, trials)] for what, trials in results.items()}}


def second_try(
        rows: Sequence[Row], data: dict[str, Any], stalls: Sequence[Stall],
        over_grpc: bool = False) -> tuple[dict[str, Any], list[str]]:
    """Repeat the rows in which the machine stalled during each trial with a violation."""
    trials, again = trials_of(data), []
    for row in rows:
        what = row.expectation.what
        met = [[stall for stall in stalls if stall.meets(trial.began, trial.ended)]
               for trial in trials.get(what, [])
               if violations([row], {what: [trial]}, under_load=True)]
        found = violations([row], trials, under_load=True)
        if found and met and all(met):
            again.append(row)
            print(f'REPEATED {"; ".join(found)}: {describe(itertools.chain(*met))}')
    print(f'rows: {len(rows)}, repeated because the machine stood still: {len(again)}')
    if again:
        data = merged(data, measure([(row, row.quick) for row in again], over_grpc))
    return data, ([f'more than {MAX_REPEATED:.0%} of the rows were repeated']
                  if too_many(len(again), len(rows)) else [])


def merged(old: dict[str, Any], new: dict[str, Any]) -> dict[str, Any]:
    """Return the new results, with the old results of the rows that the new ones lack."""
    return {**new, 'rows': {**old.get('rows', {}), **new['rows']}}


def for_reference(data: dict[str, Any]) -> dict[str, Any]:
    """Return what the page and its test need of the results: of equal messages, the first."""
    def kept(trials: list[dict[str, Any]]) -> list[dict[str, Any]]:
        said = [trial.get('message') for trial in trials]
        return [
            {name: round(value, 7) if isinstance(value, float) else value
             for name, value in trial.items()
             if name not in ('began', 'ended') and value != []
             and not (name == 'message' and value in said[:number])}
            for number, trial in enumerate(trials)]
    return {**data, 'rows': {what: kept(trials) for what, trials in data['rows'].items()}}


def trials_of(data: dict[str, Any]) -> dict[str, list[Trial]]:
    """Return the trials of the results, by the name of the row."""
    return {what: [*map(Trial.from_json, trials)] for what, trials in data['rows'].items()}


def violations(
        rows: Sequence[Row], trials: dict[str, list[Trial]], under_load: bool) -> list[str]:
    """Return the violations of the expectations, as sentences."""
    found = []
    for row in rows:
        tried = trials.get(row.expectation.what, [])
        found += find_violations(row.expectation, tried)
        found += find_late_stops(row.expectation, tried, under_load)
    return found


def write_page(table: Table, data: dict[str, Any]) -> None:
    """Write the table and the description of the machine to the page on safety."""
    text = '\n'.join([measured_on(data), '', table.markdown()])
    write_measured(PAGE, text, BEGIN, END)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the trials that the arguments name; return 1 if there is a violation, else 0."""
    options = _parser().parse_args(arguments)
    over_grpc = options.robot == 'grpc'
    known = [row for row in ROWS if not over_grpc or row.expectation.what in CORE]
    rows = [row for row in known if (row.quick if options.quick else row.full)
            and (not options.rows or any(part in row.expectation.what for part in options.rows))]
    if any(row.over_link for row in rows) and not options.of and (
            reason := unavailable_reason()):
        rows = [row for row in rows if not row.over_link]
        print(f'Rows over a link between two machines are left out: {reason}')
    excess: list[str] = []
    if options.of:
        data = json.loads(options.of.read_text())
    else:
        with tempfile.TemporaryDirectory() as seen:
            observers, begin = StallObservers(Path(seen)), time.monotonic()
            observers.start()
            data = measure(
                [(row, row.quick if options.quick else row.full) for row in rows], over_grpc)
            stalls = observers.between(begin, time.monotonic())
            observers.end()
        if options.quick:
            data, excess = second_try(rows, data, stalls, over_grpc)
        if options.merge and REFERENCE.exists() and not over_grpc:
            data = merged(json.loads(REFERENCE.read_text()), data)
        kind = ('quick' if options.quick else 'full') + '-grpc' * over_grpc
        save(data, f'stops-{kind}')
    trials = trials_of(data)
    table = matrix([row.expectation for row in ROWS], trials)
    print(table.markdown() if over_grpc else table.text())
    if options.quick:
        left_out = [row.expectation.what for row in known if row.full and not row.quick]
        print(f'Left out of the quick form: {"; ".join(left_out) or "nothing"}. Limits are ten '
              'times as long, for the machine may be busy with other things.')
    elif not over_grpc and (not options.rows or options.merge):
        # The page must show what the reference says, with its rounded figures.
        data = for_reference(data)
        write_page(matrix([row.expectation for row in ROWS], trials_of(data)), data)
        REFERENCE.write_text(json.dumps(data, separators=(',', ':')) + '\n')
    found = violations(rows, trials, under_load=options.quick) + excess
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
