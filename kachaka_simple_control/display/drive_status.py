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
"""What the display shows of a drive: the status at a moment, from events."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from enum import Enum

from kachaka_simple_control.control.stop import StandstillDetector
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.motion.plan import Plan, plan
from kachaka_simple_control.report.metrics import Displacement, driven, requested
from kachaka_simple_control.report.plan_view import describe_step
from kachaka_simple_control.telemetry.events import (
    Event,
    MotionEnded,
    MotionPlanned,
    MotionStarted,
    OdometryReceived,
    SessionEnded,
    SessionStarted,
    VelocitySent,
)


class DriveState(Enum):
    """What is going on, in words that need no colour."""

    READY = 'ready'
    WAITING = 'waiting'
    CONNECTING = 'meeting'
    DRIVING = 'driving'
    STOPPING = 'stopping'
    STOPPED = 'stopped'
    CUT_SHORT = 'cut short'


@dataclass(frozen=True)
class Remaining:
    """
    How far it is to the end of a step.

    :param distance: along the path [m]; None if the step does not go anywhere
    :param angle: how far to turn [rad]; None if the step does not turn
    :param is_seen: whether odometry says so; otherwise what was sent does
    """

    distance: float | None
    angle: float | None
    is_seen: bool


@dataclass(frozen=True)
class StepStatus:
    """
    The step under way.

    :param number: the how many-th it is, from 1 on
    :param count: of how many; None if nobody knows how many will come
    :param words: what it is
    :param duration: how long it takes [s]
    :param time_left: until its end, by the plan [s]
    :param left: how far it is to its end
    """

    number: int
    count: int | None
    words: str
    duration: float
    time_left: float
    left: Remaining


@dataclass(frozen=True)
class DriveStatus:
    """
    What there is to see at one time.

    :param state: what is going on
    :param title: what is driven
    :param robot: by which robot; empty before that is known
    :param reason: why it was cut short; None if it was not
    :param step: the step under way; None without one
    :param duration: how long the motion takes [s]; None without one
    :param time_left: until its end, by the plan [s]
    :param commanded: what was sent last; None before
    :param seen: how fast odometry said the robot was; None if it never did
    :param seen_ago: how long ago that was [s]
    :param silent_for: how long nothing was heard of a program that should drive [s]; None if all
        is well
    """

    state: DriveState
    title: str
    robot: str
    reason: str | None
    step: StepStatus | None
    duration: float | None
    time_left: float
    commanded: Velocity | None
    seen: Velocity | None
    seen_ago: float
    silent_for: float | None

    @property
    def fraction(self) -> float:
        """Return how much of the motion is over, from 0 to 1."""
        return 1.0 - self.time_left / self.duration if self.duration else 1.0


REST = Displacement(0.0, 0.0)


class StepTimeline:
    """
    When the steps of a motion are due.

    :param plan: the motion's plan
    """

    def __init__(self, plan: Plan) -> None:
        """Look up its steps."""
        self.stages = plan.steps
        self.duration = plan.steps[-1].end if plan.steps else 0.0
        self._starts = [stage.start for stage in plan.steps]

    def step_at(self, elapsed: float) -> int:
        """
        Return which step is due.

        :param elapsed: the time since t = 0 [s]; at least 0
        :returns: its place; of several that begin at once the last
        """
        return max(0, bisect_right(self._starts, elapsed) - 1)


class StepOdometer:
    """
    How far it is since the step under way began, by one of those who know.

    :param course: when the steps begin
    :param began: when the motion began [s on the steady clock]
    """

    def __init__(self, course: StepTimeline, began: float) -> None:
        """Have gone nowhere."""
        self._course, self._began = course, began
        self._step, self._gone = 0, REST

    def update(self, since: float, until: float, way: Displacement) -> None:
        """
        Go on; what falls into an earlier step is left to that.

        :param since: when this stretch began [s on the steady clock]
        :param until: when it ended
        :param way: how far it was
        """
        step = self._course.step_at(until - self._began)
        part = 1.0
        if step != self._step:
            start = self._began + self._course.stages[step].start
            part = min(1.0, max(0.0, (until - start) / max(until - since, 1e-9)))
            self._step, self._gone = step, REST
        self._gone = Displacement(
            self._gone.distance + part * way.distance, self._gone.angle + part * way.angle)

    def distance(self, step: int) -> Displacement:
        """
        Return how far it was.

        :param step: the step under way
        :returns: the way since it began; none if nothing was heard of it yet
        """
        return self._gone if step == self._step else REST


def remaining(asked: float, gone: float) -> float | None:
    """
    Return what is left of a way.

    :param asked: how far it was to be, either way
    :param distance: how far it is
    :returns: the rest, not below zero; None if there was no way to go
    """
    if asked == 0.0:
        return None
    return max(0.0, asked - gone if asked > 0.0 else gone - asked)


#: When the steps are due does not depend on the rate, and what is sent each time is not shown.
COARSE = 0.001
#: The zeros of a stop follow each other more closely than this [s].
BETWEEN_ZEROS = 0.1
#: A stop begins with ten zeros at once; no plan sends as many as these within a period.
BURST = 4
#: Odometry older than this [s] says nothing of how far it is.
ODOMETRY_MAX_AGE = 0.5
#: A program that drives tells something more often than this [s], or is held up.
SILENCE = 1.0


class DriveTracker:
    """Follows the events of one program; any order of them will do."""

    def __init__(self) -> None:
        """Have heard nothing yet."""
        self._opened: SessionStarted | None = None
        self._planned: MotionPlanned | None = None
        self._course: StepTimeline | None = None
        self._began: float | None = None
        self._ended: MotionEnded | None = None
        self._motions = 0
        self._sent: VelocitySent | None = None
        self._zeros = 0
        self._stopped: float | None = None
        self._answered: OdometryReceived | None = None
        self._told: StepOdometer | None = None
        self._driven: StepOdometer | None = None
        self._stillness = StandstillDetector()
        #: the last event of all; None if none came: it goes on, or was killed
        self.closed: SessionEnded | None = None

    def on_event(self, event: Event) -> None:
        """
        Take note of what happened.

        :param event: what it was
        """
        match event:
            case VelocitySent():
                self._hear_sent(event)
            case OdometryReceived():
                self._hear_answered(event)
            case MotionPlanned():
                self._plan(event)
            case MotionStarted() if self._course is not None and self._course.stages:
                self._began = event.time
                self._told = StepOdometer(self._course, event.time)
                self._driven = StepOdometer(self._course, event.time)
            case MotionEnded():
                self._ended = event
            case SessionStarted():
                self._opened = event
            case SessionEnded():
                self.closed = event

    def status_at(self, now: float) -> DriveStatus:
        """
        Return what there is to see.

        :param now: the time [s on the steady clock]
        :returns: all of it
        """
        elapsed = self._elapsed(now)
        duration = self._course.duration if self._course is not None else None
        return DriveStatus(
            state=self._state(now),
            title=self._title(),
            robot='' if self._opened is None else self._opened.robot,
            reason=None if self._ended is None else self._ended.reason,
            step=self._step(now, elapsed),
            duration=duration,
            time_left=(duration or 0.0) - elapsed,
            commanded=None if self._sent is None else self._sent.velocity,
            seen=None if self._answered is None else self._answered.velocity,
            seen_ago=0.0 if self._answered is None else max(0.0, now - self._answered.time),
            silent_for=self._silence(now))

    @property
    def is_under_way(self) -> bool:
        """Whether a motion was begun and not ended."""
        return self._began is not None and self._ended is None

    @property
    def is_guarded(self) -> bool:
        """Whether a guardian stops the robot when the program cannot."""
        return self._opened is not None and bool(self._opened.settings.get('guardian'))

    def _plan(self, event: MotionPlanned) -> None:
        self._planned, self._began, self._ended = event, None, None
        self._zeros, self._stopped = 0, None
        self._course = StepTimeline(plan(event.motion, event.limits, COARSE))
        self._told = self._driven = None
        self._motions += 1

    def _hear_sent(self, event: VelocitySent) -> None:
        before, self._sent = self._sent, event
        if before is not None and self.is_under_way:
            self._look_for_stop(before, event)
        if before is not None and self._told is not None and self.is_under_way:
            self._told.update(before.time, event.time, _held(before, event.time))

    def _look_for_stop(self, before: VelocitySent, event: VelocitySent) -> None:
        # The end of a motion is told when its stop is complete, 0.4 s later.
        period = 1.0 / self._planned.rate if self._planned is not None else 0.0
        is_next = event.velocity == ZERO and event.time - before.time < 0.5 * period
        self._zeros = self._zeros + 1 if is_next else 1
        if self._zeros >= BURST and self._stopped is None:
            self._stopped = event.time

    def _hear_answered(self, event: OdometryReceived) -> None:
        before, self._answered = self._answered, event
        self._stillness.on_odometry(event.time, event.velocity)
        if before is None or self._driven is None or not self.is_under_way:
            return
        if before.time < event.time:
            way = driven((before, event), before.time, event.time) or REST
            self._driven.update(before.time, event.time, way)

    def _state(self, now: float) -> DriveState:
        if self._planned is None:
            return DriveState.READY
        if self._ended is None:
            if self._stopped is not None:
                return DriveState.STOPPING
            if self._began is not None:
                return DriveState.DRIVING
            return DriveState.CONNECTING if self._sends_zeros(now) else DriveState.WAITING
        if self._sends_zeros(now) or self._stillness.is_moving(now):
            return DriveState.STOPPING
        return DriveState.STOPPED if self._ended.reason is None else DriveState.CUT_SHORT

    def _sends_zeros(self, now: float) -> bool:
        return self._sent is not None and now - self._sent.time < BETWEEN_ZEROS

    def _silence(self, now: float) -> float | None:
        if not self.is_under_way or self._sent is None:
            return None
        silence = now - self._sent.time
        return silence if silence > SILENCE else None

    def _elapsed(self, now: float) -> float:
        if self._course is None or self._began is None:
            return 0.0
        if self._ended is not None:
            if self._ended.reason is None:
                return self._course.duration
            now = min(now, self._ended.time)
        if self._stopped is not None:
            now = min(now, self._stopped)
        return min(max(0.0, now - self._began), self._course.duration)

    def _title(self) -> str:
        if self._opened is not None:
            return self._opened.title
        return '' if self._planned is None else self._planned.motion.name

    def _step(self, now: float, elapsed: float) -> StepStatus | None:
        if self._course is None or self._planned is None or not self._course.stages:
            return None
        place = self._course.step_at(elapsed)
        stage = self._course.stages[place]
        # What is driven by calls, one at a time, is counted: nobody knows how many will come.
        is_called = self._planned.motion.name != self._title()
        return StepStatus(
            self._motions if is_called else place + 1,
            None if is_called else len(self._course.stages),
            describe_step(stage.step), stage.end - stage.start,
            max(0.0, stage.end - max(elapsed, stage.start)),
            self._left(place, requested(stage.step), now))

    def _left(self, place: int, asked: Displacement, now: float) -> Remaining:
        answered = self._answered
        is_seen = answered is not None and now - answered.time <= ODOMETRY_MAX_AGE
        trip = self._driven if is_seen else self._told
        gone = REST if trip is None else trip.distance(place)
        return Remaining(
            remaining(asked.distance, gone.distance), remaining(asked.angle, gone.angle), is_seen)


def _held(sent: VelocitySent, until: float) -> Displacement:
    held = until - sent.time
    return Displacement(sent.velocity.linear_x * held, sent.velocity.angular_z * held)
