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
"""Pause fleets of robots with limits of their own, and see how they end, and whether in step."""

from __future__ import annotations

from collections.abc import Sequence
import math
from pathlib import Path
import random
import threading
import time
from typing import Any

from benchmarks.fleet.drives import rounded
from benchmarks.fleet.fleet_files import write_corner, write_fleet, write_profiles
from benchmarks.fleet.in_step import departure, firsts, planned_ticks, Records
from benchmarks.fleet.scale import Scale
from benchmarks.fleet.stage import FLEET, Stage, START_TIMEOUT
from benchmarks.run import show
from kachaka_simple_control.files.fleet_file import find_fleet
from kachaka_simple_control.fleet.fleet_plan import FleetPlan, plan_fleet
from kachaka_simple_control.motion.geometry import distance_between, Pose, relative_to
from program import JsonProcess
from waiting import poll

ROBOTS = 10
#: When the drives are paused [s after their first velocities]: in the square, or on a first side.
TIME_TO_PAUSE = {True: (1.0, 12.0), False: (0.5, 1.5)}
#: How often a page that is open says so [s].
ALIVE_PERIOD = 0.25
#: How long a square may take beyond its plan and its pause [s].
PATIENCE = 10.0


class FleetPipe(JsonProcess):
    """The process of ``kachaka_fleet --pipe``, commanded as by the console."""

    def __init__(self, file: Path, stage: Stage) -> None:
        #: the newest state of the fleet
        self.state: dict[str, Any] = {}
        #: the answers to commands, by their number
        self.answers: dict[int, dict[str, Any]] = {}
        self._number = 0
        self._lock, self._is_over = threading.Lock(), threading.Event()
        super().__init__(
            [*FLEET, str(file), '--pipe'], self._on_report, cwd=stage.folder,
            env=stage.variables)
        threading.Thread(target=self._say_alive, daemon=True).start()

    def ask(self, what: str) -> str:
        """Send a command, and wait for its answer; return its text, and fail if it is refused."""
        self._number += 1
        number = self._number
        self._send({'type': what, 'id': number})
        answer = poll(lambda: self.answers.get(number), START_TIMEOUT)
        assert answer is not None, f'{what} was not answered; {self}'
        assert answer['is_done'], f'{what}: {answer["text"]}'
        return str(answer['text'])

    def close(self, timeout: float = 0.0, signum: int = 0) -> bool:
        """End it."""
        self._is_over.set()
        return super().close(timeout, signum)

    def _send(self, command: dict[str, Any]) -> None:
        with self._lock:
            self.write({'v': 1, **command})

    def _say_alive(self) -> None:
        while not self._is_over.wait(ALIVE_PERIOD) and not self.is_over:
            self._send({'type': 'alive'})

    def _on_report(self, report: dict[str, Any]) -> None:
        if report['type'] == 'fleet_state':
            self.state = report
        elif report['type'] == 'answer':
            self.answers[report['id']] = report


def measure_pauses(scale: Scale) -> list[dict[str, Any]]:
    """Pause drives around a square, or around its first corner; return an entry for each."""
    entries = []
    with Stage(ROBOTS, odometry_rate=50.0) as stage:
        stage.start_robots()
        file = write_fleet(
            stage.folder / 'fleet.yaml', stage.names,
            'square' if scale.has_square else write_corner(stage.folder), 10.0,
            profiles=write_profiles(stage.folder, stage.names))
        plan = plan_fleet(find_fleet(file))
        for number in range(1, scale.pauses + 1):
            stage.observer.clear()
            entries.append(_paused(stage, file, plan, scale))
            show('fleets that are paused', number, scale.pauses)
    return entries


def _paused(stage: Stage, file: Path, plan: FleetPlan, scale: Scale) -> dict[str, Any]:
    before = stage.observer.poses()
    with FleetPipe(file, stage) as pipe:
        poll(lambda: pipe.state, START_TIMEOUT)
        pipe.ask('run')
        assert stage.observer.wait_until_moving(START_TIMEOUT), f'it never moved; {pipe}'
        time.sleep(random.uniform(*TIME_TO_PAUSE[scale.has_square]))
        pipe.ask('pause')
        time.sleep(scale.pause)
        resumed = time.time()
        pipe.ask('resume')
        ended = poll(lambda: {*pipe.state['states']} <= {'done', 'stopped'},
                     plan.duration + scale.pause + PATIENCE, 0.05)
        apart, states = pipe.state['apart'], pipe.state['states']
        after, records = stage.observer.poses(), stage.observer.records()
        pipe.ask('release')
    return {
        'ended': bool(ended) and {*states} == {'done'}, 'arrived_apart': apart,
        **judged(plan, records, resumed, [
            moved(before[name], after[name]) for name in stage.names])}


def judged(
        plan: FleetPlan, records: Records, resumed: float,
        driven: Sequence[Pose]) -> dict[str, Any]:
    """
    Return how far a paused fleet was in step, and how far from its plan it has ended.

    :param resumed: when the pause ended [s, system clock]
    :param driven: by odometry, from where each robot began
    :returns: by how much the robots were apart when they left the next rest [s], None if one
        never did; the largest error of the end poses [m, degrees]
    """
    t0 = min(filter(None, firsts(records).values()))
    left = [departure(records[robot.name], planned_ticks(robot.plan),
                      [step.start for step in robot.plan.steps], resumed) for robot in plan.robots]
    known = [time - t0 for time in left if time is not None]
    errors = [distance_between(robot.plan.pose, pose)
              for robot, pose in zip(plan.robots, driven)]
    return {
        'late': rounded(max(known, default=0.0)),
        'apart': rounded(max(known) - min(known)) if len(known) == len(left) else None,
        'distance': round(max(distance for distance, _ in errors), 6),
        'angle': round(max(abs(math.degrees(angle)) for _, angle in errors), 4)}


def moved(before: Sequence[float], after: Sequence[float]) -> Pose:
    """Return a pose relative to an earlier one; headings from -180 to 180 degrees."""
    return relative_to(Pose(*before), Pose(*after))
