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
"""The tables of a report's page."""

from __future__ import annotations

import math

from kachaka_simple_control.motion.kinematics import Pose
from kachaka_simple_control.report.page.parts import (
    both,
    degrees,
    head,
    NOTHING,
    number,
    numbers,
    text,
)
from kachaka_simple_control.report.preview import amount, counted
from kachaka_simple_control.report.quantiles import Quantiles
from kachaka_simple_control.report.step_errors import step_in_words, StepDriven
from kachaka_simple_control.report.summary import Miss, Summary

#: So many steps at each end of a long drive are shown.
SHOWN = 150

STEPS = (('#', ' '), ('step', ''), ('requested', '[m, °]'), ('sent', '[m, °]'),
         ('odometry', '[m, °]'), ('error', '[mm, °]'))
MOTIONS = (('#', ' '), ('motion', ''), ('began', '[s]'), ('takes', '[s]'), ('how it ended', ''))


def end_table(summary: Summary) -> str:
    """
    Show where a drive ended: as planned, as sent, as seen.

    :param summary: the drive
    :returns: the element
    """
    path, seen = summary.path, summary.end
    sent = path.reckoning.end if path.sent else None
    rows = []
    looks = 0.0
    for name, pose in (('planned', path.planned_end), ('sent', sent), ('odometry', seen)):
        # Where it looks, not how often it turned: within half a turn of the line above.
        looks += 0.0 if pose is None else math.remainder(pose.theta - looks, math.tau)
        rows.append(_pose(name, pose, looks))
    rows += [_miss('odometry from planned', summary.miss_of_plan),
             _miss('odometry from sent', summary.miss_of_sent)]
    names = (('', ''), ('x', '[m]'), ('y', '[m]'), ('heading', '[°]'))
    return ('<table><caption>Where it ended, seen from where it stood at t = 0</caption>'
            f'{head(names)}<tbody>{"".join(rows)}</tbody></table>')


def _pose(name: str, pose: Pose | None, looks: float) -> str:
    cells = [NOTHING] * 3 if pose is None else [
        number(pose.x, 4), number(pose.y, 4), degrees(looks)[:-1]]
    return f'<tr><th scope="row">{name}</th>{numbers(cells)}</tr>'


def _miss(name: str, miss: Miss | None) -> str:
    if miss is None:
        return ''
    return (f'<tr><th scope="row">{name}</th><td class="n" colspan="2">'
            f'{number(1e3 * miss.distance, 1)} mm apart</td>'
            f'<td class="n">{degrees(miss.angle)[:-1]}</td></tr>')


def steps_table(summary: Summary) -> str:
    """
    Show each step as it was asked, sent and driven; of very many the first and the last.

    :param summary: the drive
    :returns: the element
    """
    steps = summary.steps
    with_motion = len({id(step.movement.stage) for step in steps}) > 0 and len(
        {step.motion for step in steps}) > 1
    rows = [_step(number_, step, summary.path.began, with_motion)
            for number_, step in _ends(list(enumerate(steps, 1)))]
    if len(steps) > 2 * SHOWN:
        left = len(steps) - 2 * SHOWN
        rows.insert(SHOWN, (
            f'<tr class="gap"><td colspan="6">{counted(left, "step")} left out here; '
            '<code>run.json</code> has all</td></tr>'))
    return (f'<table class="steps">{head(STEPS)}<tbody>{"".join(rows)}</tbody></table>')


def _ends(rows: list[tuple[int, StepDriven]]) -> list[tuple[int, StepDriven]]:
    return rows if len(rows) <= 2 * SHOWN else rows[:SHOWN] + rows[-SHOWN:]


def _step(place: int, step: StepDriven, origin: float, with_motion: bool) -> str:
    movement = step.movement
    start = movement.began - origin
    duration = movement.stage.end - movement.stage.start
    note = f'from {number(start, 2)} s, for {number(duration, 2)} s'
    if with_motion:
        note = f'{text(step.motion)}: {note}'
    if not movement.is_whole:
        note += '; cut short'
    seen, error = step.odometry, step.error
    cells = [both(step.requested.distance, step.requested.angle),
             both(step.sent.distance, step.sent.angle),
             NOTHING if seen is None else both(seen.distance, seen.angle),
             NOTHING if error is None else both(1e3 * error.distance, error.angle, 1)]
    return (f'<tr{"" if movement.is_whole else " class=cut"}><td class="n">{place}</td>'
            f'<th scope="row">{text(step_in_words(movement.step))}<small>{note}</small></th>'
            f'{numbers(cells)}</tr>')


def motions_table(summary: Summary) -> str:
    """
    Show the motions of a program that drove several; of very many the first and the last.

    :param summary: the drive
    :returns: the element
    """
    origin = summary.path.began
    rows = []
    motions = list(enumerate(summary.record.motions, 1))
    for place, motion in motions if len(motions) <= 2 * SHOWN else (
            motions[:SHOWN] + motions[-SHOWN:]):
        began = number(motion.began - origin, 2) if motion.has_begun else NOTHING
        how = 'driven to its end' if motion.is_whole else motion.reason or 'nobody told'
        rows.append(
            f'<tr><td class="n">{place}</td><th scope="row">{text(motion.planned.motion.name)}'
            f'</th>{("".join(map(_right, (began, number(motion.plan.duration, 2)))))}'
            f'<td>{text(how)}</td></tr>')
    if len(motions) > 2 * SHOWN:
        left = counted(len(motions) - 2 * SHOWN, 'motion')
        rows.insert(SHOWN, f'<tr class="gap"><td colspan="5">{left} left out here; '
                           '<code>run.json</code> has all</td></tr>')
    return (f'<table>{head(MOTIONS)}<tbody>{"".join(rows)}</tbody></table>')


def _right(cell: str) -> str:
    return f'<td class="n">{cell}</td>'


def timing_table(summary: Summary) -> str:
    """
    Show how exactly a drive was timed.

    :param summary: the drive
    :returns: the element
    """
    timing = summary.timing
    rates = ', '.join(f'{amount(1e3 * period)} ms' for period in timing.periods)
    rows = [('period', rates), ('messages due', str(timing.due)),
            ('late', _part(timing.late, timing.due)), ('lost', _part(timing.lost, timing.due)),
            ('away from its time', _spread(timing.lateness)),
            ('interval away from the due one', _spread(timing.jitter))]
    cells = ''.join(f'<tr><th scope="row">{name}</th><td class="n">{value}</td></tr>'
                    for name, value in rows)
    return f'<table><tbody>{cells}</tbody></table>'


def _part(count: int, whole: int) -> str:
    return f'{count} ({100.0 * count / whole:.2f} %)' if whole else NOTHING


def _spread(found: Quantiles | None) -> str:
    if found is None:
        return NOTHING
    return (f'{number(1e3 * found.median, 3)} ms<small>99 %: {number(1e3 * found.p99, 3)} ms'
            f'</small><small>worst: {number(1e3 * found.worst, 3)} ms</small>')
