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
"""Who may see the page and who may drive: hosts, origins, tokens and rates, without a network."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.console.security import (
    Access,
    allowed_hosts,
    RateLimit,
    Tokens,
)
import pytest

ACCESS = Access(allowed_hosts('127.0.0.1', 8400), None, 8400)
TOKENS = Tokens()
GUARDED = Access(allowed_hosts('192.0.2.7', 8400, ['robot.lan']), TOKENS, 8400)


@pytest.mark.parametrize('host', ['127.0.0.1:8400', 'localhost:8400', 'LocalHost:8400',
                                  '[::1]:8400'])
def test_own_names_are_hosts(host: str):
    assert ACCESS.is_own_host(host)
    assert ACCESS.is_same_origin(f'http://{host}', host)


@pytest.mark.parametrize('host', [
    None, '', '127.0.0.1', '127.0.0.1:80', 'evil.example', 'evil.example:8400',
    '127.0.0.1.evil.example:8400', 'localhost.:8400', '127.0.0.1:8400@evil.example',
    '127.0.0.1:8400, evil.example', 'robot.lan:8400'])
def test_other_names_are_none(host: str | None):
    assert not ACCESS.is_own_host(host)
    assert not ACCESS.is_same_origin(f'http://{host}', host)


@pytest.mark.parametrize('origin', [
    None, '', 'null', 'http://evil.example', 'https://127.0.0.1:8400', 'http://127.0.0.1',
    'http://127.0.0.1:8401', '127.0.0.1:8400', 'http://localhost:8400', 'ws://127.0.0.1:8400',
    'http://127.0.0.1:8400/', 'http://evil.example#http://127.0.0.1:8400', 'about:blank'])
def test_other_origins_are_refused(origin: str | None):
    assert not ACCESS.is_same_origin(origin, '127.0.0.1:8400')


def test_each_link_has_its_role():
    cookie = GUARDED.cookie
    assert 'driver' == GUARDED.role(f'{cookie}={TOKENS.driver}')
    assert 'viewer' == GUARDED.role(f'a=b; {cookie}={TOKENS.viewer}')
    assert GUARDED.role(f'other={TOKENS.driver}') is None
    assert GUARDED.role(f'{cookie}={TOKENS.driver}x') is None
    assert GUARDED.role(None) is None
    assert 'driver' == ACCESS.role(None)
    header = GUARDED.set_cookie(TOKENS.viewer)
    assert 'HttpOnly' in header
    assert 'SameSite=Strict' in header


def test_tokens_are_long_different_and_not_shown():
    other = Tokens()
    assert 4 == len({TOKENS.driver, TOKENS.viewer, other.driver, other.viewer})
    assert all(len(token) >= 32 for token in (TOKENS.driver, TOKENS.viewer))
    assert TOKENS.driver not in repr(TOKENS)


@given(st.lists(st.floats(0.0, 0.2), min_size=1, max_size=300))
def test_a_rate_is_never_exceeded_by_more_than_a_second(pauses: list[float]):
    limit, now, allowed = RateLimit(20.0, 0.0), 0.0, 0
    for pause in pauses:
        now += pause
        allowed += limit.allows(now)
    assert allowed <= 20.0 + 20.0 * now + 1e-6
