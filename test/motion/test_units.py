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
"""Quantities as people write them."""

from __future__ import annotations

import math
import re
import time

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.motion.units import (
    ANGLE,
    ANGULAR_JERK,
    COMMAND_TIMEOUT,
    FREQUENCY,
    LENGTH,
    LINEAR_ACCELERATION,
    POSITIVE_LINEAR_VELOCITY,
    QUANTITIES,
    Quantity,
    TIME,
    UnitError,
)
import pytest

ALL = list(QUANTITIES.values())


@pytest.mark.parametrize('quantity, text, value', [
    (LENGTH, '0.5 m', 0.5),
    (LENGTH, '57 cm', 0.57),  # 57 * 0.01 is 0.5700000000000001
    (LENGTH, '-20cm', -0.2),
    (LENGTH, '+.5e3   mm', 0.5),
    (ANGLE, '90 deg', math.pi / 2),
    (ANGLE, '-360 deg', -2 * math.pi),
    (ANGLE, '1 rad', 1.0),
    (ANGLE, '90°', math.pi / 2),
    (TIME, '1.5 min', 90.0),
    (TIME, '250 ms', 0.25),
    (TIME, '0', 0.0),
    (POSITIVE_LINEAR_VELOCITY, '30 cm/s', 0.3),
    (LINEAR_ACCELERATION, '1 mm/s^2', 0.001),
    (ANGULAR_JERK, '180 deg/s^3', math.pi),
    (FREQUENCY, '1000 Hz', 1000.0),
])
def test_a_quantity_is_converted_from_its_unit(quantity, text, value):
    assert quantity.parse(text) == value


@pytest.mark.parametrize('quantity, text, words', [
    (TIME, '2 m', "'2 m'; it must be a time, as in 2 s (in s, ms or min)"),
    (TIME, '1:30', "'1:30'; write 1:30 as 90 s or 1.5 min"),
    (TIME, '-2 s', "'-2 s'; it must not be negative"),
    (COMMAND_TIMEOUT, '0 s', "'0 s'; it must be above 0 s"),
    (POSITIVE_LINEAR_VELOCITY, '-0.1', "'-0.1'; it must not be negative"),
    (POSITIVE_LINEAR_VELOCITY, 'fast',
     "'fast'; it must be a speed, as in 0.2 m/s (in m/s, cm/s or mm/s)"),
    (ANGLE, '90 º', "'90 º'; it must be an angle, as in 90 deg (in rad, deg or °)"),
    (ANGLE, '90', '90 has no unit; an angle needs one: write 90 deg or 90 rad'),
    (LENGTH, '-50.0', '-50.0 has no unit; a length needs one: write -50.0 cm or -50.0 m'),
    (FREQUENCY, '1001 Hz', "'1001 Hz'; it must be at most 1000 Hz"),
    (FREQUENCY, '20 hz', "'20 hz'; it must be a frequency, as in 20 Hz (in Hz)"),
    (LENGTH, '1e309 m', "'1e309 m' is too large a number"),
    (LENGTH, '\u22120.5 m',
     "'\u22120.5 m'; its minus is U+2212: write that of the keyboard, '-0.5 m'"),
    (LENGTH, '0,5 m', "'0,5 m'; write '0.5 m', with a point"),
    (TIME, '-1,25', "'-1,25'; write '-1.25', with a point"),
    (LENGTH, '0, 5 m', "'0, 5 m'; it must be a length, as in 0.5 m (in m, cm or mm)"),
    (LENGTH, '', "''; it must be a length, as in 0.5 m (in m, cm or mm)"),
])
def test_an_invalid_quantity_is_refused_with_the_units_that_fit(quantity, text, words):
    with pytest.raises(UnitError) as caught:
        quantity.parse(text)
    assert str(caught.value) == words


@given(st.sampled_from(ALL), st.text('0123456789.eE+- msradegHzin°/^23', max_size=12))
def test_the_pattern_accepts_what_the_parser_accepts(quantity: Quantity, text: str):
    """An editor marks what the program would refuse; only the size of a number it cannot check."""
    matches = re.search(quantity.pattern, text) is not None
    try:
        quantity.parse(text)
        refused = None
    except UnitError as error:
        refused = str(error)
    too_much = re.search('above 0|at most|too large', refused or '') is not None
    assert matches == (refused is None or too_much)


@pytest.mark.parametrize('text', [
    '9' * 10**6, '1' + ' ' * 10**6 + 'x', '1e' + '1' * 10**6, '9' * 10**6 + ' ',
    '9' * 10**6 + ',' + '9' * 10**6, '9,' * 10**6, '\u2212' + '9' * 10**6])
def test_a_long_text_is_refused_quickly(text):
    begin = time.process_time()
    with pytest.raises(UnitError):
        LENGTH.parse(text)
    assert re.search(LENGTH.pattern, text + 'x') is None
    assert time.process_time() - begin < 2.0
