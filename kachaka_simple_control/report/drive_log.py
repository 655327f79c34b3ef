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
"""The log of a drive: what was sent and what odometry answered, with times."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
import math

from kachaka_simple_control.motion.plan import Plan, plan, PlannedStep
from kachaka_simple_control.motion.steps import Step
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

#: A message is not early if it is by less than this [s]: times are sums, and rounded.
ROUNDING = 1e-6


@dataclass(frozen=True)
class StepLog:
    """
    A step and its messages.

    :param planned: what was planned
    :param began: when it began by the plan [s on the steady clock]
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


@dataclass
class MotionLog:
    """
    A motion, its messages and how it ended.

    :param planned: what was to be driven
    :param sent: every message since it was planned, in order: zeros after connecting, its own,
        the zeros of the stop
    :param began: when its first own message was sent [s on the steady clock]; nan before
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

    @property
    def has_begun(self) -> bool:
        """Return whether its first own message was sent."""
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
    def own_messages(self) -> Sequence[VelocitySent]:
        """Return its own messages, from t = 0 to the zero that ended it."""
        if not self.has_begun:
            return ()
        return self.sent[self._first(0.0):self._last() + 1]

    @property
    def steps(self) -> list[StepLog]:
        """Return its steps that were begun, in order."""
        if not self.has_begun or not self.sent:
            return []
        last = self._last()
        until = self.sent[last].time
        steps = [step for step in self.plan.steps
                 if self.is_complete or self._begins_by(step, until)]
        starts = [self._first(step.start) for step in steps]
        return [
            StepLog(step, self.began + step.start, tuple(self.sent[first:following + 1]),
                    self.is_complete or self.began + step.end <= until + ROUNDING)
            for step, first, following in zip(steps, starts, [*starts[1:], last])]

    def _begins_by(self, step: PlannedStep, until: float) -> bool:
        # A rest begins with a zero, which may be the first of the stop.
        rests = step.max_linear_velocity == step.max_angular_velocity == 0.0
        return self.began + step.start < until + (ROUNDING if rests else -ROUNDING)

    def _first(self, elapsed: float) -> int:
        return bisect_left(self.sent, self.began + elapsed - ROUNDING, key=_time)

    def _is_zero_after_start(self, sent: VelocitySent) -> bool:
        return sent.velocity.is_zero and sent.time > self.began

    def _last(self) -> int:
        """Return the index of the message that ended it."""
        end = len(self.sent) - 1
        if self.is_complete:
            return min(end, self._first(self.plan.duration))
        # All zeros at the end but the first belong to the stop.
        while end > 0 and self._is_zero_after_start(self.sent[end - 1]):
            end -= 1
        return end


@dataclass
class DriveLog:
    """
    The log of a drive, from events.

    :param session_started: the start of the session; None before it
    :param motions: what was to be driven, in order
    :param odometry: every pose that arrived, in order
    :param session_ended: its end; None while it goes on, or if the program was killed
    """

    session_started: SessionStarted | None = None
    motions: list[MotionLog] = field(default_factory=list)
    odometry: list[OdometryReceived] = field(default_factory=list)
    session_ended: SessionEnded | None = None

    @property
    def steps(self) -> list[StepLog]:
        """Return the steps of all motions that were begun, in order."""
        return [step for motion in self.motions for step in motion.steps]

    @property
    def sent(self) -> list[VelocitySent]:
        """Return every message, in order."""
        return [message for motion in self.motions for message in motion.sent]

    def on_event(self, event: Event) -> None:
        """Log an event; no velocity comes before the first plan."""
        match event:
            case VelocitySent():
                self.motions[-1].sent.append(event)
            case OdometryReceived():
                self.odometry.append(event)
            case MotionPlanned():
                self.motions.append(MotionLog(event))
            case MotionStarted():
                self.motions[-1].began = event.time
            case MotionEnded():
                motion = self.motions[-1]
                motion.ended, motion.reason = event.time, event.reason
                motion.is_fault = event.is_fault
            case SessionStarted():
                self.session_started = event
            case SessionEnded():
                self.session_ended = event


def _time(sent: VelocitySent) -> float:
    return sent.time
