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
"""The rows of the matrix about the obstacle watch."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from benchmarks.stop_matrix import faults, fleets, obstacles, pauses, scripts
from benchmarks.stop_matrix.expectation import Expectation, Zero
from benchmarks.stop_matrix.lasers import Lasers, Mode
from benchmarks.stop_matrix.limits import NODE, NOTHING, SIGNAL
from benchmarks.stop_matrix.pauses import State
from benchmarks.stop_matrix.trial_setup import Row, TrialContext
from kachaka_simple_control.control.timing import SCAN_TIMEOUT

#: The faults that are also tested while an obstacle holds the robot, with the same limits.
WHILE_HELD = (
    'SIGINT (Ctrl+C)', 'SIGKILL', 'SIGSTOP', 'listener leaves',
    'listener killed: odometry falls silent')
#: The faults while an obstacle holds the robot in the quick form.
QUICK_WHILE_HELD = ('SIGKILL',)
#: The time limits [s] for the request of a stop; and from the last scan until a robot of 0.3 m/s
#: is at rest: two velocities until it brakes, and the duration of the brake.
REQUESTED = 0.05
NO_SCANS = SCAN_TIMEOUT + 0.2 + 0.85
#: Trials of a row in the quick form.
QUICK = 1
#: What each row has in common.
WATCHED: dict[str, object] = {
    'script': scripts.WATCHED, 'options': ('watch:=true', 'robot:=./laser.yaml'),
    'has_lasers': True, 'full': 5, 'quick': 0}


def _row(
        expectation: Expectation, inject: Callable[[TrialContext], float],
        **more: object) -> Row:
    return Row(expectation, inject, **{**WATCHED, **more})  # type: ignore[arg-type]


def _held(row: Row) -> Row:
    what = row.expectation.what
    checks = [check for check in (row.check, pauses.check_no_velocity) if check]
    held = replace(
        row, expectation=replace(row.expectation, what=f'{what}, while {State.HELD.value}'),
        inject=pauses.at(State.HELD, row.inject),
        check=lambda context, fault: [
            text for check in checks for text in check(context, fault)],
        **WATCHED)  # type: ignore[arg-type]
    return replace(held, quick=QUICK) if what in QUICK_WHILE_HELD else held


def _silent(what: str, lose: Callable[[Lasers], object], **more: object) -> Row:
    return _row(
        Expectation(f'{what}: held, then SIGINT', NODE, (130,), limit=NO_SCANS),
        obstacles.lose_scans(lose), after=obstacles.interrupt_held, check=obstacles.check_braked,
        exclusive=False, **more)


def obstacle_rows(in_motion: Mapping[str, Row]) -> tuple[Row, ...]:
    """Return the rows; ``in_motion`` has those without a watch by their names."""
    stop = Row(Expectation('`~/stop`', NODE, (1,), limit=REQUESTED), obstacles.request_stop)
    fleet: dict[str, object] = {
        'script': fleets.WATCHED, 'options': (), 'robots': 2, 'batch_size': 2,
        'measures_distance': False}
    return (
        *(_held(row) for row in (*map(in_motion.__getitem__, WHILE_HELD), stop)),
        _row(Expectation('an obstacle comes and goes', NOTHING, (0,), Zero.AT_END),
             obstacles.come_and_go, check=obstacles.check_goes_on, duration=3.0, quick=QUICK),
        _silent('the laser is killed', obstacles.kill_laser, quick=QUICK),
        _silent('the laser repeats a scan', obstacles.fail_by(Mode.FROZEN)),
        _silent('scans are stamped in the future', obstacles.fail_by(Mode.FUTURE)),
        _row(Expectation('a scan that cannot be read', NODE, (1,)), obstacles.break_scans),
        _row(Expectation('no scan comes', 'nothing moves', (3,), Zero.NONE), faults.fault_now,
             script=scripts.UNSEEING, has_lasers=False, after=faults.wait(4.0), moves=False,
             measures_distance=False, check=obstacles.check_nothing_moved),
        _row(Expectation('an obstacle before one robot comes and goes, a fleet of 2', NOTHING,
                         (0,), Zero.AT_END),
             obstacles.come_and_go, check=obstacles.check_goes_on, duration=3.0, **fleet),
        _row(Expectation('SIGINT while an obstacle holds one robot, a fleet of 2', NODE, (130,),
                         limit=SIGNAL),
             obstacles.all_held(faults.send_signals('SIGINT')), **fleet),
    )
