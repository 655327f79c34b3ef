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
"""Test that a motion is driven again from its report, and what is refused."""

from __future__ import annotations

from dataclasses import replace
import json
from pathlib import Path

from kachaka_simple_control.analysis.summary import Summary
from kachaka_simple_control.files.document import MotionFileError
from kachaka_simple_control.files.library import find
from kachaka_simple_control.files.motion_file import MotionFile
from kachaka_simple_control.files.report_file import RecordedMotion
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.report.json_export import run_json
import pytest
from simulated_drive import SimulatedDrive

pytestmark = pytest.mark.needs('yaml', 'jsonschema')

LIMITS = Limits(0.3, 1.57, max_linear_acceleration=0.5, max_angular_acceleration=2.5)
FILES = {
    'mine.yaml': """\
parameters: {side: {max: 4 m}, turn: 90 deg, laps: 2}
steps:
  - repeat: {times: $laps, steps: [{include: {motion: ./parts/leg.yaml, with: {way: $side / 3}}}]}
  - turn: 0.1 * $turn
  - include: {motion: square, with: {side: 2 * $side + 10 cm, laps: 1}}
  - include: ./square
  - include: {motion: parts/back.yaml}
""",
    'parts/leg.yaml': 'parameters: {way: {}}\nsteps: [{forward: $way}, {include: ../end.yaml}]',
    'parts/back.yaml': 'steps: [include: ./leg.yaml]'.replace(
        './leg.yaml', '{motion: ./leg.yaml, with: {way: -10 cm}}'),
    'end.yaml': 'corners: 2 cm\nsteps: [wait: 0.1 s]',
    # A file without a suffix is no motion of the package.
    'square': 'steps: [forward: 7 cm]',
}
VALUES = {'side': 0.1 + 0.2, 'turn': 1.0 / 3.0, 'laps': '3'}


def write_report(path: Path, file: MotionFile, title: str = 'mine') -> dict[str, object]:
    """Write the ``run.json`` of a drive of a motion that never began; return its content."""
    drive = SimulatedDrive(title=title)
    drive.publish(replace(
        drive.drive_log.session_started, motion_file=file.as_text()))
    path.write_text(run_json(Summary(drive.close()), None))
    return json.loads(path.read_text())


@pytest.fixture
def driven(tmp_path, monkeypatch):
    """Return a motion that was driven; ``run.json`` is its report."""
    monkeypatch.chdir(tmp_path)
    Path('parts').mkdir()
    for name, text in FILES.items():
        Path(name).write_text(text)
    file = find('./mine.yaml', **VALUES)
    write_report(Path('run.json'), file)
    return file


def test_a_report_is_planned_alike_whatever_its_files_are_now(driven, tmp_path):
    assert set(driven.included_texts) == {
        'parts/leg.yaml', 'end.yaml', 'square', './square', 'parts/back.yaml'}
    Path('mine.yaml').unlink()
    Path('parts/leg.yaml').write_text('steps: []')
    # A link to another file does not make them one.
    Path('parts/back.yaml').unlink()
    Path('parts/back.yaml').symlink_to('../end.yaml')
    again = find('run.json')
    assert (again.motion, again.values) == (driven.motion, driven.values)
    assert again.included_texts == driven.included_texts
    plans = [plan(file.motion, LIMITS, 50.0) for file in (driven, again)]
    assert [plans[0].steps, plans[0].pose] == [plans[1].steps, plans[1].pose]
    # And so is the report of that drive.
    write_report(tmp_path / 'again.json', again)
    assert find(tmp_path / 'again.json').motion == driven.motion


def test_a_motion_of_the_package_is_that_of_the_report(driven):
    kept = json.loads(Path('run.json').read_text())
    kept['motion_file']['included']['square'] = (
        'parameters: {side: 1 m, laps: 1}\nsteps: [forward: $side]')
    Path('run.json').write_text(json.dumps(kept))
    step = find('run.json').motion.steps[2]
    assert [part.distance for part in step.steps] == [2.0 * VALUES['side'] + 0.1]


def test_other_values_win_over_those_of_the_report(driven):
    again = find('run.json', laps=1)
    assert again.values == {**driven.values, 'laps': '1'}
    assert again.motion == find('./mine.yaml', **{**VALUES, 'laps': 1}).motion
    with pytest.raises(MotionFileError, match=r'^./mine.yaml:1: parameters.side: 5 m is above'):
        find('run.json', side='5 m')


def test_a_report_of_an_earlier_version_has_no_values(driven):
    kept = write_report(Path('run.json'), find('spin'))
    del kept['motion_file']['values'], kept['motion_file']['included']
    Path('run.json').write_text(json.dumps(kept))
    assert find('run.json').motion == find('spin').motion


def test_a_motion_that_is_written_as_json_is_no_report(driven):
    Path('json.json').write_text('{"steps": [{"forward": "1 m"}, {"wait": "1 m"}]}')
    with pytest.raises(MotionFileError, match=r'^json.json:1: step 2: wait: '):
        find('json.json')


@pytest.mark.parametrize('change, text', [
    ('{\n"format": 1,', ':2: this is not JSON: Expecting property name enclosed in double quotes'),
    ('\xff', ': this is not JSON'), ('[' * 100_000, ': this is not JSON'),
    (None, ': there is no such file'),
    ('[]', ': this is not the run.json of a report'),
    ('{"a": 1}', ': this is not the run.json of a report'),
    ({'fleet': 'two'}, ': this is the report of a fleet; only that of one robot has one motion'),
    ({'format': 2}, ': this is the report of another version'),
    ({'motion_file': None}, ': this drive had no motion from a file, or several'),
    ({'motion_file': None, 'title': 'lesson'}, (
        ': this is the report of the lesson, which has no file: name `lesson`')),
    ({'motion_file': 7}, ': its motion_file was edited'),
    ({'motion_file': {'source': 'a.yaml', 'text': None}}, ': its motion_file was edited'),
    ({'motion_file': {'source': 'a.yaml', 'text': '', 'values': {'a': 1}}}, (
        ': its motion_file was edited')),
])
def test_what_is_no_report_of_a_motion_is_refused_in_one_line(driven, change, text):
    path = Path('run.json')
    if change is None:
        path.unlink()
    elif isinstance(change, str):
        path.write_text(change, 'latin-1')
    else:
        path.write_text(json.dumps({**json.loads(path.read_text()), **change}))
    with pytest.raises(MotionFileError) as caught:
        find('run.json')
    assert str(caught.value) == f'run.json{text}'


PARTS = 'parameters: {side: 1 m, laps: 2}\nsteps: [{forward: $side}, {include: ./part.yaml}]'


@pytest.mark.parametrize('change, difference', [
    ({}, None), ({'source': './other.yaml'}, None),
    ({'values': {'side': '100cm', 'laps': '2'}}, None), ({'text': f'# old\n{PARTS}'}, None),
    ({'values': {'side': '2 m', 'laps': '3'}}, 'side is 1 m and 2 m, laps is 2 and 3'),
    ({'text': PARTS.replace('side: 1', 'side: 3')}, 'side is 1 m and 3 m'),
    ({'text': PARTS.replace(': $side', ': 5 m')}, 'their files differ'),
    ({'included': {'part.yaml': 'steps: [wait: 2 s]'}}, 'their files differ'),
    ({'text': 'steps: [leap: 2 m]'}, 'their files differ'),
])
def test_motions_differ_in_what_they_say(change, difference):
    one = RecordedMotion('./a.yaml', PARTS, {}, {'part.yaml': 'steps: [wait: 1 s]'})
    assert one.difference(replace(one, **change)) == difference
