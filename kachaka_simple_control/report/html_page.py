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
"""Make the HTML page of a drive's report from the template ``templates/report.html.j2``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from importlib.resources import files
import math
import re
from typing import Any, TypeVar

from kachaka_simple_control.analysis.flows import repetition_key
from kachaka_simple_control.analysis.plan_view import LOOP_OVERHEAD
from kachaka_simple_control.analysis.step_results import StepResult
from kachaka_simple_control.analysis.summary import OutcomeKind, Summary
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.motion.units import format_number
from kachaka_simple_control.report.drive_plots import BANDS, common_limits, is_dense
from kachaka_simple_control.report.json_export import start_datetime
from kachaka_simple_control.report.output_file import NEEDS_JINJA2
from kachaka_simple_control.report.text_tables import (
    describe_flow,
    fold,
    Gap,
    IN_FLOW,
    repeat_labels,
)
from kachaka_simple_control.text import format_fixed, pluralize

T = TypeVar('T')

#: A pattern for markup and preformatted text, in which units stay unchanged.
_FIXED = re.compile('(<style>.*?</style>|<svg.*?</svg>|<pre>.*?</pre>|<[^>]*>)', re.DOTALL)
_UNIT = re.compile(r'([0-9]) (mm|ms|m|s|deg|rad|Hz|%)(?=[^a-zA-Z0-9]|$)')

#: A row of the table of steps: the number of the step, its result, and its repeat label, such as
#: '1 of 4'.  If steps are left out, the row has None, None and a text about these steps.
StepRow = tuple[int | None, StepResult | None, str]

#: The text of a cell whose value is not known.
UNKNOWN = '-'
#: A table with more steps leaves out repeated steps, like the table of a plan.
MAX_ROWS = 20
#: The number of rows at the start, and at the end, of a table of many steps or motions.  The rows
#: in the middle are left out.
SHOWN = 500
#: The symbol of each outcome as an SVG path; symbols differ in shape as well as in colour.
SIGNS = {
    OutcomeKind.DONE: 'M5 13l5 5L20 6',
    OutcomeKind.STOPPED: 'M6 6h12v12H6z',
    OutcomeKind.FAULTED: 'M6 6l12 12M18 6L6 18',
    OutcomeKind.KILLED: 'M6 6l12 12M18 6L6 18',
    OutcomeKind.NEVER_BEGAN: 'M5 12h14',
}
#: The symbol of a completed drive in which messages were lost.
LOST_SIGN = 'M12 4v10M12 18v2'


def render_page(summary: Summary, plots: Mapping[str, str], no_plots: str | None,
                recording: str | None) -> str:
    """
    Return the report of a drive as the text of an HTML page.

    :param plots: the plots as SVG elements; the key is the name of the plot
    :param no_plots: the reason why there are no plots; None if there are plots
    :param recording: the reason why the recording ``run.mcap`` is missing or incomplete; None if
        it is complete
    :raises UsageError: if Jinja2 is missing
    """
    steps, all_steps = _step_tables(summary)
    outcome, lost = summary.outcome, summary.timing.lost
    kind, sign = outcome.kind.value.replace(' ', '-'), SIGNS[outcome.kind]
    headline, began = outcome.headline, start_datetime(summary)
    if outcome.kind is OutcomeKind.DONE and lost:
        kind, sign = 'lost', LOST_SIGN
        headline = f'{headline}, with {pluralize(lost, "message")} lost'
    return render_template(
        'report.html.j2', summary=summary, log=summary.log,
        session=summary.log.session_started, file=summary.log.motion_file,
        aligned=summary.aligned, timing=summary.timing, sleep_loop=summary.sleep_loop,
        outcome=outcome, kind=kind, sign=sign, headline=headline,
        plots=plots, no_plots=no_plots, recording=recording, ended=_ended(summary),
        began=began and began.astimezone().isoformat(' ', 'seconds'), silence=_silence(summary),
        poses=list(_poses(summary)), steps=steps, all_steps=all_steps, shown=SHOWN,
        band=round(summary.aligned.time_span / BANDS, 1), is_dense=is_dense(summary.aligned),
        motions=ends_of(summary.log.motions), shows_motions=_shows_motions(summary),
        has_motions=len({step.motion for step in summary.steps}) > 1, robot=_robot(summary),
        description=_description(summary), extra=1e3 * LOOP_OVERHEAD, in_flow=IN_FLOW,
        describe_flow=describe_flow, speed=ends_of(summary.speed), holds=ends_of(summary.holds))


def render_template(name: str, **values: object) -> str:
    """
    Return an HTML page from a template of this package; a number and its unit stay together.

    :raises UsageError: if Jinja2 is missing
    """
    try:
        from jinja2 import Environment, FunctionLoader, StrictUndefined
    except ModuleNotFoundError as error:
        if error.name != 'jinja2':
            raise
        raise UsageError(NEEDS_JINJA2) from None
    environment = Environment(
        loader=FunctionLoader(lambda file: _resource(f'templates/{file}')), autoescape=True,
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        keep_trailing_newline=True)
    environment.filters.update(number=_number, degrees=_degrees, short=format_number)
    return _keep_units(environment.get_template(name).render(
        style=_resource('report.css'), pluralize=pluralize, unknown=UNKNOWN, **values))


def _keep_units(page: str) -> str:
    """
    Replace the space between each number and its unit with a no-break space.

    HTML tags, style sheets, SVG elements and preformatted text do not change.

    :returns: the changed page
    """
    return ''.join(part if index % 2 else _UNIT.sub('\\1\N{NO-BREAK SPACE}\\2', part)
                   for index, part in enumerate(_FIXED.split(page)))


def _resource(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding='utf-8')


def _number(value: float, digits: int) -> str:
    return format_fixed(value, digits) if math.isfinite(value) else UNKNOWN


def _degrees(angle: float, digits: int = 2) -> str:
    return _number(math.degrees(angle), digits)


def _ended(summary: Summary) -> tuple[str, str]:
    """
    Return two texts: the error of a drive's end pose, and the reference pose of this error.

    The error is the difference between the last pose from odometry and the reference pose.  If all
    motions were completed, the reference pose is the planned end pose.  Otherwise, it is the pose
    that is expected from the sent velocities.  Without odometry, the first text is ``unknown``,
    and the second text gives the reason.
    """
    for error, goal in ((summary.error_from_plan, 'the planned end'),
                        (summary.error_from_sent, 'where it was sent')):
        if error is not None:
            return (f'{_number(1e3 * error.distance, 1)} mm, {_degrees(error.angle)}°',
                    f'from {goal}, by odometry')
    return 'unknown', 'no odometry arrived'


def _poses(summary: Summary) -> Iterator[tuple[str, tuple[str, str, str]]]:
    """
    Yield three end poses of a drive as text: as planned, as sent, and from odometry.

    The pose "as sent" is the end pose of a robot that follows the sent velocities exactly.  An
    unknown number is shown as a hyphen.

    :returns: for each pose, its name, and a tuple of x [m], y [m] and heading [deg]
    """
    aligned = summary.aligned
    heading = 0.0
    for name, pose in (('planned', aligned.planned_end),
                       ('sent', aligned.dead_reckoning.end if aligned.sent else None),
                       ('odometry', summary.final_pose)):
        if pose is None:
            yield name, (UNKNOWN, UNKNOWN, UNKNOWN)
            continue
        # Each heading differs from that in the row above by half a turn or less.
        heading += math.remainder(pose.theta - heading, math.tau)
        yield name, (_number(pose.x, 4), _number(pose.y, 4), _degrees(heading))


def _silence(summary: Summary) -> tuple[float, float] | None:
    """
    Return the times of the last odometry and the last message, if odometry ended early.

    Odometry ended early if its last sample is more than 0.5 s before the last velocity message.

    :returns: the times of the last odometry sample and of the last message [s after the start of
        the first motion]; None if odometry did not end early, or if there is no odometry or no
        message
    """
    aligned, seen = summary.aligned, summary.last_seen
    if not aligned.sent or seen is None:
        return None
    last = aligned.sent[-1].time - aligned.start_time
    return (seen.time, last) if seen.time < last - 0.5 else None


def ends_of(rows: Sequence[T]) -> list[tuple[int, T | None]]:
    """
    Add a number to each row of a table, from 1, and leave out the middle of a long table.

    A table with more than 1000 rows keeps only its first 500 and its last 500 rows.

    :returns: for each row, a pair of its number and its content; if rows are left out, their place
        is taken by one pair of the count of these rows and None
    """
    numbered: list[tuple[int, T | None]] = list(enumerate(rows, 1))
    left_out = len(rows) - 2 * SHOWN
    if left_out <= 0:
        return numbered
    return [*numbered[:SHOWN], (left_out, None), *numbered[-SHOWN:]]


def _step_tables(summary: Summary) -> tuple[list[StepRow], list[StepRow]]:
    """
    Return the rows of a short and of a long table of the steps that the robot drove.

    If there are at most MAX_ROWS steps, the short table shows all of them, and the long table is
    empty.

    If there are more steps, the short table shows only the first and the last repetition of each
    step.  If it is then still too long, its middle is left out.  The long table shows all steps.
    If there are more than 1001 steps, it shows only the first 500 and the last 500.
    """
    results = summary.steps
    keys = [(result.motion, repetition_key(result.log.planned), result.log.step,
             result.log.is_complete, result.log.is_delayed) for result in results]
    # The labels count the repeats in the whole plan, even if the motion ended early.
    repeats = [label for motion in summary.log.motions if motion.has_begun
               for label, step in zip(
                   repeat_labels(motion.plan.steps), motion.steps)
               if step.sent]

    def row(entry: int | Gap) -> StepRow:
        if isinstance(entry, int):
            return entry + 1, results[entry], repeats[entry]
        before, after = results[entry.before].log, results[entry.after].log
        start, end = (_number(time - summary.aligned.start_time, 2) for time in (
            before.began + (before.driven_duration if before.is_delayed else
                            before.planned.duration), after.began))
        return None, None, entry.describe(start, end)

    unfolded = fold(range(len(keys)), 2 * SHOWN + 1) if len(keys) > MAX_ROWS else []
    return list(map(row, fold(keys, MAX_ROWS))), list(map(row, unfolded))


def _shows_motions(summary: Summary) -> bool:
    motions = summary.log.motions
    names = {motion.planned.motion.name for motion in motions}
    return len(motions) > 1 and (
        len(names) > 1 or not all(motion.is_complete for motion in motions))


def _description(summary: Summary) -> str:
    """
    Return the description of the driven motions, if all of them have the same description.

    If the descriptions differ, or if no motion was planned, return an empty text.
    """
    descriptions = {motion.planned.motion.description for motion in summary.log.motions}
    return descriptions.pop() if len(descriptions) == 1 else ''


def _robot(summary: Summary) -> dict[str, Any]:
    session = summary.log.session_started
    if session is None:
        return {}
    timeout = session.command_timeout
    limits = {name: format_number(value) for name, value in asdict(session.limits).items()
              if value is not None and math.isfinite(value)}
    if summary.log.motions:
        used = asdict(common_limits(summary.log))
        limits = {name: text if used[name] == getattr(session.limits, name) else
                  f'{text}; planned with {format_number(used[name])}'
                  for name, text in limits.items()}
    return {
        'robot': session.robot, 'velocities go to': session.velocity_topic,
        'sent as': session.message_type,
        'odometry comes from': session.odometry_topic or 'nowhere',
        'command timeout [s]': format_number(timeout) if math.isfinite(timeout) else 'none',
        **limits}
