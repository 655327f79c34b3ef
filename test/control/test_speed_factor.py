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
"""The speed factor: a product of named factors, from any thread."""

from kachaka_simple_control.control.speed_factor import OVERRIDE, PAUSE, SpeedFactor
from kachaka_simple_control.errors import MotionRefusedError
import pytest


@pytest.fixture
def changes():
    return []


@pytest.fixture
def factor(changes):
    factor = SpeedFactor(lambda: 5.0)
    factor.on_change = lambda now, factors: changes.append((now, dict(factors)))
    return factor


def test_the_value_is_the_product_of_all(factor, changes):
    assert factor.value == 1.0
    assert factor.describe() == 'full speed'
    factor.set(OVERRIDE, 0.5)
    factor.set('obstacle', 0.4)
    assert factor.value == 0.2
    assert factor.describe() == 'speed 50 %, obstacle 40 %'
    factor.set(OVERRIDE, 1)
    assert factor.value == 0.4
    assert changes == [
        (5.0, {'override': 0.5}), (5.0, {'override': 0.5, 'obstacle': 0.4}),
        (5.0, {'obstacle': 0.4})]


def test_what_changes_nothing_is_no_change(factor, changes):
    assert factor.set(PAUSE, 0.0)
    assert not factor.set(PAUSE, 0.0)
    assert not factor.set(OVERRIDE, 1.0)
    assert len(changes) == 1


@pytest.mark.parametrize('value', [-0.1, 1.01, float('nan'), float('inf'), '1', None])
def test_what_is_no_factor_is_refused_and_changes_nothing(factor, changes, value):
    with pytest.raises(MotionRefusedError, match='it must be from 0 to 1'):
        factor.set(OVERRIDE, value)
    assert factor.value == 1.0
    assert changes == []


def test_a_factor_that_is_not_renewed_in_time_holds_the_robot(changes):
    now = [5.0]
    factor = SpeedFactor(lambda: now[0])
    factor.on_change = lambda at, factors: changes.append((at, dict(factors)))
    factor.set('obstacle', 1.0, valid_for=0.5)
    for _ in range(5):
        now[0] += 0.4
        assert factor.value == 1.0
        factor.set('obstacle', 1.0, valid_for=0.5)
    now[0] += 0.49
    assert (factor.value, factor.is_hold, dict(factor.factors)) == (1.0, False, {})
    now[0] += 0.01
    assert (factor.value, factor.is_hold, dict(factor.factors)) == (0.0, True, {'obstacle': 0.0})
    assert changes == [(now[0], {'obstacle': 0.0})]
    # It is back, and for ever.
    factor.set('obstacle', 0.5)
    now[0] += 99.0
    assert factor.value == 0.5


@pytest.mark.parametrize('valid_for', [0.0, -1.0, float('nan'), '1'])
def test_a_time_that_is_not_above_zero_is_refused(factor, changes, valid_for):
    with pytest.raises(MotionRefusedError, match='valid_for is .* it must be above 0'):
        factor.set('obstacle', 0.5, valid_for=valid_for)
    assert (factor.value, changes) == (1.0, [])
