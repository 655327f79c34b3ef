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
"""Text tables of a plan and of a drive."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
import math
import sys
import unicodedata

from kachaka_simple_control.motion.geometry import Displacement, Pose
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import Plan, PlannedStep
from kachaka_simple_control.motion.units import format_number
from kachaka_simple_control.report.drive_log import DriveLog, StepLog
from kachaka_simple_control.report.metrics import driven, segment_odometry, sent
from kachaka_simple_control.report.plan_view import format_fixed, PlanView, pluralize

#: The widest table: what most terminals show without breaking lines.
WIDEST = 99
#: Between two columns.
SPACE = '  '

Row = tuple[str, ...]


def columns(
        head: Sequence[tuple[str, str]], rows: Sequence[Row], rule_above_last: bool = False,
        widest: int = WIDEST) -> list[str]:
    """
    Lay out a table; columns that are empty throughout are left out.

    Text is aligned to the left, and numbers, whose column has a unit, to the right.  If the table
    is too wide, its longest texts are cut.

    :param head: the name and the unit of each column
    :param rows: the cells, as many in each row as there are columns
    :param rule_above_last: whether a line separates the last row from the others
    :param widest: how many columns of text the table may have
    :returns: lines of text: names, units if there are any, a rule, the rows
    """
    units = tuple(unit for _, unit in head)
    cells = [tuple(name for name, _ in head), *([units] if any(units) else []), *rows]
    used = [place for place in range(len(head)) if any(row[place] for row in cells)]
    widths = [max(_width(row[place]) for row in cells) for place in used]
    for _ in range(sum(widths) + len(SPACE) * (len(widths) - 1) - widest):
        widths[widths.index(max(widths))] -= 1
    lines = [SPACE.join(
        _aligned(row[place], width, bool(units[place]) or row[place].isdecimal())
        for place, width in zip(used, widths)).rstrip() for row in cells]
    rule = SPACE.join('-' * width for width in widths)
    lines.insert(len(cells) - len(rows), rule)
    if rule_above_last and len(rows) > 1:
        lines.insert(-1, rule)
    return lines


def one_line(text: str, width: int) -> str:
    """Return a text of any length and characters as one line, cut to a width with an ellipsis."""
    line = ' '.join(text.split())
    return _cut(''.join(char if char.isprintable() else '?' for char in line), width)


def _cut(text: str, width: int) -> str:
    if _width(text) <= width:
        return text
    end = len(text)
    while end and _width(text[:end]) > width - 3:
        end -= 1
    return text[:end] + '...'


def _aligned(text: str, width: int, right: bool) -> str:
    text = _cut(text, width)
    pad = ' ' * (width - _width(text))
    return pad + text if right else text + pad


def _width(text: str) -> int:
    # Chinese and Japanese letters are twice as wide as others; combining marks take no room.
    return sum(
        0 if unicodedata.combining(char) else 1 + (unicodedata.east_asian_width(char) in 'WF')
        for char in text)


#: About how many lines of text a person reads.
LINES = 60
#: The longest table of steps; of a longer one rows are left out.
MAX_STEPS = 40
#: A shorter table of steps says too little.
MIN_STEPS = 8
#: Lines of a table of steps without its steps, and of a comparison without its motions.
FRAME, CAPTION = 6, 7
#: The longest name there is room for.
NAME = 36
#: From this time on [s], tenths of a second are precise enough.
LONG = 1000.0

FIGURES = (('takes', '[s]'), ('length', '[m]'), ('x', '[m]'), ('y', '[m]'), ('heading', '[deg]'),
           ('linear', '[m/s]'), ('angular', '[rad/s]'))
LEGEND = 'Poses: at the end, seen from the start.  Velocities: the largest sent, either way.'


def plan_table(views: Sequence[PlanView]) -> str:
    """
    Return tables of plans: the steps of each, as far as there is room, and their totals.

    :returns: lines of text, up to 99 columns wide; about 60 unless there are more motions
    """
    if len(views) == 1:
        view = views[0]
        return '\n'.join([
            *_steps(view, MAX_STEPS, with_total=True), '', *_sending(view), LEGEND])
    most = (LINES - CAPTION - len(views)) // max(1, len(views)) - FRAME
    lines: list[str] = []
    if most >= MIN_STEPS:
        for view in views:
            lines += [*_steps(view, most, with_total=False), '']
    return '\n'.join([*lines, *_comparison(views), '', LEGEND])


def _steps(view: PlanView, most: int, with_total: bool) -> list[str]:
    steps = view.plan.steps
    kept = _kept(steps, most)
    times = Counter(step.path for step in steps)
    repeats: Counter[str] = Counter()
    rows = []
    shown = set(kept)
    for index, step in enumerate(steps):
        repeats[step.path] += 1
        if index in shown:
            rows.append(_plan_row(index, step, repeats[step.path], times[step.path]))
    if with_total:
        rows.append(_total(view.plan))
    head = (('', ''), ('step', ''), ('', ''), ('start', '[s]'), *FIGURES)
    lines = columns(head, rows, rule_above_last=with_total)
    _mark_gaps(lines, kept, steps)
    title = (f'{one_line(view.name, NAME)} on {one_line(view.robot, NAME)} '
             f'at {format_number(view.rate)} Hz')
    return [title, '', *lines]


def _plan_row(index: int, step: PlannedStep, number: int, times: int) -> Row:
    return (
        str(index + 1), step.step.describe(), f'{number} of {times}' if times > 1 else '',
        _time(step.start),
        *_figures(step.end - step.start, step.length, step.pose,
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


def _kept(steps: Sequence[PlannedStep], most: int) -> list[int]:
    """Return which steps of a long motion are shown: of repeated ones the first and the last."""
    if len(steps) <= most:
        return list(range(len(steps)))
    first: dict[str, int] = {}
    last: dict[str, int] = {}
    for index, step in enumerate(steps):
        first.setdefault(step.path, index)
        last[step.path] = index
    ends = sorted({*first.values(), *last.values()})
    gaps = sum(two - one > 1 for one, two in pairwise(ends))
    if len(ends) + gaps <= most:
        return ends
    half = (most - 1) // 2
    return [*range(half), *range(len(steps) - half, len(steps))]


def _mark_gaps(lines: list[str], kept: Sequence[int], steps: Sequence[PlannedStep]) -> None:
    # From below, so that the lines above keep their places; two lines and a rule are the head.
    for place in range(len(kept) - 1, 0, -1):
        before, after = kept[place - 1], kept[place]
        if after - before == 1:
            continue
        known = {steps[index].path for index in kept[:place]}
        again = all(step.path in known for step in steps[before + 1:after])
        lines.insert(3 + place, (
            f'... {pluralize(after - before - 1, "step")}, from {_time(steps[before].end)} s '
            f'to {_time(steps[after].start)} s{", as above" if again else ""} ...'))


def _sending(view: PlanView) -> list[str]:
    count = view.messages
    sent = (f'Sent: {pluralize(count, "velocity", "velocities")}, '
            f'{format_number(1000.0 * view.plan.period)} ms apart or less, then the stop')
    return [sent, _floor(view), *_limits(view.limits)]


def _floor(view: PlanView) -> str:
    # Rounded up to a centimetre, and not by a rounding error.
    width, depth = (math.ceil(100.0 * size - 1e-6) / 100.0 for size in view.floor)
    what = 'the robot included' if view.footprint else 'and the robot, whose outline is not known'
    return f'Floor: {width:.2f} m x {depth:.2f} m, {what}'


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


def _comparison(views: Sequence[PlanView]) -> list[str]:
    robots = {view.robot for view in views}
    rates = {view.rate for view in views}
    own: list[tuple[str, str]] = []
    if len(robots) > 1:
        own.append(('robot', ''))
    if len(rates) > 1:
        own.append(('rate', '[Hz]'))
    rows = [_compared(view, dict(own)) for view in views]
    head = (('motion', ''), *own, ('steps', ''), *FIGURES, ('sent', ''))
    common = [f'on {one_line(next(iter(robots)), NAME)}'] if len(robots) == 1 else []
    common += [f'at {format_number(next(iter(rates)))} Hz'] if len(rates) == 1 else []
    return [' '.join([pluralize(len(views), 'motion'), *common]), '', *columns(head, rows)]


def _compared(view: PlanView, own: dict[str, str]) -> Row:
    cells = [one_line(view.name, NAME)]
    cells += [one_line(view.robot, NAME)] if 'robot' in own else []
    cells += [format_number(view.rate)] if 'rate' in own else []
    plan = view.plan
    return (*cells, str(len(plan.steps)), *_plan_figures(plan), str(view.messages))


def _time(value: float) -> str:
    return format_fixed(value, 3 if value < LONG else 1)


#: Columns of the table of a drive; its cells have their units.
DRIVE_HEAD = (('movement', ''), ('requested', ''), ('sent', ''), ('odometry', ''))


def drive_table(log: DriveLog, still_after: float | None) -> str:
    """
    Return a table of a drive: each step's displacement as requested, as sent and as driven.

    :param log: the drive
    :param still_after: how long after the stop began odometry saw the robot still [s]; None if
        it did not
    :returns: lines of text, the last two with the stop and the final pose
    """
    steps = log.steps
    cuts = segment_odometry(steps, log.odometry) if steps else []
    rows = [_drive_row(step, driven(log.odometry, begin, end))
            for step, begin, end in zip(steps, cuts, cuts[1:])]
    lines = columns(DRIVE_HEAD, rows, widest=sys.maxsize)
    return '\n'.join([*lines, _stop(still_after), _final_pose(log)])


def _drive_row(step: StepLog, seen: Displacement | None) -> Row:
    return (
        step.step.describe_fully() + ('' if step.is_complete else '; cut short'),
        _amount(step.step.displacement),
        _amount(sent(step.sent)), 'none' if seen is None else _amount(seen))


def _amount(displacement: Displacement) -> str:
    # Adding 0.0 turns -0.0 into 0.0.
    return (f'{round(displacement.distance, 4) + 0.0:7.4f} m '
            f'{round(displacement.angle, 4) + 0.0:7.4f} rad')


def _stop(still_after: float | None) -> str:
    if still_after is None:
        return 'Stop: sent, not confirmed by odometry'
    return f'Stop: confirmed by odometry after {still_after:.2f} s'


def _final_pose(log: DriveLog) -> str:
    if not log.odometry:
        return 'Final pose: unknown, no odometry arrived'
    pose = log.odometry[-1].pose
    return (f'Final pose by odometry: x {pose.x + 0.0:.4f} m, y {pose.y + 0.0:.4f} m, '
            f'heading {math.degrees(pose.theta) + 0.0:.2f} degrees')
