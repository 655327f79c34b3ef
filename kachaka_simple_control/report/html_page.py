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
"""The report as one HTML page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from html import escape
from importlib.resources import files
import math

from kachaka_simple_control.motion.geometry import Pose
from kachaka_simple_control.motion.units import format_number
from kachaka_simple_control.report.drive_plots import (
    end_of,
    ERRORS,
    is_dense,
    PATH,
    PERIODS,
    STRETCHES,
    VELOCITIES,
)
from kachaka_simple_control.report.json_export import moment
from kachaka_simple_control.report.metrics import (
    EXTRA,
    Quantiles,
    SleepLoopEstimate,
    StepResult,
)
from kachaka_simple_control.report.plan_view import format_fixed, pluralize
from kachaka_simple_control.report.summary import OutcomeKind, PoseError, Summary

# What stands below the pictures, and is read aloud for them.
PATH_SENT = (
    'The path to scale: as planned, as sent (for a robot that does exactly as it is told), and as '
    'odometry saw it; with the robot where it stood at t = 0, and in the end.')
PATH_PLANNED = 'The path to scale as it was planned, with the robot at its start and at its end.'
VELOCITIES_SENT = (
    'Velocities as planned, as sent and as odometry told them. Limits are dashed; at the faint '
    'lines steps end.')
VELOCITIES_PLANNED = (
    'Velocities as they were planned. Limits are dashed; at the faint lines steps end.')
ERRORS_SEEN = (
    'How far odometry saw the robot from where the messages should have brought it by then: '
    'distance, and heading (positive to the left).')
PERIODS_SENT = (
    'By how much the intervals between two messages were longer than due; how often is on a '
    'logarithmic scale.')
LOWEST = 'So long a drive is shown by the lowest and the highest value in each'
#: What the words mean.
MEANINGS = {
    'planned': (
        'What the motion comes to under the limits, for a robot that does as it is told. Each '
        'motion begins where the one before was to end; after one that was cut short, where the '
        'messages had brought the robot.'),
    'sent': (
        'What the messages come to, at the times at which they were published, for a robot that '
        'keeps each velocity until the next, but not longer than its hold.'),
    'odometry': (
        'What the robot told. Its frame is laid so that its last pose before t = 0, or its first '
        'one after that, is where the messages had brought the robot by then. It arrives a little '
        'late, and so lags behind what was sent while the robot moves.'),
    't = 0': 'When the first velocity of the first motion was published, on the steady clock.',
    'error of a step': (
        'Odometry less requested; of a step that was cut short, odometry less sent. Where two '
        'steps meet without a rest between them, what belongs to which is blurred by the delay of '
        'odometry.'),
    'due, late, lost': (
        'A message is due when the velocity changes, and each period in between. It is late if it '
        'came a quarter of a period or more from its time, and lost if none came within half a '
        'period. The benchmarks count alike.'),
    'stop': 'How long after the stop began odometry saw the robot still.',
}


def loop_in_words(naive: SleepLoopEstimate) -> str:
    """
    Say what the lesson's loop would have lost, and how that was worked out.

    :param naive: what it would have made of the same plans
    :returns: the inside of a paragraph
    """
    fewer = 'as many messages' if not naive.missing else (
        f'{pluralize(abs(naive.missing), "message")} {"fewer" if naive.missing > 0 else "more"}')
    return (
        '<strong>What the loop of the lesson would have lost.</strong> For what was planned it '
        f'would have taken {number(naive.longer, 3)} s longer, sent {fewer}, and brought a robot '
        f'that does exactly as it is told {number(1e3 * naive.distance, 1)} mm and '
        f'{degrees(naive.angle)} from the planned end. <span class="note">This is worked out, not '
        'measured here: the loop publishes what is due, waits for as long as that is to be held, '
        'a period at most, and begins again until the time of the step is up; each turn takes '
        f'{format_number(1e3 * EXTRA)} ms longer than it should, as the benchmarks measured it '
        'at 10 Hz '
        '(docs/why.md). What it loses before a robot listens is not counted.</span>')


#: What stands where nothing is known.
NOTHING = '-'


def text(value: object) -> str:
    """
    Return something from outside so that a page shows it as it is.

    :param value: anything
    :returns: its text, escaped
    """
    return escape(str(value))


def head(cells: Iterable[tuple[str, str]]) -> str:
    """
    Return the head of a table.

    :param cells: the name of each column, and its unit if its cells are numbers
    :returns: the element
    """
    return '<thead><tr>' + ''.join(
        f'<th scope="col" class="n">{text(name)}<small>{text(unit)}</small></th>' if unit else
        f'<th scope="col">{text(name)}</th>' for name, unit in cells) + '</tr></thead>'


def numbers(cells: Iterable[str]) -> str:
    """
    Return cells with numbers.

    :param cells: what stands in them, already escaped
    :returns: the elements
    """
    return ''.join(f'<td class="n">{cell}</td>' for cell in cells)


def named(values: Mapping[str, object], caption: str) -> str:
    """
    Return a table of names and values from outside.

    :param values: the values by name
    :param caption: what it shows
    :returns: the element
    """
    rows = ''.join(f'<tr><th scope="row">{text(name)}</th><td>{text(value)}</td></tr>'
                   for name, value in values.items())
    return f'<table class="plain"><caption>{text(caption)}</caption><tbody>{rows}</tbody></table>'


def words(meanings: Mapping[str, str]) -> str:
    """
    Return a list of what words mean.

    :param meanings: what they mean, by word
    :returns: the element
    """
    return '<dl class="words">' + ''.join(
        f'<div><dt>{text(word)}</dt><dd>{text(meaning)}</dd></div>'
        for word, meaning in meanings.items()) + '</dl>'


def both(distance: float, angle: float, digits: int = 4) -> str:
    """
    Return a distance above an angle.

    :param distance: in metres or parts of them
    :param angle: [rad]
    :param digits: behind the point of the distance
    :returns: the inside of a cell
    """
    return f'{number(distance, digits)}<small>{degrees(angle)}</small>'


def degrees(angle: float, digits: int = 2) -> str:
    """
    Return an angle for people.

    :param angle: [rad]
    :param digits: how many stand behind the point
    :returns: its text in degrees
    """
    return f'{number(math.degrees(angle), digits)}°'


def number(value: float, digits: int) -> str:
    """
    Return a number.

    :param value: the number
    :param digits: how many stand behind the point
    :returns: its text, or a dash if it is none
    """
    return format_fixed(value, digits) if math.isfinite(value) else NOTHING


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
    rows += [_miss_text('odometry from planned', summary.error_from_plan),
             _miss_text('odometry from sent', summary.error_from_sent)]
    names = (('', ''), ('x', '[m]'), ('y', '[m]'), ('heading', '[°]'))
    return ('<table><caption>Where it ended, seen from where it stood at t = 0</caption>'
            f'{head(names)}<tbody>{"".join(rows)}</tbody></table>')


def _pose(name: str, pose: Pose | None, looks: float) -> str:
    cells = [NOTHING] * 3 if pose is None else [
        number(pose.x, 4), number(pose.y, 4), degrees(looks)[:-1]]
    return f'<tr><th scope="row">{name}</th>{numbers(cells)}</tr>'


def _miss_text(name: str, miss: PoseError | None) -> str:
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
            f'<tr class="gap"><td colspan="6">{pluralize(left, "step")} left out here; '
            '<code>run.json</code> has all</td></tr>'))
    return (f'<table class="steps">{head(STEPS)}<tbody>{"".join(rows)}</tbody></table>')


def _ends(rows: list[tuple[int, StepResult]]) -> list[tuple[int, StepResult]]:
    return rows if len(rows) <= 2 * SHOWN else rows[:SHOWN] + rows[-SHOWN:]


def _step(place: int, step: StepResult, origin: float, with_motion: bool) -> str:
    movement = step.movement
    start = movement.began - origin
    duration = movement.stage.end - movement.stage.start
    note = f'from {number(start, 2)} s, for {number(duration, 2)} s'
    if with_motion:
        note = f'{text(step.motion)}: {note}'
    if not movement.is_complete:
        note += '; cut short'
    seen, error = step.odometry, step.error
    cells = [both(step.requested.distance, step.requested.angle),
             both(step.sent.distance, step.sent.angle),
             NOTHING if seen is None else both(seen.distance, seen.angle),
             NOTHING if error is None else both(1e3 * error.distance, error.angle, 1)]
    return (f'<tr{"" if movement.is_complete else " class=cut"}><td class="n">{place}</td>'
            f'<th scope="row">{text(movement.step.describe_fully())}<small>{note}</small></th>'
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
        how = 'driven to its end' if motion.is_complete else motion.reason or 'nobody told'
        rows.append(
            f'<tr><td class="n">{place}</td><th scope="row">{text(motion.planned.motion.name)}'
            f'</th>{("".join(map(_right, (began, number(motion.plan.duration, 2)))))}'
            f'<td>{text(how)}</td></tr>')
    if len(motions) > 2 * SHOWN:
        left = pluralize(len(motions) - 2 * SHOWN, 'motion')
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
    rates = ', '.join(f'{format_number(1e3 * period)} ms' for period in timing.periods)
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


#: A page that may load nothing, whatever gets into it.
POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
#: Told apart by shape, for whoever sees no colours.
SIGNS = {
    OutcomeKind.DONE: '<path d="M5 13l5 5L20 6"/>',
    OutcomeKind.STOPPED: '<path d="M6 6h12v12H6z"/>',
    OutcomeKind.FAULTED: '<path d="M6 6l12 12M18 6L6 18"/>',
    OutcomeKind.KILLED: '<path d="M6 6l12 12M18 6L6 18"/>',
    OutcomeKind.NEVER_BEGAN: '<path d="M5 12h14"/>',
}


def page(summary: Summary, pictures: Mapping[str, str], no_pictures: str | None,
         recording: str | None) -> str:
    """
    Put a report as a page.

    :param summary: the drive
    :param pictures: SVG elements by name
    :param no_pictures: why there are none; None if there are
    :param recording: why ``run.mcap`` is missing or not whole; None if it is whole
    :returns: the text of the file
    """
    verdict = summary.outcome
    name = verdict.ending.value.replace(' ', '-')
    style = files(__package__).joinpath('report.css').read_text(encoding='utf-8')
    parts = [_verdict(summary, name), _path(summary, pictures, no_pictures),
             _over_time(summary, pictures), _steps(summary), _timing(summary, pictures),
             _settings(summary), _words()]
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<title>{text(verdict.headline)}: {text(_what(summary))}</title>\n'
        f'<link rel="icon" href="data:,">\n<style>\n{style}</style>\n</head>\n<body>\n<main>\n'
        f'{"".join(parts)}</main>\n<footer>{_files(recording)}</footer>\n</body>\n</html>\n')


def _what(summary: Summary) -> str:
    opened = summary.record.opened
    return 'a drive' if opened is None else f'{opened.title} on {opened.robot}'


def _verdict(summary: Summary, name: str) -> str:
    verdict = summary.outcome
    began = moment(summary)
    when = '' if began is None else f', {began.astimezone().isoformat(" ", "seconds")}'
    sign = ('<svg viewBox="0 0 24 24" aria-hidden="true" fill="none" stroke="var(--mark)" '
            f'stroke-width="4">{SIGNS[verdict.ending]}</svg>')
    return (
        f'<section class="verdict {name}" aria-label="verdict">'
        f'<h1>{sign}<span>{text(verdict.headline)}</span></h1>'
        f'<p class="what">{text(_what(summary))}{when}</p>'
        f'<p class="why">{text(verdict.why)}</p>{_figures(summary)}</section>\n')


def _figures(summary: Summary) -> str:
    if not summary.path.sent:
        return ''
    figures = [_duration(summary), _miss_figure(summary), _stop(summary), _ticks(summary)]
    return '<dl class="figures">' + ''.join(
        f'<div><dt>{name}</dt><dd>{value}<small>{more}</small></dd></div>'
        for name, value, more in figures) + '</dl>'


def _duration(summary: Summary) -> tuple[str, str, str]:
    return ('Driven for', f'{number(summary.driven_duration, 3)} s',
            f'planned: {number(summary.planned_duration, 3)} s')


def _miss_figure(summary: Summary) -> tuple[str, str, str]:
    miss, beside = summary.error_from_plan, 'the planned end'
    if miss is None:
        miss, beside = summary.error_from_sent, 'where it was sent'
    if miss is None:
        return ('Ended', 'unknown', 'no odometry arrived')
    return ('Ended', f'{number(1e3 * miss.distance, 1)} mm, {degrees(miss.angle)}',
            f'from {beside}, by odometry')


def _stop(summary: Summary) -> tuple[str, str, str]:
    closed = summary.record.closed
    if closed is None:
        return ('Stop', 'unknown', 'nobody told')
    if closed.still_after is None:
        return ('Stop', 'sent', 'not confirmed by odometry')
    return ('Stop', f'{number(closed.still_after, 2)} s', 'until odometry saw it still')


def _ticks(summary: Summary) -> tuple[str, str, str]:
    timing = summary.timing
    return ('Late or lost', str(timing.late + timing.lost),
            f'of {pluralize(timing.due, "message")} due; {timing.lost} lost')


def _picture(pictures: Mapping[str, str], name: str, caption: str) -> str:
    if name not in pictures:
        return ''
    svg = pictures[name].replace('<svg', f'<svg role="img" aria-label="{text(caption)}"', 1)
    return f'<figure id="{name}">{svg}<figcaption>{text(caption)}</figcaption></figure>'


def _path(summary: Summary, pictures: Mapping[str, str], no_pictures: str | None) -> str:
    if not summary.record.motions:
        return ''
    missing = '' if no_pictures is None else f'<p class="note">{text(no_pictures)}</p>'
    head = 'Where it went' if summary.path.sent else 'Where it was to go'
    caption = PATH_SENT if summary.path.sent else PATH_PLANNED
    return (f'<section><h2>{head}</h2>'
            f'<div class="pair">{_picture(pictures, PATH, caption)}<div>{missing}'
            f'{end_table(summary)}{_silence(summary)}</div></div></section>\n')


def _silence(summary: Summary) -> str:
    path, seen = summary.path, summary.last_seen
    if not path.sent:
        return '<p class="note">Nothing was sent; this is the plan.</p>'
    if seen is None:
        return '<p class="note">No odometry arrived.</p>'
    last = path.sent[-1].time - path.began
    if seen.time < last - 0.5:
        return (f'<p class="note">Odometry fell silent at {number(seen.time, 2)} s; the last '
                f'message was sent at {number(last, 2)} s.</p>')
    return ''


def _over_time(summary: Summary, pictures: Mapping[str, str]) -> str:
    if VELOCITIES not in pictures:
        return ''
    velocities = VELOCITIES_SENT if summary.path.sent else VELOCITIES_PLANNED
    band = '' if not is_dense(summary.path) else (
        f' {LOWEST} {format_number(round(end_of(summary.path) / STRETCHES, 1))} s.')
    drawn = [_picture(pictures, VELOCITIES, velocities + band),
             _picture(pictures, ERRORS, ERRORS_SEEN + band)]
    return f'<section><h2>Over time</h2><div class="pair">{"".join(drawn)}</div></section>\n'


def _steps(summary: Summary) -> str:
    if not summary.steps:
        return ''
    motions = summary.record.motions
    names = {motion.planned.motion.name for motion in motions}
    several = ''
    if len(motions) > 1 and (len(names) > 1 or not all(motion.is_complete for motion in motions)):
        several = (f'<details><summary>{pluralize(len(motions), "motion")}</summary>'
                   f'{motions_table(summary)}</details>')
    return (f'<section><h2>Step by step</h2>{steps_table(summary)}{several}</section>\n')


def _timing(summary: Summary, pictures: Mapping[str, str]) -> str:
    if not summary.timing.due:
        return ''
    return ('<section><h2>Timing</h2><div class="pair">'
            f'{_picture(pictures, PERIODS, PERIODS_SENT)}'
            f'<div>{timing_table(summary)}</div></div>'
            f'<p>{loop_in_words(summary.naive)}</p></section>\n')


def _settings(summary: Summary) -> str:
    opened = summary.record.opened
    if opened is None:
        return ''
    limits = {name: format_number(value) for name, value in asdict(opened.limits).items()
              if value is not None and math.isfinite(value)}
    robot = {
        'robot': opened.robot, 'velocities go to': opened.velocity_topic,
        'sent as': opened.message_type,
        'odometry comes from': opened.odometry_topic or 'nowhere',
        'hold [s]': (format_number(opened.command_timeout)
                     if math.isfinite(opened.command_timeout) else 'none'), **limits}
    return (
        '<details><summary>Settings and versions</summary>'
        f'{named(robot, "The robot; limits in m, rad and s")}'
        f'{named(opened.settings, "Parameters of the node")}'
        f'{named(opened.versions, "Versions")}</details>\n')


def _words() -> str:
    return f'<details><summary>What the words mean</summary>{words(MEANINGS)}</details>\n'


def _files(recording: str | None) -> str:
    beside = '<p class="note">Beside this page: <code>path.png</code>, <code>run.json</code>'
    if recording is None:
        return f'{beside} and <code>run.mcap</code>, the recording.</p>'
    return f'{beside}. The recording <code>run.mcap</code>: {text(recording)}</p>'
