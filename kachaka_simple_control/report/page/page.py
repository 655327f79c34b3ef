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
"""A report's page: one file that needs no other, no network and no script."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from importlib.resources import files
import math

from kachaka_simple_control.report.page import texts
from kachaka_simple_control.report.page.parts import degrees, named, number, text, words
from kachaka_simple_control.report.page.tables import (
    end_table,
    motions_table,
    steps_table,
    timing_table,
)
from kachaka_simple_control.report.pictures.drive_pictures import ERRORS, PATH, PERIODS, VELOCITIES
from kachaka_simple_control.report.pictures.drive_time_picture import end_of, is_dense, STRETCHES
from kachaka_simple_control.report.preview import amount, counted
from kachaka_simple_control.report.run_json import moment
from kachaka_simple_control.report.summary import Summary
from kachaka_simple_control.report.verdict import Ending

#: A page that may load nothing, whatever gets into it.
POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
#: Told apart by shape, for whoever sees no colours.
SIGNS = {
    Ending.DONE: '<path d="M5 13l5 5L20 6"/>',
    Ending.STOPPED: '<path d="M6 6h12v12H6z"/>',
    Ending.FAULTED: '<path d="M6 6l12 12M18 6L6 18"/>',
    Ending.KILLED: '<path d="M6 6l12 12M18 6L6 18"/>',
    Ending.NEVER_BEGAN: '<path d="M5 12h14"/>',
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
    verdict = summary.verdict
    name = verdict.ending.value.replace(' ', '-')
    style = files(__package__).joinpath('page.css').read_text(encoding='utf-8')
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
    verdict = summary.verdict
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
    figures = [_duration(summary), _miss(summary), _stop(summary), _ticks(summary)]
    return '<dl class="figures">' + ''.join(
        f'<div><dt>{name}</dt><dd>{value}<small>{more}</small></dd></div>'
        for name, value, more in figures) + '</dl>'


def _duration(summary: Summary) -> tuple[str, str, str]:
    return ('Driven for', f'{number(summary.driven_duration, 3)} s',
            f'planned: {number(summary.planned_duration, 3)} s')


def _miss(summary: Summary) -> tuple[str, str, str]:
    miss, beside = summary.miss_of_plan, 'the planned end'
    if miss is None:
        miss, beside = summary.miss_of_sent, 'where it was sent'
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
            f'of {counted(timing.due, "message")} due; {timing.lost} lost')


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
    caption = texts.PATH_SENT if summary.path.sent else texts.PATH_PLANNED
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
    velocities = texts.VELOCITIES_SENT if summary.path.sent else texts.VELOCITIES_PLANNED
    band = '' if not is_dense(summary.path) else (
        f' {texts.LOWEST} {amount(round(end_of(summary.path) / STRETCHES, 1))} s.')
    drawn = [_picture(pictures, VELOCITIES, velocities + band),
             _picture(pictures, ERRORS, texts.ERRORS_SEEN + band)]
    return f'<section><h2>Over time</h2><div class="pair">{"".join(drawn)}</div></section>\n'


def _steps(summary: Summary) -> str:
    if not summary.steps:
        return ''
    motions = summary.record.motions
    names = {motion.planned.motion.name for motion in motions}
    several = ''
    if len(motions) > 1 and (len(names) > 1 or not all(motion.is_whole for motion in motions)):
        several = (f'<details><summary>{counted(len(motions), "motion")}</summary>'
                   f'{motions_table(summary)}</details>')
    return (f'<section><h2>Step by step</h2>{steps_table(summary)}{several}</section>\n')


def _timing(summary: Summary, pictures: Mapping[str, str]) -> str:
    if not summary.timing.due:
        return ''
    return ('<section><h2>Timing</h2><div class="pair">'
            f'{_picture(pictures, PERIODS, texts.PERIODS_SENT)}'
            f'<div>{timing_table(summary)}</div></div>'
            f'<p>{texts.loop_in_words(summary.naive)}</p></section>\n')


def _settings(summary: Summary) -> str:
    opened = summary.record.opened
    if opened is None:
        return ''
    limits = {name: amount(value) for name, value in asdict(opened.limits).items()
              if value is not None and math.isfinite(value)}
    robot = {
        'robot': opened.robot, 'velocities go to': opened.velocity_topic,
        'sent as': opened.message_type,
        'odometry comes from': opened.odometry_topic or 'nowhere',
        'hold [s]': amount(opened.hold) if math.isfinite(opened.hold) else 'none', **limits}
    return (
        '<details><summary>Settings and versions</summary>'
        f'{named(robot, "The robot; limits in m, rad and s")}'
        f'{named(opened.settings, "Parameters of the node")}'
        f'{named(opened.versions, "Versions")}</details>\n')


def _words() -> str:
    return f'<details><summary>What the words mean</summary>{words(texts.MEANINGS)}</details>\n'


def _files(recording: str | None) -> str:
    beside = '<p class="note">Beside this page: <code>path.png</code>, <code>run.json</code>'
    if recording is None:
        return f'{beside} and <code>run.mcap</code>, the recording.</p>'
    return f'{beside}. The recording <code>run.mcap</code>: {text(recording)}</p>'
