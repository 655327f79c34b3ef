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
"""The address of a robot, velocity commands, error texts."""

from __future__ import annotations

import json
import math

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.control.diagnosis import Level
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.kachaka.grpc_client.command_arbiter import velocity_command
from kachaka_simple_control.kachaka.program import Address
from kachaka_simple_control.kachaka.robot_status import ErrorTexts
from kachaka_simple_control.motion.geometry import Velocity
import pytest

LIMITS = KACHAKA.limits
FINITE = st.floats(allow_nan=False, allow_infinity=False)


@pytest.mark.parametrize(('text', 'host', 'port'), [
    ('192.168.1.20', '192.168.1.20', 26400),
    ('192.168.1.20:26401', '192.168.1.20', 26401),
    (' kachaka.local ', 'kachaka.local', 26400),
    ('[fe80::1]:5', 'fe80::1', 5),
    ('[fe80::1]', 'fe80::1', 26400),
    ('fe80::1', 'fe80::1', 26400)])
def test_address_has_its_port_or_the_default(text, host, port):
    assert Address.parse(text) == Address(host, port)


@pytest.mark.parametrize('text', [
    '', ' ', ':26400', 'http://1.2.3.4', 'a b', '[::1', '[::1]x', '[]:1'])
def test_invalid_address_is_refused_with_an_example(text):
    with pytest.raises(ValueError, match=r'no address of a robot; write HOST or HOST:26400'):
        Address.parse(text)


@pytest.mark.parametrize('port', ['', '0', '65536', '-1', 'x', '٣', '1.0'])
def test_invalid_port_is_refused(port):
    with pytest.raises(ValueError, match='must be a number from 1 to 65535'):
        Address.parse(f'robot:{port}')


@given(FINITE, FINITE)
def test_velocity_is_clipped(linear_x, angular_z):
    wanted = velocity_command(Velocity(linear_x, angular_z), LIMITS, 1.0)
    assert -1.0 <= wanted.linear <= 1.0
    assert -1.0 <= wanted.angular <= 1.0
    assert wanted.linear == pytest.approx(max(-0.3, min(linear_x, 0.3)) / 0.3)
    assert wanted.angular == pytest.approx(max(-1.57, min(angular_z, 1.57)) / 1.57)
    assert wanted.is_stop == (wanted.linear == wanted.angular == 0.0)


@pytest.mark.parametrize('value', [math.nan, math.inf, -math.inf])
def test_velocity_must_be_finite(value):
    for velocity in (Velocity(value, 0.0), Velocity(0.0, value)):
        with pytest.raises(ValueError, match='must be finite numbers'):
            velocity_command(velocity, LIMITS, 0.0)


LIST = json.dumps([
    {'code': 13151, 'error_type': 'Error', 'title': 'x', 'title_en': 'Manual control\nis off.',
     'description_en': 'Switch it on.', 'ref_url': ''},
    {'code': 5, 'error_type': 'Warn', 'title': 'Only here', 'title_en': ''},
    {'code': 6, 'error_type': 'Ignore', 'title_en': None},
    {'code': 7, 'error_type': 'Bug', 'title_en': 'Broken'}])


def test_errors_are_described_in_english_in_one_line():
    texts = ErrorTexts(LIST)
    assert texts.describe(13151) == 'error 13151 (Manual control is off. Switch it on)'
    assert texts.describe(5) == 'error 5 (Only here)'
    assert texts.describe(6) == 'error 6'
    assert texts.describe(99) == 'error 99'
    assert [texts.find(code).level for code in (13151, 5, 6, 7, 99)] == [
        Level.ERROR, Level.WARN, Level.OK, Level.ERROR, Level.ERROR]


@given(st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(
        st.sampled_from(['code', 'title', 'title_en', 'error_type', 'description']), inner,
        max_size=5), max_leaves=10))
def test_any_json_is_accepted(value):
    texts = ErrorTexts(json.dumps(value))
    assert texts.describe(0).startswith('error 0')
    assert '\n' not in texts.describe(0)
