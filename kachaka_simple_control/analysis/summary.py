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
"""The results of a drive: how it ended, the errors of its end pose, and its timing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from itertools import pairwise
import math
import signal

from kachaka_simple_control.analysis.drive_log import DriveLog, MotionLog
from kachaka_simple_control.analysis.message_timing import Timing, timing
from kachaka_simple_control.analysis.odometry_alignment import AlignedDrive, OdometrySample
from kachaka_simple_control.analysis.plan_view import estimate_sleep_loop, SleepLoopEstimate
from kachaka_simple_control.analysis.step_results import step_results, StepResult
from kachaka_simple_control.control.events import SpeedFactorChanged
from kachaka_simple_control.control.speed_factor import describe_factors, product
from kachaka_simple_control.motion.geometry import Displacement, distance_between, Pose
from kachaka_simple_control.motion.plan import PlannedStep
from kachaka_simple_control.text import pluralize

#: The reason that is shown if the program did not report its end.
NO_END = (
    'Nothing more came from the program: it was killed or crashed, was frozen, or drives on '
    'without a report process')


class OutcomeKind(Enum):
    """The ways in which a drive can end; the value is the word to show."""

    DONE = 'done'
    STOPPED = 'stopped'
    FAULTED = 'faulted'
    NEVER_BEGAN = 'never began'
    KILLED = 'killed'


@dataclass(frozen=True)
class Outcome:
    """
    The outcome of a drive: how it ended, and why.

    :param kind: the kind of the outcome
    :param headline: the outcome in a few words
    :param reason: sentences with the cause and the progress of the drive
    """

    kind: OutcomeKind
    headline: str
    reason: str


def outcome(log: DriveLog) -> Outcome:
    """Return the outcome of a drive."""
    end, reason, progress = log.session_ended, _reason(log), _progress(log)
    fault = _reason(log, faults_only=True) or (None if end is None else end.error)
    if end is None:
        kind, headline, text = OutcomeKind.KILLED, 'Killed', f'{NO_END}.'
    elif end.signal is not None:
        name = signal_name(end.signal)
        kind, headline, text = (
            OutcomeKind.STOPPED, f'Stopped by {name}', f'{name} ended the program.')
        if reason is not None and reason != f'stopped by {name}':
            # With --wait a program continues after an aborted motion.
            text += f' A motion had been given up: {_sentence(reason)}'
    elif not any(motion.has_begun for motion in log.motions):
        return Outcome(OutcomeKind.NEVER_BEGAN, 'Never began',
                       _sentence(fault or reason or 'The program ended without driving'))
    elif fault is not None:
        kind, headline, text = OutcomeKind.FAULTED, 'Faulted', _sentence(fault)
    elif reason is not None:
        kind, headline, text = OutcomeKind.STOPPED, 'Stopped on request', _sentence(reason)
    elif not all(motion.is_complete for motion in log.motions):
        kind, headline, text = OutcomeKind.FAULTED, 'Not finished', 'The reason is not known.'
    else:
        return Outcome(OutcomeKind.DONE, 'Done', progress)
    return Outcome(kind, headline, f'{text} {progress}')


def signal_name(number: int) -> str:
    """Return the name of a signal, for example SIGINT."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f'signal {number}'


def _reason(log: DriveLog, faults_only: bool = False) -> str | None:
    """
    Return the reason for the first early end of a motion; None if no motion ended early.

    :param log: the drive
    :param faults_only: whether to ignore motions that ended early on request
    """
    return next((motion.reason for motion in log.motions
                 if motion.reason is not None and (motion.is_fault or not faults_only)), None)


def _sentence(text: str) -> str:
    text = ' '.join(text.split()) or 'no reason was given'
    return text[0].upper() + text[1:] + ('' if text[-1] in '.!?' else '.')


def _progress(log: DriveLog) -> str:
    begun = [motion for motion in log.motions if motion.has_begun]
    if not begun:
        return 'No motion had begun.'
    complete = [motion for motion in begun if motion.is_complete]
    cut = next((motion for motion in begun if not motion.is_complete), None)
    if cut is not None:
        return _progress_of(cut, len(complete), len(begun))
    steps = sum(len(motion.plan.steps) for motion in complete)
    more = len(log.motions) - len(begun)
    rest = f' {pluralize(more, "motion")} more did not begin.' if more else ''
    if len(complete) == 1:
        all_steps = f'all {steps} steps' if steps > 1 else pluralize(steps, 'step')
        return f'Its motion was driven to its end, {all_steps}.{rest}'
    return (f'{len(complete)} motions were driven to their end, '
            f'{pluralize(steps, "step")} in all.{rest}')


def _progress_of(cut: MotionLog, complete: int, begun: int) -> str:
    steps = len(cut.steps)
    end = cut.own_messages[-1].time - cut.began if cut.own_messages else 0.0
    where = f'in step {steps} of {len(cut.plan.steps)}, ' if steps else ''
    others = (f'; of {pluralize(begun, "motion")} {complete} were driven to their end'
              if complete else '')
    at = f'at {cut.timeline.reached:.2f} s of its plan, ' if cut.timeline.is_delayed else ''
    return (f'The motion ended {where}{end:.2f} s after its t = 0, {at}of '
            f'{cut.plan.duration:.2f} s{others}.')


@dataclass(frozen=True)
class SpeedInterval:
    """
    A part of a motion with a constant speed factor.

    :param motion: the motion
    :param factors: the speed factors below 1, each by the name of its source; empty at full speed
    :param begin: the start time [s on the steady clock]
    :param end: the end time [s on the steady clock]
    :param plan_begin: the plan time at the start [s of the plan]
    :param plan_end: the plan time at the end [s of the plan]
    """

    motion: MotionLog
    factors: Mapping[str, float]
    begin: float
    end: float
    plan_begin: float
    plan_end: float

    @property
    def factor(self) -> float:
        """Return the product of the speed factors, from 0 to 1."""
        return product(self.factors)

    @property
    def reason(self) -> str:
        """Return the sources that asked for less speed, as text; empty at full speed."""
        return describe_factors(self.factors)

    @property
    def is_pause(self) -> bool:
        """Return whether the motion was paused."""
        return self.factor == 0.0

    @property
    def step(self) -> PlannedStep:
        """Return the step at the start of the interval; for a pause, the step at its end."""
        plan = self.motion.plan
        return plan.steps[plan.step_index(self.plan_end if self.is_pause else self.plan_begin)]


def speed_intervals(log: DriveLog) -> list[SpeedInterval]:
    """
    Return the intervals of a drive in which the speed factor is constant, in order.

    :param log: the drive
    :returns: all intervals of each motion that had a speed factor below 1 at some time
    """
    return [interval for motion in log.motions if motion.own_messages and motion.plan.steps
            for interval in _intervals(motion, log.speed_changes)]


def _intervals(motion: MotionLog, changes: Sequence[SpeedFactorChanged]) -> list[SpeedInterval]:
    end = motion.own_messages[-1].time
    before: Mapping[str, float] = {}
    starts: list[tuple[float, Mapping[str, float]]] = []
    for change in changes:
        if change.time <= motion.began:
            before = change.factors
        elif change.time < end and change.factors != (starts[-1][1] if starts else before):
            starts.append((change.time, change.factors))
    starts.insert(0, (motion.began, before))
    if not any(factors for _, factors in starts):
        return []
    timeline, duration = motion.timeline, motion.plan.duration
    ends = [*(begin for begin, _ in starts[1:]), end]
    marks = [min(max(0.0, timeline.plan_time(time)), duration) for time in (motion.began, *ends)]
    return [SpeedInterval(motion, factors, begin, until, *plan_times)
            for (begin, factors), until, plan_times in zip(starts, ends, pairwise(marks))]


class Summary:
    """
    The results of a drive; each result is computed when it is first used.

    :param log: the log of the drive, which must not change after this
    """

    def __init__(self, log: DriveLog) -> None:
        self.log = log

    @cached_property
    def outcome(self) -> Outcome:
        """Return the outcome of the drive."""
        return outcome(self.log)

    @cached_property
    def aligned(self) -> AlignedDrive:
        """Return the planned, sent and reported paths of the drive in one frame."""
        return AlignedDrive(self.log)

    @cached_property
    def steps(self) -> list[StepResult]:
        """Return the displacements of all started steps."""
        pairs = [(step, motion.planned.motion.name) for motion in self.log.motions
                 for step in motion.steps if step.sent]
        odometry = [sample.received for sample in self.aligned.odometry]
        return step_results([step for step, _ in pairs], [name for _, name in pairs], odometry,
                            self.log.command_timeout)

    @cached_property
    def timing(self) -> Timing:
        """Return the timing accuracy of the drive's messages."""
        return timing(self.log.motions)

    @cached_property
    def speed(self) -> list[SpeedInterval]:
        """Return the intervals of constant speed factor; empty if all was at full speed."""
        return speed_intervals(self.log)

    @cached_property
    def _step_numbers(self) -> dict[int, int]:
        return {id(step.log.planned): number for number, step in enumerate(self.steps, 1)}

    def step_number(self, interval: SpeedInterval) -> int | None:
        """Return the number of the step of an interval, from 1; None if the step did not start."""
        return self._step_numbers.get(id(interval.step))

    @property
    def paused_duration(self) -> float:
        """Return the total time of all pauses [s]."""
        return math.fsum(interval.end - interval.begin for interval in self.speed
                         if interval.is_pause)

    @cached_property
    def sleep_loop(self) -> SleepLoopEstimate:
        """Return the estimated errors if a loop of publish and sleep drove the same plans."""
        return estimate_sleep_loop([motion.plan for motion in self.log.motions])

    @property
    def planned_duration(self) -> float:
        """Return the total planned time of all started motions [s]."""
        return math.fsum(motion.plan.duration for motion in self.log.motions if motion.has_begun)

    @property
    def driven_duration(self) -> float:
        """
        Return the total driven time of all motions [s].

        The time of a motion ends when the zero velocity at its end is sent.
        """
        return math.fsum(
            motion.own_messages[-1].time - motion.began for motion in self.log.motions
            if motion.own_messages)

    @property
    def last_seen(self) -> OdometrySample | None:
        """Return the last odometry sample; None if none was received since t = 0."""
        return self.aligned.odometry[-1] if self.aligned.odometry else None

    @property
    def final_pose(self) -> Pose | None:
        """Return the last odometry pose; None if none was received since t = 0."""
        return None if self.last_seen is None else self.last_seen.pose

    @property
    def error_from_plan(self) -> Displacement | None:
        """
        Return the distance and the heading error of the last odometry pose from the planned end.

        Return None if a motion ended early, or without odometry.
        """
        if self.final_pose is None or not all(motion.is_complete for motion in self.log.motions):
            return None
        return Displacement(*distance_between(self.aligned.planned_end, self.final_pose))

    @property
    def error_from_sent(self) -> Displacement | None:
        """
        Return the distance and the heading error of the last odometry pose from the sent path.

        They are relative to the pose that is expected at that time from the sent velocities.
        Without odometry, return None.
        """
        return None if self.last_seen is None else Displacement(
            self.last_seen.distance, self.last_seen.angle)
