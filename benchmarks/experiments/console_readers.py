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
Measure how much the readers of a console delay the velocities of a drive.

Run this with ``python -m``.  A motion is driven at 50 Hz: without a reader; with three WebSocket
clients that take every message and one that takes none; and with three tabs of Chromium.  Shown is
how far the intervals between velocities are off the period, from the source timestamps of DDS.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from contextlib import ExitStack
import itertools
import sys
import time
from typing import TYPE_CHECKING

from benchmarks.console_matrix.raw_client import RawClient
from kachaka_simple_control.analysis.message_timing import median, quantile
from program import restore_signals

if TYPE_CHECKING:
    from benchmarks.console_matrix.stage import Stage

RATE, DURATION = 50.0, 10.0
MOTION = f'name: ahead\nrate: {RATE:g} Hz\nsteps: [forward: {{length}} m]\n'
#: The speed of the motion [m/s], which gives its length.
SPEED = 0.3
#: By how much readers may lengthen the 99th percentile [s].
MAX_EXCESS = 0.001


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and print a line for each run; return 1 if the readers cost too much, else 0."""
    parser = argparse.ArgumentParser(prog='benchmarks.experiments.console_readers')
    parser.add_argument('--runs', type=int, default=5, help='runs of each kind (default: 5)')
    options = parser.parse_args(arguments)
    from kachaka_simple_control.ros.dds_transport import use_localhost_only
    # Called before rclpy is imported, so that no other robot receives these messages.
    use_localhost_only()
    restore_signals()
    from benchmarks.console_matrix.stage import Stage
    kinds: dict[str, Callable[[ExitStack, Stage], None]] = {
        'no reader': lambda _, __: None, 'four clients': clients, 'three tabs': tabs}
    found: dict[str, list[float]] = {name: [] for name in kinds}
    with Stage() as stage:
        for number, (name, begin) in itertools.product(range(options.runs), kinds.items()):
            with ExitStack() as stack:
                begin(stack, stage)
                off = intervals_off(stage)
            stage.leave_page()
            found[name].append(quantile(off, 0.99))
            print(f'run {number + 1}, {name}: interval off by {1e3 * median(off):.2f} / '
                  f'{1e3 * quantile(off, 0.99):.2f} / {1e3 * max(off):.2f} ms '
                  '(median / 99 % / worst)', flush=True)
    percentiles = {name: median(values) for name, values in found.items()}
    for name, value in percentiles.items():
        print(f'{name}: 99 % of the intervals within {1e3 * value:.2f} ms of the period '
              f'(median of {options.runs} runs)')
    return int(percentiles['four clients'] - percentiles['no reader'] > MAX_EXCESS)


def clients(stack: ExitStack, stage: Stage) -> None:
    """Connect three clients that read, and one that does not."""
    for _ in range(3):
        stack.callback(RawClient(stage.console.port).greet().close)
    deaf = RawClient(stage.console.port, reads=False)
    deaf.send('hello')
    stack.callback(deaf.close)


def tabs(_: ExitStack, stage: Stage) -> None:
    """Open three tabs with the page."""
    stage.browser.open(stage.console.address)
    for _tab in range(2):
        stage.browser.open_another(stage.console.address)
    time.sleep(1.0)


def intervals_off(stage: Stage) -> list[float]:
    """Drive the motion, and return how far each interval was off the period [s]."""
    console = stage.console
    driver = RawClient(console.port).greet()
    try:
        driver.take()
        began = time.time()
        text = MOTION.format(length=DURATION * SPEED)
        answer = driver.ask('run', text=text, name='ahead.yaml')
        if not answer['is_done']:
            raise RuntimeError(answer['text'])
        driver.until(lambda: driver.state['state'] == 'driving')
        driver.until(lambda: driver.state['state'] != 'driving', DURATION + 20.0)
        moves = [one.time for one in console.recorder.sent_since(began) if one.moves]
        return [abs(after - before - 1.0 / RATE) for before, after in itertools.pairwise(moves)]
    finally:
        driver.close()


if __name__ == '__main__':
    sys.exit(main())
