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
"""A real-time test that fails is repeated only if the machine stood still during it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

from kachaka_simple_control.process.processes import is_stopped
from program import ROOT
import pytest
from real_time_trials import FOLDER
from stall_observer import MIN_STALL, StallObservers, too_many
from waiting import poll, wait_until

pytestmark = pytest.mark.real_time

TESTS = """
import os, pathlib, pytest, time

def see_stall(until=0.0):
    # As an observer would: from 0.2 s ago until now, or later [s].
    now = time.monotonic()
    with pathlib.Path(os.environ['STALL_OBSERVERS'], 'core-99').open('a') as seen:
        print(now - 0.2, now + until, file=seen)

trials = []
"""
FAILS_ONCE = """
@pytest.mark.ros
def test_fails_once():
    trials.append(1)
    if len(trials) == 1:
        see_stall()
        assert False
"""
FAILS = """
@pytest.mark.ros
def test_fails():
    trials.append(1)
    assert False, f'trial {len(trials)}'
"""


@pytest.fixture
def run(tmp_path):
    """Return a way to run tests with the plug-in, and to get what pytest printed."""
    def start(text, *options):
        tmp_path.joinpath('test_some.py').write_text(TESTS + text)
        more = {name: value for name, value in os.environ.items()
                if name != FOLDER and not name.startswith('PYTEST_')}
        return subprocess.run(
            [sys.executable, '-m', 'pytest', '-p', 'no:cacheprovider', '-p', 'conftest',
             '--rootdir', str(tmp_path), '-c', str(ROOT / 'pyproject.toml'), *options,
             str(tmp_path)],
            cwd=tmp_path, capture_output=True, text=True, check=False,
            env={**more, 'PYTHONPATH': os.pathsep.join(
                [str(ROOT / 'test'), str(ROOT), os.environ.get('PYTHONPATH', '')])})
    return start


def test_a_failed_trial_is_repeated_and_printed_if_the_machine_stood_still(run):
    result = run(FAILS_ONCE)
    assert result.returncode == 0, result.stdout
    assert 'REPEATED test_some.py::test_fails_once: core 99 stood still for 200 ms' in (
        result.stdout)
    assert 'real-time trials: 1, repeated because the machine stood still: 1' in result.stdout


def test_a_fixture_of_a_module_that_failed_is_made_anew(run):
    result = run("""
@pytest.fixture(scope='module')
def fails_once():
    trials.append(1)
    if len(trials) == 1:
        see_stall()
        assert False

@pytest.mark.ros
@pytest.mark.parametrize('number', range(3))
def test_some(fails_once, number):
    assert len(trials) == 2
""")
    assert result.returncode == 0, result.stdout
    assert '3 passed' in result.stdout


def test_a_trial_is_not_repeated_otherwise(run):
    result = run(FAILS)
    assert result.returncode == 1, result.stdout
    assert 'trial 1' in result.stdout
    assert 'trial 2' not in result.stdout
    assert 'repeated because the machine stood still: 0' in result.stdout


def test_a_run_with_too_many_repeated_trials_fails(run):
    result = run("""
failed = set()
@pytest.mark.ros
@pytest.mark.parametrize('number', range(30))
def test_some_fail_once(number):
    if number < 2 and number not in failed:
        failed.add(number)
        see_stall()
        assert False
""")
    assert result.returncode == 1, result.stdout
    assert '30 passed' in result.stdout
    assert 'more stalls than 5% of the trials, and than one a minute' in result.stdout


def test_a_long_run_of_few_trials_may_repeat_one_a_minute():
    assert not too_many(5, 16, 301.0)
    assert too_many(5, 16, 299.0)


def test_a_stall_that_met_several_trials_counts_once(run):
    result = run("""
failed = set()
@pytest.mark.ros
@pytest.mark.parametrize('number', range(3))
def test_some_fail_once(number):
    if number not in failed:
        if not failed:
            see_stall(until=3.0)
        failed.add(number)
        assert False
""")
    assert result.returncode == 0, result.stdout
    assert 'repeated because the machine stood still: 3 (stalls: 1)' in result.stdout


@pytest.mark.needs('xdist')
def test_workers_share_the_observers_and_report_what_was_repeated(run):
    result = run(FAILS_ONCE, '-n', '2')
    assert result.returncode == 0, result.stdout
    assert 'REPEATED test_some.py::test_fails_once' in result.stdout


def test_the_observers_see_a_core_that_stands_still(tmp_path):
    observers = StallObservers(tmp_path)
    observers.start()
    try:
        files = [tmp_path / f'core-{core}' for core in sorted(os.sched_getaffinity(0))]
        assert wait_until(lambda: all(file.exists() for file in files))
        time.sleep(0.1)
        begin = time.monotonic()
        for process in observers.processes:
            process.send_signal(signal.SIGSTOP)
        wait_until(lambda: all(is_stopped(process.pid) for process in observers.processes))
        time.sleep(2.0 * MIN_STALL)
        for process in observers.processes:
            process.send_signal(signal.SIGCONT)
        end = time.monotonic()
        # The core of an observer may be busy.
        poll(lambda: len(observers.between(begin, end)) >= len(files), 10.0)
        seen = observers.between(begin, end)
        assert {stall.core for stall in seen} == os.sched_getaffinity(0), (
            begin, end, [(file.name, file.read_text()) for file in files],
            [process.poll() for process in observers.processes])
    finally:
        observers.end()
    assert all(stall.end - stall.begin >= MIN_STALL for stall in seen)
    assert observers.between(begin - 10.0, begin - 5.0) == []
