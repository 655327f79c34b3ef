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
"""Test expressions with units and parameters."""

from __future__ import annotations

import contextlib
import math

from golden import answers, compare
from hypothesis import example, given
from hypothesis import strategies as st
from kachaka_simple_control.files.amounts import PARAMETER_QUANTITIES, read_value
from kachaka_simple_control.files.expressions import compute, compute_count, evaluate
from kachaka_simple_control.motion.units import (
    ANGLE,
    LENGTH,
    LINEAR_VELOCITY,
    POSITIVE_LINEAR_VELOCITY,
    TIME,
    UnitError,
)
import pytest

VALUES = {
    'side': read_value('57 cm'), 'laps': read_value('4'), 'turn': read_value('90 deg'),
    'bad': None}


@pytest.mark.parametrize('text, quantity, value', [
    ('$side', LENGTH, 0.57),
    ('50 cm + 7 cm', LENGTH, 0.57),
    ('0.1 m * 3', LENGTH, 0.3),
    ('2 * $side + 10 cm', LENGTH, 1.24),
    ('($side + 10 cm) / 2', LENGTH, 0.335),
    ('-$side', LENGTH, -0.57),
    ('10 cm - -(2 * 3 cm)', LENGTH, 0.16),
    ('$turn', ANGLE, ANGLE.parse('90 deg')),
    ('360 deg / $laps', ANGLE, math.pi / 2.0),
    ('$turn + 1 rad', ANGLE, math.pi / 2.0 + 1.0),
    ('$side / 2 s', LINEAR_VELOCITY, 0.285),
    ('$side / (10 cm/s)', TIME, 5.7),
    ('$side * ($turn / 45 deg)', LENGTH, 1.14),
    ('$bad + 1 m', LENGTH, None),
    ('0.2 m/s', LINEAR_VELOCITY, 0.2),
])
def test_an_expression_is_computed(text, quantity, value):
    assert compute(text, quantity, VALUES) == value


REFUSED = (
    '$sid', '$side + 90 deg', '1 m - 2', '$side * $side', '1 / $side', '$turn', '$laps',
    '1 m / ($laps - 4)', '2 * ', '* 2', '(2', '2) * 1', '2 3 * $side', '() + $side',
    'sin($turn)', '2 x $side', '$', '$ side', '1e999 * $side', '\uff11 m + $side', '0,5 m * 2',
    ' * '.join(['1e90'] * 3), '(' * 60 + '$side' + ')' * 60, ' + '.join(['$side'] * 10_000),
    '9' * 200 + ' * $side', '$side ** 2', '$side; $side', '1/2 m', '10 km/h', '$bad / 0',
    '1 m' + ' / $turn' * 100, '1 m' + ' * (1 rad / $turn)' * 50)


def test_what_is_no_length_is_refused_in_one_line():
    def refusal(text: str) -> str:
        with pytest.raises(UnitError) as caught:
            compute(text, LENGTH, VALUES)
        return str(caught.value)
    compare('expressions', answers(REFUSED, refusal))


def test_the_sign_of_a_result_is_checked():
    with pytest.raises(UnitError, match="'-\\$side / 1 s': '-0.57 m/s'; it must not be negative"):
        compute('-$side / 1 s', POSITIVE_LINEAR_VELOCITY, VALUES)


@pytest.mark.parametrize('text, count', [
    ('$laps', 4), ('2 * $laps - 1', 7), ('$laps / 3 * 3', 4), ('$side / 19 cm', 3)])
def test_a_count_is_whole(text, count):
    assert compute_count(text, VALUES) == count


@pytest.mark.parametrize('text, found', [('$laps / 3', '1.333 with laps 4'), ('$side', '0.57 m')])
def test_what_is_no_count_is_refused(text, found):
    with pytest.raises(UnitError, match=f'is {found}; it must be a whole number'):
        compute_count(text, VALUES)


NUMBERS = st.floats(-1e9, 1e9, allow_nan=False)


@given(NUMBERS, st.sampled_from(PARAMETER_QUANTITIES).flatmap(
    lambda quantity: st.tuples(st.just(quantity), st.sampled_from([*quantity.units]))))
@example(57.0, (LENGTH, 'cm'))
def test_a_parameter_has_the_bits_of_what_is_written(number, kind):
    quantity, unit = kind
    number = number if quantity is not TIME else abs(number)
    text = f'{number!r} {unit}'
    assert compute('$x', quantity, {'x': read_value(text)}) == quantity.parse(text)


def _terms(inner):
    return st.tuples(inner, st.sampled_from('+-*/'), inner, st.booleans()).map(
        lambda part: f'({part[0]} {part[1]} {part[2]})' if part[3] else
        f'{part[0]} {part[1]} {part[2]}')


@given(st.recursive(st.integers(-9, 9).map(str), _terms, max_leaves=8))
def test_numbers_are_computed_as_by_python(text):
    try:
        expected = eval(text.replace('--', '- -'))
    except ZeroDivisionError:
        with pytest.raises(UnitError, match='divides by 0'):
            evaluate(text, {})
        return
    found = evaluate(text, {})
    assert found.dimension == (0, 0, 0)
    assert found.value == pytest.approx(expected, rel=1e-9, abs=1e-9)


@given(st.text(alphabet=' $+-*/()0123456789.eEmsradegcx_°', max_size=40))
def test_any_text_is_computed_or_refused(text):
    with contextlib.suppress(UnitError):
        compute(text, LENGTH, {'x': read_value('1 m')})
