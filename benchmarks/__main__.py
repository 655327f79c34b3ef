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
"""Measure, print the tables, and compare with thresholds; ``make bench`` runs this."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import json
from pathlib import Path
import sys
import time
from typing import Any

from benchmarks import ROOT
from benchmarks.figures import figures, judge
from benchmarks.run import (
    FULL,
    measured_on,
    QUICK,
    RESULTS,
    save,
    Scale,
    today,
    write_measured,
)
from benchmarks.tables import Table, tables
from program import restore_signals
from ros_domain import isolate_ros

#: The run that the documentation shows.
REFERENCE = RESULTS / 'reference.json'
PAGE = ROOT / 'docs' / 'benchmarks.md'


def measure(scale: Scale) -> dict[str, Any]:
    """Run all measurements, and return the results as plain data."""
    # Called before any module imports rclpy.
    isolate_ros()
    # Programs that are started in the background of a shell ignore SIGINT.
    restore_signals()
    from benchmarks import machine, planning, startup_shutdown, timing
    described = machine.describe()
    begin = time.monotonic()
    run = {
        'date': today(),
        'moves': {str(rate): count for rate, count in scale.moves.items()},
        'machine': described,
        'starts': startup_shutdown.measure_starts(scale),
        'signals': startup_shutdown.measure_signals(scale),
        'firsts': startup_shutdown.measure_firsts(scale),
        'in_step': startup_shutdown.measure_in_step(scale),
        'timing': timing.measure_timing(scale),
        'planning': planning.measure_planning(scale.plans),
        'flows': planning.measure_flows(),
        'exactness': planning.measure_exactness()}
    print(f'measured in {(time.monotonic() - begin) / 60.0:.1f} minutes\n')
    return run


def write_page(shown: list[Table], run: dict[str, Any]) -> None:
    """Write the tables of a run to the documentation page."""
    counts = ', '.join(f'{count} at {rate} Hz' for rate, count in run['moves'].items())
    head = f'{measured_on(run)}  Movements of one second by each loop: {counts}.'
    measured = '\n'.join([head, '', *(table.markdown() for table in shown)])
    write_measured(PAGE, measured)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure according to the arguments; return 1 if a threshold was missed, else 0."""
    parser = argparse.ArgumentParser(prog='benchmarks', description=__doc__)
    parser.add_argument('--quick', action='store_true', help='measure little; leaves docs alone')
    parser.add_argument('--no-bars', action='store_true', help='a missed threshold is no failure')
    parser.add_argument('--of', type=Path, metavar='FILE', help='show this run, measure nothing')
    options = parser.parse_args(arguments)
    if options.of:
        file, run = options.of.resolve(), json.loads(options.of.read_text())
    else:
        run = measure(QUICK if options.quick else FULL)
        file = save(run, 'quick' if options.quick else 'full')
    shown = tables(run)
    print('\n'.join(table.text() for table in shown))
    if not options.quick:
        write_page(shown, run)
        REFERENCE.write_bytes(file.read_bytes())
    print(f'All of it: {file.relative_to(ROOT)}')
    missed = [result.threshold.what for result in judge(figures(run)) if not result.is_met]
    print(f'Missed: {"; ".join(missed)}' if missed else 'Every threshold is held')
    return 0 if options.no_bars or not missed else 1


if __name__ == '__main__':
    sys.exit(main())
