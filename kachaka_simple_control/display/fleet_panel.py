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
Draw the status of a fleet as lines for a terminal, one a robot, with the Python library rich.

Tested by test/display/test_fleet_status.py.
"""

from __future__ import annotations

import os

from kachaka_simple_control.control.events import DriveState
from kachaka_simple_control.control.hold_text import is_of_watch
from kachaka_simple_control.control.speed_factor import describe_factors, is_hold, PAUSE
from kachaka_simple_control.display.drive_status import DriveStatus
from kachaka_simple_control.display.fleet_status import describe_states, FleetStatus, RobotRow
from kachaka_simple_control.display.panel import BLUE, GREY, MAX_COLUMNS, ORANGE, STATE_STYLES
from kachaka_simple_control.text import cut, format_fixed, one_line, width_of
from rich.console import COLOR_SYSTEMS, Console
from rich.style import Style

#: How many rows of the terminal stay for log lines.
LOG_ROWS = 6
#: The largest width of the name of a robot, and of a fleet [columns].
MAX_NAME_WIDTH, MAX_TITLE_WIDTH = 16, 28
#: The width of the longest state with a space on each side, and of a bar [columns].
STATE_WIDTH, MAX_BAR_WIDTH = 12, 40
#: A text with its style, as rich writes it; empty for none.
Part = tuple[str, str]


def render_fleet(
        console: Console, size: os.terminal_size, status: FleetStatus, hint: str) -> list[str]:
    """
    Return the lines of the panel, each narrower than the terminal.

    Their number depends on the size of the terminal and the number of robots alone.

    :param console: of rich; it knows the available colours and characters
    """
    # One column stays free, because a terminal may wrap a line of full width.
    width = min(size.columns - 1, MAX_COLUMNS)
    is_plain = not console.encoding.startswith('utf')
    done, rest = '#-' if is_plain else '\u2501\u2500'
    room = max(2, size.lines - LOG_ROWS) - 1
    shown = status.rows if len(status.rows) <= room else status.rows[:room - 1]
    hidden = status.rows[len(shown):]
    name_width = min(max((width_of(row.name) for row in status.rows), default=0), MAX_NAME_WIDTH)
    lines = [_head(status, hint, rest, width)]
    lines += [_row(row, name_width, done, rest, width) for row in shown]
    if hidden:
        lines.append([(f'and {len(hidden)} more: {describe_states(hidden)}', GREY)])
    return [_render(console, parts, width) for parts in lines]


def _head(status: FleetStatus, hint: str, line: str, width: int) -> list[Part]:
    # The rows show pauses and holds.
    slower = describe_factors({
        name: factor for name, factor in status.factors.items()
        if name != PAUSE and not (is_of_watch(name) and is_hold(factor))})
    texts = [f'{format_fixed(status.elapsed, 1)} s of {format_fixed(status.duration, 1)} s']
    if status.rounds > 1:
        texts.append(f'round {max(1, status.round_number)} of {status.rounds}')
    texts += [slower] if slower else []
    title = one_line(status.title, MAX_TITLE_WIDTH)
    while True:
        figures = '  ' + '  '.join(texts)
        rule = width - width_of(title) - width_of(figures) - width_of(hint) - 2
        if rule >= 1 or len(texts) == 1:
            break
        texts.pop()
    if rule < 1:  # the hint is needed more than the name
        title, rule = cut(title, max(4, width_of(title) + rule - 1)), 1
    return [(title, 'bold'), (figures, ''), (f' {line * rule} ', GREY), (hint, 'bold')]


def _row(row: RobotRow, name_width: int, done: str, rest: str, width: int) -> list[Part]:
    status = row.status
    name = one_line(row.name, name_width)
    parts: list[Part] = [
        (f'{name}{" " * (name_width - width_of(name))} ', 'bold'),
        (f' {status.word.upper():{STATE_WIDTH - 2}} ',
         STATE_STYLES.get(status.state, 'reverse')),
        (f' {100.0 * _fraction(status):3.0f} %  ', '')]
    if not row.trouble:
        parts.append((f'{_speed(status):12}{_lateness(status):10}', ''))
    left = width - sum(width_of(text) for text, _ in parts)
    if row.trouble:
        return [*parts, (one_line(row.trouble, max(3, left)), f'bold {ORANGE}')]
    bar = max(0, min(left, MAX_BAR_WIDTH))
    full = min(bar, max(0, round(_fraction(status) * bar)))
    return [*parts, (done * full, f'bold {BLUE}'), (rest * (bar - full), GREY)]


def _fraction(status: DriveStatus) -> float:
    return status.fraction if status.duration else 0.0


def _speed(status: DriveStatus) -> str:
    velocity = status.commanded
    if velocity is None or status.state not in (DriveState.DRIVING, DriveState.PAUSED):
        return ''
    if velocity.linear_x == 0.0 != velocity.angular_z:
        return f'{format_fixed(velocity.angular_z, 2):>5} rad/s'
    return f'{format_fixed(velocity.linear_x, 2):>5} m/s'


def _lateness(status: DriveStatus) -> str:
    if status.state is not DriveState.DRIVING:
        return ''
    return f'{format_fixed(1e3 * status.lateness, 1):>5} ms'


def _render(console: Console, parts: list[Part], width: int) -> str:
    # Without Text and console.print of rich, which take 20 times as long: fleets are large.
    system = COLOR_SYSTEMS.get(console.color_system or '')
    text, room = '', width
    for whole, style in parts:
        shown = cut(whole, room) if room >= 3 else whole[:room]
        room = max(0, room - width_of(shown))
        text += Style.parse(style).render(shown, color_system=system) if style else shown
    return text.rstrip()
