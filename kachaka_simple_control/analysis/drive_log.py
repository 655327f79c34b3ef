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
"""The log of a drive: its plans, the sent velocities and the received odometry."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate
import math
from operator import attrgetter
from typing import NamedTuple

from kachaka_simple_control.control.events import (
    Event,
    MotionEnded,
    MotionPlanned,
    MotionStarted,
    OdometryReceived,
    ScanReceived,
    SessionEnded,
    SessionStarted,
    SpeedFactorChanged,
    VelocitySent,
    WatchChanged,
    WatchState,
)
from kachaka_simple_control.motion.drive_order import MotionText
from kachaka_simple_control.motion.plan import Plan, PlannedStep
from kachaka_simple_control.motion.steps import Step

#: The tolerance of a comparison of two times [s], because times are sums with rounding errors.
ROUNDING = 1e-6


class PlanTimeline:
    """
    Converts between the steady clock and plan time, from the sent messages of a motion.

    The plan time of a pause is converted to the start of the pause.  Times between two messages
    are interpolated.

    :param began: the time t = 0 of the motion [s]
    :param messages: of the motion, in order; the last one is the zero velocity that ended it
    """

    def __init__(self, began: float, messages: Sequence[VelocitySent]) -> None:
        self._began = began
        self._messages = messages
        #: whether a message of the motion was delayed by a pause or a speed factor
        self.is_delayed = any(message.is_of_run and message.is_delayed for message in messages)
        # To save memory, a motion without delay has no lists.
        delayed = messages if self.is_delayed else ()
        self._times = [message.time for message in delayed]
        # Plan times are rounded results of a bisection, so without max they may decrease slightly.
        self._plan_times = list(accumulate(map(self._message_plan_time, delayed), max))

    def _message_plan_time(self, message: VelocitySent) -> float:
        if message.plan_time is not None:
            return message.plan_time
        # The first zero velocity of a stop has no plan time: add the time since the last message.
        last = self._messages[-2] if len(self._messages) > 1 else None
        if last is None or last.plan_time is None:
            return message.time - self._began
        return last.plan_time + message.time - last.time

    @property
    def reached(self) -> float:
        """
        Return the plan time that was reached; 0 if no message was sent.

        After a pause or at a lower speed, the error is at most one period of the messages.
        """
        if not self._messages:
            return 0.0
        last = self._messages[-1]
        if not self.is_delayed:
            return last.time - self._began
        if not last.is_of_run and len(self._messages) > 1:
            last = self._messages[-2]
        return self._message_plan_time(last)

    def first(self, plan_time: float) -> int:
        """Return the index of the first message from a plan time on; their number without one."""
        if self.is_delayed:
            return bisect_left(self._plan_times, plan_time - ROUNDING)
        return bisect_left(
            self._messages, self._began + plan_time - ROUNDING, key=attrgetter('time'))

    def time(self, plan_time: float) -> float:
        """Return when a plan time is first reached [s]; extrapolated after the last message."""
        if not self.is_delayed:
            return self._began + plan_time
        return _interpolated(self._plan_times, self._times, plan_time, self.first(plan_time))

    def plan_time(self, time: float) -> float:
        """Return the progress of the motion at a time."""
        if not self.is_delayed:
            return time - self._began
        return _interpolated(self._times, self._plan_times, time, bisect_right(self._times, time))


def _interpolated(arguments: Sequence[float], values: Sequence[float], argument: float,
                  index: int) -> float:
    """
    Return the value of a function at an argument, interpolated linearly between known points.

    Before the first and after the last known point, the function is continued with a slope of one.
    """
    if index in (0, len(arguments)):
        nearest = max(0, index - 1)
        return values[nearest] + argument - arguments[nearest]
    before, after = arguments[index - 1], arguments[index]
    part = min(1.0, (argument - before) / (after - before))
    return values[index - 1] + part * (values[index] - values[index - 1])


@dataclass(frozen=True)
class StepLog:
    """
    A started step of a motion, and the velocity messages that were sent in it.

    :param began: when the motion reached the start of the step [s]
    :param sent: the messages in the step, and the first one after them, which ends the step
    :param is_complete: whether the step was driven to its end
    """

    planned: PlannedStep
    began: float
    sent: tuple[VelocitySent, ...]
    is_complete: bool = True

    @property
    def step(self) -> Step:
        """Return the step as it is written in the motion, that is, without planned times."""
        return self.planned.step

    @property
    def is_delayed(self) -> bool:
        """Return whether a pause or a reduced speed delayed the step."""
        return any(message.is_of_run and message.is_delayed for message in self.sent)

    @property
    def driven_duration(self) -> float:
        """Return the time from start to end of the step [s], with pauses; 0 without messages."""
        return self.sent[-1].time - self.began if self.sent else 0.0


class WatchLog(NamedTuple):
    """
    What the obstacle watch has said, and what the laser had seen.

    :param scan: the newest one, only when an obstacle has come into the way; otherwise None
    """

    change: WatchChanged
    scan: ScanReceived | None = None


@dataclass
class MotionLog:
    """
    The log of one motion: its definition, its sent velocity messages, and how it ended.

    :param sent: all messages since the motion was planned, with the zeros before and after it
    :param began: the time t = 0 of the motion [s]; nan before the start
    :param ended: [s]; None before the end
    :param reason: the reason for an early end; None if the motion was driven to its end
    :param is_fault: whether a fault, and not a request to stop, caused the early end
    :param watched: what the obstacle watch said, from before t = 0 on, in order
    """

    planned: MotionPlanned
    sent: list[VelocitySent] = field(default_factory=list)
    watched: list[WatchLog] = field(default_factory=list)
    began: float = math.nan
    ended: float | None = None
    reason: str | None = None
    is_fault: bool = True
    #: the indices in ``sent`` of the motion's first and last own message; None without any
    _own: tuple[int, int] | None = field(default=None, init=False, repr=False)

    def add(self, message: VelocitySent) -> None:
        """Add a sent message to the log of the motion."""
        if message.is_of_run and self.has_begun:
            first = self._own[0] if self._own else len(self.sent)
            self._own = first, len(self.sent)
        self.sent.append(message)

    @property
    def has_begun(self) -> bool:
        """Return whether the motion has started."""
        return not math.isnan(self.began)

    @property
    def is_complete(self) -> bool:
        """Return whether the motion was driven to its end."""
        return self.ended is not None and self.reason is None

    @property
    def plan(self) -> Plan:
        """Return the plan of the motion."""
        return self.planned.plan

    @property
    def timeline(self) -> PlanTimeline:
        """Return an object that converts between the steady clock and plan time."""
        return PlanTimeline(self.began, self.own_messages)

    @property
    def own_messages(self) -> Sequence[VelocitySent]:
        """Return the velocity messages of the motion itself, with the zero that ended it."""
        if self._own is None:
            return ()
        first, last = self._own
        # If the motion ended early, the stop's first zero velocity is the motion's last message.
        return self.sent[first:last + (1 if self.is_complete else 2)]

    @property
    def steps(self) -> list[StepLog]:
        """Return the started steps of the motion, in order, each with its sent messages."""
        own = self.own_messages
        if not own:
            return []
        timeline = self.timeline
        reached = timeline.reached
        steps = [step for step in self.plan.steps
                 if self.is_complete or self._begins_by(step, reached, timeline.is_delayed)]
        starts = [timeline.first(step.start) for step in steps]
        return [
            StepLog(step, timeline.time(step.start), tuple(own[first:following + 1]),
                    self.is_complete or step.end <= reached + ROUNDING)
            for step, first, following in zip(steps, starts, [*starts[1:], len(own) - 1])]

    @staticmethod
    def _begins_by(step: PlannedStep, reached: float, is_delayed: bool) -> bool:
        # A rest starts with a zero velocity, which may be the first one of the stop.
        rests = step.max_linear_velocity == step.max_angular_velocity == 0.0
        return step.start < reached + (ROUNDING if rests or is_delayed else -ROUNDING)


@dataclass
class DriveLog:
    """
    The log of a drive, filled from events.

    :param session_started: None if it was not received yet
    :param motions: the logs of all planned motions, in order
    :param odometry: all received samples, in order
    :param speed_changes: of the speed factor, in order; before the first it is 1
    :param session_ended: None if it was not received yet, or if the program was killed
    :param other_messages: those before the first motion, and of motions without a plan
    """

    session_started: SessionStarted | None = None
    motions: list[MotionLog] = field(default_factory=list)
    odometry: list[OdometryReceived] = field(default_factory=list)
    speed_changes: list[SpeedFactorChanged] = field(default_factory=list)
    session_ended: SessionEnded | None = None
    other_messages: list[VelocitySent] = field(default_factory=list)
    #: the current motion; None before the first motion and in a drive without a plan
    _motion: MotionLog | None = field(default=None, init=False, repr=False)
    #: the newest scan, and what the obstacle watch said last
    _scan: ScanReceived | None = field(default=None, init=False, repr=False)
    _watch: WatchLog | None = field(default=None, init=False, repr=False)

    @property
    def steps(self) -> list[StepLog]:
        """Return the started steps of all motions, in order, each with its sent messages."""
        return [step for motion in self.motions for step in motion.steps]

    @property
    def sent(self) -> list[VelocitySent]:
        """Return all velocity messages of the drive, in order of time."""
        of_motions = [message for motion in self.motions for message in motion.sent]
        return sorted([*self.other_messages, *of_motions], key=attrgetter('time'))

    @property
    def command_timeout(self) -> float:
        """Return how long the robot keeps a velocity without a new message [s]; inf if unknown."""
        started = self.session_started
        return math.inf if started is None else started.command_timeout

    @property
    def motion_file(self) -> MotionText | None:
        """Return the file of all motions; None if some have none, or another one."""
        first, *others = [motion.planned.motion_file for motion in self.motions] or [
            None if self.session_started is None else self.session_started.motion_file]
        return first if all(other == first for other in others) else None

    def on_event(self, event: Event) -> None:  # noqa: C901 (one case a kind)
        """Add an event of the drive, such as a sent velocity or an odometry sample, to the log."""
        match event:
            case VelocitySent():
                self._on_velocity(event)
            case OdometryReceived():
                self.odometry.append(event)
            case SpeedFactorChanged():
                self.speed_changes.append(event)
            case ScanReceived():
                self._scan = event
            case WatchChanged():
                self._on_watch(event)
            case MotionPlanned():
                # The watch begins anew with each motion, and says first what is not clear.
                self._motion, self._watch = MotionLog(event), None
                self.motions.append(self._motion)
            case MotionStarted() if not event.has_plan:
                self._motion = None
            case MotionStarted() if self._motion is not None:
                self._motion.began = event.time
            case MotionEnded() if self._motion is not None:
                self._motion.ended, self._motion.reason = event.time, event.reason
                self._motion.is_fault = event.is_fault
            case SessionStarted():
                self.session_started = event
            case SessionEnded():
                self.session_ended = event

    def _on_watch(self, event: WatchChanged) -> None:
        before = None if self._watch is None else self._watch.change.state
        is_new = event.state is WatchState.OBSTACLE and before is not event.state
        self._watch = WatchLog(event, self._scan if is_new else None)
        if self._motion is not None:
            self._motion.watched.append(self._watch)

    def _on_velocity(self, event: VelocitySent) -> None:
        if event.expected is not None:
            # Log the velocity expected on the floor, not the calibrated command, because the
            # report compares displacements.
            event = replace(event, velocity=event.expected)
        if self._motion is None:
            self.other_messages.append(event)
        else:
            self._motion.add(event)
