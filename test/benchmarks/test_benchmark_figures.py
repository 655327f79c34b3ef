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
"""The computations of the benchmarks: received messages, thresholds, page, comparison."""

import json
import math

from benchmarks.compare import compare, differences, main
from benchmarks.figures import figures, judge, THRESHOLDS
from benchmarks.run import BEGIN, END, updated
from benchmarks.tables import tables
from benchmarks.wire import (
    displacement,
    jitters,
    movements,
    relative_error,
    Row,
    Ticks,
    ticks,
)
from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.analysis.message_timing import median, quantile
import pytest

#: Times of some 1e9 s, in double precision, are known to a quarter of a microsecond.
CLOCK = 1e9
RATES = st.sampled_from([10, 20, 50, 100, 1000])
TEXT = st.text()


def moved(rate, count, velocity=0.1, start=CLOCK):
    """Return the messages of a movement that keeps its times, and the zero that ends it."""
    rows = [Row(start + tick / rate, velocity) for tick in range(count)]
    return [*rows, Row(start + count / rate, 0.0)]


@given(RATES, st.integers(1, 50), st.sampled_from([0.1, -0.3]))
def test_a_movement_on_time_is_exact(rate, count, velocity):
    rows = moved(rate, count, velocity)
    duration = count / rate
    assert displacement(rows) == pytest.approx(velocity * duration, abs=1e-7)
    assert relative_error(rows, duration) == pytest.approx(0.0, abs=1e-6 / duration)
    assert max(jitters(rows, 1.0 / rate), default=0.0) < 1e-6
    assert ticks(rows, 1.0 / rate, duration) == Ticks(count, 0, 0)


@given(st.lists(st.floats(0.001, 0.2), min_size=1), st.sampled_from([0.1, -0.3]))
def test_a_velocity_counts_until_the_next_message(intervals, velocity):
    times = [sum(intervals[:count]) for count in range(len(intervals) + 1)]
    rows = [Row(at, velocity) for at in times]
    assert displacement(rows) == pytest.approx(velocity * sum(intervals))


@given(st.integers(2, 60), st.data())
def test_a_message_that_is_missing_is_a_lost_tick(count, data):
    rows = moved(100, count)
    del rows[data.draw(st.integers(1, count - 1))]
    assert ticks(rows, 0.01, count / 100) == Ticks(count, 0, 1)
    assert max(jitters(rows, 0.01), default=0.0) == pytest.approx(
        0.01 if count > 2 and rows[-1].time - rows[-2].time < 0.015 else 0.0, abs=1e-5)


@pytest.mark.parametrize('delay, late, lost', [
    (0.001, 0, 0), (0.003, 1, 0), (0.0049, 1, 0), (0.0051, 0, 1)])
def test_a_tick_is_late_from_a_quarter_of_a_period_on_and_lost_from_half(delay, late, lost):
    rows = moved(100, 10)
    rows[4] = rows[4]._replace(time=rows[4].time + delay)
    assert ticks(rows, 0.01, 0.1) == Ticks(10, late, lost)


@given(st.lists(st.tuples(st.sampled_from([0.0, 0.1, -0.1]), st.integers(1, 4)), max_size=12))
def test_movements_hold_every_message_that_moves(stretches):
    velocities = [velocity for velocity, count in stretches for _ in range(count)]
    rows = [Row(float(at), velocity) for at, velocity in enumerate(velocities)]
    found = movements(rows)
    inside = [row for movement in found for row in movement
              if row.velocity == movement[0].velocity]
    assert inside == [row for row in rows if row.velocity]
    for movement in found:
        assert len({row.velocity for row in movement[:-1]}) <= 1
    assert sum(map(displacement, found)) == pytest.approx(displacement(rows))


def test_what_never_came_is_the_worst():
    assert quantile([0.1, math.inf, 0.2], 1.0) == math.inf
    assert median([0.1, math.inf, 0.2]) == 0.2
    assert median([math.inf, math.inf]) == math.inf


def a_run(**changes):
    """Return the data of a small run that meets every threshold."""
    entry = {
        'rate': 10, 'busy': 0, 'errors': [0.0001, -0.0002], 'due': 20, 'late': 1, 'lost': 0,
        'seen': 22, 'jitter': {'0.5': 1e-5, '0.99': 1e-4, '1.0': 1e-3}, 'sent': 22.0,
        'thread': 0.004, 'process': 0.005, 'helpers': 0.0, 'memory': 70.0, 'helper_memory': 0.0,
        'faults': []}
    timing = [{**entry, 'loop': loop, 'rate': rate, 'thread': cost}
              for rate in (10, 100) for loop, cost in (('ours', 0.004), ('lesson', 0.011))]
    starts = [{'loop': 'ours', 'busy': 0, 'signal': name, 'start': 2.0, 'match': 0.6,
               'zero': 0.001} for name in ('SIGINT', 'SIGKILL', 'SIGSTOP')]
    starts.append({**starts[0], 'loop': 'lesson', 'zero': None})
    firsts = [{'loop': loop, 'late': late, 'arrived': 0.1}
              for loop in ('ours', 'lesson') for late in (False, True)]
    in_step = [{'robots': count, 'start': 1.5, 'apart': 0.001 * count / 10, 'threads': 9}
               for count in (1, 2, 10)]
    return {'date': '2026-01-01', 'moves': {}, 'machine': {'cores': '2'}, 'timing': timing,
            'starts': starts, 'signals': [0.001, 0.002], 'firsts': firsts, 'in_step': in_step,
            'planning': [{'length': 3600, 'steps': 9, 'segments': 99, 'time': 0.5, 'memory': 9.0}],
            'exactness': [
                {'goal': 'turn', 'shape': 'S-curve', 'rate': 10, 'way': way, 'asked': 1.0,
                 'least': 1.0 - lost, 'most': 1.0}
                for way, lost in (('ours', 0.0), ('samples', 0.001))], **changes}


def test_a_good_run_meets_every_threshold():
    results = judge(figures(a_run()))
    assert [result.threshold for result in results] == list(THRESHOLDS)
    assert all(result.is_met for result in results)


@pytest.mark.parametrize('changes, missed', [
    ({'signals': [0.001, None]}, 1),
    ({'signals': []}, 1),
    ({'starts': []}, 5),
    ({'timing': []}, 3),
    ({'planning': []}, 1),
    ({'in_step': []}, 5),
    ({'in_step': [{'robots': 10, 'start': None, 'apart': None, 'threads': 13}]}, 5),
])
def test_what_never_came_or_was_not_measured_misses_its_threshold(changes, missed):
    results = judge(figures(a_run(**changes)))
    assert sum(not result.is_met for result in results) == missed


def test_a_threshold_relative_to_the_lesson_changes_with_it():
    run = a_run()
    run['timing'][-1]['thread'] = 0.006
    (missed,) = [result for result in judge(figures(run)) if not result.is_met]
    assert missed.threshold.what == 'CPU a command, the loop, at 100 Hz'
    assert missed.limit == pytest.approx(0.65e6 * 0.006 / 22)


def test_tables_show_what_never_came():
    text = '\n'.join(table.text() for table in tables(a_run()))
    (row,) = [line for line in text.splitlines() if line.startswith("the lesson's loop  SIGINT")]
    assert row.split()[-3:] == ['never', 'never', '1']


@given(TEXT, TEXT, TEXT, TEXT)
def test_only_the_measured_part_of_a_page_changes(before, old, after, new):
    for text in (before, old, after, new):
        if BEGIN in text or END in text:
            return
    page = updated(f'{before}{BEGIN}{old}{END}{after}', new)
    assert page == f'{before}{BEGIN}\n\n{new.strip()}\n\n{END}{after}'
    assert updated(page, new) == page


@pytest.mark.parametrize('page', ['', BEGIN, END + BEGIN, BEGIN + END + BEGIN + END])
def test_a_page_without_one_measured_part_is_refused(page):
    with pytest.raises(ValueError, match='the page must have one line'):
        updated(page, 'new')


def test_two_runs_are_compared_by_what_both_have(tmp_path, capsys):
    run, other = a_run(), a_run(firsts=[], machine={'cores': '4'}, signals=[0.004])
    assert all(row[-1] == '' for row in compare(run, run).rows)
    rows = {row[0]: row for row in compare(run, other).rows}
    assert rows['SIGINT to first zero, many in one process, worst'][2:] == (
        '2.00 ms', '4.00 ms', '+100 %')
    assert not [what for what in rows if 'first 0.1 m' in what]
    assert differences(run['machine'], other['machine']) == ['cores: 2 -> 4']
    files = [tmp_path / 'a.json', tmp_path / 'b.json']
    for file, data in zip(files, (run, other)):
        file.write_text(json.dumps(data))
    main([str(file) for file in files])
    assert '+100 %' in capsys.readouterr().out
