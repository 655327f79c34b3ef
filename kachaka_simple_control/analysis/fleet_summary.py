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
The log of a fleet's drive, and what follows from it: how each robot ended, and how far apart.

Tested by test/report/test_fleet_page.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
import math

from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.analysis.message_timing import Quantiles, quantiles
from kachaka_simple_control.analysis.summary import (
    NO_END,
    Outcome,
    outcome,
    OutcomeKind,
    signal_name,
    Summary,
)
from kachaka_simple_control.control.events import (
    Event,
    FleetMember,
    FleetStarted,
    MotionEnded,
    RobotEvent,
    RobotsApart,
    SessionEnded,
)
from kachaka_simple_control.text import pluralize

#: How the reason of a robot begins that was stopped after a fault of another.
WITH_ANOTHER = 'stopped because of '
#: The largest number of robots that a text names.
MAX_NAMED = 3


class FleetLog:
    """
    The logs of all robots of a fleet, filled from events; of one robot without a name if alone.

    :ivar started: None if there is no fleet
    :ivar robots: in the order of the fleet
    :ivar apart: how far they were apart at rests, each with its round, from 1
    :ivar session_ended: None if it was not received yet, or if the program was killed
    """

    def __init__(self) -> None:
        self.started: FleetStarted | None = None
        self.robots: dict[str, DriveLog] = {}
        self.apart: list[tuple[int, RobotsApart]] = []
        self.session_ended: SessionEnded | None = None

    def on_event(self, event: Event | RobotEvent) -> None:
        """Add an event to the log of its robot."""
        match event:
            case RobotEvent(robot, MotionEnded() as ended):
                self._log(robot).on_event(self._with_own_reason(robot, ended))
            case RobotEvent(robot, of_robot):
                self._log(robot).on_event(of_robot)
            case FleetStarted():
                self.started = event
                self.robots = {member.name: self._log(member.name) for member in event.robots}
            case RobotsApart():
                self.apart.append((self.rounds, event))
            case SessionEnded() if self.started is not None:
                self.session_ended = event
                for log in self.robots.values():
                    log.on_event(_for_robot(event, log))
            case _:
                self._log('').on_event(event)

    @property
    def rounds(self) -> int:
        """Return how many rounds were planned so far."""
        return max((len(log.motions) for log in self.robots.values()), default=0)

    def _log(self, robot: str) -> DriveLog:
        return self.robots.setdefault(robot, DriveLog())

    def _with_own_reason(self, robot: str, ended: MotionEnded) -> MotionEnded:
        """Leave out the name of a robot with a fault; say so if the fault is that of another."""
        name, colon, rest = (ended.reason or '').partition(': ')
        if not colon or name not in self.robots:
            return ended
        if name == robot:
            return replace(ended, reason=rest)
        return replace(ended, reason=f'{WITH_ANOTHER}{ended.reason}', is_fault=False)


def _for_robot(ended: SessionEnded, log: DriveLog) -> SessionEnded:
    # The error of the fleet is not that of a robot whose motions say how they ended.
    if any(motion.has_begun or motion.reason for motion in log.motions):
        return replace(ended, error=None)
    return ended


class RobotSummary(Summary):
    """The results of one robot of a fleet, each computed when it is first used."""

    def __init__(self, member: FleetMember, log: DriveLog) -> None:
        super().__init__(log)
        self.member = member

    @cached_property
    def outcome(self) -> Outcome:
        """Return how and why the drive of this robot ended, and how far it came."""
        found = outcome(self.log)
        if found.kind is OutcomeKind.STOPPED and self.reason.startswith(WITH_ANOTHER):
            return replace(found, headline='Stopped with another robot')
        return found

    @property
    def reason(self) -> str:
        """Return why the first motion that ended early did; empty if none did."""
        return next((motion.reason for motion in self.log.motions if motion.reason), '')

    @cached_property
    def lateness(self) -> Quantiles | None:
        """Return how far all velocities were from when they were due [s]; None without any."""
        return quantiles([
            abs(message.time - motion.began - message.due) for motion in self.log.motions
            for message in motion.own_messages if message.is_of_run and message.due is not None])

    @property
    def first_lateness(self) -> float | None:
        """Return how late the first velocity was [s]; None if none was sent."""
        return next((motion.own_messages[0].time - motion.began
                     for motion in self.log.motions if motion.own_messages), None)

    @property
    def longest_pause(self) -> float:
        """Return the duration of the longest pause [s]; 0 without one."""
        return max((part.end - part.begin for part in self.speed if part.is_pause), default=0.0)


class FleetSummary:
    """
    The results of a fleet's drive, each computed when it is first used.

    :param log: of a fleet; it must not change later
    """

    def __init__(self, log: FleetLog) -> None:
        assert log.started is not None
        self.log, self.started = log, log.started
        self.robots = [
            RobotSummary(member, log.robots[member.name]) for member in log.started.robots]

    @cached_property
    def outcome(self) -> Outcome:
        """Return how and why the drive of the fleet ended, and how far it came."""
        end, robots = self.log.session_ended, self.robots
        faulted = [robot for robot in robots if robot.outcome.kind is OutcomeKind.FAULTED]
        reason = _reasons(
            faulted or [robot for robot in robots if robot.reason], len(robots))
        if end is None:
            return Outcome(OutcomeKind.KILLED, 'Killed', f'{NO_END}. {self._progress}')
        if end.signal is not None:
            name = signal_name(end.signal)
            return Outcome(OutcomeKind.STOPPED, f'Stopped by {name}',
                           f'{name} ended the program. {self._progress}')
        if all(robot.outcome.kind is OutcomeKind.NEVER_BEGAN for robot in robots):
            return Outcome(
                OutcomeKind.NEVER_BEGAN, 'Never began',
                f'{end.error or reason or "The program ended without driving"}.')
        if faulted or end.error is not None:
            return Outcome(OutcomeKind.FAULTED, 'Faulted',
                           f'{reason or end.error}. {self._progress}')
        if reason:
            return Outcome(
                OutcomeKind.STOPPED, 'Stopped on request', f'{reason}. {self._progress}')
        return Outcome(OutcomeKind.DONE, 'Done', self._progress)

    @property
    def _progress(self) -> str:
        complete = [robot for robot in self.robots if robot.log.motions and all(
            motion.is_complete for motion in robot.log.motions)]
        rounds, planned = self.log.rounds, self.started.repeat
        count = pluralize(len(self.robots), 'robot')
        if len(complete) == len(self.robots):
            which = 'their motions' if planned == 1 else f'{rounds} of {planned} rounds'
            return f'{count} drove {which} to the end.'
        where = f', in round {rounds} of {planned}' if planned > 1 and rounds else ''
        return f'Of {count} {len(complete)} drove to the end{where}.'

    @property
    def planned_duration(self) -> float:
        """Return the planned duration of the robot that takes longest [s]."""
        return max((robot.planned_duration for robot in self.robots), default=0.0)

    @property
    def driven_duration(self) -> float:
        """Return the real duration of the robot that took longest [s]."""
        return max((robot.driven_duration for robot in self.robots), default=0.0)

    @property
    def first_apart(self) -> float | None:
        """Return how far apart the first velocities were late [s]; None without any."""
        found = [late for robot in self.robots if (late := robot.first_lateness) is not None]
        return max(found) - min(found) if found else None

    @property
    def worst_lateness(self) -> RobotSummary | None:
        """Return the robot whose lateness has the largest 99th percentile; None without any."""
        return max((robot for robot in self.robots if robot.lateness is not None), default=None,
                   key=_p99)

    @property
    def apart(self) -> float:
        """Return how far the robots were apart at most at a rest [s]; 0 if they never were."""
        return max((event.apart for _, event in self.log.apart), default=0.0)


def _p99(robot: RobotSummary) -> float:
    return -math.inf if robot.lateness is None else robot.lateness.p99


def _reasons(robots: Sequence[RobotSummary], count: int) -> str:
    """Return why some of a number of robots ended early, with their names unless it is all."""
    by_reason: dict[str, list[str]] = {}
    for robot in robots:
        reason = ' '.join(robot.reason.split()).rstrip('.') or 'the reason is not known'
        by_reason.setdefault(reason, []).append(robot.member.name)
    texts = [reason[0].upper() + reason[1:] if len(names) == count else
             f'{_names(names)}: {reason}' for reason, names in by_reason.items()]
    more = len(texts) - MAX_NAMED
    return '; '.join([*texts[:MAX_NAMED], *([f'and {more} more'] if more > 0 else [])])


def _names(names: Sequence[str]) -> str:
    more = len(names) - MAX_NAMED
    return ', '.join(names[:MAX_NAMED]) + (f' and {more} more' if more > 0 else '')
