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
"""Text tables of planned motions and of drives.  Tested by test/report/test_plan_table.py."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from itertools import pairwise
import math
import os
import sys
import textwrap
from typing import NamedTuple

from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.analysis.flows import cut_corners, CutCorner, repetition_key
from kachaka_simple_control.analysis.obstacle_holds import obstacle_holds
from kachaka_simple_control.analysis.odometry_alignment import AlignedDrive
from kachaka_simple_control.analysis.plan_view import PlanView
from kachaka_simple_control.analysis.step_results import (
    FlowResult,
    Result,
    step_results,
    StepResult,
)
from kachaka_simple_control.files.watch_check import watch_text
from kachaka_simple_control.motion.geometry import Displacement
from kachaka_simple_control.motion.limits import Limits, SAME_AS
from kachaka_simple_control.motion.plan import Plan, PlannedStep
from kachaka_simple_control.motion.units import format_number
from kachaka_simple_control.process.output import STDOUT
from kachaka_simple_control.text import cut, format_fixed, one_line, pluralize, width_of

#: The largest width of a table [columns]; most terminals show it without wrapping.
WIDEST = 99
#: The space between two columns.
SPACE = '  '

Row = tuple[str, ...]


class Column(NamedTuple):
    """
    The heading of a column in a text table.

    :param unit: the unit of the cells; empty if they have no unit, or if each cell contains its
        unit
    :param spare: the order in which columns are left out of a table that is too wide: the column
        with 1 first, then the column with 2, and so on; a column with 0 is never left out
    """

    name: str
    unit: str = ''
    spare: int = 0


def terminal_columns() -> int | None:
    """Return the width of the terminal in characters; None if stdout is not a terminal."""
    try:
        return os.get_terminal_size(STDOUT).columns or None
    except OSError:
        return None


def columns(head: Sequence[Column], rows: Sequence[Row], widest: int = WIDEST,
            totals: int = 0) -> list[str]:
    """
    Return a table as lines of text.

    A column is left out if its heading and all its cells are empty.  Whole numbers, and all cells
    of a column with a unit, are right-aligned.  Other cells are left-aligned.

    While the table is too wide, columns whose ``spare`` is not 0 are left out one after the other,
    the smallest ``spare`` first.  If it is still too wide, the text in the widest columns is cut.

    :param widest: the largest allowed width of the table [characters]
    :param totals: the number of rows with sums or similar results at the end; a horizontal line is
        drawn above them
    :returns: the lines: the names, the units if there are any, a horizontal line, and the rows
    """
    names, units, spares = zip(*head)
    cells = [names, *([units] if any(units) else []), *rows]
    widths = {place: max(width_of(row[place]) for row in cells)
              for place in range(len(head)) if any(row[place] for row in cells)}
    for place in sorted(filter(spares.__getitem__, widths), key=spares.__getitem__):
        if _total_width(widths) > widest:
            del widths[place]
    for _ in range(_total_width(widths) - widest):
        widths[max(widths, key=lambda place: widths[place])] -= 1
    lines = [SPACE.join(
        _aligned(row[place], width, bool(units[place]) or row[place].isdecimal())
        for place, width in widths.items()).rstrip() for row in cells]
    rule = SPACE.join('-' * width for width in widths.values())
    lines.insert(len(cells) - len(rows), rule)
    if 0 < totals < len(rows):
        lines.insert(-totals, rule)
    return lines


def _total_width(widths: Mapping[int, int]) -> int:
    return sum(widths.values()) + len(SPACE) * (len(widths) - 1)


def _aligned(text: str, width: int, right: bool) -> str:
    text = cut(text, width)
    pad = ' ' * (width - width_of(text))
    return pad + text if right else text + pad


class Gap(NamedTuple):
    """
    Consecutive steps of a motion that a table does not show.

    :param before: the index of the last step that is shown before the gap
    :param after: the index of the first step that is shown after the gap
    :param again: whether each step in the gap is a repetition of a step that is shown above the
        gap
    """

    before: int
    after: int
    again: bool

    @property
    def size(self) -> str:
        """Return the number of steps in the gap as text, for example '3 steps'."""
        return pluralize(self.after - self.before - 1, 'step')

    def describe(self, start: str, end: str) -> str:
        """
        Return a text about the gap: the number of its steps, and the times of its start and end.

        The text also says whether the steps are repetitions of steps that are shown above.

        :param start: the start time of the gap [s], as text
        :param end: the end time of the gap [s], as text
        """
        again = ', as above' if self.again else ''
        return f'{self.size}, from {start} s to {end} s{again}'


def fold(keys: Sequence[Hashable], most: int) -> list[int | Gap]:
    """
    Choose which steps of a motion a table shows, so that the table is not too long.

    If there are more than ``most`` steps, only the first and the last repetition of each step are
    shown.  If the table is still too long, its middle is left out.

    :param keys: a key for each step; repetitions of the same step have equal keys
    :returns: in order, the index of each shown step, and a ``Gap`` wherever steps are left out
    """
    kept = _kept(keys, most)
    entries: list[int | Gap] = []
    known: set[Hashable] = set()
    for before, index in pairwise([-1, *kept]):
        if index - before > 1:
            entries.append(Gap(before, index, known.issuperset(keys[before + 1:index])))
        entries.append(index)
        known.add(keys[index])
    return entries


def repeat_labels(steps: Sequence[PlannedStep], with_names: bool = True) -> list[str]:
    """
    Return labels with what includes each step, and the number of its repetition.

    :param with_names: whether with the names of included motions
    :returns: a label for each step, as in ``square 1 of 4``; empty for one that is not repeated
    """
    times = Counter(step.path for step in steps)
    so_far: Counter[str] = Counter()
    labels = []
    for step in steps:
        so_far[step.path] += 1
        number, count = so_far[step.path], times[step.path]
        name = one_line(step.included, MAX_INCLUDED_WIDTH) if with_names else ''
        labels.append(f'{name} {number} of {count}'.lstrip() if count > 1 else name)
    return labels


def _kept(keys: Sequence[Hashable], most: int) -> list[int]:
    if len(keys) <= most:
        return list(range(len(keys)))
    first: dict[Hashable, int] = {}
    last: dict[Hashable, int] = {}
    for index, key in enumerate(keys):
        first.setdefault(key, index)
        last[key] = index
    ends = sorted({*first.values(), *last.values()})
    gaps = sum(two - one > 1 for one, two in pairwise(ends))
    if len(ends) + gaps <= most:
        return ends
    half = (most - 1) // 2
    return [*range(half), *range(len(keys) - half, len(keys))]


#: The approximate number of lines of all tables together.
LINES = 60
#: The largest number of rows of a table of steps; a longer table leaves out steps.
MAX_STEPS = 40
#: The smallest useful number of rows of a table of steps.
MIN_STEPS = 8
#: The number of lines besides the rows: of a table of steps, and of a table that compares motions.
FRAME, CAPTION = 6, 7
#: The largest width of a name, and of the names of included motions [columns].
MAX_NAME_WIDTH, MAX_INCLUDED_WIDTH = 36, 20
#: Times of this value or more are shown in tenths of a second [s].
TENTHS_FROM = 1000.0

#: The columns of the tables of plans.
FIGURES = (
    Column('takes', '[s]'), Column('length', '[m]', 6), Column('x', '[m]'), Column('y', '[m]'),
    Column('heading', '[deg]', 8), Column('linear', '[m/s]', 5), Column('angular', '[rad/s]', 4))
STEPS = (Column(''), Column('step'), Column('', spare=1), Column('start', '[s]', 2), *FIGURES)
#: The cells of a row without figures.
NO_FIGURES = ('',) * (len(STEPS) - 2)
MOTIONS = (Column('motion'), Column('robot'), Column('rate', '[Hz]', 9), Column('steps', spare=7),
           *FIGURES, Column('sent', spare=3))
#: The limits below a table: the title of each line, and the unit and meaning of each limit.
LIMITS = {
    'Limits:': {
        'max_linear_velocity': 'm/s', 'max_backward_velocity': 'm/s backwards',
        'max_linear_acceleration': 'm/s^2', 'max_linear_deceleration': 'm/s^2 braking',
        'max_linear_jerk': 'm/s^3'},
    '       ': {
        'max_angular_velocity': 'rad/s', 'max_angular_acceleration': 'rad/s^2',
        'max_angular_deceleration': 'rad/s^2 braking', 'max_angular_jerk': 'rad/s^3'},
}
#: How far lines are indented that continue the line above.
INDENT = ' ' * 8
#: The largest number of lines about shrunk corners, and of corner numbers in a line.
MAX_SHRUNK, MAX_NUMBERS = 4, 3
POSES = 'Poses: at the end, seen from the start.'
VELOCITIES = '  Velocities: the largest sent, either way.'


def plan_table(views: Sequence[PlanView], widest: int | None = None) -> str:
    """
    Return text tables of the plans of one or more motions.

    For one plan, there is a table of its steps and totals.  For several plans, there is a table
    that compares their totals.  If there are not too many plans, there is also a table of the
    steps of each plan.

    :param widest: the width of the terminal [characters]; None if there is no terminal
    :returns: the tables as text, up to 99 characters wide and about 60 lines long, or longer if
        there are many plans
    """
    widest = min(widest or WIDEST, WIDEST)
    if len(views) == 1:
        view = views[0]
        lines = _steps(view, MAX_STEPS, widest, with_total=True)
        return '\n'.join([
            *lines, '', *_wrapped([*_sending(view), *_watched(views), _legend(lines)], widest)])
    most = (LINES - CAPTION - len(views)) // max(1, len(views)) - FRAME
    lines = []
    if most >= MIN_STEPS:
        for view in views:
            lines += [*_steps(view, most, widest, with_total=False), '']
    lines += _comparison(views, widest)
    return '\n'.join([*lines, '', *_wrapped([*_watched(views), _legend(lines)], widest)])


def _watched(views: Sequence[PlanView]) -> list[str]:
    return [*dict.fromkeys(watch_text(view.laser) for view in views if view.laser is not None)]


def _legend(lines: Sequence[str]) -> str:
    return POSES + (VELOCITIES if any('[m/s]' in line for line in lines) else '')


def _wrapped(lines: Sequence[str], widest: int) -> list[str]:
    # Continuation lines are indented like the second line of the limits.
    return [part for line in lines
            for part in textwrap.wrap(line, widest, subsequent_indent=INDENT)]


def _steps(view: PlanView, most: int, widest: int, with_total: bool) -> list[str]:
    steps = view.plan.steps
    entries = fold([repetition_key(step) for step in steps], most)
    repeats = repeat_labels(steps, with_names=False)
    rows: list[Row] = []
    gaps: list[tuple[int, Gap]] = []
    included = ''
    for entry in entries:
        if isinstance(entry, Gap):
            gaps.append((len(rows) + len(gaps), entry))
            continue
        step = steps[entry]
        # A row with the name of the included motion, above its steps.
        within = step.path.rpartition('.include.')[0]
        if within != included and step.included:
            rows.append(('', f'{one_line(step.included, MAX_INCLUDED_WIDTH)}:', *NO_FIGURES))
        included = within
        rows.append((
            str(entry + 1), f'{"  " * bool(step.included)}{step.step.describe()}',
            repeats[entry], _time(step.start), *_figures(step)))
    if with_total:
        rows.append(('', pluralize(len(steps), 'step'), '', '', *_figures(view.plan)))
    lines = columns(STEPS, rows, widest, totals=int(with_total))
    for place, gap in gaps:
        start, end = _time(steps[gap.before].end), _time(steps[gap.after].start)
        line = f'... {gap.describe(start, end)} ...'
        # Three lines are above the rows: names, units and a horizontal line.
        lines.insert(3 + place, line if len(line) <= widest else f'... {gap.size} ...')
    title = (f'{one_line(view.name, MAX_NAME_WIDTH)} on {one_line(view.robot, MAX_NAME_WIDTH)} '
             f'at {format_number(view.rate)} Hz')
    return [one_line(title, widest), '', *lines]


def _figures(part: Plan | PlannedStep) -> Row:
    return (
        _time(part.duration), format_fixed(part.length, 3), format_fixed(part.pose.x, 3),
        format_fixed(part.pose.y, 3), format_fixed(math.degrees(part.pose.theta), 1),
        format_fixed(part.max_linear_velocity, 3), format_fixed(part.max_angular_velocity, 3))


def _sending(view: PlanView) -> list[str]:
    what = 'the robot included' if view.footprint else 'and the robot, whose outline is not known'
    return [
        *_corners(view.plan),
        (f'Sent: {pluralize(view.messages, "velocity", "velocities")}, '
         f'{format_number(1000.0 * view.plan.period)} ms apart or less, then the stop'),
        f'Floor: {view.floor_size}, {what}',
        *(f'{title} {_bounds(view.limits, units)}' for title, units in LIMITS.items())]


def _corners(plan: Plan) -> list[str]:
    """
    Return lines about the corners of a plan that are cut, and about those that are shrunk.

    :returns: the lines; empty if the robot stops at each step
    """
    corners = [*cut_corners(plan)]
    if not corners and not plan.saved_time:
        return []
    cuts = [corner.cut.deviation for corner in corners if corner.cut.deviation]
    size = _deviation(max(cuts, default=0.0))
    most = '' if not cuts else f' by {size}{"" if size.startswith("less") else " at most"}'
    what = f'Corners: {len(cuts)} of {len(corners)} cut{most};' if corners else 'Joined legs:'
    saved = f'{format_fixed(plan.saved_time, 1)} s less than with stops'
    return [f'{what} {saved}', *_shrunk(corners)]


def _shrunk(corners: Sequence[CutCorner]) -> list[str]:
    """
    Return lines about the corners that are cut by less than allowed, because a leg is short.

    Corners with the same figures share a line.
    """
    kinds: dict[tuple[str, str], list[int]] = {}
    for corner in corners:
        if corner.cut.is_shrunk:
            deviation = corner.cut.deviation
            size = _deviation(deviation) if deviation else 'a stop'
            kinds.setdefault((size, format_number(corner.leg)), []).append(corner.number)
    lines = []
    for (size, leg), numbers in [*kinds.items()][:MAX_SHRUNK]:
        if len(numbers) == 1:
            lines.append(f'corner {numbers[0]}: {size}, its leg of {leg} m is short')
            continue
        some = ', '.join(map(str, numbers[:MAX_NUMBERS]))
        more = f', ... ({len(numbers)} in all)' if len(numbers) > MAX_NUMBERS else ''
        lines.append(f'corners {some}{more}: {size}, a leg of {leg} m is short')
    if others := sum(map(len, [*kinds.values()][MAX_SHRUNK:])):
        lines.append(f'{pluralize(others, "more corner")} with a short leg')
    return [INDENT + line for line in lines]


def _deviation(length: float) -> str:
    if length < 0.01:
        # Not 0, because the robot does not stop there.
        return 'less than 0.1 mm' if length < 1e-4 else f'{format_fixed(1e3 * length, 1)} mm'
    return f'{format_fixed(100.0 * length, 1)} cm'


def _bounds(limits: Limits, units: Mapping[str, str]) -> str:
    """
    Return the limits of velocities, accelerations and jerks as text.

    An infinite limit is left out.  A deceleration is left out if it equals the acceleration.  A
    backward velocity is left out if it equals the forward velocity.
    """
    bounds = {name: limits.bound(name) for name in units}
    known = [f'{format_number(bound)} {units[name]}' for name, bound in bounds.items()
             if bound < math.inf and bound != bounds.get(SAME_AS.get(name, ''))]
    return ', '.join(known) or 'none'


def _comparison(views: Sequence[PlanView], widest: int) -> list[str]:
    rows = [(one_line(view.name, MAX_NAME_WIDTH), one_line(view.robot, MAX_NAME_WIDTH),
             format_number(view.rate), str(len(view.plan.steps)), *_figures(view.plan),
             str(view.messages)) for view in views]
    title, kept = pluralize(len(views), 'motion'), [*range(len(MOTIONS))]
    # A robot or a rate that all motions share is in the title, without a column of its own.
    if len({view.robot for view in views}) == 1:
        title += f' on {rows[0][1]}'
        kept.remove(1)
    if len({view.rate for view in views}) == 1:
        title += f' at {rows[0][2]} Hz'
        kept.remove(2)
    lines = columns([MOTIONS[place] for place in kept],
                    [tuple(row[place] for place in kept) for row in rows], widest)
    return [one_line(title, widest), '', *lines]


def _time(value: float) -> str:
    return format_fixed(value, 3 if value < TENTHS_FROM else 1)


#: The columns of the table of a drive; the cells contain the units.
DRIVE = (Column('movement'), Column('requested', spare=1), Column('sent', spare=2),
         Column('odometry'))


#: The text in place of the odometry of a step that is a part of a flow.
IN_FLOW = 'in flow'


def drive_table(
        log: DriveLog, stop_confirmed_after: float | None, widest: int | None = None) -> str:
    """
    Return a text table that shows how the robot drove each step of a drive.

    For each step, the table shows three displacements: as requested, as sent, and from odometry.
    A drive of steps without a stop has odometry only as a whole, in a row below its last step.
    Below the table, the text lists when the obstacle watch held the robot, and describes the stop
    and the final pose.

    :param stop_confirmed_after: the time from the start of the stop until odometry showed that the
        robot stands still [s]; None if odometry did not show this
    :param widest: the width of the terminal [characters]; None if there is no terminal
    """
    steps = log.steps
    results = step_results(steps, [''] * len(steps), log.odometry, log.command_timeout)
    rows = [row for result in results for row in _drive_rows(result)]
    widest = widest or sys.maxsize
    lines = columns(DRIVE, rows, widest)
    return '\n'.join([
        *lines, *_holds(log, widest),
        *_wrapped([_stop(stop_confirmed_after), _final_pose(log)], widest)])


#: The columns of the holds of a drive by its obstacle watch.
HOLDS = (Column('held by'), Column('from', '[s]', 3), Column('for', '[s]'),
         Column('plan', '[s]', 2), Column('x', '[m]'), Column('y', '[m]'),
         Column('heading', '[deg]', 1))


def _holds(log: DriveLog, widest: int) -> list[str]:
    """Return a table of when and where the obstacle watch held the robot; empty if never."""
    if not any(motion.watched for motion in log.motions):
        return []
    rows = [
        (hold.reason, _time(hold.begin), _time(hold.duration), _time(hold.plan_time),
         *((format_fixed(hold.pose.x, 3), format_fixed(hold.pose.y, 3),
            format_fixed(math.degrees(hold.pose.theta), 1)) if hold.pose else ('-', '-', '-')))
        for hold in obstacle_holds(log, AlignedDrive(log))]
    return ['', *columns(HOLDS, rows, widest), ''] if rows else []


def _drive_rows(result: StepResult) -> list[Row]:
    """Return the row of a step, and after the last step of a flow the row of the whole flow."""
    rows = [_drive_row(
        result.log.planned.named(result.log.step.describe_fully()), result, result.is_in_flow)]
    if result.flow is not None:
        rows.append(_drive_row(describe_flow(result.flow), result.flow))
    return rows


def _drive_row(what: str, result: Result, is_in_flow: bool = False) -> Row:
    seen = 'none' if result.odometry is None else _amount(result.odometry)
    return (
        what + ('' if result.is_complete else '; cut short'), _amount(result.requested),
        _amount(result.sent), IN_FLOW if is_in_flow else seen)


def describe_flow(flow: FlowResult) -> str:
    """
    Return a text about a flow, for the row below its last step.

    :param flow: the result of the flow
    """
    return f'{pluralize(flow.count, "step")} without a stop'


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
