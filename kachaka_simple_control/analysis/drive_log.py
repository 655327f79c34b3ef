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
"""The log of a drive: what was sent and what odometry reported, with times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
import math
from operator import attrgetter

from kachaka_simple_control.analysis.plan_timeline import PlanTimeline, ROUNDING
from kachaka_simple_control.control.events import (
    Event,
    MotionEnded,
    MotionPlanned,
    MotionStarted,
    OdometryReceived,
    SessionEnded,
    SessionStarted,
    SpeedFactorChanged,
    VelocitySent,
)
from kachaka_simple_control.motion.plan import Plan, plan, PlannedStep
from kachaka_simple_control.motion.steps import Step


@dataclass(frozen=True)
class StepLog:
    """
    A step and its messages.

    :param planned: what was planned
    :param began: when the plan was at its start [s on the steady clock]
    :param sent: its messages, from its first to the one after its last, which ends it
    :param is_complete: whether it was driven to its end
    """

    planned: PlannedStep
    began: float
    sent: tuple[VelocitySent, ...]
    is_complete: bool = True

    @property
    def step(self) -> Step:
        """Return the step that was asked for."""
        return self.planned.step

    @property
    def is_delayed(self) -> bool:
        """Return whether any of it was not driven as planned, by a pause or at less speed."""
        return any(message.is_of_run and message.is_delayed for message in self.sent)

    @property
    def driven_duration(self) -> float:
        """Return how long it took, pauses included, to the message that ended it [s]."""
        return self.sent[-1].time - self.began if self.sent else 0.0


@dataclass
class MotionLog:
    """
    A motion, its messages and how it ended.

    :param planned: what was to be driven
    :param sent: every message since it was planned, in order: zeros after connecting, its own,
        the zeros of the stop
    :param began: its t = 0 [s on the steady clock]; nan before
    :param ended: when it ended [s on the steady clock]; None before
    :param reason: why it ended early; None if it was driven to its end
    :param is_fault: whether it ended early by a fault, and not on request
    """

    planned: MotionPlanned
    sent: list[VelocitySent] = field(default_factory=list)
    began: float = math.nan
    ended: float | None = None
    reason: str | None = None
    is_fault: bool = True
    #: the index of its first own message, and of its last; None before the first
    _own: tuple[int, int] | None = field(default=None, init=False, repr=False)

    def add(self, message: VelocitySent) -> None:
        """Add a message that was sent."""
        if message.is_of_run and self.has_begun:
            first = self._own[0] if self._own else len(self.sent)
            self._own = first, len(self.sent)
        self.sent.append(message)

    @property
    def has_begun(self) -> bool:
        """Return whether it began."""
        return not math.isnan(self.began)

    @property
    def is_complete(self) -> bool:
        """Return whether it was driven to its end."""
        return self.ended is not None and self.reason is None

    @cached_property
    def plan(self) -> Plan:
        """Return the plan that was to be sent."""
        return plan(self.planned.motion, self.planned.limits, self.planned.rate)

    @property
    def timeline(self) -> PlanTimeline:
        """Return when it was where on its plan."""
        return PlanTimeline(self.began, self.own_messages)

    @property
    def own_messages(self) -> Sequence[VelocitySent]:
        """Return its own messages, from its first to the zero that ended it."""
        if self._own is None:
            return ()
        first, last = self._own
        # The first zero of the stop ends a motion that was cut short.
        return self.sent[first:last + (1 if self.is_complete else 2)]

    @property
    def steps(self) -> list[StepLog]:
        """Return its steps that were begun, in order."""
        own = self.own_messages
        if not own:
            return []
        timeline = PlanTimeline(self.began, own)
        reached = timeline.reached
        steps = [step for step in self.plan.steps
                 if self.is_complete or self._begins_by(step, reached, timeline.is_delayed)]
        starts = [timeline.first(step.start) for step in steps]
        return [
            StepLog(step, timeline.time(step.start), tuple(own[first:following + 1]),
                    self.is_complete or step.end <= reached + ROUNDING)
            for step, first, following in zip(steps, starts, [*starts[1:], len(own) - 1])]

    @property
    def reached(self) -> float:
        """Return how far on its plan it came, to a period if it was delayed [s of the plan]."""
        own = self.own_messages
        return PlanTimeline(self.began, own).reached if own else 0.0

    @staticmethod
    def _begins_by(step: PlannedStep, reached: float, is_delayed: bool) -> bool:
        # A rest begins with a zero, which may be the first of the stop.
        rests = step.max_linear_velocity == step.max_angular_velocity == 0.0
        return step.start < reached + (ROUNDING if rests or is_delayed else -ROUNDING)


@dataclass
class DriveLog:
    """
    The log of a drive, from events.

    :param session_started: the start of the session; None before it
    :param motions: what was to be driven, in order
    :param odometry: every pose that arrived, in order
    :param speed_changes: changes of the speed factor, in order; it is 1 before the first
    :param session_ended: its end; None while it goes on, or if the program was killed
    :param other_messages: messages of no motion: before the first, or of a run without a plan
    """

    session_started: SessionStarted | None = None
    motions: list[MotionLog] = field(default_factory=list)
    odometry: list[OdometryReceived] = field(default_factory=list)
    speed_changes: list[SpeedFactorChanged] = field(default_factory=list)
    session_ended: SessionEnded | None = None
    other_messages: list[VelocitySent] = field(default_factory=list)
    #: the motion under way; None before the first, and in a run without a plan
    _motion: MotionLog | None = field(default=None, init=False, repr=False)

    @property
    def steps(self) -> list[StepLog]:
        """Return the steps of all motions that were begun, in order."""
        return [step for motion in self.motions for step in motion.steps]

    @property
    def sent(self) -> list[VelocitySent]:
        """Return every message, in order."""
        of_motions = [message for motion in self.motions for message in motion.sent]
        return sorted([*self.other_messages, *of_motions], key=attrgetter('time'))

    @property
    def command_timeout(self) -> float:
        """Return how long the robot keeps a velocity without a new one [s]; inf if unknown."""
        started = self.session_started
        return math.inf if started is None else started.command_timeout

    def on_event(self, event: Event) -> None:
        """Log an event."""
        match event:
            case VelocitySent():
                self._on_velocity(event)
            case OdometryReceived():
                self.odometry.append(event)
            case SpeedFactorChanged():
                self.speed_changes.append(event)
            case MotionPlanned():
                self._motion = MotionLog(event)
                self.motions.append(self._motion)
            case MotionStarted():
                self._on_start(event)
            case MotionEnded() if self._motion is not None:
                self._motion.ended, self._motion.reason = event.time, event.reason
                self._motion.is_fault = event.is_fault
            case SessionStarted():
                self.session_started = event
            case SessionEnded():
                self.session_ended = event

    def _on_velocity(self, event: VelocitySent) -> None:
        if event.expected is not None:
            # The report compares displacements: what the robot should do, not the calibrated
            # command.
            event = replace(event, velocity=event.expected)
        if self._motion is None:
            self.other_messages.append(event)
        else:
            self._motion.add(event)

    def _on_start(self, event: MotionStarted) -> None:
        if not event.has_plan:
            self._motion = None
        elif self._motion is not None:
            self._motion.began = event.time
