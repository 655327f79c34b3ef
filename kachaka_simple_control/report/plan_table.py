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
"""The table that a person sees before a drive: what a plan will do."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
import math

from kachaka_simple_control.motion.kinematics import Pose
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import Plan, Stage
from kachaka_simple_control.report.columns import columns, one_line, Row
from kachaka_simple_control.report.preview import amount, counted, fixed, in_words, Preview

#: About how many lines a person looks at.
LINES = 60
#: The longest table of steps; a longer one is cut.
MOST_STEPS = 40
#: A shorter table of steps says nothing.
FEWEST_STEPS = 8
#: What a table of steps has beside its steps, and a comparison beside its motions.
FRAME, CAPTION = 6, 7
#: The longest name there is room for.
NAME = 36
#: From this time on [s], milliseconds make a table wider than they are worth.
LONG = 1000.0

FIGURES = (('takes', '[s]'), ('length', '[m]'), ('x', '[m]'), ('y', '[m]'), ('heading', '[deg]'),
           ('linear', '[m/s]'), ('angular', '[rad/s]'))
LEGEND = 'Poses: at the end, seen from the start.  Velocities: the largest sent, either way.'


def plan_table(previews: Sequence[Preview]) -> str:
    """
    Put plans as tables: for each its steps, as long as there is room, and what they add up to.

    :param previews: the plans
    :returns: lines of text, up to 99 columns wide; about 60 unless there are more motions
    """
    if len(previews) == 1:
        preview = previews[0]
        return '\n'.join([
            *_steps(preview, MOST_STEPS, with_total=True), '', *_sending(preview), LEGEND])
    most = (LINES - CAPTION - len(previews)) // max(1, len(previews)) - FRAME
    lines: list[str] = []
    if most >= FEWEST_STEPS:
        for preview in previews:
            lines += [*_steps(preview, most, with_total=False), '']
    return '\n'.join([*lines, *_comparison(previews), '', LEGEND])


def _steps(preview: Preview, most: int, with_total: bool) -> list[str]:
    stages = preview.plan.stages
    kept = _kept(stages, most)
    times = Counter(stage.path for stage in stages)
    rounds: Counter[str] = Counter()
    rows = []
    shown = set(kept)
    for index, stage in enumerate(stages):
        rounds[stage.path] += 1
        if index in shown:
            rows.append(_row(index, stage, rounds[stage.path], times[stage.path]))
    if with_total:
        rows.append(_total(preview.plan))
    head = (('', ''), ('step', ''), ('', ''), ('start', '[s]'), *FIGURES)
    lines = columns(head, rows, rule_above_last=with_total)
    _mark_gaps(lines, kept, stages)
    title = (f'{one_line(preview.name, NAME)} on {one_line(preview.robot, NAME)} '
             f'at {amount(preview.rate)} Hz')
    return [title, '', *lines]


def _row(index: int, stage: Stage, number: int, times: int) -> Row:
    return (
        str(index + 1), in_words(stage.step), f'{number} of {times}' if times > 1 else '',
        _time(stage.start),
        *_figures(stage.end - stage.start, stage.length, stage.pose,
                  stage.max_linear_velocity, stage.max_angular_velocity))


def _total(plan: Plan) -> Row:
    return ('', counted(len(plan.stages), 'step'), '', '', *_plan_figures(plan))


def _plan_figures(plan: Plan) -> Row:
    return _figures(plan.duration, plan.length, plan.pose, plan.max_linear_velocity,
                    plan.max_angular_velocity)


def _figures(duration: float, length: float, pose: Pose, linear: float, angular: float) -> Row:
    return (
        _time(duration), fixed(length, 3), fixed(pose.x, 3), fixed(pose.y, 3),
        fixed(math.degrees(pose.theta), 1), fixed(linear, 3), fixed(angular, 3))


def _kept(stages: Sequence[Stage], most: int) -> list[int]:
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


def _mark_gaps(lines: list[str], kept: Sequence[int], stages: Sequence[Stage]) -> None:
    # From below, so that the places above stay where they are; two lines and a rule are the head.
    for place in range(len(kept) - 1, 0, -1):
        before, after = kept[place - 1], kept[place]
        if after - before == 1:
            continue
        known = {stages[index].path for index in kept[:place]}
        again = all(stage.path in known for stage in stages[before + 1:after])
        lines.insert(3 + place, (
            f'... {counted(after - before - 1, "step")}, from {_time(stages[before].end)} s '
            f'to {_time(stages[after].start)} s{", as above" if again else ""} ...'))


def _sending(preview: Preview) -> list[str]:
    count = preview.messages
    sent = (f'Sent: {counted(count, "velocity", "velocities")}, '
            f'{amount(1000.0 * preview.plan.period)} ms apart or less, then the stop')
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
    known = [f'{amount(value)} {unit}' for value, unit in bounds if value < math.inf]
    return ', '.join(known) or 'none'


def _comparison(previews: Sequence[Preview]) -> list[str]:
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
    common += [f'at {amount(next(iter(rates)))} Hz'] if len(rates) == 1 else []
    return [' '.join([counted(len(previews), 'motion'), *common]), '', *columns(head, rows)]


def _compared(preview: Preview, own: dict[str, str]) -> Row:
    cells = [one_line(preview.name, NAME)]
    cells += [one_line(preview.robot, NAME)] if 'robot' in own else []
    cells += [amount(preview.rate)] if 'rate' in own else []
    plan = preview.plan
    return (*cells, str(len(plan.stages)), *_plan_figures(plan), str(preview.messages))


def _time(value: float) -> str:
    return fixed(value, 3 if value < LONG else 1)
