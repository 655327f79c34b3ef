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
"""Stop fleets: by signals, without their guardian, the bridge of a robot, or a whole robot."""

from __future__ import annotations

import os
import random
import signal
import time
from typing import Any

from benchmarks.fleet.drives import rounded, timing
from benchmarks.fleet.fleet_files import write_fleet, write_long, write_moves
from benchmarks.fleet.in_step import first_zeros, moved_after, Records
from benchmarks.fleet.scale import Scale
from benchmarks.fleet.stage import EXIT_TIMEOUT, Stage
from benchmarks.run import show

SIGNALS = ('SIGINT', 'SIGKILL', 'SIGSTOP')
GUARDIAN, BRIDGE, GO_ON, MISSING = (
    'guardian killed', 'bridge killed', 'bridge killed, go_on', 'robot missing')
#: The time from the first velocities to a fault [s]: at any place between two velocities.
TIME_TO_FAULT = (0.2, 0.6)
#: How long zeros of a stop may come after a fault; odometry of a killed bridge is silent before
#: that is a fault [s].
STOP_TIME, SILENCE_TIME = 0.6, 1.8
#: How long a fleet waits for a robot that never comes [s], and its name.
PATIENCE, GHOST = 2.0, 'ghost'
#: The moves of a fleet that goes on: the fault comes in the first, and is seen in the second or
#: third [s].
MOVES = 4


def measure_stops(scale: Scale) -> list[dict[str, Any]]:
    """Stop fleets in each way; return an entry for each time."""
    trials = [
        *(name for name in SIGNALS for _ in range(scale.signals)),
        *[GUARDIAN] * scale.guardians, *[BRIDGE] * scale.bridges, *[GO_ON] * scale.go_on,
        MISSING]
    entries = []
    # The last robot has a bridge of its own, which can be killed.
    with Stage(scale.stopped, own=1) as stage:
        stage.start_robots()
        for number, what in enumerate(trials, 1):
            stage.observer.clear()
            entries.append({'what': what, **_trial(stage, what)})
            show('fleets that are stopped', number, len(trials))
    return entries


def _trial(stage: Stage, what: str) -> dict[str, Any]:
    if what == MISSING:
        return _missing(stage)
    if what == GO_ON:
        return _gone_on(stage)
    file = write_fleet(stage.folder / 'fleet.yaml', stage.names, write_long(stage.folder), 10.0)
    with stage.fleet(file) as program:
        stage.run(program)
        guardian = program.guardian
        time.sleep(random.uniform(*TIME_TO_FAULT))
        inject = {GUARDIAN: lambda: _kill(guardian), BRIDGE: lambda: _kill_bridge(stage)}
        fault = inject[what]() if what in inject else program.send(signal.Signals[what])
        time.sleep(SILENCE_TIME if what == BRIDGE else STOP_TIME)
        frozen = what == 'SIGSTOP'
        code = None if frozen else program.code_within(EXIT_TIMEOUT)
        records, said = stage.observer.records(), program.last_line()
    if what == BRIDGE:
        stage.replace_last()
    return {**stopped(records, fault, stage.names[-1] if what == BRIDGE else None),
            'code': code, 'said': said}


def stopped(records: Records, fault: float, killed: str | None = None) -> dict[str, Any]:
    """
    Return how a fleet was stopped.

    :param killed: the robot whose bridge was killed; its fault is seen when the first zero comes
    :returns: the time from the fault to the last robot's first zero [s]; None if one got none;
        how many velocities moved a robot after its first
    """
    zeros = first_zeros(records, fault)
    known = [zero for zero in zeros.values() if zero is not None]
    others = [zero for name, zero in zeros.items() if name != killed]
    since = min(known, default=fault) if killed is not None else fault
    last = None if None in others else max(filter(None, others))
    return {
        'zero': None if last is None else rounded(last - since),
        'seen': rounded(min(known) - fault) if known else None,
        'moved_after': moved_after(records, zeros)}


def _gone_on(stage: Stage) -> dict[str, Any]:
    """Kill the bridge of one robot; return whether the others have driven their whole plans."""
    file = write_fleet(
        stage.folder / 'fleet.yaml', stage.names, write_moves(stage.folder, MOVES), 10.0,
        on_fault='go_on')
    with stage.fleet(file) as program:
        stage.run(program)
        fault = _kill_bridge(stage)
        code = program.code_within(MOVES + EXIT_TIMEOUT)
        records, said = stage.observer.records(), program.last_line()
    stage.replace_last()
    killed = stage.names[-1]
    others = {name: sent for name, sent in records.items() if name != killed}
    driven = timing(file, others, None)
    alone = {killed: records[killed]}
    return {
        **stopped(alone, fault), 'code': code, 'said': said, 'lost': driven['lost'],
        'error': driven['errors'][-1]}


def _missing(stage: Stage) -> dict[str, Any]:
    """Let a fleet wait for a robot that is not there; return what it said, and who moved."""
    names = [*stage.names, GHOST]
    file = write_fleet(stage.folder / 'fleet.yaml', names, write_long(stage.folder), 10.0)
    with stage.fleet(file, names=names, patience=PATIENCE) as program:
        code = program.code_within(PATIENCE + 2.0 * EXIT_TIMEOUT)
        records, said = stage.observer.records(), program.last_line()
    moved = sum(one.moves for sent in records.values() for one in sent)
    return {'zero': None, 'seen': None, 'moved_after': moved, 'code': code, 'said': said}


def _kill(pid: int) -> float:
    now = time.time()
    os.kill(pid, signal.SIGKILL)
    return now


def _kill_bridge(stage: Stage) -> float:
    return stage.bridges[-1].send(signal.SIGKILL)
