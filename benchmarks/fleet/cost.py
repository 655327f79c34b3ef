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
"""Measure what a robot costs in a fleet and in a program of its own, also while it stands by."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import contextlib
import signal
import time
from typing import Any

from benchmarks.fleet.drives import UsageSampler
from benchmarks.fleet.fleet_files import MOVE_TIME, write_fleet, write_long, write_moves
from benchmarks.fleet.scale import Scale
from benchmarks.fleet.stage import (
    DriveProgram,
    end,
    EXIT_TIMEOUT,
    Stage,
    STANDING_BY,
    START_TIMEOUT,
)
from benchmarks.process_usage import participants_at, peak_memory, traffic_at
from benchmarks.run import show
from benchmarks.stop_matrix.network import Network, unavailable_reason

#: So slow that odometry is no traffic [Hz].
SILENT = 0.05
#: For how long the traffic of programs that stand by is counted, after a time in which they still
#: announce themselves often [s].
COUNTED, SETTLING_TIME = 5.0, 15.0


def measure_programs(scale: Scale) -> list[dict[str, Any]]:
    """
    Drive robots by as many programs at 10 Hz; return what these used while all drove.

    They are started one after the other: a program that starts may hold up those that drive.
    """
    entries = []
    for number, count in enumerate(scale.programs, 1):
        show('as many programs of one robot', number, len(scale.programs))
        with Stage(count, own=count) as stage, contextlib.ExitStack() as stack:
            motion = write_long(stage.folder)
            stage.start_robots()
            programs = []
            for name in stage.names:
                programs.append(stack.enter_context(stage.program(name, motion, 10.0)))
                stage.observer.wait_until_moving(START_TIMEOUT, [name])
            driving = [program for program in programs if not program.is_over]
            began = time.time()
            with UsageSampler(driving) as sampler:
                time.sleep(scale.moves * MOVE_TIME)
            used = sampler.entry(began, time.time())
            lost = sum(program.is_over for program in programs)
            for program in programs:
                program.send(signal.SIGINT)
            for program in programs:
                program.code_within(EXIT_TIMEOUT)
            entries.append({'robots': count, 'lost': lost, **used})
    return entries


def measure_standing_by(scale: Scale) -> list[dict[str, Any]]:
    """
    Let fleets, and as many programs, stand by; return participants, traffic and memory.

    They are in a network namespace, where nobody else sends; none if that is not possible.
    """
    if not scale.programs:
        return []
    if reason := unavailable_reason():
        print(f'What stands by is left out: {reason}')
        return []
    entries = []
    kinds = [(scale.fleets[0], False), (scale.fleets[-1], False),
             *((count, True) for count in scale.programs)]
    for number, (count, has_programs) in enumerate(kinds, 1):
        show('programs that stand by', number, len(kinds))
        # As many bridges as programs, as if each robot were a machine.
        with Network() as network, Stage(
                count, own=count if has_programs else 0, odometry_rate=SILENT,
                has_observer=False, network=network) as stage:
            stage.start_robots()
            bridge = stage.bridges[0].process.pid
            before = traffic_at(bridge)
            with _standing_by(stage, has_programs) as programs:
                time.sleep(SETTLING_TIME)
                found = traffic_at(bridge)
                time.sleep(COUNTED)
                traffic = traffic_at(bridge).since(found)
                pids = [pid for program in programs
                        for pid in (program.process.pid, program.guardian)]
                entries.append({
                    'robots': count, 'programs': len(programs),
                    'participants': participants_at(bridge, stage.domain),
                    'bridges': len(stage.bridges),
                    'memory': round(sum(map(peak_memory, pids)), 1),
                    'found_size': found.since(before).size,
                    'packets': round(traffic.packets / COUNTED, 1),
                    'size': round(traffic.size / COUNTED, 1)})
                for program in programs:
                    end(program)
    return entries


@contextlib.contextmanager
def _standing_by(stage: Stage, has_programs: bool) -> Iterator[Sequence[DriveProgram]]:
    motion = write_moves(stage.folder, 1)
    with contextlib.ExitStack() as stack:
        if has_programs:
            programs = [stack.enter_context(stage.program(name, motion, 10.0, '--wait'))
                        for name in stage.names]
        else:
            file = write_fleet(stage.folder / 'fleet.yaml', stage.names, motion, 10.0)
            programs = [stack.enter_context(stage.fleet(file, '--wait'))]
        for program in programs:
            program.wait_for(STANDING_BY)
        yield programs
