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

from kachaka_simple_control.motion.geometry import distance_between, Pose
from kachaka_simple_control.report.drive_log import DriveLog, MotionLog
from kachaka_simple_control.report.metrics import (
    estimate_sleep_loop,
    SleepLoopEstimate,
    step_results,
    StepResult,
    Timing,
    timing,
)
from kachaka_simple_control.report.odometry_alignment import AlignedDrive, OdometrySample
from kachaka_simple_control.report.plan_view import pluralize

#: What to say of a program whose end nobody told.
UNHEARD = (
    'Nothing more came from the program: it was killed or crashed, was frozen, or drives on '
    'without telling its report')


class OutcomeKind(Enum):
    """The ways in which a drive can end; the value is the word for it."""

    DONE = 'done'
    STOPPED = 'stopped'
    FAULTED = 'faulted'
    NEVER_BEGAN = 'never began'
    KILLED = 'killed'


@dataclass(frozen=True)
class Outcome:
    """
    How a drive came out.

    :param ending: in which way it ended
    :param headline: a few words
    :param why: sentences that say why, and how far it came
    """

    kind: OutcomeKind
    headline: str
    reason: str


def outcome(record: DriveLog) -> Outcome:
    """
    Say how a drive came out.

    :param record: what happened
    :returns: the verdict
    """
    closed = record.session_ended
    if closed is None:
        return Outcome(OutcomeKind.KILLED, 'Killed', f'{UNHEARD}. {_progress(record)}')
    if closed.signal is not None:
        name = signal_name(closed.signal)
        return Outcome(
            OutcomeKind.STOPPED, f'Stopped by {name}',
            f'{name} ended the program. {_earlier(record, name)}{_progress(record)}')
    return _by_motions(record, closed.error)


def signal_name(number: int) -> str:
    """
    Return the name of a signal.

    :param number: its number
    :returns: SIGINT, say
    """
    try:
        return signal.Signals(number).name
    except ValueError:
        return f'signal {number}'


def _by_motions(record: DriveLog, error: str | None) -> Outcome:
    reason = _reason(record, faults=True) or error
    if not any(motion.has_begun for motion in record.motions):
        return Outcome(
            OutcomeKind.NEVER_BEGAN, 'Never began',
            _sentence(reason or _reason(record) or 'The program ended without driving'))
    if reason is not None:
        return Outcome(
            OutcomeKind.FAULTED, 'Faulted', f'{_sentence(reason)} {_progress(record)}')
    if (asked := _reason(record)) is not None:
        return Outcome(
            OutcomeKind.STOPPED, 'Stopped on request', f'{_sentence(asked)} {_progress(record)}')
    if not all(motion.is_complete for motion in record.motions):
        return Outcome(
            OutcomeKind.FAULTED, 'Not finished', f'Nobody told why. {_progress(record)}')
    return Outcome(OutcomeKind.DONE, 'Done', _progress(record))


def _reason(record: DriveLog, faults: bool = False) -> str | None:
    return next((motion.reason for motion in record.motions
                 if motion.reason is not None and (motion.is_fault or not faults)), None)


def _earlier(record: DriveLog, name: str) -> str:
    # Standing by, a program drives on after a motion that came to nothing.
    reason = _reason(record)
    if reason is None or reason == f'stopped by {name}':
        return ''
    return f'A motion had been given up: {_sentence(reason)} '


def _sentence(text: str) -> str:
    text = ' '.join(text.split()) or 'no reason was told'
    return text[0].upper() + text[1:] + ('' if text[-1] in '.!?' else '.')


def _progress(record: DriveLog) -> str:
    begun = [motion for motion in record.motions if motion.has_begun]
    if not begun:
        return 'No motion had begun.'
    cut = next((motion for motion in begun if not motion.is_complete), None)
    whole = [motion for motion in begun if motion.is_complete]
    if cut is None:
        steps = sum(len(motion.plan.steps) for motion in whole)
        more = len(record.motions) - len(begun)
        left = f' {pluralize(more, "motion")} more did not begin.' if more else ''
        if len(whole) == 1:
            return f'Its motion was driven to its end, {_all_of(steps)}.{left}'
        return (f'{len(whole)} motions were driven to their end, '
                f'{pluralize(steps, "step")} in all.{left}')
    return _how_far(cut, len(whole), len(begun))


def _all_of(steps: int) -> str:
    return f'all {steps} steps' if steps > 1 else pluralize(steps, 'step')


def _how_far(cut: MotionLog, whole: int, begun: int) -> str:
    movements = cut.steps
    stages = len(cut.plan.steps)
    at = cut.own_messages[-1].time - cut.began if cut.own_messages else 0.0
    where = f'in step {len(movements)} of {stages}, ' if movements else ''
    others = f'; of {pluralize(begun, "motion")} {whole} were driven to their end' if whole else ''
    return (f'The motion ended {where}{at:.2f} s after its t = 0, of '
            f'{cut.plan.duration:.2f} s{others}.')


@dataclass(frozen=True)
class PoseError:
    """
    How far odometry saw the robot from where it should have been.

    :param distance: how far [m]
    :param angle: by how much it looked too far to the left [rad]
    """

    distance: float
    angle: float


class Summary:
    """
    What a report says, each part worked out when it is asked for first.

    :param log: what happened
    """

    def __init__(self, record: DriveLog) -> None:
        """
        Take a record; it changes no more.

        :param log: what happened
        """
        self.log = record

    @cached_property
    def outcome(self) -> Outcome:
        """How it came out."""
        return outcome(self.log)

    @cached_property
    def path(self) -> AlignedDrive:
        """Where it was planned, sent and seen to go."""
        return AlignedDrive(self.log)

    @cached_property
    def steps(self) -> list[StepResult]:
        """The steps that were begun."""
        pairs = [(movement, motion.planned.motion.name) for motion in self.log.motions
                 for movement in motion.steps if movement.sent]
        opened = self.log.session_started
        odometry = [seen.received for seen in self.path.odometry]
        return step_results([one for one, _ in pairs], [name for _, name in pairs], odometry,
                            math.inf if opened is None else opened.command_timeout)

    @cached_property
    def timing(self) -> Timing:
        """How exactly it was timed."""
        return timing(self.log.motions)

    @cached_property
    def sleep_loop(self) -> SleepLoopEstimate:
        """What the lesson's loop would have made of all that was planned."""
        return estimate_sleep_loop([motion.plan for motion in self.log.motions])

    @property
    def planned_duration(self) -> float:
        """How long all motions that began were to take [s]."""
        return math.fsum(motion.plan.duration for motion in self.log.motions
                         if motion.has_begun)

    @property
    def driven_duration(self) -> float:
        """How long they took, from t = 0 of each to the zero that ended it [s]."""
        return math.fsum(
            motion.own_messages[-1].time - motion.began for motion in self.log.motions
            if motion.own_messages)

    @property
    def last_seen(self) -> OdometrySample | None:
        """What odometry told last; None if it told nothing since t = 0."""
        return self.path.odometry[-1] if self.path.odometry else None

    @property
    def final_pose(self) -> Pose | None:
        """Where odometry saw the robot in the end."""
        return None if self.last_seen is None else self.last_seen.pose

    @property
    def error_from_plan(self) -> PoseError | None:
        """How far from the planned end that is; None if it was not to be reached or not seen."""
        if self.final_pose is None or not all(motion.is_complete for motion in self.log.motions):
            return None
        return PoseError(*distance_between(self.path.planned_end, self.final_pose))

    @property
    def error_from_sent(self) -> PoseError | None:
        """How far from where the messages should have brought it that is."""
        return None if self.last_seen is None else PoseError(
            self.last_seen.distance, self.last_seen.angle)
