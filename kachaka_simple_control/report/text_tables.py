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
"""Text tables of plans and of drives."""

from __future__ import annotations

from collections.abc import Sequence
import math
import sys
import textwrap

from kachaka_simple_control.analysis.drive_log import DriveLog, StepLog
from kachaka_simple_control.analysis.plan_view import PlanView
from kachaka_simple_control.analysis.step_results import driven, segment_odometry, sent
from kachaka_simple_control.motion.geometry import Displacement, Pose
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import Plan, PlannedStep
from kachaka_simple_control.motion.units import format_number
from kachaka_simple_control.report.table_layout import (
    columns,
    fold,
    Gap,
    repeat_labels,
    Row,
    WIDEST,
)
from kachaka_simple_control.text import format_fixed, one_line, pluralize

#: The approximate number of lines of all tables together.
LINES = 60
#: The largest number of rows of a table of steps; a longer table is folded.
MAX_STEPS = 40
#: The smallest useful number of rows of a table of steps.
MIN_STEPS = 8
#: The lines of a table of steps without its steps, and of a comparison without its motions.
FRAME, CAPTION = 6, 7
#: The largest width of a name [columns].
MAX_NAME_WIDTH = 36
#: The time from which times are shown in tenths of a second [s].
TENTHS_FROM = 1000.0

FIGURES = (('takes', '[s]'), ('length', '[m]'), ('x', '[m]'), ('y', '[m]'), ('heading', '[deg]'),
           ('linear', '[m/s]'), ('angular', '[rad/s]'))
#: The columns that a narrow table of steps leaves out, in this order.
SPARE_OF_STEPS = ('number', 'start', 'angular', 'linear', 'length', 'heading')
#: The columns that a narrow comparison leaves out, in this order.
SPARE_OF_MOTIONS = ('sent', 'angular', 'linear', 'length', 'steps', 'heading', 'rate')
POSES = 'Poses: at the end, seen from the start.'
VELOCITIES = '  Velocities: the largest sent, either way.'


def plan_table(views: Sequence[PlanView], widest: int | None = None) -> str:
    """
    Return tables of plans: the steps of each plan, if there is room, and the totals.

    :param widest: the width of the terminal [columns]; None if there is no terminal
    :returns: lines of text, up to 99 columns wide; about 60 lines, more for many motions
    """
    widest = min(widest or WIDEST, WIDEST)
    if len(views) == 1:
        view = views[0]
        lines = _steps(view, MAX_STEPS, widest, with_total=True)
        return '\n'.join([*lines, '', *_wrapped([*_sending(view), _legend(lines)], widest)])
    most = (LINES - CAPTION - len(views)) // max(1, len(views)) - FRAME
    lines = []
    if most >= MIN_STEPS:
        for view in views:
            lines += [*_steps(view, most, widest, with_total=False), '']
    lines += _comparison(views, widest)
    return '\n'.join([*lines, '', *_wrapped([_legend(lines)], widest)])


def _legend(lines: Sequence[str]) -> str:
    return POSES + (VELOCITIES if any('[m/s]' in line for line in lines) else '')


def _wrapped(lines: Sequence[str], widest: int) -> list[str]:
    # Continuation lines are indented like the second line of the limits.
    return [part for line in lines
            for part in textwrap.wrap(line, widest, subsequent_indent=' ' * 8)]


def _steps(view: PlanView, most: int, widest: int, with_total: bool) -> list[str]:
    steps = view.plan.steps
    paths = [step.path for step in steps]
    entries = fold(paths, most)
    repeats = repeat_labels(paths)
    rows = [_plan_row(entry, steps[entry], repeats[entry])
            for entry in entries if isinstance(entry, int)]
    if with_total:
        rows.append(_total(view.plan))
    head = (('', ''), ('step', ''), ('', ''), ('start', '[s]'), *FIGURES)
    names = ['', 'step', 'number', *(name for name, _ in head[3:])]
    lines = columns(head, rows, with_total, widest, [*map(names.index, SPARE_OF_STEPS)])
    for place, entry in enumerate(entries):
        if isinstance(entry, Gap):
            start, end = _time(steps[entry.before].end), _time(steps[entry.after].start)
            line = f'... {entry.describe(start, end)} ...'
            # Three lines are above the rows: names, units and a rule.
            lines.insert(3 + place, line if len(line) <= widest else f'... {entry.size} ...')
    title = (f'{one_line(view.name, MAX_NAME_WIDTH)} on {one_line(view.robot, MAX_NAME_WIDTH)} '
             f'at {format_number(view.rate)} Hz')
    return [one_line(title, widest), '', *lines]


def _plan_row(index: int, step: PlannedStep, repeat: str) -> Row:
    return (
        str(index + 1), step.step.describe(), repeat, _time(step.start),
        *_figures(step.duration, step.length, step.pose,
                  step.max_linear_velocity, step.max_angular_velocity))


def _total(plan: Plan) -> Row:
    return ('', pluralize(len(plan.steps), 'step'), '', '', *_plan_figures(plan))


def _plan_figures(plan: Plan) -> Row:
    return _figures(plan.duration, plan.length, plan.pose, plan.max_linear_velocity,
                    plan.max_angular_velocity)


def _figures(duration: float, length: float, pose: Pose, linear: float, angular: float) -> Row:
    return (
        _time(duration), format_fixed(length, 3), format_fixed(pose.x, 3), format_fixed(pose.y, 3),
        format_fixed(math.degrees(pose.theta), 1), format_fixed(linear, 3),
        format_fixed(angular, 3))


def _sending(view: PlanView) -> list[str]:
    count = view.messages
    sent = (f'Sent: {pluralize(count, "velocity", "velocities")}, '
            f'{format_number(1000.0 * view.plan.period)} ms apart or less, then the stop')
    return [sent, _floor(view), *_limits(view.limits)]


def _floor(view: PlanView) -> str:
    what = 'the robot included' if view.footprint else 'and the robot, whose outline is not known'
    return f'Floor: {view.floor_size}, {what}'


def _limits(limits: Limits) -> list[str]:
    linear = [(limits.max_linear_velocity, 'm/s'), (limits.max_linear_acceleration, 'm/s^2'),
              (limits.max_linear_jerk, 'm/s^3')]
    angular = [(limits.max_angular_velocity, 'rad/s'),
               (limits.max_angular_acceleration, 'rad/s^2'),
               (limits.max_angular_jerk, 'rad/s^3')]
    if limits.backward_velocity != limits.max_linear_velocity:
        linear.insert(1, (limits.backward_velocity, 'm/s backwards'))
    if limits.linear_deceleration != limits.max_linear_acceleration:
        linear.insert(-1, (limits.linear_deceleration, 'm/s^2 braking'))
    if limits.angular_deceleration != limits.max_angular_acceleration:
        angular.insert(-1, (limits.angular_deceleration, 'rad/s^2 braking'))
    return [f'Limits: {_bounds(linear)}', f'        {_bounds(angular)}']


def _bounds(bounds: Sequence[tuple[float, str]]) -> str:
    known = [f'{format_number(value)} {unit}' for value, unit in bounds if value < math.inf]
    return ', '.join(known) or 'none'


def _comparison(views: Sequence[PlanView], widest: int) -> list[str]:
    robots = {view.robot for view in views}
    rates = {view.rate for view in views}
    own: list[tuple[str, str]] = []
    if len(robots) > 1:
        own.append(('robot', ''))
    if len(rates) > 1:
        own.append(('rate', '[Hz]'))
    rows = [_compared(view, dict(own)) for view in views]
    head = (('motion', ''), *own, ('steps', ''), *FIGURES, ('sent', ''))
    common = [f'on {one_line(next(iter(robots)), MAX_NAME_WIDTH)}'] if len(robots) == 1 else []
    common += [f'at {format_number(next(iter(rates)))} Hz'] if len(rates) == 1 else []
    names = [name for name, _ in head]
    spare = [names.index(name) for name in SPARE_OF_MOTIONS if name in names]
    title = ' '.join([pluralize(len(views), 'motion'), *common])
    return [one_line(title, widest), '', *columns(head, rows, widest=widest, spare=spare)]


def _compared(view: PlanView, own: dict[str, str]) -> Row:
    cells = [one_line(view.name, MAX_NAME_WIDTH)]
    cells += [one_line(view.robot, MAX_NAME_WIDTH)] if 'robot' in own else []
    cells += [format_number(view.rate)] if 'rate' in own else []
    plan = view.plan
    return (*cells, str(len(plan.steps)), *_plan_figures(plan), str(view.messages))


def _time(value: float) -> str:
    return format_fixed(value, 3 if value < TENTHS_FROM else 1)


#: The columns of the table of a drive; its cells contain the units.
DRIVE_HEAD = (('movement', ''), ('requested', ''), ('sent', ''), ('odometry', ''))
#: The indices of the columns that a narrow table of a drive leaves out, in this order.
SPARE_OF_DRIVE = (1, 2)


def drive_table(
        log: DriveLog, stop_confirmed_after: float | None, widest: int | None = None) -> str:
    """
    Return a table of a drive: each step's displacement as requested, as sent and from odometry.

    :param log: the drive
    :param stop_confirmed_after: the time between the start of the stop and standstill in odometry
        [s]; None if odometry did not show standstill
    :param widest: the width of the terminal [columns]; None if there is no terminal
    :returns: lines of text; the last two show the stop and the final pose
    """
    steps = log.steps
    cuts = segment_odometry(steps, log.odometry) if steps else []
    rows = [_drive_row(step, log.command_timeout, driven(log.odometry, begin, end))
            for step, begin, end in zip(steps, cuts, cuts[1:])]
    widest = widest or sys.maxsize
    lines = columns(DRIVE_HEAD, rows, widest=widest, spare=SPARE_OF_DRIVE)
    return '\n'.join([*lines, *_wrapped([_stop(stop_confirmed_after), _final_pose(log)], widest)])


def _drive_row(step: StepLog, command_timeout: float, seen: Displacement | None) -> Row:
    return (
        step.step.describe_fully() + ('' if step.is_complete else '; cut short'),
        _amount(step.step.displacement),
        _amount(sent(step.sent, command_timeout)), 'none' if seen is None else _amount(seen))


def _amount(displacement: Displacement) -> str:
    return (f'{format_fixed(displacement.distance, 4):>7} m '
            f'{format_fixed(displacement.angle, 4):>7} rad')


def _stop(stop_confirmed_after: float | None) -> str:
    if stop_confirmed_after is None:
        return 'Stop: sent, not confirmed by odometry'
    return f'Stop: confirmed by odometry after {stop_confirmed_after:.2f} s'


def _final_pose(log: DriveLog) -> str:
    if not log.odometry:
        return 'Final pose: unknown, no odometry arrived'
    pose = log.odometry[-1].pose
    return (f'Final pose by odometry: x {format_fixed(pose.x, 4)} m, '
            f'y {format_fixed(pose.y, 4)} m, '
            f'heading {format_fixed(math.degrees(pose.theta), 2)} degrees')
