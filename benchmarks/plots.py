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
"""Draw a run; ``python -m benchmarks.plots RUN.json FOLDER`` (needs matplotlib, and no ROS)."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
import json
import math
from pathlib import Path
from typing import Any

from benchmarks.figures import Figure, figures, find, signal_groups, where, zeros  # noqa: I100
from benchmarks.tables import NAMES
import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Picture

mpl.use('agg')

#: The colours of Okabe and Ito, which colour-blind people can distinguish; markers differ, too.
STYLES = {
    'ours': {'color': '#0072B2', 'marker': 'o'},
    'lesson': {'color': '#D55E00', 'marker': 's'},
    'timer': {'color': '#009E73', 'marker': '^'},
    'rate': {'color': '#CC79A7', 'marker': 'D'},
    'floor': {'color': '#555555', 'marker': 'x'},
}


def draw_errors(axes: Axes, run: dict[str, Any]) -> None:
    """Draw the error of each movement."""
    entries = [entry for entry in run['timing'] if not entry['busy']]
    rates = sorted({entry['rate'] for entry in entries})
    for entry in entries:
        loop = LOOPS_DRAWN.index(entry['loop'])
        errors = [max(100.0 * abs(error), 1e-4) for error in entry['errors']]
        middle = rates.index(entry['rate']) + 0.17 * (loop - 2)
        axes.plot(
            _spread(middle, 0.1, len(errors)), errors, linestyle='', markersize=3.5, alpha=0.7,
            label=NAMES[entry['loop']] if entry['rate'] == rates[0] else None,
            **STYLES[entry['loop']])
    axes.set_xticks(range(len(rates)), [f'{rate} Hz' for rate in rates])
    axes.set_yscale('log')
    axes.set(title='Error of each 1 s movement, on the wire', ylabel='displacement error [%]')


def draw_by_rate(
        title: str, label: str, names: Sequence[str]) -> Callable[[Axes, dict[str, Any]], None]:
    """Return a function that draws the sum of the named figures over the rate."""
    def draw(axes: Axes, run: dict[str, Any]) -> None:
        found = figures(run)
        rates = sorted({entry['rate'] for entry in run['timing'] if not entry['busy']})
        for loop in LOOPS_DRAWN:
            values = [sum(_value(found, f'{what} {where(rate, 0)}', loop) for what in names)
                      for rate in rates]
            axes.plot(rates, values, label=NAMES[loop], markersize=5, **STYLES[loop])
        axes.set_xscale('log')
        axes.set_xticks(rates, [str(rate) for rate in rates])
        axes.minorticks_off()
        axes.set_ylim(bottom=0.0)
        axes.set(title=title, xlabel='rate [Hz]', ylabel=label)
    return draw


def draw_signals(axes: Axes, run: dict[str, Any]) -> None:
    """Draw the share of programs that have sent a zero, over the time since the signal."""
    groups = {
        f'{NAMES[loop]}: {" or ".join(names)}{", loaded" if busy else ""}':
            (loop, zeros(run['starts'], loop, busy, names))
        for loop, busy, names in signal_groups(run['starts'])}
    groups['ours: SIGINT, all to one process'] = (
        'ours', [math.inf if value is None else value for value in run['signals']])
    styles = {'ours': iter(['-', '--', ':', '-.', (0, (1, 4))])}
    for label, (loop, times) in groups.items():
        came = sorted(1e3 * value for value in times if math.isfinite(value))
        parts = [100.0 * (number + 1) / len(times) for number in range(len(came))]
        axes.step([0.1, *came, 1500.0], [0.0, *parts, parts[-1] if parts else 0.0], where='post',
                  label=label if came else f'{label} (never)', color=STYLES[loop]['color'],
                  linestyle=next(styles.get(loop, iter(['-']))))
    axes.set_xscale('log')
    axes.set(title='From a signal to the first zero', xlabel='time after the signal [ms]',
             ylabel='programs that have sent a zero [%]', ylim=(-3, 103))


def draw_firsts(axes: Axes, run: dict[str, Any]) -> None:
    """Draw the part of the lesson's first movement that arrived at the robot."""
    places = [(late, loop) for late in (False, True) for loop in ('ours', 'lesson')]
    for number, (late, loop) in enumerate(places):
        arrived = [entry['arrived'] for entry in run['firsts']
                   if (entry['late'], entry['loop']) == (late, loop)]
        axes.plot(_spread(number, 0.3, len(arrived)), arrived, linestyle='', alpha=0.7,
                  markersize=6, **STYLES[loop])
    axes.axhline(0.1, color='#999999', linewidth=1.0, linestyle='--', zorder=0)
    axes.set_xticks(range(len(places)), [
        f'{NAMES[loop]},\nrobot {"later" if late else "there before"}' for late, loop in places])
    axes.set(title="What arrived of the lesson's first movement",
             ylabel='displacement [m]; asked for: 0.1', ylim=(-0.005, 0.12), xlim=(-0.5, 3.5))


LOOPS_DRAWN = tuple(STYLES)
PICTURES = {
    'bench_error.png': draw_errors,
    'bench_jitter.png': draw_by_rate(
        'Difference of an interval from the period', '99th percentile [ms]', ['jitter, p99,']),
    'bench_lost.png': draw_by_rate(
        'Ticks that came late or were lost', 'part of all ticks [%]',
        ['late ticks', 'lost ticks']),
    'bench_cpu.png': draw_by_rate(
        'CPU a command, process and helpers', 'CPU a command [us]',
        ['CPU a command, the process,', 'CPU a command, its helpers,']),
    'bench_signals.png': draw_signals,
    'bench_first.png': draw_firsts,
}


def draw_all(run: dict[str, Any], folder: Path) -> None:
    """Draw all plots of a run in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in PICTURES.items():
        picture = Picture(figsize=(7.5, 4.2), layout='constrained')
        axes = picture.add_subplot()
        draw(axes, run)
        axes.grid(visible=True, color='#dddddd', linewidth=0.6)
        axes.set_axisbelow(True)
        axes.spines[['top', 'right']].set_visible(False)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize='small', frameon=False, loc='center left',
                        bbox_to_anchor=(1.0, 0.5))
        # No version in the file, so that the same data gives the same bytes.
        picture.savefig(folder / name, dpi=130, metadata={'Software': None})


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw the run that the arguments name."""
    parser = argparse.ArgumentParser(
        prog='benchmarks.plots', description='Draw a run of the benchmarks.')
    parser.add_argument('run', type=Path)
    parser.add_argument('folder', type=Path)
    options = parser.parse_args(arguments)
    draw_all(json.loads(options.run.read_text()), options.folder)


def _spread(middle: float, width: float, count: int) -> list[float]:
    if count == 1:
        return [middle]
    return [middle + width * (number / (count - 1) - 0.5) for number in range(count)]


def _value(found: Sequence[Figure], what: str, loop: str) -> float:
    value = find(found, what, loop)
    return math.nan if value is None else value


if __name__ == '__main__':
    main()
