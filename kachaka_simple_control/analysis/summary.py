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
"""Compute the results of a drive: how it ended, the errors of its end pose, and its timing."""

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
from kachaka_simple_control.analysis.obstacle_holds import Hold, obstacle_holds
from kachaka_simple_control.analysis.odometry_alignment import AlignedDrive, OdometrySample
from kachaka_simple_control.analysis.plan_view import estimate_sleep_loop, SleepLoopEstimate
from kachaka_simple_control.analysis.step_results import step_results, StepResult
from kachaka_simple_control.control.events import SpeedFactorChanged
from kachaka_simple_control.control.speed_factor import describe_factors, is_hold, product
from kachaka_simple_control.motion.geometry import Displacement, distance_between, Pose
from kachaka_simple_control.motion.plan import PlannedStep
from kachaka_simple_control.text import pluralize

#: The reason that is shown if the program did not report its end.
NO_END = (
    'Nothing more came from the program: it was killed or crashed, was frozen, or drives on '
    'without a report process')


class OutcomeKind(Enum):
    """The ways in which a drive can end; the value of each one is the word that reports show."""

    DONE = 'done'
    STOPPED = 'stopped'
    FAULTED = 'faulted'
    NEVER_BEGAN = 'never began'
    KILLED = 'killed'


@dataclass(frozen=True)
class Outcome:
    """The outcome of a drive: how it ended, and why."""

    kind: OutcomeKind
    headline: str
    reason: str


def outcome(log: DriveLog) -> Outcome:
    """Return how and why a drive ended, and how far it came."""
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
            text += f' A motion had ended early: {_sentence(reason)}'
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
    """Return why the first motion that ended early did; None if none did."""
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
    A time interval of a motion in which the speed factors were constant.

    :param factors: those below 1, by the name of the source; empty at full speed
    :param plan_end: the plan time at ``end`` [s]
    """

    motion: MotionLog
    factors: Mapping[str, float]
    begin: float
    end: float
    plan_begin: float
    plan_end: float

    @property
    def factor(self) -> float:
        """Return the speed relative to the plan: 1 is full speed, and 0 is a pause."""
        return product(self.factors)

    @property
    def reason(self) -> str:
        """Return a text such as ``paused, obstacle 40 %``; empty at full speed."""
        return describe_factors(self.factors)

    @property
    def is_pause(self) -> bool:
        """Return whether the robot was held at rest in this interval, as in a pause."""
        return is_hold(self.factor)

    @property
    def step(self) -> PlannedStep:
        """Return the step in which the interval starts or, in a pause, the robot is held."""
        # The motion can still advance at the start of a pause, but not at its end.
        plan = self.motion.plan
        return plan.steps[plan.step_index(self.plan_end if self.is_pause else self.plan_begin)]


def speed_intervals(log: DriveLog) -> list[SpeedInterval]:
    """
    Divide the motions of a drive into intervals of constant speed factors.

    :returns: in order; motions that were at full speed all the time have none
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
    The results of a drive, each computed when it is first used.

    :param log: it must not change later
    """

    def __init__(self, log: DriveLog) -> None:
        self.log = log

    @cached_property
    def outcome(self) -> Outcome:
        """Return how and why the drive ended, and how far it came."""
        return outcome(self.log)

    @cached_property
    def aligned(self) -> AlignedDrive:
        """Return the planned path, the sent path and the odometry path, all in one frame."""
        return AlignedDrive(self.log)

    @cached_property
    def steps(self) -> list[StepResult]:
        """Return the requested, the sent and the reported displacement of each started step."""
        pairs = [(step, motion.planned.motion.name) for motion in self.log.motions
                 for step in motion.steps if step.sent]
        odometry = [sample.received for sample in self.aligned.odometry]
        return step_results([step for step, _ in pairs], [name for _, name in pairs], odometry,
                            self.log.command_timeout)

    @cached_property
    def timing(self) -> Timing:
        """Return the timing accuracy of the velocity messages of the drive."""
        return timing(self.log.motions)

    @cached_property
    def speed(self) -> list[SpeedInterval]:
        """Return the intervals of constant speed factors; none for motions at full speed."""
        return speed_intervals(self.log)

    @cached_property
    def holds(self) -> list[Hold]:
        """Return when an obstacle watch held the robot, in order; empty without a watch."""
        return obstacle_holds(self.log, self.aligned)

    @cached_property
    def _step_numbers(self) -> dict[int, int]:
        return {id(step.log.planned): number for number, step in enumerate(self.steps, 1)}

    def step_number(self, interval: SpeedInterval | Hold) -> int | None:
        """Return the number, from 1 over all motions, of the step of an interval; or None."""
        return self._step_numbers.get(id(interval.step))

    @property
    def paused_duration(self) -> float:
        """Return the total duration of all pauses in the drive [s]."""
        return math.fsum(interval.end - interval.begin for interval in self.speed
                         if interval.is_pause)

    @cached_property
    def sleep_loop(self) -> SleepLoopEstimate:
        """Return the estimated errors if a simple loop had driven the same plans."""
        return estimate_sleep_loop([motion.plan for motion in self.log.motions])

    @property
    def planned_duration(self) -> float:
        """Return the sum of the planned durations of all started motions [s]."""
        return math.fsum(motion.plan.duration for motion in self.log.motions if motion.has_begun)

    @property
    def driven_duration(self) -> float:
        """Return the sum of the real durations of all motions [s], from t = 0 to the zero."""
        return math.fsum(
            motion.own_messages[-1].time - motion.began for motion in self.log.motions
            if motion.own_messages)

    @property
    def last_seen(self) -> OdometrySample | None:
        """
        Return the last odometry sample since the first motion started; None if there is none.

        Samples that were received more than 1 s after the last sent message are ignored.
        """
        return self.aligned.odometry[-1] if self.aligned.odometry else None

    @property
    def final_pose(self) -> Pose | None:
        """Return the last pose by odometry, relative to the start of the first motion; or None."""
        return None if self.last_seen is None else self.last_seen.pose

    @property
    def error_from_plan(self) -> Displacement | None:
        """
        Return distance and heading difference between the planned end and the last odometry pose.

        None if a motion ended early, or without odometry.
        """
        if self.final_pose is None or not all(motion.is_complete for motion in self.log.motions):
            return None
        return Displacement(*distance_between(self.aligned.planned_end, self.final_pose))

    @property
    def error_from_sent(self) -> Displacement | None:
        """
        Return distance and heading difference between where the sent velocities lead and odometry.

        At the time of its last pose; None without odometry.
        """
        return None if self.last_seen is None else Displacement(
            self.last_seen.distance, self.last_seen.angle)
