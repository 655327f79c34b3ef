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
"""Run the trials of the console matrix, and print the table; ``make console-matrix`` does so."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
import json
import sys
import time
from typing import Any

from benchmarks import ROOT
from benchmarks.console_matrix.trial import find_violations, LOAD_FACTOR, matrix, Trial
from benchmarks.run import measured_on, RESULTS, today, write_measured
import chromium
from program import restore_signals
from stall_observer import MAX_REPEATED, too_many

REFERENCE = RESULTS / 'console_matrix.json'
PAGE = ROOT / 'docs' / 'console.md'
BEGIN = '<!-- console matrix: written by make console-matrix, changes here are lost -->'
END = '<!-- console matrix: end -->'


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the trials that the arguments name; return 1 if there is a violation, else 0."""
    options = _parser().parse_args(arguments)
    if not chromium.IS_HERE:
        print(chromium.MISSING, file=sys.stderr)
        return 2
    from kachaka_simple_control.ros.dds_transport import use_localhost_only
    # Called before rclpy is imported, so that no other robot receives these messages.
    use_localhost_only()
    restore_signals()
    from benchmarks import machine
    from benchmarks.console_matrix.rows import ROWS
    from benchmarks.console_matrix.runner import run
    rows = [(row, count) for row in ROWS if (count := row.quick if options.quick else row.full)
            and (not options.rows or any(part in row.expectation.what for part in options.rows))]
    described, began = machine.describe(), time.monotonic()
    results = run(rows, options.quick)
    print(f'tried in {(time.monotonic() - began) / 60.0:.1f} minutes\n')
    print(matrix([row.expectation for row, _ in rows], results.trials).text())
    tried = sum(map(len, results.trials.values()))
    print(f'trials: {tried}, repeated because the machine stood still: {len(results.repeated)}')
    if options.quick:
        left_out = [row.expectation.what for row in ROWS if not row.quick]
        print(f'Left out of the quick form: {"; ".join(left_out)}.\nLimits are {LOAD_FACTOR:g} '
              'times as long, for the machine may be busy with other things.')
    elif not options.rows or options.merge:
        known = json.loads(REFERENCE.read_text())['rows'] if options.merge else {}
        tried_rows = {what: [*map(asdict, trials)] for what, trials in results.trials.items()}
        data = {'date': today(), 'machine': described, 'rows': {**known, **tried_rows}}
        REFERENCE.write_text(json.dumps(data) + '\n')
        write_measured(PAGE, measured(data), BEGIN, END)
    found = [text for row, _ in rows
             for text in find_violations(
                 row.expectation, results.trials[row.expectation.what], options.quick)]
    if too_many(len(results.repeated), tried):
        found.append(f'more than {MAX_REPEATED:.0%} of the trials were repeated')
    print('\n'.join(['Not kept:', *found]) if found else 'Every promise is kept')
    return 1 if found else 0


def measured(data: dict[str, Any]) -> str:
    """Return the part of the page that shows the results of a file."""
    from benchmarks.console_matrix.rows import ROWS
    trials = {what: [*map(Trial.from_json, row)] for what, row in data['rows'].items()}
    table = matrix([row.expectation for row in ROWS], trials)
    return '\n'.join([measured_on(data), '', table.markdown()])


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='benchmarks.console_matrix', description=__doc__)
    add = parser.add_argument
    add('--quick', action='store_true', help='try each row once; writes no results')
    add('--rows', nargs='+', metavar='PART', help='only rows with a part of their name in these')
    add('--merge', action='store_true', help='keep the other rows of the reference')
    return parser


if __name__ == '__main__':
    sys.exit(main())
