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
"""Measure fleets, print the tables, and compare with bars; ``make fleet-bench`` runs this."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
import json
from pathlib import Path
import sys
import tempfile
import time
from typing import Any

from benchmarks import ROOT
from benchmarks.fleet.calculation import SENTENCE
from benchmarks.fleet.scale import FULL, QUICK, Scale
from benchmarks.run import measured_on, RESULTS, save, today, write_measured
from benchmarks.tables import Table
from program import restore_signals
from ros_domain import isolate_ros
from stall_observer import describe, Stall, StallObservers

#: The run that the documentation shows.
REFERENCE = RESULTS / 'fleet.json'
PAGE = ROOT / 'docs' / 'fleet.md'
BEGIN = '<!-- measured: written by make fleet-bench, changes here are lost -->'
#: The parts of a run, each with what it is without a measurement.
PARTS: dict[str, Any] = {
    'in_step': [], 'fleets': [], 'stops': [], 'pauses': [],
    'two_fleets': {'reason': 'left out'}, 'programs': [], 'standing_by': []}


def measure(scale: Scale, parts: Sequence[str]) -> dict[str, Any]:
    """Run measurements, and return the results as plain data."""
    # Called before any module imports rclpy.
    isolate_ros()
    # Programs that are started in the background of a shell ignore SIGINT.
    restore_signals()
    from benchmarks import machine
    from benchmarks.fleet.cost import measure_programs, measure_standing_by
    from benchmarks.fleet.drives import measure_in_step, measure_many
    from benchmarks.fleet.pauses import measure_pauses
    from benchmarks.fleet.stops import measure_stops
    from benchmarks.fleet.two_fleets import measure_two_fleets
    measures: dict[str, Callable[[Scale], Any]] = {
        'in_step': measure_in_step, 'fleets': measure_many, 'stops': measure_stops,
        'pauses': measure_pauses, 'two_fleets': measure_two_fleets,
        'programs': measure_programs, 'standing_by': measure_standing_by}
    described = machine.describe()
    begin = time.monotonic()
    spans: dict[str, tuple[float, float]] = {}
    found = dict(PARTS)
    with tempfile.TemporaryDirectory() as seen:
        observers = StallObservers(Path(seen))
        observers.start()
        for name in (name for name in PARTS if name in parts):
            start = time.monotonic()
            found[name] = measures[name](scale)
            spans[name] = start, time.monotonic()
        stalls = observers.between(begin, time.monotonic())
        observers.end()
    run = {'date': today(), 'machine': described, 'is_quick': scale is QUICK, **found}
    if scale is QUICK:
        for name in stalled_parts(run, spans, stalls):
            run[name] = measures[name](scale)
    print(f'measured in {(time.monotonic() - begin) / 60.0:.1f} minutes\n')
    return run


def stalled_parts(
        run: dict[str, Any], spans: Mapping[str, tuple[float, float]],
        stalls: Sequence[Stall]) -> list[str]:
    """Return the parts that missed a bar, and in whose time the machine stood still."""
    from benchmarks.fleet.figures import missed_parts
    found = []
    for name in missed_parts(run):
        if met := [stall for stall in stalls if name in spans and stall.meets(*spans[name])]:
            print(f'REPEATED {name}: {describe(met)}')
            found.append(name)
    return found


def page_text(shown: Sequence[Table], run: dict[str, Any]) -> str:
    """Return the part of the page that shows a run."""
    return '\n'.join([
        measured_on(run), '', *(table.markdown() for table in shown if table.rows), SENTENCE])


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure according to the arguments; return 1 if a bar was missed, else 0."""
    options = _parser().parse_args(arguments)
    parts = options.parts or [*PARTS]
    if options.of:
        run = json.loads(options.of.read_text())
    else:
        run = measure(QUICK if options.quick else FULL, parts)
        if not options.quick and options.parts and REFERENCE.exists():
            run = {**json.loads(REFERENCE.read_text()), **{
                name: run[name] for name in ('date', 'machine', *parts)}}
        save(run, f'fleet-{"quick" if options.quick else "full"}')
    from benchmarks.fleet.figures import results
    from benchmarks.fleet.tables import tables
    shown = tables(run, bool(options.parts))
    print('\n'.join(table.text() for table in shown if table.rows))
    if not (options.quick or options.of):
        write_measured(PAGE, page_text(shown, run), BEGIN)
        REFERENCE.write_text(json.dumps(run, separators=(',', ':')) + '\n')
    missed = [result.threshold.what for result in results(run)
              if not result.is_met and (result.value is not None or not options.parts)]
    print(f'Missed: {"; ".join(missed)}' if missed else 'Every bar is kept')
    return 0 if options.no_bars or not missed else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='benchmarks.fleet', description=__doc__)
    add = parser.add_argument
    add('--quick', action='store_true', help='measure little; leaves docs alone')
    add('--no-bars', action='store_true', help='a missed bar is no failure')
    add('--parts', nargs='+', choices=PARTS, help='measure only these; of the others, keep what '
        'the reference has')
    add('--of', type=Path, metavar='FILE', help='show this run, measure nothing')
    return parser


if __name__ == '__main__':
    sys.exit(main())
