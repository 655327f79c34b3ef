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
"""The outcome of a drive, and its figures."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cached_property
import math
import signal

from kachaka_simple_control.analysis.drive_log import DriveLog, MotionLog
from kachaka_simple_control.analysis.message_timing import Timing, timing
from kachaka_simple_control.analysis.odometry_alignment import AlignedDrive, OdometrySample
from kachaka_simple_control.analysis.sleep_loop import estimate_sleep_loop, SleepLoopEstimate
from kachaka_simple_control.analysis.speed_history import speed_intervals, SpeedInterval
from kachaka_simple_control.analysis.step_results import step_results, StepResult
from kachaka_simple_control.motion.geometry import distance_between, Pose
from kachaka_simple_control.text import pluralize

#: The reason of a program whose end was not reported.
NO_END = (
    'Nothing more came from the program: it was killed or crashed, was frozen, or drives on '
    'without a report process')


class OutcomeKind(Enum):
    """How a drive can end; the value is the word for it."""

    DONE = 'done'
    STOPPED = 'stopped'
    FAULTED = 'faulted'
    NEVER_BEGAN = 'never began'
    KILLED = 'killed'


@dataclass(frozen=True)
class Outcome:
    """
    How a drive ended.

    :param kind: in which way
    :param headline: a few words
    :param reason: sentences that say why, and how far it came
    """

    kind: OutcomeKind
    headline: str
    reason: str


def outcome(log: DriveLog) -> Outcome:
    """Return how a drive ended."""
    end = log.session_ended
    if end is None:
        return Outcome(OutcomeKind.KILLED, 'Killed', f'{NO_END}. {_progress(log)}')
    if end.signal is not None:
        name = signal_name(end.signal)
        return Outcome(
            OutcomeKind.STOPPED, f'Stopped by {name}',
            f'{name} ended the program. {_earlier_reason(log, name)}{_progress(log)}')
    return _outcome_of_motions(log, end.error)


def signal_name(number: int) -> str:
    """Return the name of a signal, as SIGINT."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f'signal {number}'


def _outcome_of_motions(log: DriveLog, error: str | None) -> Outcome:
    fault = _reason(log, faults_only=True) or error
    if not any(motion.has_begun for motion in log.motions):
        return Outcome(
            OutcomeKind.NEVER_BEGAN, 'Never began',
            _sentence(fault or _reason(log) or 'The program ended without driving'))
    if fault is not None:
        return Outcome(OutcomeKind.FAULTED, 'Faulted', f'{_sentence(fault)} {_progress(log)}')
    if (request := _reason(log)) is not None:
        return Outcome(
            OutcomeKind.STOPPED, 'Stopped on request', f'{_sentence(request)} {_progress(log)}')
    if not all(motion.is_complete for motion in log.motions):
        return Outcome(
            OutcomeKind.FAULTED, 'Not finished', f'The reason is not known. {_progress(log)}')
    return Outcome(OutcomeKind.DONE, 'Done', _progress(log))


def _reason(log: DriveLog, faults_only: bool = False) -> str | None:
    """Return why the first of the motions that ended early did."""
    return next((motion.reason for motion in log.motions
                 if motion.reason is not None and (motion.is_fault or not faults_only)), None)


def _earlier_reason(log: DriveLog, signal_: str) -> str:
    # With --wait a program goes on after a motion that was given up.
    reason = _reason(log)
    if reason is None or reason == f'stopped by {signal_}':
        return ''
    return f'A motion had been given up: {_sentence(reason)} '


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
    if cut.timeline.is_delayed:
        return (f'The motion ended {where}{end:.2f} s after its t = 0, at {cut.reached:.2f} s of '
                f'its plan, of {cut.plan.duration:.2f} s{others}.')
    return (f'The motion ended {where}{end:.2f} s after its t = 0, of '
            f'{cut.plan.duration:.2f} s{others}.')


@dataclass(frozen=True)
class PoseError:
    """
    How far the robot was by odometry from where it should have been.

    :param distance: how far [m]
    :param angle: by how much it was turned too far to the left [rad]
    """

    distance: float
    angle: float


class Summary:
    """
    The figures of a drive, each computed when it is first used.

    :param log: the drive; it changes no more
    """

    def __init__(self, log: DriveLog) -> None:
        self.log = log

    @cached_property
    def outcome(self) -> Outcome:
        """Return how the drive ended."""
        return outcome(self.log)

    @cached_property
    def aligned(self) -> AlignedDrive:
        """Return the drive as planned, as sent and by odometry, all in one frame."""
        return AlignedDrive(self.log)

    @cached_property
    def steps(self) -> list[StepResult]:
        """Return the steps that were begun."""
        pairs = [(step, motion.planned.motion.name) for motion in self.log.motions
                 for step in motion.steps if step.sent]
        odometry = [sample.received for sample in self.aligned.odometry]
        return step_results([step for step, _ in pairs], [name for _, name in pairs], odometry,
                            self.log.command_timeout)

    @cached_property
    def timing(self) -> Timing:
        """Return how exactly the drive was timed."""
        return timing(self.log.motions)

    @cached_property
    def speed(self) -> list[SpeedInterval]:
        """Return how fast the motions were driven; empty if all was at full speed."""
        return speed_intervals(self.log)

    @property
    def paused_duration(self) -> float:
        """Return for how long motions were paused [s]."""
        return math.fsum(interval.end - interval.begin for interval in self.speed
                         if interval.is_pause)

    @cached_property
    def sleep_loop(self) -> SleepLoopEstimate:
        """Return what the lesson's loop would have made of all that was planned."""
        return estimate_sleep_loop([motion.plan for motion in self.log.motions])

    @property
    def planned_duration(self) -> float:
        """Return how long all motions that began were to take [s]."""
        return math.fsum(motion.plan.duration for motion in self.log.motions
                         if motion.has_begun)

    @property
    def driven_duration(self) -> float:
        """Return how long they took, from t = 0 of each to the zero that ended it [s]."""
        return math.fsum(
            motion.own_messages[-1].time - motion.began for motion in self.log.motions
            if motion.own_messages)

    @property
    def last_seen(self) -> OdometrySample | None:
        """Return the last sample of odometry; None if there is none since t = 0."""
        return self.aligned.odometry[-1] if self.aligned.odometry else None

    @property
    def final_pose(self) -> Pose | None:
        """Return the last pose of odometry; None if there is none since t = 0."""
        return None if self.last_seen is None else self.last_seen.pose

    @property
    def error_from_plan(self) -> PoseError | None:
        """Return its error from the planned end; None if not all was driven, or not reported."""
        if self.final_pose is None or not all(motion.is_complete for motion in self.log.motions):
            return None
        return PoseError(*distance_between(self.aligned.planned_end, self.final_pose))

    @property
    def error_from_sent(self) -> PoseError | None:
        """Return its error from where the messages should have brought the robot."""
        return None if self.last_seen is None else PoseError(
            self.last_seen.distance, self.last_seen.angle)
