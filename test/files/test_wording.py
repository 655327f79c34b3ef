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
"""A motion file with a common mistake is refused with the right spelling."""

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.library import loads
from kachaka_simple_control.motion import units
import pytest

pytestmark = pytest.mark.needs('yaml', 'jsonschema')


@pytest.mark.parametrize(('text', 'line', 'advice'), [
    ('steps: [backward: 1 m]', 1, 'write `forward: -1 m`'),
    ('steps: [reverse: -20 cm]', 1, 'write `forward: 20 cm`'),
    ('steps: [backward: {distance: 1 m}]', 1, 'write `forward: -1 m`'),
    ('steps: [left: 90 deg]', 1, 'write `turn: 90 deg`'),
    ('steps: [right: 45 deg]', 1, 'write `turn: -45 deg`'),
    ('steps: [right: 1 m]', 1, 'write `turn: -90 deg`, and `forward: 1 m` after it'),
    ('name: x\nforward: 1 m', 2, 'forward: it is a step: put it below `steps:`'),
    ('steps:\n- wait: 1 h', 2, "write '3600 s'"),
    ('steps:\n- forward: {distance: 1 m, speed: 1 km/h}', 2, "write '0.28 m/s'"),
    ('steps:\n- forward: ０.５ m', 2, "full-width: write '0.5 m'"),
    ('steps:\n- forward: 0.5　m', 2, "full-width: write '0.5 m'"),
    ('steps:\n- forward: －０，５ m', 2, "full-width: write '-0.5 m'"),
    ('name: 正方形：右\nsteps:\n- forward：0.5 m', 3, 'full-width: write `- forward: 0.5 m`'),
    ('steps：\n- forward: 0.5 m', 1, 'full-width: write `steps:`'),
    ('steps:\n　- forward: 0.5 m', 2, 'full-width: write `- forward: 0.5 m`'),
    ('steps: ［forward: 1 m］', 1, 'full-width: write `steps: [forward: 1 m]`'),
    ('description: "：［"\nsteps: [forward: 1 cn]', 2, "'1 cn'; it must be a length"),
])
def test_what_people_write_is_refused_with_what_to_write(text, line, advice):
    with pytest.raises(InvalidMotionError) as caught:
        loads(text, 'own.yaml')
    problem = caught.value.problems[-1]
    assert problem.line == line
    assert advice in str(problem)


def test_texts_may_be_full_width():
    text = 'name: 正方形：右回り\ndescription: ｛０．５ｍ｝\nsteps: [forward: 0.5 m]'
    motion_file = loads(text, 'own.yaml')
    assert motion_file.motion.name == '正方形：右回り'


@pytest.mark.parametrize(('quantity', 'text', 'advice'), [
    (units.LENGTH, '10 in', '25.4 cm'), (units.LENGTH, '1/2 m', '0.5 m'),
    (units.LENGTH, '-3 feet', '-91.44 cm'), (units.LENGTH, '0.5 km', '500 m'),
    (units.ANGLE, '1/4 turn', '90 deg'), (units.ANGLE, '0.5 pi', '90 deg'),
    (units.LINEAR_VELOCITY, '1 mph', '0.45 m/s'), (units.ANGULAR_VELOCITY, '10 rpm', '60 deg/s'),
    (units.TIME, '2 minutes', '120 s'), (units.SIZE, '40 Centimeters', '40 cm')])
def test_other_units_are_refused_with_the_same_in_units_of_files(quantity, text, advice):
    with pytest.raises(units.UnitError, match=f"; write '{advice}'$"):
        quantity.parse(text)
    quantity.parse(advice)
