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
import sys
import time

from kachaka_simple_control.console import preview as preview_module
from kachaka_simple_control.console.page_protocol import AskPreview
from kachaka_simple_control.console.preview import preview, PreviewWorker
import pytest

pytestmark = pytest.mark.needs('yaml', 'jsonschema')

TEXT = 'steps:\n  - forward: 1 m\n  - turn: 90 deg\n'


def test_a_plan_has_its_path_box_duration_and_steps():
    plan = preview(7, TEXT).plan
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
    result = preview(1, text)
    assert result.plan is None
    assert line in [error.line for error in result.errors]
    assert reason in ' '.join(error.text for error in result.errors)


def test_there_are_never_too_many_errors_or_points():
    errors = preview(1, 'steps:\n' + '  - turn: 90\n' * 3000).errors
    assert len(errors) <= preview_module.MAX_ERRORS
    plan = preview(1, 'steps:\n  - repeat:\n      times: 400\n      steps:\n'
                      '        - arc: {radius: 1 m, angle: 350 deg}\n').plan
    assert plan is not None
    assert len(plan.points) <= preview_module.MAX_POINTS


def test_the_worker_answers_and_the_loop_goes_on_meanwhile():
    async def scenario() -> float:
        worker = PreviewWorker()
        gaps, last = [0.0], time.monotonic()
        works = [asyncio.ensure_future(worker.preview(AskPreview(number, TEXT)))
                 for number in range(3)]
        while not all(work.done() for work in works):
            await asyncio.sleep(0.001)
            gaps.append(time.monotonic() - last)
            last = time.monotonic()
        await worker.close()
        wanted = preview(0, TEXT)
        assert [replace(wanted, id=number) for number in range(3)] == [
            work.result() for work in works]
        return max(gaps)

    assert asyncio.run(scenario()) < 0.3  # on a busy machine; a plan takes longer than that


def test_a_worker_that_takes_too_long_is_replaced(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(preview_module, 'PATIENCE', 0.3)

    async def scenario() -> None:
        worker = PreviewWorker(command=[sys.executable, '-c', 'import time; time.sleep(60)'])
        result = await worker.preview(AskPreview(1, TEXT))
        assert 'longer than' in result.errors[0].text
        worker._command = [sys.executable, '-c', '']
        result = await worker.preview(AskPreview(2, TEXT))
        assert 'failed' in result.errors[0].text
        await worker.close()

    asyncio.run(scenario())
