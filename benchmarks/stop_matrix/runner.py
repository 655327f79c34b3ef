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
"""Plays the trials: programs are prepared side by side, their measured moments come in turn."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
import itertools
import random
import threading

from benchmarks.load import busy
from benchmarks.progress import show
from benchmarks.stop_matrix.robot_pool import Cast
from benchmarks.stop_matrix.rows import Row
from benchmarks.stop_matrix.trial import Trial
from benchmarks.stop_matrix.trial_setup import follow, play, Scene

#: How long a program moves before anything happens [s]: a random time, for what is asked for is
#: the worst moment.
BEFORE = (0.2, 0.4)
#: How many programs may be starting at the same time: more would only wait for each other.
AT_ONCE = 3


def run(rows: Sequence[tuple[Row, int]], over_grpc: bool = False) -> dict[str, list[Trial]]:
    """
    Try every row.

    :param rows: the rows, and how often each is tried
    :param over_grpc: whether robots are to be reached over gRPC, by a bridge
    :returns: what was seen, by the name of the row
    """
    seen: dict[str, list[Trial]] = {row.promise.what: [] for row, _ in rows}
    queue = [row for row, count in rows for _ in range(count)]
    done = 0
    with Cast(over_grpc) as cast:
        for batch in batches(queue):
            for row, trial in zip(batch, _batch(batch, cast)):
                seen[row.promise.what].append(trial)
            done += len(batch)
            show('programs that drive, and what happens to them', done, len(queue))
            cast.spare(batch[-1].together)
    return seen


def batches(queue: Sequence[Row]) -> Iterator[list[Row]]:
    """
    Cut trials into batches that can be prepared side by side.

    :param queue: a row for each trial
    :returns: the batches; all rows of one have the same load, and want as many beside them
    """
    for _, alike in itertools.groupby(queue, key=lambda row: (row.busy, row.together)):
        rest = [*alike]
        while rest:
            yield rest[:rest[0].together]
            rest = rest[rest[0].together:]


def _batch(rows: Sequence[Row], cast: Cast) -> list[Trial]:
    members = cast.take(rows)
    scenes: list[Scene] = []
    try:
        for row, member in zip(rows, members):
            scenes.append(Scene(row, member))
            if len(scenes) >= AT_ONCE:
                scenes[-AT_ONCE].wait_until_ready()
        for scene in scenes[1 - AT_ONCE:]:
            scene.wait_until_ready()
        with busy(rows[0].busy):
            return _perform(scenes)
    finally:
        for scene in scenes:
            scene.end()
        cast.put_back(rows, members)


def _perform(scenes: Sequence[Scene]) -> list[Trial]:
    stage = threading.Lock()

    def perform(scene: Scene) -> Trial:
        with scene.row.beside(scene):
            with stage:
                fault = play(scene, lambda: random.uniform(*BEFORE))
            return follow(scene, fault)

    with ThreadPoolExecutor(max_workers=len(scenes)) as threads:
        return [*threads.map(perform, scenes)]
