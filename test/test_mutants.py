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
"""Each mutant applies to the source as it is, and its tests are where its diff says."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys

from program import ROOT
import pytest

MUTANTS = ROOT / 'tools' / 'mutants'
sys.path.insert(0, str(MUTANTS))
# Elsewhere git would leave out what is not below its repository, and say that all is well.
pytestmark = pytest.mark.skipif(
    not MUTANTS.is_dir() or not (ROOT / '.git').exists() or shutil.which('git') is None,
    reason='no git repository here')


@pytest.mark.parametrize('file', sorted(MUTANTS.glob('*.diff')), ids=lambda file: file.stem)
def test_a_mutant_applies_and_its_tests_are_there(file):
    from run import load
    result = subprocess.run(
        ['git', 'apply', '--check', str(file)], cwd=ROOT, capture_output=True, text=True,
        check=False)
    assert result.returncode == 0, result.stderr
    mutant = load(file)
    texts = {reach: ROOT.joinpath(reach).read_text() for reach in mutant.reach}
    assert texts
    for killer in mutant.killers:
        reach, _, name = killer.strip().partition('::')
        assert reach in texts
        assert re.search(rf'^def {name}\(', texts[reach], re.MULTILINE), killer
