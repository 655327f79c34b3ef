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
"""A motion is read from texts alone, whatever files are on the disk."""

from __future__ import annotations

from pathlib import Path

from kachaka_simple_control.files.document import MotionFileError
from kachaka_simple_control.files.included_texts import find_among
from kachaka_simple_control.files.library import find
from kachaka_simple_control.files.motion_reader import loads
import pytest

pytestmark = pytest.mark.needs('yaml', 'jsonschema')


def test_a_motion_is_read_again_from_its_texts_without_its_files(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    for name, text in {
            'main.yaml': 'parameters: {side: 1 m}\nsteps: [include: legs/two.yaml, wait: 1 s]\n',
            'legs/two.yaml': 'steps: [include: ./one.yaml, include: ../legs/one.yaml]',
            'legs/one.yaml': 'steps: [forward: 1 m, include: square]'}.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    for source in ('main.yaml', tmp_path / 'main.yaml'):
        file = find(Path(source), side='2 m')
        texts = file.included_texts
        read = loads(str(file.text), file.source, file.values, find_among(texts))
        assert (read.motion, read.values) == (file.motion, file.values)
        # A motion of the package need not be among them.
        texts.pop('square')
        assert loads(str(file.text), file.source, None, find_among(texts)).motion == file.motion
        texts.popitem()
        with pytest.raises(MotionFileError, match='the text of this file was not given'):
            loads(str(file.text), file.source, None, find_among(texts))
