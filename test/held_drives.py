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
"""Drives in which an obstacle watch holds a robot, and their logs."""

from __future__ import annotations

from collections.abc import Sequence
import math

from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.control.events import (
    Event,
    MotionStarted,
    OdometryReceived,
    ScanReceived,
    WatchChanged,
    WatchState,
)
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.motion.geometry import ORIGIN, Pose, relative_to
from kachaka_simple_control.motion.steps import Forward, Motion, Turn
from simulated_drive import SimulatedDrive

#: 0.5 m ahead, which takes 2.3 s, and a turn to the left.
AHEAD = Motion('ahead', (Forward(0.5), Turn(1.5)))
#: What the laser sees, from where the robot starts.
POST = (0.9, 0.05)
#: How old the scan is for which the robot is held [s].
SCAN_AGE = 0.05
NEAR = WatchState.OBSTACLE, 0.3, 0.0
#: When a hold begins and ends [s after t = 0], and what the watch says meanwhile, each 0.1 s.
Hold = tuple[float, float, Sequence[tuple[object, ...]]]


def held_drive(*holds: Hold, until: float = math.inf, **options: object) -> list[Event]:
    """
    Return the events of a watched drive along AHEAD by an exact robot.

    :param until: when it is interrupted [s after t = 0]
    """
    drive = SimulatedDrive(
        20.0, lateness=lambda _: 0.0, parameters=SimulationParameters(), **options)
    drive.drive(
        AHEAD, until, None if until == math.inf else 'stopped by SIGINT', factors=[
            change for begin, end, _ in holds
            for change in ((begin, {'obstacle': 0.0}), (end, {}))])
    drive.close()
    began = next(event.time for event in drive.events if isinstance(event, MotionStarted))
    odometry = [event for event in drive.events if isinstance(event, OdometryReceived)]
    more = [ScanReceived(began - 0.2, ((2.0, 0.0),)), WatchChanged(began - 0.1, WatchState.CLEAR)]
    for begin, end, said in holds:
        taken = began + begin - SCAN_AGE
        pose = relative_to(odometry[0].pose, min(
            odometry, key=lambda one: abs(one.time - taken)).pose) if odometry else ORIGIN
        seen = relative_to(pose, Pose(*POST))
        more += [ScanReceived(taken, ((seen.x, seen.y),)),
                 *(WatchChanged(began + begin + 0.1 * number, *what)
                   for number, what in enumerate(said)),
                 WatchChanged(began + end, WatchState.CLEAR)]
    events: list[Event] = []
    for event in drive.events:
        while more and more[0].time < (getattr(event, 'time', None) or -math.inf):
            events.append(more.pop(0))
        events.append(event)
    return events


def log_of(events: Sequence[Event]) -> DriveLog:
    """Return the log of events."""
    log = DriveLog()
    for event in events:
        log.on_event(event)
    return log
