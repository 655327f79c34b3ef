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
"""A drive's figures as JSON, for programs; docs/report.md says what each is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from datetime import datetime, timezone
import json
import math
from typing import Any

from kachaka_simple_control.motion.geometry import Displacement, Pose
from kachaka_simple_control.report.drive_log import DriveLog, MotionLog
from kachaka_simple_control.report.metrics import (
    Quantiles,
    StepResult,
)
from kachaka_simple_control.report.summary import PoseError, signal_name, Summary

#: Counts up when a field goes away or changes its meaning; new fields may come at any time.
FORMAT = 1
#: Digits behind the point: nanometres and nanoseconds.
DIGITS = 9

Fields = dict[str, Any]


def run_json(summary: Summary, recording: str | None) -> str:
    """
    Put a drive's figures as JSON.

    :param summary: the drive
    :param recording: why ``run.mcap`` is missing or not whole; None if it is whole
    :returns: the text of a file
    """
    return json.dumps(_plain(fields(summary, recording)), indent=1, allow_nan=False) + '\n'


def fields(summary: Summary, recording: str | None) -> Fields:
    """
    Return a drive's figures; units are in their names.

    :param summary: the drive
    :param recording: why ``run.mcap`` is missing or not whole; None if it is whole
    :returns: the figures by name; what is not known is None or not finite
    """
    record = summary.record
    opened = record.opened
    return {
        'format': FORMAT,
        'title': None if opened is None else opened.title,
        'robot': None if opened is None else opened.robot,
        'began': _moment(summary),
        'verdict': _verdict(summary),
        'duration': {'planned_s': summary.planned_duration, 'driven_s': summary.driven_duration},
        'end': _end(summary),
        'stop': {'confirmed_after_s': _still_after(record)},
        'timing': _timing(summary),
        'lesson_loop': {
            'longer_s': summary.naive.longer, 'missing_messages': summary.naive.missing,
            'end_distance_m': summary.naive.distance, 'end_angle_rad': summary.naive.angle},
        'motions': [_motion(motion, summary.path.began) for motion in record.motions],
        'steps': [_step(number, step, summary.path.began)
                  for number, step in enumerate(summary.steps, 1)],
        'recording': {'is_whole': recording is None, 'why_not': recording},
        'limits': None if opened is None else asdict(opened.limits),
        'hold_s': None if opened is None else opened.command_timeout,
        'topics': None if opened is None else {
            'velocity': opened.velocity_topic, 'type': opened.message_type,
            'odometry': opened.odometry_topic},
        'settings': {} if opened is None else dict(opened.settings),
        'versions': {} if opened is None else dict(opened.versions),
    }


def moment(summary: Summary) -> datetime | None:
    """
    Return when a drive began by the clock on the wall.

    :param summary: the drive
    :returns: the time of t = 0; None if nothing began
    """
    opened, began = summary.record.opened, summary.path.began
    if opened is None or not math.isfinite(opened.epoch + began):
        return None
    try:
        return datetime.fromtimestamp(opened.epoch + began, timezone.utc)
    except (OverflowError, OSError, ValueError):
        return None


def _moment(summary: Summary) -> str | None:
    began = moment(summary)
    return None if began is None else began.isoformat(timespec='milliseconds')


def _verdict(summary: Summary) -> Fields:
    closed, found = summary.record.closed, summary.outcome
    signum = None if closed is None else closed.signal
    return {
        'ending': found.ending.value.replace(' ', '_'), 'headline': found.headline,
        'why': found.why, 'signal': None if signum is None else signal_name(signum)}


def _still_after(record: DriveLog) -> float | None:
    return None if record.closed is None else record.closed.still_after


def _end(summary: Summary) -> Fields:
    seen = summary.last_seen
    return {
        'planned': _pose(summary.path.planned_end),
        'sent': _pose(summary.path.reckoning.end),
        'odometry': _pose(summary.end),
        'odometry_time_s': None if seen is None else seen.time,
        'odometry_from_planned': _miss(summary.error_from_plan),
        'odometry_from_sent': _miss(summary.error_from_sent)}


def _timing(summary: Summary) -> Fields:
    timing = summary.timing
    return {
        'periods_s': timing.periods, 'due': timing.due, 'late': timing.late, 'lost': timing.lost,
        'lateness': _quantiles(timing.lateness), 'jitter': _quantiles(timing.jitter)}


def _quantiles(found: Quantiles | None) -> Fields | None:
    return None if found is None else {
        'median_s': found.median, 'p99_s': found.p99, 'worst_s': found.worst}


def _motion(motion: MotionLog, origin: float) -> Fields:
    return {
        'name': motion.planned.motion.name, 'rate_hz': motion.planned.rate,
        'steps': len(motion.plan.steps), 'planned_duration_s': motion.plan.duration,
        'began_s': motion.began - origin if motion.has_begun else None,
        'is_whole': motion.is_complete, 'reason': motion.reason}


def _step(number: int, step: StepResult, origin: float) -> Fields:
    movement = step.movement
    return {
        'number': number, 'motion': step.motion, 'path': movement.stage.path,
        'step': movement.step.describe_fully(), 'start_s': movement.began - origin,
        'duration_s': movement.stage.end - movement.stage.start, 'is_whole': movement.is_complete,
        'messages': max(0, len(movement.sent) - 1),
        'requested': _displacement(step.requested), 'sent': _displacement(step.sent),
        'odometry': _displacement(step.odometry), 'error': _displacement(step.error)}


def _displacement(displacement: Displacement | None) -> Fields | None:
    return None if displacement is None else {
        'distance_m': displacement.distance, 'angle_rad': displacement.angle}


def _miss(miss: PoseError | None) -> Fields | None:
    return None if miss is None else {'distance_m': miss.distance, 'angle_rad': miss.angle}


def _pose(pose: Pose | None) -> Fields | None:
    return None if pose is None else {'x_m': pose.x, 'y_m': pose.y, 'heading_rad': pose.theta}


def _plain(value: object) -> object:
    """Return something as JSON has it: what is no finite number is null."""
    if isinstance(value, bool) or value is None or isinstance(value, (int, str)):
        return value
    if isinstance(value, float):
        return round(value, DIGITS) + 0.0 if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(name): _plain(part) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    return str(value)
