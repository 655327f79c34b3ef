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
"""
Export the results of a drive as JSON.

The file docs/report.md describes each field.  Tested by test/report/test_report_files.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from datetime import datetime, timezone
import json
import math
from typing import Any

from kachaka_simple_control.analysis.drive_log import MotionLog
from kachaka_simple_control.analysis.fleet_summary import FleetSummary
from kachaka_simple_control.analysis.message_timing import Quantiles
from kachaka_simple_control.analysis.obstacle_holds import Hold
from kachaka_simple_control.analysis.step_results import Result, StepResult
from kachaka_simple_control.analysis.summary import (
    Outcome,
    signal_name,
    SpeedInterval,
    Summary,
)
from kachaka_simple_control.files.report_file import FORMAT
from kachaka_simple_control.motion.geometry import Displacement, Pose
from kachaka_simple_control.motion.paths import simplify
from kachaka_simple_control.report.map_plot import path_lines

#: The number of decimal places of all numbers: nanometres and nanoseconds.
DIGITS = 9

#: The tolerance of a simplified path [m], and its largest number of points.
PATH_GRAIN, MAX_PATH_POINTS = 0.001, 500

Fields = dict[str, Any]


def run_json(summary: Summary, recording: str | None) -> str:
    """
    Return the results of a drive as the text of a JSON file.

    :param recording: the reason why the recording ``run.mcap`` is missing or incomplete; None if
        it is complete
    """
    return json.dumps(_plain(fields(summary, recording)), indent=1, allow_nan=False) + '\n'


def fleet_json(fleet: FleetSummary, recording: str | None) -> str:
    """Return the results of a fleet's drive as the text of a JSON file, with those of a robot."""
    started, outcome = fleet.started, fleet.outcome
    return json.dumps(_plain({
        'format': FORMAT, 'fleet': started.name,
        'fleet_file': None if started.text is None else {
            'source': started.source, 'text': started.text},
        'repeat': started.repeat, 'on_fault': 'go_on' if started.goes_on else 'stop_all',
        'verdict': {'ending': _ending(outcome), 'headline': outcome.headline,
                    'why': outcome.reason},
        'near_passes': started.near_passes,
        'first_velocities_apart_s': fleet.first_apart,
        'apart': [{'round': number, 'plan_time_s': event.at, 'apart_s': event.apart,
                   'robots': event.robots} for number, event in fleet.log.apart],
        'recording': {'is_whole': recording is None, 'why_not': recording},
        'robots': {robot.member.name: {
            'start': _pose(robot.member.start), 'lateness': _quantiles(robot.lateness),
            'longest_pause_s': robot.longest_pause, **fields(robot, recording)}
            for robot in fleet.robots}}), indent=1, allow_nan=False) + '\n'


def fields(summary: Summary, recording: str | None) -> Fields:
    """
    Return the results of a drive as a dictionary, from which a JSON file is made.

    Most keys of quantities end with the unit, for example ``planned_s`` for a time in seconds.
    The keys of the robot's limits have no unit; these limits use metres, radians and seconds.

    :param recording: the reason why the recording ``run.mcap`` is missing or incomplete; None if
        it is complete
    :returns: the results; an unknown value is None, infinite or NaN
    """
    log = summary.log
    session, end, file = log.session_started, log.session_ended, log.motion_file
    began = start_datetime(summary)
    return {
        'format': FORMAT,
        'title': None if session is None else session.title,
        'robot': None if session is None else session.robot,
        'command': None if session is None else session.command or None,
        'motion_file': None if file is None else asdict(file),
        'began': None if began is None else began.isoformat(timespec='milliseconds'),
        'verdict': _outcome(summary),
        'duration': {'planned_s': summary.planned_duration, 'driven_s': summary.driven_duration},
        'end': _end(summary),
        'path': _path(summary),
        'stop': {'confirmed_after_s': None if end is None else end.stop_confirmed_after},
        'timing': _timing(summary),
        'lesson_loop': {
            'longer_s': summary.sleep_loop.extra_time,
            'missing_messages': summary.sleep_loop.missing_messages,
            'end_distance_m': summary.sleep_loop.distance,
            'end_angle_rad': summary.sleep_loop.angle},
        **_speed(summary),
        **({'holds': [_hold(summary, hold) for hold in summary.holds]} if summary.holds else {}),
        'motions': [_motion(motion, summary.aligned.start_time) for motion in log.motions],
        'steps': [_step(number, step, summary.aligned.start_time)
                  for number, step in enumerate(summary.steps, 1)],
        'recording': {'is_whole': recording is None, 'why_not': recording},
        'limits': None if session is None else asdict(session.limits),
        'hold_s': None if session is None else session.command_timeout,
        'topics': None if session is None else {
            'velocity': session.velocity_topic, 'type': session.message_type,
            'odometry': session.odometry_topic},
        'settings': {} if session is None else dict(session.settings),
        'versions': {} if session is None else dict(session.versions),
    }


def start_datetime(summary: Summary) -> datetime | None:
    """
    Return the date and time at which the first motion of a drive started, in UTC.

    Return None if no motion started, or if the date is not known.
    """
    session, began = summary.log.session_started, summary.aligned.start_time
    if session is None or not math.isfinite(session.epoch + began):
        return None
    try:
        return datetime.fromtimestamp(session.epoch + began, timezone.utc)
    except (OverflowError, OSError, ValueError):
        return None


def _outcome(summary: Summary) -> Fields:
    end, outcome = summary.log.session_ended, summary.outcome
    signum = None if end is None else end.signal
    return {
        'ending': _ending(outcome), 'headline': outcome.headline,
        'why': outcome.reason, 'signal': None if signum is None else signal_name(signum)}


def _ending(outcome: Outcome) -> str:
    return outcome.kind.value.replace(' ', '_')


def _path(summary: Summary) -> Fields:
    """
    Return the planned path and the odometry path of a drive as lists of points [m].

    Each path has at most 500 points, which are enough to plot it.
    """
    lines = path_lines(summary.aligned)
    return {name: [[round(value, 4) for value in point]
                   for point in simplify(lines.get(name, []), PATH_GRAIN, MAX_PATH_POINTS)]
            for name in ('planned', 'odometry')}


def _end(summary: Summary) -> Fields:
    seen = summary.last_seen
    return {
        'planned': _pose(summary.aligned.planned_end),
        'sent': _pose(summary.aligned.dead_reckoning.end),
        'odometry': _pose(summary.final_pose),
        'odometry_time_s': None if seen is None else seen.time,
        'odometry_from_planned': _distance_and_angle(summary.error_from_plan),
        'odometry_from_sent': _distance_and_angle(summary.error_from_sent)}


def _timing(summary: Summary) -> Fields:
    timing = summary.timing
    return {
        'periods_s': timing.periods, 'due': timing.due, 'late': timing.late, 'lost': timing.lost,
        'lateness': _quantiles(timing.lateness), 'jitter': _quantiles(timing.jitter),
        **({'unjudged': timing.unjudged} if timing.unjudged else {})}


def _speed(summary: Summary) -> Fields:
    """
    Return the times at which a drive was paused or slower than planned, for a JSON file.

    :returns: a dictionary with the key ``speed``; empty if the whole drive had the planned speed.
        The value of ``speed`` is a dictionary with the total time of all pauses, and with a list
        of time intervals in which the speed relative to the plan was constant
    """
    if not summary.speed:
        return {}
    return {'speed': {
        'paused_s': summary.paused_duration,
        'intervals': [_interval(summary, interval) for interval in summary.speed]}}


def _interval(summary: Summary, interval: SpeedInterval) -> Fields:
    begin = interval.begin - summary.aligned.start_time
    return {
        'motion': _number(summary, interval.motion), 'step': summary.step_number(interval),
        'path': interval.step.path,
        'factor': interval.factor, 'factors': interval.factors, 'is_pause': interval.is_pause,
        'begin_s': begin, 'end_s': begin + interval.end - interval.begin,
        'plan_begin_s': interval.plan_begin, 'plan_end_s': interval.plan_end}


def _hold(summary: Summary, hold: Hold) -> Fields:
    return {
        'motion': _number(summary, hold.motion), 'step': summary.step_number(hold),
        'path': hold.step.path, 'state': hold.state.value, 'reason': hold.reason,
        'begin_s': hold.begin, 'end_s': hold.end, 'plan_s': hold.plan_time,
        'distance_m': hold.distance, 'angle_rad': hold.angle, 'pose': _pose(hold.pose)}


def _number(summary: Summary, motion: MotionLog) -> int:
    return next(number for number, other in enumerate(summary.log.motions, 1)
                if other is motion)


def _quantiles(quantiles: Quantiles | None) -> Fields | None:
    return None if quantiles is None else {
        'median_s': quantiles.median, 'p99_s': quantiles.p99, 'worst_s': quantiles.worst}


def _motion(motion: MotionLog, start_time: float) -> Fields:
    return {
        'name': motion.planned.motion.name,
        'description': motion.planned.motion.description,
        'limits': asdict(motion.planned.limits), 'rate_hz': motion.planned.rate,
        'steps': len(motion.plan.steps), 'planned_duration_s': motion.plan.duration,
        'began_s': motion.began - start_time if motion.has_begun else None,
        'is_whole': motion.is_complete, 'reason': motion.reason}


def _step(number: int, result: StepResult, start_time: float) -> Fields:
    log = result.log
    return {
        'number': number, 'motion': result.motion, 'path': log.planned.path,
        'step': log.step.describe_fully(), 'included': log.planned.included or None,
        'start_s': log.began - start_time,
        'duration_s': log.planned.duration, 'is_whole': log.is_complete,
        'messages': max(0, len(log.sent) - 1),
        **({'plan_start_s': log.planned.start, 'driven_s': log.driven_duration}
           if log.is_delayed else {}),
        **_result(result),
        **({'in_flow': True} if result.is_in_flow else {}),
        **({} if result.flow is None else {
            'flow': {'steps': result.flow.count, **_result(result.flow)}})}


def _result(result: Result) -> Fields:
    return {
        'requested': _distance_and_angle(result.requested),
        'sent': _distance_and_angle(result.sent),
        'odometry': _distance_and_angle(result.odometry),
        'error': _distance_and_angle(result.error)}


def _distance_and_angle(value: Displacement | None) -> Fields | None:
    return None if value is None else {'distance_m': value.distance, 'angle_rad': value.angle}


def _pose(pose: Pose | None) -> Fields | None:
    return None if pose is None else {'x_m': pose.x, 'y_m': pose.y, 'heading_rad': pose.theta}


def _plain(value: object) -> object:
    """
    Convert a value to types that JSON can represent.

    A float is rounded to nine decimal places.  A float that is infinite or NaN becomes None.  The
    values in a dictionary or a list are converted too, and an object of any other type becomes
    text.
    """
    if isinstance(value, bool) or value is None or isinstance(value, (int, str)):
        return value
    if isinstance(value, float):
        return round(value, DIGITS) + 0.0 if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(name): _plain(part) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    return str(value)
