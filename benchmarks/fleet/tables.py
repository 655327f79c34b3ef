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
"""The tables of a run of the fleet benchmark, for a terminal and for its page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from benchmarks.figures import NEVER
from benchmarks.fleet.calculation import Cost, costs
from benchmarks.fleet.figures import results
from benchmarks.fleet.stops import BRIDGE, GO_ON, GUARDIAN, MISSING, SIGNALS
from benchmarks.fleet.two_fleets import OFFSET
from benchmarks.tables import number, Table, threshold_table
from kachaka_simple_control.analysis.message_timing import median


def tables(run: dict[str, Any], is_partial: bool = False) -> list[Table]:
    """Return the tables of a run; of a part of one, without the bars of the others."""
    judged = [result for result in results(run) if result.value is not None or not is_partial]
    return [
        threshold_table(judged), _in_step(run['in_step']), _many(run['fleets']),
        _stops(run['stops']), _pauses(run['pauses']), _two_fleets(run['two_fleets']),
        _beside(run['fleets'], run['programs']), _standing_by(run['standing_by']),
        _costs(costs(run['fleets'], run['standing_by']))]


def _milliseconds(seconds: float | None) -> str:
    return number(NEVER if seconds is None else 1e3 * seconds)


def _quantiles(entry: dict[str, Any], key: str) -> str:
    found = entry.get(key, {})
    return ' / '.join(_milliseconds(found.get(name)) for name in ('median', 'p99', 'worst'))


def _cpu(entry: dict[str, Any]) -> str:
    return f'{number(entry.get("cpu"))} + {number(entry.get("guardian_cpu"))}'


def _in_step(entries: Sequence[dict[str, Any]]) -> Table:
    return Table(
        'The square in step, all around once at 20 Hz: one process, and its guardian',
        ('robots', 'odometry [Hz]', 'first velocities apart [ms]',
         'later boundaries apart, median / p99 / worst [ms]',
         'as much work in a bare loop, likewise', 'lost of', 'CPU [% of a core]',
         'memory [MB]', 'Python threads', 'all threads', 'found to t = 0 [s]',
         'start to t = 0 [s]'),
        tuple((
            str(entry['robots']), f'{entry["odometry"]:g}' if entry['odometry'] else 'none',
            _milliseconds(entry['first_apart']), _quantiles(entry, 'apart'),
            _quantiles(entry, 'apart_alone'),
            f'{entry["lost"]} of {entry["ticks"] * entry["robots"]}', _cpu(entry),
            number(entry.get('memory')),
            str(entry['python_threads']), str(entry.get('threads', '-')),
            number(entry['found']), number(entry['start'])) for entry in entries))


def _many(entries: Sequence[dict[str, Any]]) -> Table:
    return Table(
        'Movements of one second to and fro at 10 Hz',
        ('robots', 'late, median / p99 / worst [ms]', 'lost of',
         'displacement error, median / worst [%]', 'CPU [% of a core]', 'memory [MB]',
         'CPU a robot [%]', 'memory a robot [MB]'),
        tuple((
            str(entry['robots']), _quantiles(entry, 'late'),
            f'{entry["lost"]} of {entry["ticks"] * entry["robots"]}',
            ' / '.join(number(100.0 * error) for error in entry['errors']) or '-', _cpu(entry),
            number(entry.get('memory')), _share(entry, _total), _share(entry, _memory))
            for entry in entries))


def _total(entry: dict[str, Any]) -> float | None:
    return entry['cpu'] + entry['guardian_cpu'] if 'cpu' in entry else None


def _memory(entry: dict[str, Any]) -> float | None:
    return entry.get('memory')


def _share(entry: dict[str, Any], value: Any) -> str:
    found = value(entry)
    return number(None if found is None else found / entry['robots'])


def _stops(entries: Sequence[dict[str, Any]]) -> Table:
    rows = []
    for what in (*SIGNALS, GUARDIAN, BRIDGE, GO_ON, MISSING):
        found = [entry for entry in entries if entry['what'] == what]
        times = [NEVER if entry['zero'] is None else entry['zero'] for entry in found]
        if found:
            rows.append((
                what, str(len(found)),
                '-' if what == MISSING else
                f'{_milliseconds(median(times))} / {_milliseconds(max(times))}',
                str(sum(entry['moved_after'] for entry in found)),
                ', '.join(sorted({'none' if entry['code'] is None else str(entry['code'])
                                  for entry in found}))))
    return Table(
        'Until the last robot has its first zero; of a killed bridge, until the others have '
        'theirs after its own; with go_on, until its own robot has one',
        ('what happens', 'times', 'to the first zero, median / worst [ms]', 'motion after',
         'exit code'), tuple(rows))


def _pauses(entries: Sequence[dict[str, Any]]) -> Table:
    return Table(
        'The square, paused: ten robots with limits of their own',
        ('arrived at their rests apart [ms]', 'left the next rest apart [ms]',
         'late by the pause [s]', 'from the planned end [mm]', '[degrees]'),
        tuple((_milliseconds(entry['arrived_apart']), _milliseconds(entry['apart']),
               number(entry['late']), number(1e3 * entry['distance']), number(entry['angle']))
              for entry in entries))


def _two_fleets(entry: dict[str, Any]) -> Table:
    head = ('', 'measured')
    title = (f'Two fleets with one start in two network namespaces, clocks {1e3 * OFFSET:g} ms '
             'apart, by a discovery server, without multicast')
    if 'reason' in entry:
        return Table(title, head, (('not measured', entry['reason']),))
    return Table(title, head, (
        ('robots', str(entry['robots'])),
        ('first velocities apart [ms]', _milliseconds(entry.get('first_apart'))),
        ('later boundaries apart, median / p99 / worst [ms]', _quantiles(entry, 'apart')),
        ('server killed in mid-drive: drove on for [s], exit code',
         f'{number(entry["after_kill"])}, {entry["code"]}'),
        ('somebody else sends in the other namespace: exit code', str(entry['foreign_code'])),
        ('it says', entry['foreign_said'].replace('|', '/'))))


def _beside(fleets: Sequence[dict[str, Any]], programs: Sequence[dict[str, Any]]) -> Table:
    rows = []
    for entry in programs:
        fleet = next((one for one in fleets if one['robots'] == entry['robots']), {})
        rows.append((
            str(entry['robots']), number(_total(fleet)), number(_total(entry)),
            number(_memory(fleet)), number(_memory(entry)), str(entry['lost'])))
    return Table(
        'A fleet, and as many programs of one robot, each with its guardian, at 10 Hz',
        ('robots', 'CPU of the fleet [% of a core]', 'of the programs', 'memory of the fleet [MB]',
         'of the programs', 'programs that were held up'), tuple(rows))


def _standing_by(entries: Sequence[dict[str, Any]]) -> Table:
    return Table(
        'What stands by on a network: programs, guardians, and bridges without odometry',
        ('robots', 'programs', 'participants', 'memory of the programs [MB]',
         'until all have found each other [kB]', 'afterwards [packets/s]', '[kB/s]'),
        tuple((
            str(entry['robots']), str(entry['programs']), str(entry['participants']),
            number(entry['memory']), number(entry['found_size'] / 1e3),
            number(entry['packets']), number(entry['size'] / 1e3)) for entry in entries))


def _costs(found: Sequence[Cost]) -> Table:
    def cell(cost: Cost, value: float) -> str:
        return number(value) if cost.is_measured else _about(value)

    return Table(
        'What robots cost at 10 Hz, and odometry at 10 Hz; ≈: calculated',
        ('robots', 'programs', 'CPU [% of a core]', 'memory [MB]', 'CPU a robot', 'MB a robot',
         'participants, a bridge on each robot', 'to find each other [MB]', 'afterwards [kB/s]'),
        tuple((
            str(cost.robots), str(cost.programs), cell(cost, cost.cpu), cell(cost, cost.memory),
            cell(cost, cost.cpu / cost.robots), cell(cost, cost.memory / cost.robots),
            str(cost.participants), _about(cost.finding), _about(cost.traffic))
            for cost in found))


def _about(value: float | None) -> str:
    return '-' if value is None else f'≈ {number(value)}'
