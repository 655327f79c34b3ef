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
"""A text is checked and planned in a process of its own; errors have their lines."""

from __future__ import annotations

import asyncio
from dataclasses import replace
import math
import os
from pathlib import Path
import sys
import time

from kachaka_simple_control.console import preview as preview_module
from kachaka_simple_control.console.folder import Folder, MAX_TEXT
from kachaka_simple_control.console.page_protocol import AskPreview, MotionParameter, Preview
from kachaka_simple_control.console.preview import preview, PreviewWorker
from kachaka_simple_control.files.included_texts import find_among
from kachaka_simple_control.files.motion_reader import loads
import pytest

pytestmark = pytest.mark.needs('yaml', 'jsonschema')

TEXT = 'steps:\n  - forward: 1 m\n  - turn: 90 deg\n'
LEG = """parameters:
  side: {min: 20 cm, max: 4 m, description: of the square}
  laps: 2
steps:
  - repeat: {times: $laps, steps: [forward: $side]}
"""


def checked(text: str, folder: Path | None = None, **asked: object) -> Preview:
    """Return the preview of a text on a console with a folder."""
    own = Folder(None if folder is None else str(folder))
    try:
        return preview(AskPreview(7, text, **asked), own)
    finally:
        own.close()


def test_a_plan_has_its_path_box_duration_and_steps():
    plan = checked(TEXT).plan
    assert plan is not None
    assert (0.0, 0.0, 0.0) == plan.points[0]
    assert (1.0, 0.0, math.pi / 2) == pytest.approx(plan.points[-1], abs=1e-4)
    x0, y0, x1, y1 = plan.box
    assert x0 < 0.0
    assert x1 > 1.0
    assert y0 < 0.0 < y1
    assert plan.duration > 1.0 / 0.3
    assert 2 == plan.steps


@pytest.mark.parametrize('text, line, reason', [
    ('steps:\n  - turn: 90\n', 2, 'has no unit'),
    ('steps:\n  - wait: 1 s\n\n  - fly: 1\n', 4, 'there is no such step'),
    ('steps:\n  - move: {linear_x: 9 m/s, angular_z: 0 rad/s, duration: 1 s}\n', 2, 'limits'),
    ('steps: [\n', 2, ''),
    ('name: a\nrobot: unknown\nsteps:\n  - wait: 1 s\n', 2, 'no robot of this name'),
    ('rate: 900 Hz\nsteps: {}\n', 2, 'it must be a list of steps'),
])
def test_an_error_has_its_line(text: str, line: int | None, reason: str):
    result = checked(text)
    assert result.plan is None
    assert line in [error.line for error in result.errors]
    assert reason in ' '.join(error.text for error in result.errors)


def test_a_value_of_a_parameter_is_used_or_named():
    parameters = (MotionParameter('side', 'of the square', None, '20 cm to 4 m'),
                  MotionParameter('laps', '', '2', ''))
    result = checked(LEG)
    assert result.parameters == parameters
    assert [(error.line, error.text, error.parameter) for error in result.errors] == [
        (2, 'it must be given: a length, 20 cm to 4 m', 'side')]
    result = checked(LEG, values={'side': '50 cm', 'of another text': '1 m'})
    assert result.plan is not None
    assert result.plan.points[-1] == (1.0, 0.0, 0.0)
    result = checked(LEG + '  - turn: 90\n', values={'side': '5 m', 'laps': '1 s'})
    assert [(error.line, error.parameter) for error in result.errors] == [
        (2, 'side'), (3, 'laps'), (6, None)]
    assert result.parameters == parameters
    # An error of the text belongs to no field of a value.
    [error] = checked(LEG.replace('laps: 2', 'laps: 2 kg'), values={'side': '1 m'}).errors
    assert (error.line, error.parameter) == (3, None)


def test_a_text_includes_files_of_the_folder_and_motions_of_the_package(tmp_path: Path):
    (tmp_path / 'leg.yaml').write_text(LEG)
    (tmp_path / 'two.yaml').write_text(
        'steps:\n  - include: {motion: leg.yaml, with: {side: 1 m}}\n')
    text = ('parameters: {side: 2 m}\nsteps:\n  - include: ./two.yaml\n'
            '  - include: {motion: ./leg.yaml, with: {side: $side, laps: 1}}\n'
            '  - include: square\n')
    result = checked(text, tmp_path, values={'side': '1 m'})
    assert result.errors == ()
    assert result.plan is not None
    assert result.plan.points[-1] == pytest.approx((3.0, 0.0, math.tau), abs=1e-3)
    assert {*result.included} == {'two.yaml', 'leg.yaml'}
    # With these texts alone the motion is the same.
    assert checked(text, values={'side': '1 m'}, included=result.included).plan == result.plan
    assert loads(text, 'a.yaml', None, find_among(result.included)).motion.steps


def test_a_problem_in_an_included_file_is_at_the_line_of_its_include(tmp_path: Path):
    (tmp_path / 'leg.yaml').write_text('steps:\n  - wait: 1 s\n  - turn: 90\n')
    (tmp_path / 'fast.yaml').write_text('steps: [forward: {distance: 1 m, speed: 9 m/s}]\n')
    text = 'steps:\n  - wait: 1 s\n  - include: ./leg.yaml\n'
    [error] = checked(text, tmp_path, name='mine.yaml').errors
    assert error.line == 3
    assert error.text.startswith('leg.yaml:3: step 2: turn: 90 has no unit')
    assert error.text.endswith('(included by mine.yaml:3)')
    [error] = checked(text.replace('leg', 'fast'), tmp_path).errors
    assert error.line == 3
    assert error.text.startswith('fast.yaml:1: step 1: forward.speed: 9.0 m/s')
    (tmp_path / 'leg.yaml').write_text('steps:\n  - include: ./mine.yaml\n')
    (tmp_path / 'mine.yaml').write_text('the last state that was saved')
    [error] = checked(text, tmp_path, name='mine.yaml').errors
    assert (error.line, error.text) == (
        3, 'step 2: include: mine.yaml includes leg.yaml includes mine.yaml')


@pytest.mark.parametrize('name', [
    '../secret.yaml', '/{}/secret.yaml', 'folder/inner.yaml', './link.yaml', 'linked/secret.yaml',
    './pipe.yaml', './.hidden.yaml', '../own/../secret.yaml', './square', 'mine.txt'])
def test_a_text_of_a_page_reads_nothing_else(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str):
    own = tmp_path / 'own'
    (own / 'folder').mkdir(parents=True)
    for path in ('secret.yaml', 'own/folder/inner.yaml', 'own/.hidden.yaml', 'own/mine.txt'):
        (tmp_path / path).write_text('steps: [wait: 1 s]')
    (own / 'link.yaml').symlink_to(tmp_path / 'secret.yaml')
    (own / 'linked').symlink_to(tmp_path)
    os.mkfifo(own / 'pipe.yaml')
    monkeypatch.chdir(own)
    text = f'steps:\n  - include: {name.format(tmp_path)}\n'
    for asked in ({}, {'name': '../own/mine.yaml'}, {'name': f'{tmp_path}/mine.yaml'}):
        [error] = checked(text, own, **asked).errors
        assert error.line == 2
        assert '\n' not in error.text
    [error] = checked(text).errors
    assert error.line == 2


def test_included_files_fit_into_a_message_with_their_text(tmp_path: Path):
    for name in ('a.yaml', 'b.yaml'):
        (tmp_path / name).write_text(f'# {"x" * (MAX_TEXT // 2)}\nsteps: [forward: 1 m]\n')
    text = 'steps:\n  - include: ./a.yaml\n  - include: ./a.yaml\n'
    assert checked(text, tmp_path).plan is not None
    [error] = checked(text + '  - include: ./b.yaml\n', tmp_path).errors
    assert error.line == 4
    assert 'more than 60000 bytes' in error.text


def test_there_are_never_too_many_errors_or_points():
    errors = checked('steps:\n' + '  - turn: 90\n' * 3000).errors
    assert len(errors) <= preview_module.MAX_ERRORS
    plan = checked('steps:\n  - repeat:\n      times: 400\n      steps:\n'
                   '        - arc: {radius: 1 m, angle: 350 deg}\n').plan
    assert plan is not None
    assert len(plan.points) <= preview_module.MAX_POINTS


def test_the_worker_answers_and_the_loop_goes_on_meanwhile():
    async def scenario() -> float:
        worker = PreviewWorker(None, Folder(None))
        gaps, last = [0.0], time.monotonic()
        works = [asyncio.ensure_future(worker.preview(AskPreview(number, TEXT)))
                 for number in range(3)]
        while not all(work.done() for work in works):
            await asyncio.sleep(0.001)
            gaps.append(time.monotonic() - last)
            last = time.monotonic()
        await worker.close()
        wanted = checked(TEXT)
        assert [replace(wanted, id=number) for number in range(3)] == [
            work.result() for work in works]
        return max(gaps)

    assert asyncio.run(scenario()) < 0.3  # on a busy machine; a plan takes longer than that


def test_the_worker_reads_the_folder_of_the_console_wherever_it_is(tmp_path: Path):
    own = tmp_path / 'own'
    own.mkdir()
    (own / 'leg.yaml').write_text('steps: [forward: 1 m]')
    folder = Folder(str(own))
    own.rename(tmp_path / 'moved')

    async def scenario() -> None:
        worker = PreviewWorker(None, folder)
        result = await worker.preview(AskPreview(1, 'steps: [include: ./leg.yaml]'))
        assert result.included == {'leg.yaml': 'steps: [forward: 1 m]'}
        await worker.close()

    asyncio.run(scenario())
    folder.close()


def test_a_worker_that_takes_too_long_is_replaced(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(preview_module, 'PATIENCE', 0.3)

    async def scenario() -> None:
        sleep = [sys.executable, '-c', 'import time; time.sleep(60)']
        worker = PreviewWorker(None, Folder(None), sleep)
        result = await worker.preview(AskPreview(1, TEXT))
        assert 'longer than' in result.errors[0].text
        worker._command = [sys.executable, '-c', '']
        result = await worker.preview(AskPreview(2, TEXT))
        assert 'failed' in result.errors[0].text
        await worker.close()

    asyncio.run(scenario())
