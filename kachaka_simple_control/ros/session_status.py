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

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
import time

from kachaka_simple_control.analysis.message_timing import LATE
from kachaka_simple_control.control.guardian import Guardian, NullGuardian
from kachaka_simple_control.control.speed_factor import is_hold, SpeedFactor
from kachaka_simple_control.control.standstill import StandstillDetector
from kachaka_simple_control.control.tick_scheduler import Tick, TickScheduler
from kachaka_simple_control.control.velocity_gate import GateState, VelocityGate
from kachaka_simple_control.errors import ControlError
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.ros.manual_control_client import ManualControlClient
from kachaka_simple_control.ros.robot_discovery import RobotDiscovery
from kachaka_simple_control.telemetry.diagnosis import Diagnosis, Level
from kachaka_simple_control.telemetry.events import (
    Event,
    MotionEnded,
    MotionPlanned,
    MotionStarted,
    PlanClock,
    VelocitySent,
)

#: How many events are kept until they are processed; an hour of 20 Hz.
MAX_EVENTS = 100_000
#: How many events are processed before other threads may run.
BATCH_SIZE = 100
#: Odometry older than this is worth a warning [s]: it comes 10 times a second and more.
ODOMETRY_WARN_AGE = 1.0


class TickStatistics:
    """
    Counts late and skipped velocities.

    To receive an event takes no time: events are counted later, in the thread that calls
    ``process``.
    """

    def __init__(self) -> None:
        #: the name of the newest motion; empty before there is one
        self.motion = ''
        #: velocities of all motions that left a quarter of a period or more after their time
        self.late = 0
        #: velocities of all motions that never left: the next was due by then
        self.skipped = 0
        #: why the newest motion was over before its end; None if it was not
        self.failure: str | None = None
        #: whether a motion was planned and is not over
        self.is_active = False
        #: receives events, from any thread
        self.on_event: Callable[[Event], None]
        self._unread: deque[Event | Plan] = deque(maxlen=MAX_EVENTS)
        self.on_event = self.on_plan = self._unread.append
        self._plan: Plan | None = None
        self._scheduler: TickScheduler | None = None
        self._started: float | None = None
        self._clock: PlanClock | None = None
        self._tick: Tick | None = None

    @property
    def has_started(self) -> bool:
        """Whether the newest motion has sent its first velocity."""
        return self._started is not None

    def process(self) -> None:
        """Count the events received since the last call; in one thread at a time."""
        count = 0
        while self._unread:
            self._process(self._unread.popleft())
            count += 1
            if count % BATCH_SIZE == 0:
                time.sleep(0.0)  # releases the interpreter lock for the robot's thread

    def step(self, now: float) -> tuple[int, int]:
        """
        Return how far the newest motion is.

        :param now: the time [s on the steady clock]
        :returns: the number of the step under way, and of all; 0 before the first
        """
        if self._plan is None or not self._plan.steps:
            return 0, 0
        number = 0 if self._clock is None else self._plan.step_index(
            self._clock.plan_time(now)) + 1
        return number, len(self._plan.steps)

    def _process(self, event: Event | Plan) -> None:
        match event:
            case Plan():
                self._plan, self._scheduler = event, TickScheduler(event)
                self._started = self._tick = self._clock = None
            case VelocitySent():
                if self._clock is not None:
                    self._clock.on_sent(event)
                if event.plan_time is not None:
                    self._tick = None  # not as planned: what is late is unknown from here on
                if self._tick is not None:
                    self._count(event.time)
            case MotionStarted():
                self._started, self._clock = event.time, PlanClock(event.time)
                self._tick = self._scheduler.due(0.0) if self._scheduler else None
            case MotionPlanned():
                self.motion, self.is_active, self.failure = event.motion.name, True, None
            case MotionEnded():
                self.is_active, self.failure, self._tick = False, event.reason, None

    def _count(self, now: float) -> None:
        assert self._started is not None
        assert self._plan is not None
        elapsed = now - self._started
        due = self._advance()
        while self._tick is not None and self._tick.deadline <= elapsed:
            self.skipped += 1
            due = self._advance()
        if elapsed - due >= LATE * self._plan.period:
            self.late += 1

    def _advance(self) -> float:
        """Go on to the next tick, None after the last zero; return when it is due."""
        assert self._tick is not None
        assert self._scheduler is not None
        due = self._tick.deadline
        self._tick = self._scheduler.due(due)
        return due


@dataclass(frozen=True)
class SessionStatus:
    """
    The state of a session at one time.

    :param subscriber_count: how many take the node's velocities
    :param other_publishers: the names of other nodes that publish velocities
    :param guardian: the state of the guardian
    :param odometry_age: how old the newest odometry is [s]; None if there was none
    :param manual_control: whether manual control is on, as far as this node knows
    :param speed_factor: the speed factor, from 0 to 1; 1: as planned
    :param speed: who asks for less speed
    :param stopped_by: why nothing moves any more; None if it does
    """

    subscriber_count: int
    other_publishers: tuple[str, ...]
    guardian: str
    odometry_age: float | None
    manual_control: str
    speed_factor: float
    speed: str
    stopped_by: str | None


class StatusReader:
    """
    Reads the state of the parts of a session, from any thread, and changes nothing.

    :param stopped_by: returns why nothing moves any more
    """

    def __init__(
            self, gate: VelocityGate, discovery: RobotDiscovery, guardian: Guardian | NullGuardian,
            odometry: StandstillDetector, manual_control: ManualControlClient,
            stopped_by: Callable[[], ControlError | None], speed_factor: SpeedFactor) -> None:
        self._gate = gate
        self._discovery = discovery
        self._guardian = guardian
        self._odometry = odometry
        self._manual_control = manual_control
        self._stopped_by = stopped_by
        self._speed_factor = speed_factor

    @property
    def is_closed(self) -> bool:
        """Whether the robot was released: nothing is to be published any more."""
        return self._gate.state is GateState.CLOSED

    def read(self, now: float) -> SessionStatus:
        """
        Return the state now.

        :param now: the time [s on the steady clock]
        """
        stopped_by = self._stopped_by()
        return SessionStatus(
            subscriber_count=self._discovery.subscriber_count,
            other_publishers=tuple(self._discovery.other_publishers()),
            guardian=_guardian(self._guardian),
            odometry_age=self._odometry.age(now),
            manual_control=self._manual_control.state(now),
            speed_factor=self._speed_factor.value,
            speed=self._speed_factor.describe(),
            stopped_by=str(stopped_by) if stopped_by else None)


def _guardian(guardian: Guardian | NullGuardian) -> str:
    if isinstance(guardian, NullGuardian):
        return 'off'
    if guardian.stopped_because is not None:
        return f'stopped the robot because {guardian.stopped_because}'
    return 'matched' if guardian.is_matched else 'not matched yet'


def diagnose(statistics: TickStatistics, status: SessionStatus, now: float) -> Diagnosis:
    """
    Return the diagnosis of a drive.

    :param now: the time [s on the steady clock]
    """
    state = _state(statistics, status)
    level, message = _worst(statistics, status, state)
    age = status.odometry_age
    return Diagnosis(level, message, {
        'state': state,
        'motion': statistics.motion or 'none',
        'step': '{} of {}'.format(*statistics.step(now)),
        'late ticks': str(statistics.late),
        'skipped ticks': str(statistics.skipped),
        'subscribers': str(status.subscriber_count),
        'other publishers': ', '.join(status.other_publishers) or 'none',
        'guardian': status.guardian,
        'odometry age': 'none received' if age is None else f'{age:.2f} s',
        'manual control': status.manual_control,
        'speed': status.speed,
    })


def _state(statistics: TickStatistics, status: SessionStatus) -> str:
    if status.stopped_by is not None:
        return 'stopped permanently'
    if statistics.is_active:
        if not statistics.has_started:
            return 'connecting to the robot'
        return 'paused' if is_hold(status.speed_factor) else 'driving'
    if not statistics.motion:
        # A motion may wait for ~/run.
        return 'nothing started yet'
    return 'at rest' if statistics.failure is None else 'stopped early'


def _worst(statistics: TickStatistics, status: SessionStatus, state: str) -> tuple[Level, str]:
    if status.stopped_by is not None:
        return Level.ERROR, f'stopped permanently: {status.stopped_by}'
    if status.guardian.startswith('stopped'):
        return Level.ERROR, f'the guardian {status.guardian}'
    if statistics.failure is not None:
        return Level.WARN, f'the last motion was over before its end: {statistics.failure}'
    warnings = [
        ('no subscriber for the velocities', not status.subscriber_count),
        (f'others have publishers of velocities: {", ".join(status.other_publishers)}',
         status.other_publishers),
        ('odometry is silent', (status.odometry_age or 0.0) > ODOMETRY_WARN_AGE),
        ('velocities were skipped', statistics.skipped),
    ]
    for warning, applies in warnings:
        if applies:
            return Level.WARN, warning
    return Level.OK, state
