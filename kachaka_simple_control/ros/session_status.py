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
"""The state of a session for diagnostics: snapshot, tick statistics, level."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
import time
from typing import NamedTuple

from kachaka_simple_control.control.guardian import Guardian, NullGuardian
from kachaka_simple_control.control.plan_runner import Tick, TickScheduler
from kachaka_simple_control.control.stop import StandstillDetector
from kachaka_simple_control.control.velocity_gate import GateState, VelocityGate
from kachaka_simple_control.errors import ControlError
from kachaka_simple_control.motion.plan import Plan, PlannedStep
from kachaka_simple_control.report.metrics import LATE
from kachaka_simple_control.ros.manual_control_client import ManualControlClient
from kachaka_simple_control.ros.robot_discovery import RobotDiscovery
from kachaka_simple_control.telemetry.events import (
    Event,
    MotionEnded,
    MotionPlanned,
    MotionStarted,
    VelocitySent,
)

#: How much is kept for a count that does not come; an hour of 20 Hz.
MAX_TICKS = 100_000
#: How much is counted at once.
AT_ONCE = 100


class TickStatistics:
    """
    Counts what happens.

    To be told of it takes no time; the counting is done later, in the thread that asks for it.
    """

    def __init__(self) -> None:
        """Have seen no motion yet."""
        #: the name of the newest motion; empty before there is one
        self.motion = ''
        #: velocities of all motions that left a quarter of a period or more after their time
        self.late = 0
        #: velocities of all motions that never left: the next was due by then
        self.skipped = 0
        #: why the newest motion was over before its end; None if it was not
        self.failure: str | None = None
        #: whether a motion was planned and is not over
        self.is_on = False
        #: takes what happens, from any thread
        self.on_event: Callable[[Event], None]
        self._unread: deque[Event | Plan] = deque(maxlen=MAX_TICKS)
        self.on_event = self.on_plan = self._unread.append
        self._stages: Sequence[PlannedStep] = ()
        self._began: float | None = None
        self._period = 0.0
        self._player: TickScheduler | None = None
        self._due: Tick | None = None

    @property
    def has_begun(self) -> bool:
        """Whether the newest motion has sent its first velocity."""
        return self._began is not None

    def process(self) -> None:
        """Count what happened since; in one thread at a time."""
        counted = 0
        while self._unread:
            self._take(self._unread.popleft())
            counted += 1
            if counted % AT_ONCE == 0:
                time.sleep(0.0)  # lets go of the interpreter: the robot's thread may wait for it

    def _take(self, event: Event | Plan) -> None:
        match event:
            case Plan():
                self._expect(event)
            case VelocitySent():
                if self._due is not None:
                    self._count(event.time)
            case MotionStarted():
                self._began = event.time
                self._due = self._player.due(0.0) if self._player else None
            case MotionPlanned():
                self.motion, self.is_on, self.failure = event.motion.name, True, None
            case MotionEnded():
                self.is_on, self.failure, self._due = False, event.reason, None

    def _expect(self, plan: Plan) -> None:
        self._stages, self._period = plan.steps, plan.period
        self._player, self._began, self._due = TickScheduler(plan), None, None

    def step(self, now: float) -> tuple[int, int]:
        """
        Return how far the newest motion is.

        :param now: the time [s]
        :returns: the number of the step under way, and of all; 0 before the first
        """
        count = len(self._stages)
        if self._began is None:
            return 0, count
        passed = bisect_right(self._stages, now - self._began, key=_end)
        return min(passed + 1, count), count

    def _count(self, now: float) -> None:
        assert self._began is not None
        assert self._player is not None
        elapsed = now - self._began
        due, self._due = self._next()
        while self._due is not None and self._due.deadline <= elapsed:
            self.skipped += 1
            due, self._due = self._next()
        if elapsed - due >= LATE * self._period:
            self.late += 1

    def _next(self) -> tuple[float, Tick | None]:
        """Return when the next velocity is due, and what; nothing after the last zero."""
        assert self._due is not None
        assert self._player is not None
        return self._due.deadline, self._player.due(self._due.deadline)


def _end(stage: PlannedStep) -> float:
    return stage.end


@dataclass(frozen=True)
class SessionStatus:
    """
    One look at it.

    :param subscriber_count: how many take the node's velocities
    :param other_publishers: who else has a publisher of velocities: the names of their nodes
    :param guardian: what became of the guardian
    :param odometry_age: how old the newest odometry is [s]; None if there was none
    :param manual_control: whether manual control is on, as far as this node knows
    :param halted_by: why nothing moves any more; None if it does
    """

    subscriber_count: int
    other_publishers: tuple[str, ...]
    guardian: str
    odometry_age: float | None
    manual_control: str
    halted_by: str | None


class StatusReader:
    """Looks at the parts of a session, from any thread, and changes nothing."""

    def __init__(
            self, edge: VelocityGate, link: RobotDiscovery, guardian: Guardian | NullGuardian,
            odometry: StandstillDetector, manual_control: ManualControlClient,
            halted_by: Callable[[], ControlError | None]) -> None:
        """
        Look at nothing yet.

        :param edge: where velocities leave
        :param link: what the graph tells of the robot
        :param guardian: who stops the robot if this process cannot
        :param odometry: what odometry tells
        :param manual_control: what the robot may need beside a subscription
        :param halted_by: returns why nothing moves any more
        """
        self._edge = edge
        self._link = link
        self._guardian = guardian
        self._odometry = odometry
        self._manual_control = manual_control
        self._halted_by = halted_by

    @property
    def is_closed(self) -> bool:
        """Whether the robot was given back: nothing is to be published any more."""
        return self._edge.state is GateState.CLOSED

    def read(self, now: float) -> SessionStatus:
        """
        Look.

        :param now: the time [s on the steady clock]
        :returns: how it is now
        """
        halted_by = self._halted_by()
        return SessionStatus(
            subscriber_count=self._link.subscriber_count,
            other_publishers=tuple(self._link.other_publishers()),
            guardian=_guardian(self._guardian),
            odometry_age=self._odometry.age(now),
            manual_control=self._manual_control.state(now),
            halted_by=str(halted_by) if halted_by else None)


def _guardian(guardian: Guardian | NullGuardian) -> str:
    if isinstance(guardian, NullGuardian):
        return 'off'
    if guardian.stopped_because is not None:
        return f'stopped the robot because {guardian.stopped_because}'
    return 'matched' if guardian.is_matched else 'not matched yet'


#: Odometry older than this is worth a warning [s]: it comes 10 times a second and more.
OLD = 1.0


class Severity(IntEnum):
    """The levels of ``diagnostic_msgs/msg/DiagnosticStatus``."""

    OK = 0
    WARN = 1
    ERROR = 2


class Diagnosis(NamedTuple):
    """
    What is told once a second.

    :param level: how bad it is
    :param message: the worst of it, in a sentence
    :param values: what there is to know, by name
    """

    level: Severity
    message: str
    values: dict[str, str]


def diagnose(tally: TickStatistics, standing: SessionStatus, now: float) -> Diagnosis:
    """
    Judge.

    :param tally: how the drive goes
    :param standing: how the node stands with its robot
    :param now: the time [s on the steady clock]
    :returns: the diagnosis
    """
    state = _state(tally, standing)
    level, message = _worst(tally, standing, state)
    age = standing.odometry_age
    return Diagnosis(level, message, {
        'state': state,
        'motion': tally.motion or 'none',
        'step': '{} of {}'.format(*tally.step(now)),
        'late ticks': str(tally.late),
        'skipped ticks': str(tally.skipped),
        'listeners': str(standing.subscriber_count),
        'other publishers': ', '.join(standing.other_publishers) or 'none',
        'guardian': standing.guardian,
        'odometry age': 'never heard' if age is None else f'{age:.2f} s',
        'manual control': standing.manual_control,
    })


def _state(tally: TickStatistics, standing: SessionStatus) -> str:
    if standing.halted_by is not None:
        return 'halted'
    if tally.is_on:
        return 'driving' if tally.has_begun else 'meeting the robot'
    if not tally.motion:
        return 'nothing to drive yet'
    return 'at rest' if tally.failure is None else 'stopped early'


def _worst(tally: TickStatistics, standing: SessionStatus, state: str) -> tuple[Severity, str]:
    if standing.halted_by is not None:
        return Severity.ERROR, f'halted for good: {standing.halted_by}'
    if standing.guardian.startswith('stopped'):
        return Severity.ERROR, f'the guardian {standing.guardian}'
    if tally.failure is not None:
        return Severity.WARN, f'the last motion was over before its end: {tally.failure}'
    doubts = [
        ('nobody takes our velocities', not standing.subscriber_count),
        (f'others have publishers of velocities: {", ".join(standing.other_publishers)}',
        standing.other_publishers),
        ('odometry is silent', (standing.odometry_age or 0.0) > OLD),
        ('velocities were skipped', tally.skipped),
    ]
    for doubt, is_so in doubts:
        if is_so:
            return Severity.WARN, doubt
    return Severity.OK, state
