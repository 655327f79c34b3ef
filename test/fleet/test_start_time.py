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
"""When a fleet begins by the clock, and whether chrony's word is enough."""

from __future__ import annotations

from datetime import datetime, timedelta
import os
import time

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.fleet.start_time import clock_error, start_time
import pytest

#: What `chronyc -n -c tracking` prints of a good clock.
GOOD = ('C0A80101,192.168.1.1,3,1795863284.690622410,0.000012,-0.000003,0.000020,-5.1,0.0,0.05,'
        '0.0010,0.0008,64.2,Normal')


def answer(offset='0.0', delay='0.0', dispersion='0.0', leap='Normal'):
    """Return an answer of chrony with some figures [s]."""
    return f'0,,3,0,{offset},0,0,0,0,0,{delay},{dispersion},64,{leap}'


@pytest.fixture
def chrony(tmp_path, monkeypatch):
    """Return a function that puts a chronyc, which prints a text, first on the PATH."""
    def install(text, code=0):
        program = tmp_path / 'chronyc'
        program.write_text(f'#!/bin/sh\necho "{text}"\nexit {code}\n')
        program.chmod(0o755)
    monkeypatch.setenv('PATH', f'{tmp_path}{os.pathsep}{os.environ["PATH"]}')
    return install


@pytest.mark.parametrize('text, error', [
    (GOOD, 0.000012 + 0.0008 + 0.0005), (answer(offset='-0.004'), 0.004),
    (answer(delay='0.010'), 0.005), (answer(dispersion='0.006'), 0.006),
    (answer(leap='Not synchronised'), float('inf')), ('', float('inf')),
    ('506 Cannot talk to daemon', float('inf')), (answer(offset='nothing'), float('inf'))])
def test_the_error_of_the_clock(text, error):
    """Offset, dispersion and half the delay, as the documentation of chronyc adds them up."""
    assert clock_error(text) == pytest.approx(error)


@pytest.mark.parametrize('form', ['%H:%M:%S', '%Y-%m-%dT%H:%M:%S', '%Y-%m-%d %H:%M:%S'])
def test_a_time_becomes_one_of_the_steady_clock(chrony, form):
    chrony(GOOD)
    wanted = (datetime.now().astimezone() + timedelta(seconds=30)).replace(microsecond=0)
    found = start_time(wanted.strftime(form)) - time.monotonic()
    assert found == pytest.approx(wanted.timestamp() - time.time(), abs=0.1)


def test_a_time_of_day_that_is_over_is_tomorrow(chrony):
    chrony(GOOD)
    before = datetime.now().astimezone() - timedelta(minutes=5)
    ahead = start_time(before.strftime('%H:%M:%S')) - time.monotonic()
    assert 85_000.0 < ahead < 90_001.0


@pytest.mark.parametrize('text, reason', [
    ('soon', 'is no time; write one as in 14:30:00'), ('25:00:00', 'is no time'),
    ('2020-01-01T00:00:00', 'that was .* s ago'), ('2999-01-01T00:00:00', 'h ahead')])
def test_what_is_no_start_is_refused(chrony, text, reason):
    chrony(GOOD)
    with pytest.raises(UsageError, match=reason):
        start_time(text)


@pytest.mark.parametrize('text, code, reason', [
    (answer(offset='0.007'), 0, 'may be wrong by 7.0 ms by chrony'),
    (answer(leap='Not synchronised'), 0, 'is not synchronised by chrony'),
    ('506 Cannot talk to daemon', 1, 'is chronyd running')])
def test_a_clock_that_chrony_does_not_vouch_for_is_refused(chrony, text, code, reason):
    chrony(text, code)
    with pytest.raises(UsageError, match=reason):
        start_time((datetime.now().astimezone() + timedelta(minutes=1)).strftime('%H:%M:%S'))


def test_without_chrony_it_is_refused(monkeypatch, tmp_path):
    monkeypatch.setenv('PATH', str(tmp_path))
    with pytest.raises(UsageError, match='apt install chrony'):
        start_time((datetime.now().astimezone() + timedelta(minutes=1)).strftime('%H:%M:%S'))
