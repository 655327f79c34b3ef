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
"""The tables of ``docs/kachaka.md`` are those that the programs named there print."""

from __future__ import annotations

from pathlib import Path

from link_fault_cases import DOES, HEAD, line, Result, row, SCENARIOS, SPEED
from optional_libraries import optional_imports
from program import ROOT
import pytest

with optional_imports():
    from benchmarks.experiments import bridge_latency

PAGE = Path(ROOT, 'docs', 'kachaka.md')
pytestmark = pytest.mark.skipif(not PAGE.is_file(), reason='the documentation is not here')


def lines():
    """Return the lines of the page."""
    return PAGE.read_text().splitlines()


def test_faults_are_all_in_the_table_with_what_the_bridge_does():
    shown = lines()
    assert len(DOES) == len(SCENARIOS)
    begin = shown.index(line(*HEAD))
    for name, does, text in zip(SCENARIOS, DOES, shown[begin + 2:]):
        assert text.startswith(line(name, does)[:-1])


@pytest.mark.parametrize('result, cells', [
    (Result(0.03, 0, 0.0, ''), '| 30 mm | 0 ms | 0 |'),
    (Result(0.0302, 2, 0.1101, ''), '| 30 mm | 110 ms | 2 |'),
    (Result(0.0, 0, 0.0, ''), '| stood still |  | 0 |'),
    (Result(0.0, 1, 0.2, ''), '| 0 mm | 200 ms | 1 |')])
def test_a_fault_is_a_row(result, cells):
    assert row('a', 'b', result) == f'| a | b {cells}'


def test_no_fault_in_the_table_exceeds_the_command_timeout_or_moves_after_a_stop():
    shown = lines()
    begin = shown.index(line(*HEAD)) + 2
    for text in shown[begin:begin + len(SCENARIOS)]:
        _, _, _, drove, _, after, _ = (cell.strip() for cell in text.split('|'))
        assert drove == 'stood still' or float(drove.removesuffix(' mm')) <= 1e3 * SPEED * 0.45
        assert after == '0'


@pytest.mark.needs('rclpy')
def test_latencies_are_within_the_threshold():
    shown = lines()
    begin = shown.index(line(*bridge_latency.HEAD)) + 2
    for text, rate in zip(shown[begin:], bridge_latency.RATES):
        cells = [cell.strip() for cell in text.split('|')]
        assert cells[1] == f'{rate} Hz'
        assert float(cells[4]) <= bridge_latency.MAX_RATIO


def entries(delay):
    """Return what a measurement at 10 Hz is, the bridge later than the bare call."""
    return [{'who': 'floor', 'rate': 10, 'latency': [0.0005] * 3, 'sent': 3, 'cpu': 0.0004},
            {'who': 'bridge', 'rate': 10, 'latency': [delay] * 2, 'sent': 3, 'cpu': 0.0007}]


@pytest.mark.needs('rclpy')
def test_latency_table_holds_the_bridge_against_the_bare_call():
    shown = bridge_latency.table(entries(0.0008))
    assert shown.head == bridge_latency.HEAD
    assert shown.rows == (
        ('10 Hz', '0.50 / 0.50 ms', '0.80 / 0.80 ms', '1.60', '0.40 / 0.70 ms'),)
    assert bridge_latency.lost(entries(0.0008)) == 'Of 3 velocities 1 did not arrive.'


def test_page_names_the_programs_that_print_its_tables():
    text = PAGE.read_text()
    for program in ('test/link_fault_cases.py', 'python -m benchmarks.experiments.bridge_latency',
                    'python -m benchmarks.experiments.three_processes',
                    'python -m benchmarks.stop_matrix --robot grpc'):
        assert f'`{program}`' in text
