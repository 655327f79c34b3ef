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
import unicodedata

from kachaka_simple_control.motion.geometry import Displacement, Pose
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import Plan, PlannedStep
from kachaka_simple_control.motion.units import format_number
from kachaka_simple_control.report.drive_log import DriveLog, StepLog
from kachaka_simple_control.report.metrics import (
    driven,
    segment_odometry,
    sent,
)
from kachaka_simple_control.report.plan_view import (
    format_fixed,
    PlanView,
    pluralize,
)

#: The widest table: what most terminals show without breaking lines.
WIDEST = 99
#: Between two columns.
SPACE = '  '

Row = tuple[str, ...]


def columns(
        head: Sequence[tuple[str, str]], rows: Sequence[Row],
        rule_above_last: bool = False) -> list[str]:
    """
    Lay out a table; columns that are empty throughout are left away.

    Words stand on the left of their column, and figures, whose head has a unit, on the right.  If
    the table is too wide, its longest words are cut.

    :param head: the name and the unit of each column
    :param rows: the cells, as many in each row as there are columns
    :param rule_above_last: whether a line parts the last row from the others
    :returns: lines of text: two of the head, a rule, the rows
    """
    cells = [tuple(name for name, _ in head), tuple(unit for _, unit in head), *rows]
    used = [place for place in range(len(head)) if any(row[place] for row in cells)]
    widths = [max(_width(row[place]) for row in cells) for place in used]
    for _ in range(sum(widths) + len(SPACE) * (len(widths) - 1) - WIDEST):
        widths[widths.index(max(widths))] -= 1
    lines = [SPACE.join(
        _aligned(row[place], width, bool(head[place][1]) or _is_number(row[place]))
        for place, width in zip(used, widths)).rstrip() for row in cells]
    rule = SPACE.join('-' * width for width in widths)
    lines.insert(2, rule)
    if rule_above_last and len(rows) > 1:
        lines.insert(-1, rule)
    return lines


def _is_number(text: str) -> bool:
    return text.isdecimal()


def one_line(text: str, width: int) -> str:
    """
    Return a text from a file so that it stands in one line.

    :param text: a name, of any length, with any characters
    :param width: how many columns there are for it
    :returns: the text, with an ellipsis if it is longer
    """
    line = ' '.join(text.split())
    return _cut(''.join(sign if sign.isprintable() else '?' for sign in line), width)


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
    # Chinese and Japanese letters are twice as wide as others, and marks go on top of them.
    return sum(
        0 if unicodedata.combining(sign) else 1 + (unicodedata.east_asian_width(sign) in 'WF')
        for sign in text)


#: About how many lines a person looks at.
LINES = 60
#: The longest table of steps; a longer one is cut.
MAX_STEPS = 40
#: A shorter table of steps says nothing.
MIN_STEPS = 8
#: What a table of steps has beside its steps, and a comparison beside its motions.
FRAME, CAPTION = 6, 7
#: The longest name there is room for.
NAME = 36
#: From this time on [s], milliseconds make a table wider than they are worth.
LONG = 1000.0

FIGURES = (('takes', '[s]'), ('length', '[m]'), ('x', '[m]'), ('y', '[m]'), ('heading', '[deg]'),
           ('linear', '[m/s]'), ('angular', '[rad/s]'))
LEGEND = 'Poses: at the end, seen from the start.  Velocities: the largest sent, either way.'


def plan_table(previews: Sequence[PlanView]) -> str:
    """
    Put plans as tables: for each its steps, as long as there is room, and what they add up to.

    :param previews: the plans
    :returns: lines of text, up to 99 columns wide; about 60 unless there are more motions
    """
    if len(previews) == 1:
        preview = previews[0]
        return '\n'.join([
            *_steps(preview, MAX_STEPS, with_total=True), '', *_sending(preview), LEGEND])
    most = (LINES - CAPTION - len(previews)) // max(1, len(previews)) - FRAME
    lines: list[str] = []
    if most >= MIN_STEPS:
        for preview in previews:
            lines += [*_steps(preview, most, with_total=False), '']
    return '\n'.join([*lines, *_comparison(previews), '', LEGEND])


def _steps(preview: PlanView, most: int, with_total: bool) -> list[str]:
    stages = preview.plan.steps
    kept = _kept(stages, most)
    times = Counter(stage.path for stage in stages)
    rounds: Counter[str] = Counter()
    rows = []
    shown = set(kept)
    for index, stage in enumerate(stages):
        rounds[stage.path] += 1
        if index in shown:
            rows.append(_plan_row(index, stage, rounds[stage.path], times[stage.path]))
    if with_total:
        rows.append(_total(preview.plan))
    head = (('', ''), ('step', ''), ('', ''), ('start', '[s]'), *FIGURES)
    lines = columns(head, rows, rule_above_last=with_total)
    _mark_gaps(lines, kept, stages)
    title = (f'{one_line(preview.name, NAME)} on {one_line(preview.robot, NAME)} '
             f'at {format_number(preview.rate)} Hz')
    return [title, '', *lines]


def _plan_row(index: int, stage: PlannedStep, number: int, times: int) -> Row:
    return (
        str(index + 1), stage.step.describe(), f'{number} of {times}' if times > 1 else '',
        _time(stage.start),
        *_figures(stage.end - stage.start, stage.length, stage.pose,
                  stage.max_linear_velocity, stage.max_angular_velocity))


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


def _kept(stages: Sequence[PlannedStep], most: int) -> list[int]:
    # What is shown of a long motion: of repeated steps the first time and the last.
    if len(stages) <= most:
        return list(range(len(stages)))
    first: dict[str, int] = {}
    last: dict[str, int] = {}
    for index, stage in enumerate(stages):
        first.setdefault(stage.path, index)
        last[stage.path] = index
    ends = sorted({*first.values(), *last.values()})
    gaps = sum(two - one > 1 for one, two in pairwise(ends))
    if len(ends) + gaps <= most:
        return ends
    half = (most - 1) // 2
    return [*range(half), *range(len(stages) - half, len(stages))]


def _mark_gaps(lines: list[str], kept: Sequence[int], stages: Sequence[PlannedStep]) -> None:
    # From below, so that the places above stay where they are; two lines and a rule are the head.
    for place in range(len(kept) - 1, 0, -1):
        before, after = kept[place - 1], kept[place]
        if after - before == 1:
            continue
        known = {stages[index].path for index in kept[:place]}
        again = all(stage.path in known for stage in stages[before + 1:after])
        lines.insert(3 + place, (
            f'... {pluralize(after - before - 1, "step")}, from {_time(stages[before].end)} s '
            f'to {_time(stages[after].start)} s{", as above" if again else ""} ...'))


def _sending(preview: PlanView) -> list[str]:
    count = preview.messages
    sent = (f'Sent: {pluralize(count, "velocity", "velocities")}, '
            f'{format_number(1000.0 * preview.plan.period)} ms apart or less, then the stop')
    return [sent, *_limits(preview.limits)]


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
    # Infinity is no limit, and needs no words.
    known = [f'{format_number(value)} {unit}' for value, unit in bounds if value < math.inf]
    return ', '.join(known) or 'none'


def _comparison(previews: Sequence[PlanView]) -> list[str]:
    robots = {preview.robot for preview in previews}
    rates = {preview.rate for preview in previews}
    own: list[tuple[str, str]] = []
    if len(robots) > 1:
        own.append(('robot', ''))
    if len(rates) > 1:
        own.append(('rate', '[Hz]'))
    rows = [_compared(preview, dict(own)) for preview in previews]
    head = (('motion', ''), *own, ('steps', ''), *FIGURES, ('sent', ''))
    common = [f'on {one_line(next(iter(robots)), NAME)}'] if len(robots) == 1 else []
    common += [f'at {format_number(next(iter(rates)))} Hz'] if len(rates) == 1 else []
    return [' '.join([pluralize(len(previews), 'motion'), *common]), '', *columns(head, rows)]


def _compared(preview: PlanView, own: dict[str, str]) -> Row:
    cells = [one_line(preview.name, NAME)]
    cells += [one_line(preview.robot, NAME)] if 'robot' in own else []
    cells += [format_number(preview.rate)] if 'rate' in own else []
    plan = preview.plan
    return (*cells, str(len(plan.steps)), *_plan_figures(plan), str(preview.messages))


def _time(value: float) -> str:
    return format_fixed(value, 3 if value < LONG else 1)


HEAD = ('movement', 'requested', 'sent', 'odometry')


def table(record: DriveLog, still_after: float | None) -> str:
    """
    Put a record as a table: each movement's displacement as asked, as sent and as driven.

    :param record: what happened
    :param still_after: how long after the stop began odometry saw the robot still [s]; None if
        it did not
    :returns: lines of text, the last two with the stop and the final pose
    """
    cuts = segment_odometry(record.steps, record.odometry) if record.steps else []
    rows = [HEAD, *(
        _drive_row(movement, driven(record.odometry, begin, end))
        for movement, begin, end in zip(record.steps, cuts, cuts[1:]))]
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEAD))]
    lines = ['  '.join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip()
             for row in rows]
    lines.insert(1, '  '.join('-' * width for width in widths))
    return '\n'.join([*lines, _stop(still_after), _final_pose(record)])


def _drive_row(movement: StepLog, seen: Displacement | None) -> tuple[str, ...]:
    return (
        movement.step.describe_fully(),
        _amount(movement.step.displacement),
        _amount(sent(movement.sent)),
        'none' if seen is None else _amount(seen))


def _amount(displacement: Displacement) -> str:
    # Adding 0.0 turns -0.0 into 0.0.
    return (f'{round(displacement.distance, 4) + 0.0:7.4f} m '
            f'{round(displacement.angle, 4) + 0.0:7.4f} rad')


def _stop(still_after: float | None) -> str:
    if still_after is None:
        return 'Stop: sent, not confirmed by odometry'
    return f'Stop: confirmed by odometry after {still_after:.2f} s'


def _final_pose(record: DriveLog) -> str:
    if not record.odometry:
        return 'Final pose: unknown, no odometry arrived'
    pose = record.odometry[-1].pose
    return (f'Final pose by odometry: x {pose.x + 0.0:.4f} m, y {pose.y + 0.0:.4f} m, '
            f'heading {math.degrees(pose.theta) + 0.0:.2f} degrees')
