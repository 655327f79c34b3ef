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
"""
Repeat a real-time trial only if the machine itself stood still during it.

A plug-in of pytest, for the tests marked ``ros`` or ``real_time``.  A test that fails is a fact:
it is repeated only if observers outside the tests saw the machine stand still meanwhile.  Each
repeated trial is printed.  The run fails if the stalls that made it repeat some are more than one
in twenty trials and more than one a minute: a suite that makes its own gaps fails.
"""

from __future__ import annotations

import os
from pathlib import Path
import tempfile
import time
from typing import Any

from _pytest.runner import runtestprotocol
import pytest
from stall_observer import longest, MAX_REPEATED, StallObservers, too_many

#: How often a trial is made at most, however often the machine stands still.
MAX_TRIALS = 3
#: Where the observers write; given to the workers of pytest-xdist.
FOLDER = 'STALL_OBSERVERS'
REPEATED = 'repeated_because'
IS_PYTEST_6 = pytest.__version__.startswith('6.')
#: The marks of real-time tests.
MARKS = {'ros', 'real_time'}


class RealTimeTrials:
    """The plug-in; each worker has one, and the process that they report to has the observers."""

    def __init__(self) -> None:
        self._is_worker = FOLDER in os.environ
        self._scratch = None if self._is_worker else tempfile.TemporaryDirectory()
        if self._scratch is not None:
            os.environ[FOLDER] = self._scratch.name
        self._observers = StallObservers(Path(os.environ[FOLDER]))
        self._trials: set[str] = set()
        #: why each trial was repeated
        self._repeated: dict[str, list[str]] = {}
        #: when the stalls for it began [s, steady clock]; one meets the trials of all workers
        self._stalls: set[float] = set()
        self._began = time.monotonic()

    def pytest_sessionstart(self) -> None:
        """Start the observers."""
        if not self._is_worker:
            self._observers.start()

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item, nextitem: pytest.Item | None) -> Any:
        """Run a real-time test; others are left to pytest."""
        if not MARKS.intersection(mark.name for mark in item.iter_markers()):
            return None
        item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
        reasons: list[tuple[float, str]] = []
        while True:
            begin = time.monotonic()
            reports = runtestprotocol(item, nextitem=nextitem, log=False)
            if len(reasons) + 1 == MAX_TRIALS or not any(report.failed for report in reports):
                break
            stalls = self._observers.between(begin, time.monotonic())
            if not stalls:
                break
            stall = longest(stalls)
            reasons.append((stall.begin, str(stall)))
            # A fixture of the module, too, is made anew: it would fail as before.
            # Pytest 6, which Ubuntu 22.04 has, wants the item as well.
            item.session._setupstate.teardown_exact(*[item] * IS_PYTEST_6, None)
        for report in reports:
            report.user_properties.append((REPEATED, reasons))
            item.ihook.pytest_runtest_logreport(report=report)
        item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
        return True

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Count the trials, and those that were repeated."""
        for name, reasons in report.user_properties:
            if name == REPEATED and report.when == 'setup' and not report.skipped:
                self._trials.add(report.nodeid)
                if reasons:
                    self._repeated[report.nodeid] = [text for _, text in reasons]
                    self._stalls.update(begin for begin, _ in reasons)

    @property
    def _too_many(self) -> bool:
        return too_many(len(self._stalls), len(self._trials), time.monotonic() - self._began)

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """End the observers, and fail the run if too many trials were repeated."""
        if self._is_worker:
            return
        self._observers.end()
        if self._scratch is not None:
            self._scratch.cleanup()
        del os.environ[FOLDER]
        if self._too_many and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """Print each repeated trial, and their number."""
        if not self._trials:
            return
        write = terminalreporter.write_line
        for name, reasons in self._repeated.items():
            write(f'REPEATED {name}: {"; ".join(reasons)}')
        write(f'real-time trials: {len(self._trials)}, repeated because the machine stood still: '
              f'{len(self._repeated)} (stalls: {len(self._stalls)})')
        if self._too_many:
            write(f'more stalls than {MAX_REPEATED:.0%} of the trials, and than one a minute: the '
                  'run fails')
