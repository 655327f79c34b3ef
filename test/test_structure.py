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
"""The figures of a package's structure are counted as ``tools/structure.py`` says."""

from pathlib import Path

from program import ROOT
import pytest

#: Rooms: the package itself, its module top, and the folders low, high and deep; empty is none.
FILES = {
    '__init__.py': '"""A package."""\n\nfrom package.top import function\n',
    'top.py': '''# A comment.
"""A docstring."""

from package import low


def function():
    """
    Return text.

    It has two lines.
    """
    from package.high.one import ONE
    return """two
lines""" + ONE
''',
    'empty/__init__.py': '"""Nothing."""\n',
    'low/__init__.py': '',
    'low/one.py': 'import package.low.two\nimport json\n',
    'low/two.py': 'TWO = 2\n',
    'high/__init__.py': '"""Not a module."""\n',
    'high/one.py': """from typing import TYPE_CHECKING

from package.low import one

if TYPE_CHECKING:
    from package.high.deep.one import DEEP

ONE = one
""",
    'high/deep/__init__.py': '',
    'high/deep/one.py': 'import package.high.one\nfrom package import empty\nDEEP = 3\n',
}


@pytest.fixture
def package(tmp_path) -> Path:
    """Return the folder of a small package."""
    for name, text in FILES.items():
        path = tmp_path / 'package' / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path / 'package'


def test_a_small_package_is_counted_as_the_tool_says(package, monkeypatch):
    monkeypatch.syspath_prepend(ROOT / 'tools')
    from structure import structure
    # Arrows: package - top - low, top - high - low, high - deep - high.  Floors: high and deep
    # are a circle, so package, top, high, low.
    assert structure(package) == {
        'rooms': 5, 'arrows': 6, 'floors': 4, 'modules': 6, 'code lines': 17,
        'docstring lines': 8}
