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
"""Driving by hand becomes a motion with exactly the velocities and durations that were sent."""

from __future__ import annotations

import asyncio
from itertools import groupby
from math import fsum

from hypothesis import given, settings
from hypothesis import strategies as st
from kachaka_simple_control.console.folder import MAX_TEXT
from kachaka_simple_control.console.open_pages import OpenPages
from kachaka_simple_control.console.page_protocol import Recorded
from kachaka_simple_control.console.recording import Recorder, Recording
from kachaka_simple_control.files.motion_reader import loads
import pytest

pytestmark = pytest.mark.needs('yaml', 'jsonschema')

SEGMENTS = st.lists(st.tuples(
    st.sampled_from([0.0, 0.1, 0.25, -0.2]), st.sampled_from([0.0, 0.5]),
    st.floats(0.001, 3.0)), max_size=12)


@settings(max_examples=30, deadline=None)
@given(SEGMENTS)
def test_a_recording_is_read_with_the_same_durations(segments: list[tuple[float, float, float]]):
    recording = Recording()
    for segment in segments:
        recording.add([segment])
    wanted = [(key, fsum(held for *_, held in group))
              for key, group in groupby(segments, lambda segment: segment[:2])]
    while wanted and wanted[0][0] == (0.0, 0.0):
        wanted.pop(0)
    while wanted and wanted[-1][0] == (0.0, 0.0):
        wanted.pop()
    text = recording.text('hand 2026-11-25 12.00.00', 'Driven by hand.')
    if not wanted:
        assert not text
        return
    steps = loads(text).motion.steps
    assert [key for key, _ in wanted] == [(step.linear_x, step.angular_z) for step in steps]
    assert [held for _, held in wanted] == pytest.approx(
        [step.duration for step in steps], abs=1e-12)


def test_equal_neighbours_are_merged_and_others_kept():
    recording = Recording()
    recording.add([(0.0, 0.0, 5.0), (0.1, 0.0, 0.05), (0.1, 0.0, 0.05)])
    recording.add([(0.1, 0.0, 0.1), (0.0, 0.0, 1.0), (0.1, 0.0, 0.25), (0.0, 0.0, 9.0)])
    motion = recording.motion('hand')
    assert motion is not None
    assert [(0.1, 0.2), (0.0, 1.0), (0.1, 0.25)] == [
        (step.linear_x, step.duration) for step in motion.steps]


def test_a_recording_fits_into_a_file_of_the_folder():
    recording = Recording()
    for index in range(2000):
        recording.add([(0.1 + index / 7e6, 0.123456789 / 3, 0.05 + index / 9e6)])
    assert recording.is_full
    text = recording.text('hand', 'Driven by hand.')
    assert 0.9 * MAX_TEXT < len(text) <= MAX_TEXT


class FakePage:
    """A page that keeps the recordings that it is sent."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def send(self, message: Recorded) -> None:
        """Keep the text of a recording."""
        self.texts.append(message.text)


def test_a_page_gets_its_recording_with_the_last_segment_and_a_newer_one_goes_on(
        monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr('kachaka_simple_control.console.recording.LAST_SEGMENTS', 0.0)

    async def scenario() -> None:
        tasks, shown, page = [], [], FakePage()
        recorder = Recorder(OpenPages(), tasks.append, lambda: shown.append(recorder.is_on))
        assert not recorder.switch(page, False)[0]
        assert recorder.switch(page, True)[0]
        recorder.take([(0.1, 0.0, 0.5)], page)
        recorder.finish(page)
        recorder.take([(0.2, 0.0, 0.5)], page)
        await tasks.pop()
        assert [0.1, 0.2] == [step.linear_x for step in loads(page.texts[0]).motion.steps]
        assert [True, False] == shown
        recorder.switch(page, True)
        recorder.finish(page)
        recorder.switch(page, True)  # begun anew before the end of the old one
        await tasks.pop()
        assert recorder.is_on
        assert len(page.texts) == 1

    asyncio.run(scenario())
