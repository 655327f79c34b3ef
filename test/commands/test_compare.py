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
"""The command ``kachaka_compare``: its table and plot, and what it refuses."""

from dataclasses import replace
import json
import math
from pathlib import Path
import re
import subprocess
import sys

from golden import answers, compare
from kachaka_simple_control.analysis.summary import Summary
from kachaka_simple_control.commands.compare import main
from kachaka_simple_control.files.library import find
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.motion.steps import Forward, Motion, Repeat, Turn
from kachaka_simple_control.report.comparison import read_drive, spread
from kachaka_simple_control.report.json_export import run_json
from program import call
import pytest
from simulated_drive import SimulatedDrive

SQUARE = Motion('square', (Repeat(4, (Forward(0.5), Turn(math.pi / 2.0))),))


@pytest.fixture
def reports(tmp_path, monkeypatch):
    """Return a function that leaves the figures of a simulated drive in a directory."""
    monkeypatch.chdir(tmp_path)

    def report(name, gain=1.0, motion=SQUARE, until=math.inf, values=None, **options):
        parameters = SimulationParameters(linear_gain=gain)
        simulated = SimulatedDrive(20.0, parameters=parameters, **options)
        if values is not None:
            file = find('square', **values)
            motion = file.motion
            simulated.publish(replace(
                simulated.drive_log.session_started, motion_file=file.as_text()))
        simulated.drive(motion, until, 'stopped by a test' if until < math.inf else None)
        (tmp_path / name).mkdir()
        (tmp_path / name / 'run.json').write_text(run_json(Summary(simulated.close()), None))

    return report


@pytest.fixture
def run(capsys):
    """Return a function that runs the command, and tells its exit code and its outputs."""
    def run(*arguments):
        return call(main, arguments, capsys)

    return run


def test_a_table_that_cannot_be_printed_is_one_line(reports, tmp_path):
    for name, gain in (('a', 0.95), ('b', 0.96)):
        reports(name, gain)
    with Path('/dev/full').open('w') as full:
        ended = subprocess.run(
            [sys.executable, '-m', 'kachaka_simple_control.commands.compare', 'a', 'b'],
            check=False, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
    assert (ended.returncode, ended.stderr) == (
        1, 'kachaka_compare: the table cannot be printed: No space left on device\n')


def test_accuracy_and_repeatability_are_those_of_the_ends(reports, run, tmp_path):
    motion = Motion('straight', (Forward(0.5),))
    for name, gain in (('a', 0.95), ('b', 0.96), ('c', 0.97)):
        reports(name, gain, motion)
    found = spread([read_drive(tmp_path / name) for name in 'abc'])
    assert found.mean == pytest.approx((-0.02, 0.0, 0.0), abs=2e-4)
    assert found.deviation == pytest.approx((0.005, 0.0, 0.0), abs=1e-4)
    assert (found.worst_distance, found.worst_angle) == pytest.approx((0.005, 0.0), abs=1e-4)
    code, output, errors = run('a', 'b', 'c')
    assert (code, errors) == (0, '')
    lines = output.splitlines()
    assert lines[0] == '3 drives of straight: where they ended, from where they were to'
    assert [line.split()[0] for line in lines[5:8]] == ['a', 'b', 'c']
    assert float(lines[5].split()[1]) == pytest.approx(-25.0, abs=0.3)
    assert re.match(r'mean +-(19|20)\.\d +-?0\.0 ', lines[9])
    assert re.match(r'standard deviation +(4.9|5.0|5.1) +0\.0 ', lines[10])
    assert re.match(r'Accuracy: the mean end is (19|20)\.\d mm and 0.0\d degrees away', lines[12])
    assert re.match(r'Repeatability: single ends are up to (4.9|5.0|5.1) mm and 0.0', lines[13])


@pytest.mark.slow
def test_all_paths_are_drawn_over_the_planned_one(reports, run, tmp_path):
    pytest.importorskip('matplotlib', reason='needs matplotlib')
    for name, gain in (('a', 0.9), ('b', 0.95), ('c', 1.0)):
        reports(name, gain)
    assert run('a', 'b', 'c', '--plot', 'all.svg')[0] == 0
    drawn = (tmp_path / 'all.svg').read_text()
    assert drawn.count('id="odometry"') == 3
    assert drawn.count('id="planned"') == 1
    assert len(set(re.findall('#D55E00|#0072B2|#009E73', drawn, re.IGNORECASE))) == 3


def test_what_cannot_be_compared_is_refused_in_one_line(reports, run, tmp_path):
    reports('a')
    reports('short', until=3.0)
    reports('other', motion=Motion('other', (Forward(0.4),)))
    reports('blind', odometry_period=None)
    (tmp_path / 'odd').mkdir()
    (tmp_path / 'odd' / 'run.json').write_text('{')
    data = json.loads((tmp_path / 'a' / 'run.json').read_text())
    (tmp_path / 'old').mkdir()
    (tmp_path / 'old' / 'run.json').write_text(json.dumps({**data, 'format': 0}))
    cases = (
        'a', 'a none', 'a odd', 'a old', 'a short', 'a blind', 'a other', 'a a --plot all.txt')

    def refusal(words: str) -> str:
        code, output, errors = run(*words.split())
        assert (code, output) == (2, '')
        (line,) = errors.splitlines()
        return line

    compare('compare', answers(cases, refusal))


def test_drives_of_a_motion_with_other_values_are_refused(reports, run):
    """Both end where they began, and so do their names."""
    for name, gain, side in (('a', 0.99, '20 cm'), ('b', 0.98, '0.2m'), ('c', 0.97, '0.3 m')):
        reports(name, gain, values={'side': side})
    assert run('a', 'b')[0] == 0
    assert run('a', 'b', 'c') == (2, '', (
        'kachaka_compare: a and c are drives of different motions: side is 20 cm and 0.3 m\n'))


@pytest.mark.parametrize('change', [
    {'path': 7}, {'path': {'planned': [[1]]}}, {'path': {'planned': [[None, 'x']]}}, {'end': None},
    {'end': {'planned': {'x_m': 'x'}, 'odometry': {}}}, {'timing': {}}, {'verdict': []},
    {'motions': [None]}, {'timing': {'late': 'a', 'lost': 1}},
    {'path': {'planned': [[float('nan'), 0.0]]}}, {'path': {}},
    {'path': {'planned': [[0.0, 0.0]]}}, {'path': {'planned': [[0.0, 0.0]], 'odometry': []}},
    {'motion_file': {'text': 7}}])
def test_a_report_that_was_edited_is_refused_in_one_line(reports, run, tmp_path, change):
    reports('a')
    data = json.loads((tmp_path / 'a' / 'run.json').read_text())
    (tmp_path / 'edited').mkdir()
    (tmp_path / 'edited' / 'run.json').write_text(json.dumps({**data, **change}))
    code, output, errors = run('a', 'edited')
    assert (code, output) == (2, '')
    assert errors.startswith('kachaka_compare: edited: ')
    assert errors.count('\n') == 1


@pytest.mark.parametrize('again', ['a', './a', 'link'])
def test_a_drive_is_not_compared_with_itself(reports, run, tmp_path, again):
    reports('a')
    (tmp_path / 'link').symlink_to('a')
    assert run('a', again) == (
        2, '', 'kachaka_compare: a is named twice: a drive is always like itself\n')
