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
"""Drives of a fleet in simulated time: the events as the driving program publishes them."""

from __future__ import annotations

from collections.abc import Mapping
import functools
import math

from kachaka_simple_control.analysis.fleet_summary import FleetLog
from kachaka_simple_control.control.events import (
    Event,
    FleetMember,
    FleetStarted,
    RobotEvent,
    RobotsApart,
    SessionEnded,
    SessionStarted,
)
from kachaka_simple_control.motion.geometry import Pose
from plans import SQUARE, SQUARE_CW
from simulated_drive import SimulatedDrive

ENDED = SessionEnded(5100.0)
#: Where robots begin: beside each other, in different directions.
STARTS = {
    'r1': Pose(0.0, 1.0), 'r2': Pose(1.5, -1.0, math.pi), 'r3': Pose(4.0, 2.0, math.pi / 2.0)}


@functools.cache
def driven(fault_at: float | None = None, pause: tuple[float, float] | None = None,
           goes_on: bool = False, rounds: int = 1) -> dict[str, SimulatedDrive]:
    """
    Return the drives of three robots, of which the second may have a fault in the last round.

    They are made once, and must not be changed.

    :param fault_at: when it has one [s after t = 0]; the others then stop, unless they go on
    :param pause: when all are paused and resumed [s after t = 0]
    """
    factors = () if pause is None else (
        (pause[0], {'pause': 0.0}), (pause[1], {}))
    drives = {}
    for number, name in enumerate(STARTS):
        drive = SimulatedDrive(20.0, title='square', seed=number)
        for count in range(1, rounds + 1):
            ends = fault_at is not None and count == rounds and (name == 'r2' or not goes_on)
            drive.drive(
                SQUARE_CW if name == 'r2' else SQUARE, fault_at if ends else math.inf,
                'r2: odometry has been silent for 0.5 s' if ends else None, factors=factors)
        drives[name] = drive
    return drives


def events_of(
        drives: Mapping[str, SimulatedDrive], *more: Event,
        ended: SessionEnded | None = ENDED,
        **about: object) -> list[Event | RobotEvent]:
    """
    Return the events of a fleet, in order of time.

    :param more: events of the fleet itself
    :param ended: None for a program that was killed
    :param about: more fields of ``FleetStarted``
    """
    started = FleetStarted('trio', tuple(
        FleetMember(name, STARTS[name], 'square_cw' if name == 'r2' else 'square')
        for name in drives), **about)
    events = [RobotEvent(name, event) for name, drive in drives.items()
              for event in drive.events if not isinstance(event, SessionEnded)]
    sessions = [event for event in events if isinstance(event.event, SessionStarted)]
    # A plan has no time here: it comes directly before what follows it.
    times, time = [], 0.0
    for event in reversed(events):
        time = getattr(event.event, 'time', None) or time
        times.append(time)
    timed = sorted([*zip(reversed(times), range(len(events)), events),
                    *((one.time, len(events), one) for one in more if isinstance(
                        one, RobotsApart))])
    return [started, *sessions, *(event for *_, event in timed if event not in sessions),
            *([] if ended is None else [ended])]


def log_of(drives: Mapping[str, SimulatedDrive], *more: Event, **about: object) -> FleetLog:
    """Return the log of a fleet; the parameters are those of ``events_of``."""
    log = FleetLog()
    for event in events_of(drives, *more, **about):
        log.on_event(event)
    return log
