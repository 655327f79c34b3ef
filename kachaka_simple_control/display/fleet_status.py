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
"""Compute the current status of a fleet from the events of its robots, for the display."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import math

from kachaka_simple_control.control.events import (
    DriveState,
    Event,
    FleetStarted,
    RobotEvent,
    SessionEnded,
)
from kachaka_simple_control.control.hold_text import HELD
from kachaka_simple_control.display.drive_status import DriveStatus, DriveTracker
from kachaka_simple_control.text import format_fixed, pluralize

#: The states by what a fleet shows if its robots differ, first the one that counts most.
_ORDER = (
    DriveState.DRIVING, DriveState.PAUSED, DriveState.CONNECTING, DriveState.WAITING,
    DriveState.STOPPING, DriveState.CUT_SHORT, DriveState.STOPPED, DriveState.READY)
#: In these states velocities are sent all the time.
_MOVING = (DriveState.DRIVING, DriveState.PAUSED)
#: A robot that stops with more than this left of its plan stops early [s].
END_TOLERANCE = 0.1
#: If the program waits for robots for this time, a line reports the wait [s].
WAIT_NOTICE_DELAY = 2.0
#: The largest number of robots that a line names.
MAX_NAMED = 3


@dataclass(frozen=True)
class RobotRow:
    """
    One robot of a fleet.

    :param trouble: what is wrong with it; empty if nothing is
    :param is_own: whether that is not the fault of another
    """

    name: str
    status: DriveStatus
    trouble: str = ''
    is_own: bool = False


@dataclass(frozen=True)
class FleetStatus:
    """
    The status of a fleet at one time.

    :param rows: first the robots that are in trouble, each in the order of the fleet
    :param round_number: from 1; 0 before the first
    :param elapsed: how far the robots are by their plans [s], of ``duration``
    :param factors: the speed factors below 1 of any robot, by the name of their source
    """

    title: str
    rows: tuple[RobotRow, ...]
    round_number: int
    rounds: int
    elapsed: float
    duration: float
    factors: Mapping[str, float]

    @property
    def state(self) -> DriveState:
        """Return the state of a robot that counts most; driving, if one drives."""
        return min((row.status.state for row in self.rows), default=DriveState.READY,
                   key=_ORDER.index)

    @property
    def waits_for_resume(self) -> bool:
        """Return whether a robot is held until somebody resumes, or could go on so."""
        return any(row.status.waits_for_resume for row in self.rows)


class FleetTracker:
    """Follows the status of one fleet from its events, which must arrive in order."""

    what, program = 'all robots', 'kachaka_fleet'

    def __init__(self, started: FleetStarted) -> None:
        self._started = started
        self._robots = {member.name: DriveTracker() for member in started.robots}
        #: the last event of the program; None if the program still runs or was killed
        self.session_ended: SessionEnded | None = None

    def on_event(self, event: Event | RobotEvent) -> None:
        """Update the status of the robot of an event."""
        if isinstance(event, RobotEvent):
            if (tracker := self._robots.get(event.robot)) is not None:
                tracker.on_event(event.event)
        elif isinstance(event, SessionEnded):
            self.session_ended = event

    def status_at(self, now: float) -> FleetStatus:
        """Return the status of the fleet at a time, according to all events so far."""
        statuses = {name: tracker.status_at(now) for name, tracker in self._robots.items()}
        states = {status.state for status in statuses.values()}
        rows = [self._row(name, status, states) for name, status in statuses.items()]
        factors: dict[str, float] = {}
        for status in statuses.values():
            for source, factor in status.factors.items():
                factors[source] = min(factor, factors.get(source, 1.0))
        durations = [status.duration or 0.0 for status in statuses.values()]
        return FleetStatus(
            self._started.name,
            tuple(sorted(rows, key=lambda row: (not row.is_own, not row.trouble))),
            max((tracker.motion_count for tracker in self._robots.values()), default=0),
            self._started.repeat,
            max((duration - status.time_left for duration, status in zip(
                durations, statuses.values())), default=0.0),
            max(durations, default=0.0), factors)

    @property
    def is_under_way(self) -> bool:
        """Whether a motion has begun and has not ended."""
        return any(tracker.is_under_way for tracker in self._robots.values())

    @property
    def has_keys(self) -> bool:
        """Whether the driving program reads keys from the terminal."""
        return any(tracker.has_keys for tracker in self._robots.values())

    @property
    def is_guarded(self) -> bool:
        """Whether the guardian stops each robot if the program is killed."""
        return all(tracker.is_guarded for tracker in self._robots.values())

    def _row(self, name: str, status: DriveStatus, states: set[DriveState]) -> RobotRow:
        """Return the row of a robot, given the states that robots of the fleet have."""
        if status.state is DriveState.CUT_SHORT:
            other, colon, rest = (status.reason or '').partition(': ')
            is_own = bool(colon) and other == name
            return RobotRow(name, status, rest if is_own else status.reason or '', is_own)
        if status.silent_for is not None and status.state in _MOVING:
            return RobotRow(name, status, f'no message for {status.silent_for:.0f} s', True)
        if status.state is DriveState.WAITING and states - {DriveState.WAITING, DriveState.READY}:
            left = '' if status.wait_left is None else f', {math.ceil(status.wait_left)} s left'
            return RobotRow(name, status, f'not ready: {status.topic}{left}', True)
        if (status.state is DriveState.STOPPING and status.time_left > END_TOLERANCE
                and DriveState.DRIVING in states):
            return RobotRow(name, status, 'stopped early, the others drive on', True)
        if status.is_late and status.state is DriveState.DRIVING:
            return RobotRow(
                name, status, f'late by {format_fixed(1e3 * status.lateness, 1)} ms', True)
        return RobotRow(name, status, status.held_by, status.has_own_hold)


def describe_states(rows: Sequence[RobotRow]) -> str:
    """Return in which states robots are, as in ``40 driving, 3 stopped``; one without a count."""
    counts = Counter(row.status.word for row in rows)
    if len(counts) == 1:
        return next(iter(counts))
    return ', '.join(
        f'{counts[word]} {word}' for word in (HELD, *(state.value for state in _ORDER))
        if counts[word])


class FleetLogger:
    """Creates text lines that say that a round begins, that robots are awaited, or in trouble."""

    def __init__(self) -> None:
        self._round = 0
        self._waits_since, self._has_noted_wait = math.inf, False
        self._told: set[tuple[str, str]] = set()

    def update(self, status: FleetStatus, now: float) -> list[str]:
        """Return the new lines to print for the current status; usually there are none."""
        lines = []
        if status.state is DriveState.DRIVING and status.round_number != self._round:
            self._round = status.round_number
            rounds = f'round {self._round} of {status.rounds}: ' if status.rounds > 1 else ''
            lines.append(f'{status.title}: {rounds}{pluralize(len(status.rows), "robot")} '
                         f'for {format_fixed(status.duration, 1)} s')
        lines += self._waits(status, now)
        for row in status.rows:
            # A wait has a line of its own, and that a robot is late may change at any time.
            if row.is_own and row.status.state is DriveState.CUT_SHORT and (
                    (fault := (row.name, row.trouble)) not in self._told):
                self._told.add(fault)
                lines.append(f'{row.name}: {row.trouble}')
        return lines

    def _waits(self, status: FleetStatus, now: float) -> list[str]:
        awaited = [row.name for row in status.rows if row.status.state is DriveState.WAITING]
        if not awaited:
            self._waits_since, self._has_noted_wait = math.inf, False
            return []
        self._waits_since = min(self._waits_since, now)
        if self._has_noted_wait or now - self._waits_since < WAIT_NOTICE_DELAY:
            return []
        self._has_noted_wait = True
        more = len(awaited) - MAX_NAMED
        rest = f' and {more} more' if more > 0 else ''
        return [f'{status.title}: waiting for {", ".join(awaited[:MAX_NAMED])}{rest}']
