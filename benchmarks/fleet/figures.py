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
"""The figures of a run of the fleet benchmark, and the bars that they must keep."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
import math
from typing import Any

from benchmarks.figures import Figure, judge, NEVER, Threshold, ThresholdResult
from benchmarks.fleet.stops import BRIDGE, GO_ON, GUARDIAN, MISSING, SIGNALS

#: The exit codes of a fleet: complete, after a fault, after a robot did not come, by signals.
DONE, FAULTED, NO_ROBOT = 0, 1, 3
EXIT_CODES = {
    'SIGINT': 130, 'SIGKILL': 137, 'SIGSTOP': None, GUARDIAN: FAULTED, BRIDGE: FAULTED,
    GO_ON: FAULTED, MISSING: NO_ROBOT}
#: The largest relative displacement error of a robot that has ended its plan.
DISPLACEMENT = 0.005
#: How long a fleet is to drive on, at least, when its server of discovery was killed [s].
MOVED_ON = 1.0

#: The bars of a quick run are this many times higher, as it is for any machine, which may be busy.
#: What must not happen at all has the bar 0 there as well.
QUICK_SLACK = 10.0

THRESHOLDS = (
    Threshold('in step: first velocities apart', 5.0),
    Threshold('in step: later boundaries apart, p99', 5.0),
    Threshold('fleet and guardian, odometry at 10 Hz: CPU', 25.0),
    Threshold('fleet and guardian, odometry at 10 Hz: memory', 250.0),
    Threshold('fleet: Python threads', 14.0),
    Threshold('from the robots found to t = 0', 6.0),
    Threshold('many: lateness, p99', 10.0),
    Threshold('many: displacement error, median', 0.1),
    Threshold('many: displacement error, worst', 0.5),
    *(Threshold(f'{name} to the last first zero, worst', limit)
      for name, limit in zip(SIGNALS, (20.0, 100.0, 200.0))),
    Threshold('guardian killed: fleets not stopped', 0.0),
    Threshold('bridge killed: fault seen to the last first zero, worst', 50.0),
    Threshold('stopped fleets: velocities after the first zero', 0.0),
    Threshold('stopped fleets: wrong exit codes', 0.0),
    Threshold('robot missing: who moved, or what was not said', 0.0),
    Threshold('pause: distance from the planned end, worst', 1.0),
    Threshold('pause: angle from the planned end, worst', 0.1),
    Threshold('pause: apart at the next rest, worst', 20.0),
)
#: Judged where more than one size was measured, and where one was to go on: not in the quick form.
COST = (
    Threshold('cost a robot, the largest fleet over one robot: CPU', 1.0),
    Threshold('cost a robot, the largest fleet over one robot: memory', 1.0),
)
GOING_ON = (Threshold('go_on: robots or ticks that were lost', 0.0),)
#: Judged only where network namespaces are possible; the offset of the clocks is added.
TWO_FLEETS = (
    Threshold('two fleets: first velocities apart', 8.0),
    Threshold('two fleets: later boundaries apart, p99', 8.0),
    Threshold('two fleets, server killed: drives that ended', 0.0),
    Threshold('two fleets: foreign senders not seen', 0.0),
)


def results(run: dict[str, Any]) -> list[ThresholdResult]:
    """Compare the figures of a run with their bars."""
    thresholds = THRESHOLDS
    if len(run['fleets']) != 1:
        thresholds += COST
    if not run['stops'] or any(entry['what'] == GO_ON for entry in run['stops']):
        thresholds += GOING_ON
    if 'reason' not in run['two_fleets']:
        thresholds += TWO_FLEETS
    slack = QUICK_SLACK if run.get('is_quick') else 1.0
    return judge([*figures(run)], [
        replace(threshold, limit=slack * threshold.limit) for threshold in thresholds])


def figures(run: dict[str, Any]) -> Iterator[Figure]:
    """Return all figures of a run that have a bar."""
    for part, read in _parts().items():
        yield from read(run[part])


def missed_parts(run: dict[str, Any]) -> list[str]:
    """Return the parts of a run that have a figure beyond its bar."""
    missed = {result.threshold.what for result in results(run) if not result.is_met}
    return [part for part, read in _parts().items()
            if any(figure.what in missed for figure in read(run[part]))]


def _parts() -> dict[str, Callable[[Any], Iterator[Figure]]]:
    return {'in_step': _in_step, 'fleets': _many, 'stops': _stops, 'pauses': _pauses,
            'two_fleets': _two_fleets}


def _figure(what: str, value: float, unit: str) -> Figure:
    return Figure(what, 'ours', value, unit)


def _in_step(entries: Sequence[dict[str, Any]]) -> Iterator[Figure]:
    for entry in entries:
        if entry['odometry'] != 10.0:
            continue
        yield _figure('in step: first velocities apart', 1e3 * entry['first_apart'], 'ms')
        yield _figure('in step: later boundaries apart, p99', 1e3 * _part(entry, 'apart'), 'ms')
        what = 'fleet and guardian, odometry at 10 Hz'
        yield _figure(f'{what}: CPU', _cpu(entry), '% of a core')
        yield _figure(f'{what}: memory', entry.get('memory', NEVER), 'MB')
        yield _figure('fleet: Python threads', entry['python_threads'], '')
        yield _figure('from the robots found to t = 0', entry['found'], 's')


def _many(entries: Sequence[dict[str, Any]]) -> Iterator[Figure]:
    if not entries:
        return
    least, most = entries[0], entries[-1]
    yield _figure('many: lateness, p99', 1e3 * _part(most, 'late'), 'ms')
    for name, error in zip(('median', 'worst'), most['errors'] or (NEVER, NEVER)):
        yield _figure(f'many: displacement error, {name}', 100.0 * error, '%')
    if least is most:
        return
    what = 'cost a robot, the largest fleet over one robot'
    for key, value in (('CPU', _cpu), ('memory', lambda entry: entry.get('memory', NEVER))):
        first, last = (value(entry) / entry['robots'] for entry in (least, most))
        yield _figure(f'{what}: {key}', last / first if first else NEVER, '')


def _stops(entries: Sequence[dict[str, Any]]) -> Iterator[Figure]:
    def times(what: str) -> list[float]:
        return [NEVER if entry['zero'] is None else entry['zero'] for entry in entries
                if entry['what'] == what]

    for name in SIGNALS:
        if found := times(name):
            yield _figure(f'{name} to the last first zero, worst', 1e3 * max(found), 'ms')
    if found := times(GUARDIAN):
        yield _figure('guardian killed: fleets not stopped', sum(map(math.isinf, found)), '')
    if found := times(BRIDGE):
        yield _figure('bridge killed: fault seen to the last first zero, worst',
                      1e3 * max(found), 'ms')
    if not entries:
        return
    ended = [entry for entry in entries if entry['what'] not in (GO_ON, MISSING)]
    yield _figure('stopped fleets: velocities after the first zero',
                  sum(entry['moved_after'] for entry in ended), '')
    yield _figure('stopped fleets: wrong exit codes', sum(
        entry['code'] != EXIT_CODES[entry['what']] for entry in entries), '')
    if gone_on := [entry for entry in entries if entry['what'] == GO_ON]:
        yield _figure('go_on: robots or ticks that were lost', sum(
            entry['lost'] + (entry['error'] > DISPLACEMENT) + (entry['zero'] is None)
            for entry in gone_on), '')
    if missing := [entry for entry in entries if entry['what'] == MISSING]:
        yield _figure('robot missing: who moved, or what was not said', sum(
            entry['moved_after'] + ('ghost' not in entry['said']) for entry in missing), '')


def _pauses(entries: Sequence[dict[str, Any]]) -> Iterator[Figure]:
    if not entries:
        return
    ended = all(entry['ended'] for entry in entries)
    yield _figure('pause: distance from the planned end, worst', 1e3 * max(
        entry['distance'] for entry in entries) if ended else NEVER, 'mm')
    yield _figure('pause: angle from the planned end, worst', max(
        entry['angle'] for entry in entries) if ended else NEVER, 'degrees')
    apart = [NEVER if entry['apart'] is None else entry['apart'] for entry in entries]
    yield _figure('pause: apart at the next rest, worst', 1e3 * max(apart), 'ms')


def _two_fleets(entry: dict[str, Any]) -> Iterator[Figure]:
    if 'reason' in entry:
        return
    yield _figure('two fleets: first velocities apart',
                  1e3 * entry.get('first_apart', NEVER), 'ms')
    yield _figure('two fleets: later boundaries apart, p99', 1e3 * _part(entry, 'apart'), 'ms')
    yield _figure('two fleets, server killed: drives that ended',
                  entry['code'] != DONE or entry['after_kill'] < MOVED_ON, '')
    yield _figure('two fleets: foreign senders not seen', not entry['foreign_seen'], '')


def _part(entry: dict[str, Any], key: str) -> float:
    return float(entry.get(key, {}).get('p99', NEVER))


def _cpu(entry: dict[str, Any]) -> float:
    return float(entry.get('cpu', NEVER) + entry.get('guardian_cpu', NEVER))
