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
"""Claims that programs publish to each other: by hand, and at random."""

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.control.claims import Claim, Claims, HELD, MAX_CLAIMS, RELEASED, WANTED
from kachaka_simple_control.control.timing import CLAIM_TIMEOUT
import pytest

HOLDER = Claim('bb', HELD, 'holder')


def test_a_program_that_wants_the_robot_yields_to_its_holder():
    claims = Claims('cc')
    claims.on_claim(HOLDER, 0.0)
    assert claims.blocking_claim(0.1) == claims.holder(0.1) == HOLDER


def test_of_two_newcomers_the_lower_participant_wins():
    first, second = Claims('aa'), Claims('bb')
    first.on_claim(Claim('bb', WANTED, 'second'), 0.0)
    second.on_claim(Claim('aa', WANTED, 'first'), 0.0)
    assert first.blocking_claim(0.1) is None
    assert second.blocking_claim(0.1).who == 'first'


def test_a_claim_that_is_not_received_any_more_expires():
    """As of a program that was killed or is frozen, though DDS still lists it."""
    claims = Claims('cc')
    claims.on_claim(HOLDER, 10.0)
    assert claims.holder(10.0 + CLAIM_TIMEOUT) is HOLDER
    assert claims.holder(10.01 + CLAIM_TIMEOUT) is None


def test_a_claim_may_be_released():
    claims = Claims('cc')
    claims.on_claim(HOLDER, 0.0)
    claims.on_claim(Claim('bb', RELEASED, 'holder'), 0.1)
    assert claims.blocking_claim(0.2) is None


def test_the_number_of_stored_claims_is_bounded():
    claims = Claims('cc')
    for number in range(10 * MAX_CLAIMS):
        claims.on_claim(Claim(str(number), HELD, 'flood'), 0.0)
    claims.on_claim(HOLDER, 0.0)
    assert len(claims._received) <= MAX_CLAIMS
    assert claims.holder(0.1) is not None


@given(st.permutations(['aa', 'bb', 'cc', 'dd']))
def test_of_newcomers_that_receive_each_other_one_wins(order):
    programs = {participant: Claims(participant) for participant in order}
    for claims in programs.values():
        for participant in order:
            claims.on_claim(Claim(participant, WANTED, participant), 0.0)
    assert [name for name, claims in sorted(programs.items())
            if claims.blocking_claim(0.1) is None] == ['aa']


@given(
    st.builds(Claim, st.text(max_size=30), st.sampled_from([RELEASED, WANTED, HELD]), st.text()))
def test_a_claim_is_the_same_after_json(claim):
    read = Claim.from_json(claim.to_json())
    assert (read.participant, read.state) == (claim.participant, claim.state)
    assert read.who.isprintable()


@pytest.mark.parametrize('text', [
    '', '[]', '7', 'null', '{}', '{"participant": "aa"}', '[' * 100_000,
    '{"participant": 1, "state": "held", "who": "x"}',
    '{"participant": "aa", "state": "nonsense", "who": "x"}',
    '{"participant": "aa", "state": "held", "who": "x", "more": 1}'])
def test_hostile_texts_are_no_claims(text):
    assert Claim.from_json(text) is None


def test_the_description_of_a_holder_is_one_printable_line():
    claim = Claim.from_json(Claim('aa', HELD, 'a\nb\x1b[2J' + 'c' * 1000).to_json())
    assert claim.who.startswith('a?b?[2Jccc')
    assert len(claim.who) == 200
