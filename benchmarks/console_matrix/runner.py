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
"""Run the trials, one after the other; repeat those that say nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
import tempfile
import time

from benchmarks.console_matrix.rows import Row
from benchmarks.console_matrix.stage import Stage
from benchmarks.console_matrix.trial import excess, LOAD_FACTOR, SpoiltError, Trial
from selenium.common.exceptions import WebDriverException
from stall_observer import describe, StallObservers

#: How often a trial may begin.
MAX_ATTEMPTS = 4


@dataclass
class Results:
    """The results of a run."""

    trials: dict[str, list[Trial]] = field(default_factory=dict)
    repeated: list[str] = field(default_factory=list)


class Runner:
    """Runs trials, one after the other."""

    def __init__(self, stage: Stage, observers: StallObservers, under_load: bool) -> None:
        self._stage, self._observers, self._under_load = stage, observers, under_load
        self.results = Results()

    def run(self, row: Row, count: int) -> None:
        """Run the trials of a row; end with the first that could not be tried."""
        what, began = row.expectation.what, time.monotonic()
        trials = self.results.trials[what] = []
        while len(trials) < count and not (trials and trials[-1].not_tried):
            trials.append(self._trial(row))
        print(f'{what}: {len(trials)} in {time.monotonic() - began:.0f} s', flush=True)

    def _trial(self, row: Row) -> Trial:
        """Run a trial until it says something."""
        reason = ''
        for _ in range(MAX_ATTEMPTS):
            try:
                trial = row.run(self._stage)
            except SpoiltError as error:
                reason = str(error)
            except (RuntimeError, AssertionError, OSError, WebDriverException) as error:
                reason = _line(error)
                self._stage.restart()
            except Exception as error:  # the results of the other rows must not be lost
                self._stage.restart()
                return Trial(broken=(_line(error),))
            else:
                reason = self._excuse(row, trial)
                if not reason:
                    return trial
                self.results.repeated.append(reason)
            print(f'Repeated {row.expectation.what}: {reason}', flush=True)
        return Trial(broken=(f'no trial succeeded: {reason}',))

    def _excuse(self, row: Row, trial: Trial) -> str:
        """Return why a trial that misses only its time limits says nothing; empty if it does."""
        late = excess(row.expectation, trial, LOAD_FACTOR if self._under_load else 1.0)
        if late is None:
            return ''
        # The stalls between command and zero must be as long as the zero is late.
        offset = time.monotonic() - time.time()
        begin, end = trial.began + offset, trial.ended + offset
        stalls = self._observers.between(begin, end)
        lost = max((min(stall.end, end) - max(stall.begin, begin) for stall in stalls),
                   default=0.0)
        return f'{1e3 * late:.0f} ms late, while {describe(stalls)}' if lost >= late else ''


def _line(error: Exception) -> str:
    return f'{type(error).__name__}: {error}'.partition('\n')[0]


def run(rows: Sequence[tuple[Row, int]], under_load: bool) -> Results:
    """Run all trials."""
    with tempfile.TemporaryDirectory() as seen, Stage() as stage:
        observers = StallObservers(Path(seen))
        observers.start()
        try:
            runner = Runner(stage, observers, under_load)
            for row, count in rows:
                runner.run(row, count)
        finally:
            observers.end()
    return runner.results
