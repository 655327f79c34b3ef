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
"""The derivation and the code that cites it, side by side."""

from pathlib import Path
import re

from kachaka_simple_control import motion
from program import ROOT
import pytest

CODE = Path(motion.__file__).parent
#: The formulas in the order of their numbers, which Sphinx gives them.
LABELS = (
    'limits', 'ramp', 'ramp-position', 'ramp-velocity', 'profile', 'both-ramps', 'no-jerk',
    'none-reached', 'both-reached', 'one-reached', 'mean', 'means-keep', 'along', 'chord',
    'change', 'rest-of-path', 'clock', 'calibration', 'odometry-calibration',
    'feedback-error', 'feedback', 'corner', 'corner-arcs', 'corner-size', 'arc-part',
    'smaller-circle', 'transition-gap', 'transition-ends')
#: Which file carries which of them out.
CITED = {
    'velocity_profile.py': {2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12},
    'replanning.py': {15, 16},
    'path_segment.py': {13, 17},
    'corner.py': {22, 23, 24}, 'chain.py': {25}, 'arc_group.py': {26}, 'transition.py': {27, 28},
    'geometry.py': {14}, 'calibration.py': {18, 19},
    '../control/pose_feedback.py': {20, 21}}


@pytest.fixture
def theory():
    path = ROOT / 'docs' / 'theory.md'
    if not path.exists():
        pytest.skip('the documentation is not installed')
    return path.read_text()


def test_the_formulas_have_the_numbers_that_the_code_cites(theory):
    assert tuple(re.findall(r'^:label: (\S+)$', theory, re.MULTILINE)) == LABELS
    assert theory.count('```{math}') == len(LABELS)


@pytest.mark.parametrize('file', CITED)
def test_every_formula_is_cited_where_it_is_carried_out(file):
    text = (CODE / file).read_text()
    assert {int(number) for number in re.findall(r'[ a-z\]]\((\d+)\)', text)} == CITED[file]
    assert 'docs/theory.md' in text
