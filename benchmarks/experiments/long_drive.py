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
Whether a long drive reaches its end, and what grows with it; ``python -m`` runs this.

A script with a million objects drives the simulated robot at 100 Hz with a report, beside one busy
process, and is paused each 10 s.  Printed are the memory of node and reader, the longest garbage
collection during the run, and the longest interval between two velocities.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
import fcntl
from itertools import pairwise
import json
from pathlib import Path
import struct
import sys
import tempfile
import termios
import time

from benchmarks import ROOT
from benchmarks.machine import busy
from program import children_of, environment, find_process, GONE, Program
from ros_domain import isolate_ros
from stall_observer import Stall, StallObservers

RATE = 100
#: The period and the duration of the pauses of the drive [s].
PAUSE_PERIOD, PAUSE_DURATION = 10.0, 1.0
#: The time after which memory must not grow [s]; libraries are then loaded and caches are full.
SETTLING_TIME = 300.0
#: The largest growth of memory after this time [MB], and the longest collection [s of CPU time].
MAX_NODE_GROWTH, MAX_READER_GROWTH, MAX_COLLECTION = 1.0, 5.0, 0.002
#: The largest excess of an interval over the period [s].
MAX_EXCESS = 0.05
READER = 'kachaka_simple_control.report.report_program'
#: The driving program: the command in a process with many objects in memory.
SCRIPT = """
import gc, json, sys, threading, time
objects = [{'number': number} for number in range(1000000)]
longest, began = (0.0,), 0.0

def on_collection(phase, info):
    global longest, began
    if phase == 'start':
        began = time.thread_time()
        return
    duration = time.thread_time() - began
    # During a run, the objects made before it are frozen; to count them takes 5 ms.
    if duration > longest[0] and gc.get_freeze_count():
        longest = duration, time.monotonic(), info, threading.current_thread().name

gc.callbacks.append(on_collection)
from kachaka_simple_control.__main__ import main
file, sys.argv = sys.argv[1], ['long_drive', *sys.argv[2:]]
try:
    code = main()
finally:
    with open(file, 'w') as file:
        json.dump({'longest': longest, 'is_frozen': bool(gc.get_freeze_count()),
                   'thresholds': gc.get_threshold(), 'is_enabled': gc.isenabled()}, file)
sys.exit(code)
"""


def private_memory(pid: int | None) -> float | None:
    """Return the private memory of a process [MB]; None if the process has ended."""
    try:
        lines = Path(f'/proc/{pid}/smaps_rollup').read_text().splitlines()
    except GONE:
        return None
    return sum(int(line.split()[1]) for line in lines if line.startswith('Private_')) / 1000


def waiting(pid: int | None) -> float | None:
    """Return what a process has not read of its standard input [kB]; None if it has ended."""
    try:
        with Path(f'/proc/{pid}/fd/0').open('rb', buffering=0) as pipe:
            return struct.unpack('i', fcntl.ioctl(pipe, termios.FIONREAD, bytes(4)))[0] / 1000
    except GONE:
        return None


def longest_interval(recording: Path, topic: str, stalls: Sequence[Stall]) -> float:
    """Return the longest interval between two velocities, except during stalls of a core [s]."""
    from mcap.reader import make_reader
    # The recording uses the system clock, the stalls use the steady clock.
    offset = time.time() - time.monotonic()
    with recording.open('rb') as file:
        times = [message.log_time / 1e9 - offset for _, _, message in make_reader(
            file).iter_messages(topics=[topic])]
    return max(end - begin for begin, end in pairwise(times)
               if not any(stall.meets(begin, end) for stall in stalls))


def samples(drive: Program, namespace: str) -> Iterator[tuple[float, float, float, float]]:
    """
    Pause and resume a drive until its end.

    Yield the time [s], the memory of node and reader [MB], and what the reader has not read [kB].
    """
    import rclpy
    from std_srvs.srv import Trigger
    rclpy.init(args=[])
    node = rclpy.create_node('long_drive')
    clients = [node.create_client(Trigger, f'{namespace}/kachaka_simple_control/{name}')
               for name in ('pause', 'resume')]
    began = time.monotonic()
    while not drive.is_over:
        for client in clients:
            if not drive.is_over and client.wait_for_service(5.0):
                rclpy.spin_until_future_complete(
                    node, client.call_async(Trigger.Request()), timeout_sec=5.0)
            time.sleep(PAUSE_DURATION)
        node_memory = private_memory(drive.process.pid)
        reader = find_process(children_of(drive.process.pid), READER)
        reader_memory, unread = private_memory(reader), waiting(reader)
        if node_memory is not None and reader_memory is not None and unread is not None:
            yield time.monotonic() - began, node_memory, reader_memory, unread
        time.sleep(PAUSE_PERIOD - 2 * PAUSE_DURATION)
    node.destroy_node()
    rclpy.shutdown()


def main(arguments: list[str] | None = None) -> int:
    """Drive and print the measured values; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--minutes', type=float, default=30.0)
    minutes = parser.parse_args(arguments).minutes
    isolate_ros()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        legs = round(minutes * 60 / 4.4 * 0.9)  # a leg takes 4.4 s; a tenth is paused
        (folder / 'long.yaml').write_text(
            f'name: long\nrate: {RATE} Hz\nsteps:\n'
            f'- repeat: {{times: {legs}, steps: [forward: 0.5 m, turn: 90 deg]}}\n')
        observers = StallObservers(folder)
        observers.start()
        began = time.monotonic()
        command = [sys.executable, '-c', SCRIPT, str(folder / 'collections.json'),
                   str(folder / 'long.yaml'), '--sim', '--quiet', '--report', str(folder / 'run')]
        with busy(1, 2 * minutes * 60 + 120), Program(
                command, env=environment(), cwd=ROOT) as drive:
            found = []
            for sample in samples(drive, ''):
                found.append(sample)
                print('{:7.0f} s  node {:7.2f} MB  reader {:7.2f} MB, {:7.1f} kB behind'.format(
                    *sample), flush=True)
            code = drive.end()
            print(drive.text[-300:])
        stalls = observers.between(began, time.monotonic())
        observers.end()
        collections = json.loads((folder / 'collections.json').read_text())
        run = json.loads((folder / 'run' / 'run.json').read_text())
        interval = longest_interval(
            folder / 'run' / 'run.mcap', run['topics']['velocity'], stalls)
    print(f'exit code {code}, {run["verdict"]["headline"]}; collections: {collections}')
    print(f'longest interval {1e3 * interval:.1f} ms, without {len(stalls)} times in which the '
          'machine stood still')
    # The last samples are from the time after the drive, when the report is written.
    settled = [sample for sample in found[:-3] if sample[0] >= min(SETTLING_TIME, minutes * 10)]
    growth = [settled[-1][column] - settled[0][column] for column in (1, 2)] if settled else [0, 0]
    print('growth from then on: node {:.2f} MB, reader {:.2f} MB'.format(*growth))
    is_kept = (code == 0 and collections['longest'][0] <= MAX_COLLECTION
               and interval <= 1.0 / RATE + MAX_EXCESS
               and growth[0] <= MAX_NODE_GROWTH and growth[1] <= MAX_READER_GROWTH)
    print('kept' if is_kept else 'MISSED')
    return int(not is_kept)


if __name__ == '__main__':
    sys.exit(main())
