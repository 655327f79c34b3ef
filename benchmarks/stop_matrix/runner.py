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
"""Run the trials: prepare programs in parallel, and measure them one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
import itertools
import random
import threading
import time

from benchmarks.run import show
from benchmarks.stop_matrix.expectation import Trial
from benchmarks.stop_matrix.robot_pool import RobotPool
from benchmarks.stop_matrix.trial_setup import finish_trial, inject_fault, Row, TrialContext

#: The range of the random time from the start of a motion to the fault [s].
TIME_TO_FAULT = (0.2, 0.4)
#: The largest number of programs that start at the same time.
MAX_STARTING = 3


def run(rows: Sequence[tuple[Row, int]], over_grpc: bool = False) -> dict[str, list[Trial]]:
    """Run all trials."""
    results: dict[str, list[Trial]] = {row.expectation.what: [] for row, _ in rows}
    queue = [row for row, count in rows for _ in range(count)]
    done = 0
    with RobotPool(over_grpc) as pool:
        for batch in batches(queue):
            for row, trial in zip(batch, _run_batch(batch, pool)):
                results[row.expectation.what].append(trial)
            done += len(batch)
            show('programs that drive, and what happens to them', done, len(queue))
            pool.limit_free(batch[-1].batch_size)
    return results


def batches(queue: Sequence[Row]) -> Iterator[list[Row]]:
    """Split trials into batches that can be prepared in parallel."""
    for (_, size), group in itertools.groupby(
            queue, key=lambda row: (row.background, row.batch_size)):
        while batch := [*itertools.islice(group, size)]:
            yield batch


def _run_batch(rows: Sequence[Row], pool: RobotPool) -> list[Trial]:
    robots = [pool.take(row.slow_robot, row.over_link) for row in rows]
    contexts: list[TrialContext] = []
    try:
        for robot in robots:
            robot.wait_until_there()
        for row, robot in zip(rows, robots):
            contexts.append(TrialContext(row, robot))
            if len(contexts) >= MAX_STARTING:
                contexts[-MAX_STARTING].wait_until_ready()
        for context in contexts[1 - MAX_STARTING:]:
            context.wait_until_ready()
        with rows[0].background(contexts[0]):
            return _run_trials(contexts)
    finally:
        for context in contexts:
            context.end()
        for row, robot in zip(rows, robots):
            pool.put_back(robot, row.robot_reusable)


def _run_trials(contexts: Sequence[TrialContext]) -> list[Trial]:
    measured = threading.Lock()

    def run_trial(context: TrialContext) -> Trial:
        with measured:
            began = time.monotonic()
            fault = inject_fault(context, lambda: random.uniform(*TIME_TO_FAULT))
        trial = finish_trial(context, fault)
        return replace(trial, began=began, ended=time.monotonic())

    with ThreadPoolExecutor(max_workers=len(contexts)) as threads:
        return [*threads.map(run_trial, contexts)]
