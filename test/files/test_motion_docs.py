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
"""What docs/motions.md says of files agrees with the code."""

from __future__ import annotations

from pathlib import Path
import re

from kachaka_simple_control.files.library import library
from kachaka_simple_control.files.motion_file import loads
from kachaka_simple_control.files.robot_profile import find_robot, robots
from kachaka_simple_control.files.yaml_document import MAX_BYTES, MAX_VALUES
from kachaka_simple_control.motion.geometry import advance, ORIGIN
from kachaka_simple_control.motion.limits import LIMIT_QUANTITIES
from kachaka_simple_control.motion.step_base import KINDS
from kachaka_simple_control.motion.units import QUANTITIES
import pytest

PAGE = Path(__file__).parents[2] / 'docs' / 'motions.md'
pytestmark = [
    pytest.mark.skipif(not PAGE.is_file(), reason='the source is not here'),
    pytest.mark.needs('yaml', 'jsonschema')]


@pytest.fixture(scope='module')
def page() -> str:
    """Return the page."""
    return PAGE.read_text()


def file_in(page: str, name: str) -> str:
    """Return a file that a reader types."""
    return re.search(
        rf'<!-- test: file {re.escape(name)} -->\n```yaml\n(.*?)```', page, re.DOTALL)[1]


def test_its_files_can_be_read(page, tmp_path):
    assert len(loads(file_in(page, 'square.yaml')).motion.steps) == 6
    path = tmp_path / 'robot.yaml'
    path.write_text(file_in(page, 'robot.yaml'))
    assert find_robot(path).name == 'carrier'


def test_each_form_of_a_step_in_the_table_is_valid(page):
    forms = re.findall(r'^\| `(\w+: .+?)` \|', page, re.MULTILINE)
    assert len(forms) == 9
    for form in forms:
        loads(f'steps: [{{{form.replace("[...]", "[]")}}}]')


def test_each_unit_is_in_the_table(page):
    rows = re.findall(r'^\| ([a-z ,]+) \| (`\S+`(?:, `\S+`)*) \|$', page, re.MULTILINE)
    shown = {name: units.replace('`', '').split(', ') for names, units in rows
             for name in names.split(', ')}
    known = {name: list(quantity.units) for name, quantity in QUANTITIES.items()
             if name not in ('size', 'time above zero')}
    assert shown == known


def test_each_name_is_on_the_page(page):
    for word in [*KINDS, *LIMIT_QUANTITIES, *library(), *robots()]:
        assert f'`{word}' in page, word


def test_each_bound_is_on_the_page(page):
    for bound in (MAX_BYTES, MAX_VALUES):
        assert f'{bound:,}'.replace(',', ' ') in page


@pytest.mark.parametrize('form, side', [
    ('{radius: 0.3 m, angle: 90 deg}', 1), ('{radius: -0.3 m, angle: 90 deg}', -1)])
def test_the_arcs_it_explains_end_where_it_says(page, form, side):
    assert f'`{form}` ends 0.3 m ahead' in ' '.join(page.split())
    step, = loads(f'steps: [{{arc: {form}}}]').motion.steps
    length = abs(step.radius) * step.angle
    end = advance(ORIGIN, length, length / step.radius)
    assert (end.x, end.y) == pytest.approx((0.3, side * 0.3))
