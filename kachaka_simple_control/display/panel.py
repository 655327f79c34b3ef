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
Draw the status of a drive as a panel of a few terminal lines, with the Python library rich.

Tested by test/display/test_drive_status.py.
"""

from __future__ import annotations

import math
import textwrap

from kachaka_simple_control.control.events import DriveState
from kachaka_simple_control.control.hold_text import describe_watch, is_of_watch
from kachaka_simple_control.control.speed_factor import describe_factors, OBSTACLE, PAUSE
from kachaka_simple_control.display.drive_status import DISPLAY_ODOMETRY_MAX_AGE, DriveStatus
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.text import format_fixed, one_line
from rich.console import Console
from rich.text import Text

#: The number of lines of a panel.
HEIGHT = 6
#: The largest width of a panel [columns].
MAX_COLUMNS = 120
MAX_NAME_WIDTH = 28
LABEL_WIDTH = 11
#: Colours as RGB values, because many terminals show the named colour "black" in bold as grey.
WHITE, BLACK = '#ffffff', '#000000'
#: The same colours as in the plots of the report.
BLUE, GREY, ORANGE = '#0072B2', '#666666', '#D55E00'
#: The style of each state; colour-blind people can distinguish the colours.
STATE_STYLES = {
    DriveState.DRIVING: f'bold {WHITE} on {BLUE}',
    DriveState.PAUSED: f'bold {BLACK} on {ORANGE}',
    DriveState.STOPPING: f'bold {BLACK} on {ORANGE}',
    DriveState.CUT_SHORT: f'bold {BLACK} on {ORANGE}',
}
_TEXTS = {
    DriveState.READY: 'the motion has not been started',
    DriveState.WAITING: 'for the robot to be ready',
    DriveState.CONNECTING: 'the robot is there; zeros first',
    DriveState.STOPPING: 'zeros are sent until the robot stands still',
    DriveState.STOPPED: 'the stop was sent',
}


def render_panel(console: Console, columns: int, status: DriveStatus, hint: str) -> list[str]:
    """
    Return the ``HEIGHT`` lines of the panel, each narrower than the terminal.

    :param console: of rich; it knows the available colours and characters
    :param columns: the width of the terminal [columns]
    """
    # One column stays free, because a terminal may wrap a line of full width.
    width = min(columns - 1, MAX_COLUMNS)
    console.width = columns
    done, rest = '\u2501\u2500' if console.encoding.startswith('utf') else '#-'
    rows = [
        _head(status, hint, rest, width), *_state(status, width),
        _bar(status, done, rest, width), _velocity('commanded', status.commanded),
        _velocity('odometry', status.odometry, f'{format_fixed(status.odometry_age, 1)} s ago')]
    return [_render(console, row, width) for row in rows]


def _render(console: Console, row: Text, width: int) -> str:
    row.truncate(width, overflow='ellipsis')
    with console.capture() as capture:
        console.print(row, no_wrap=True, overflow='ellipsis', width=width, end='')
    return capture.get().rstrip('\n')


def _head(status: DriveStatus, hint: str, line: str, width: int) -> Text:
    names = [one_line(name, MAX_NAME_WIDTH) for name in (status.title, status.robot) if name]
    room = max(1, width - len(hint) - 3)
    text = Text(' on '.join(names), style='bold')
    if text.cell_len > room:
        text = Text(names[0], style='bold')
    text.truncate(room, overflow='ellipsis')
    rule = line * max(1, width - text.cell_len - len(hint) - 2)
    return Text.assemble(text, (f' {rule} ', GREY), (hint, 'bold'))


def _state(status: DriveStatus, width: int) -> list[Text]:
    word = f' {status.word.upper()} '
    text = _state_text(status)
    style = STATE_STYLES.get(status.state, 'bold reverse')
    if status.state is not DriveState.CUT_SHORT:
        second = _step(status) if status.state is not DriveState.WAITING else _row(
            'topic', one_line(status.topic, MAX_COLUMNS) or 'not known yet')
        return [Text.assemble((word, style), f'  {text}'), second]
    # The reason may be long, so it also uses the second row, where no step is shown now.
    parts = textwrap.wrap(text, width - len(word) - 2) or ['']
    return [Text.assemble((word, style), f'  {parts[0]}'),
            Text(' ' * (len(word) + 2) + ' '.join(parts[1:]))]


def _state_text(status: DriveStatus) -> str:
    if status.silent_for is not None:
        return f'no message for {status.silent_for:.0f} s: the program is held up'
    if status.state in (DriveState.DRIVING, DriveState.PAUSED) and status.step is not None:
        return (status.held_by or f'{status.step.label}: {status.step.description}') + (
            _slower(status))
    if status.state is DriveState.WAITING and status.wait_left is not None:
        return f'{_TEXTS[status.state]}, {math.ceil(status.wait_left)} s left'
    if status.state is DriveState.CUT_SHORT:
        return one_line(status.reason or '', 2 * MAX_COLUMNS)
    if (status.state is DriveState.STOPPED and status.odometry is not None
            and status.odometry_age < DISPLAY_ODOMETRY_MAX_AGE):
        return 'odometry shows standstill'
    return _TEXTS.get(status.state, '')


def _slower(status: DriveStatus) -> str:
    """Return who makes the robot slower, but for a hold: the word of the state shows that."""
    is_blind = status.state is DriveState.DRIVING and OBSTACLE in status.factors
    blind = describe_watch(status.watch, status.factors) if is_blind else ''
    others = describe_factors({
        name: factor for name, factor in status.factors.items()
        if name != PAUSE and not ((blind or status.held_by) and is_of_watch(name))})
    slower = ', '.join(filter(None, (blind, others)))
    return f' ({slower})' if slower else ''


def _bar(status: DriveStatus, done_sign: str, rest_sign: str, width: int) -> Text:
    if status.duration is None:
        return Text()
    left = f'{format_fixed(status.stretched(status.time_left), 1)} s left'
    planned = f'{format_fixed(status.duration, 1)} s'
    if status.state is DriveState.CUT_SHORT:  # nothing is left to drive
        time = f'planned: {planned}'
    else:
        time = f'{left}, planned: {planned}' if status.factors else f'{left} of {planned}'
    figures = f'  {100.0 * status.fraction:3.0f} %   {time}'
    room = max(1, width - len(figures))
    done = min(room, max(0, round(status.fraction * room)))
    # The two parts of the bar use different characters, because there may be no colours.
    return Text.assemble(
        (done_sign * done, f'bold {BLUE}'), (rest_sign * (room - done), GREY), figures)


def _step(status: DriveStatus) -> Text:
    if status.step is None:
        return _row('this step', 'none')
    remaining = status.step.remaining
    figures = [f'{format_fixed(status.stretched(status.step.time_left), 1)} s']
    if remaining.distance is not None:
        figures.append(f'{format_fixed(remaining.distance, 3)} m')
    if remaining.angle is not None:
        figures.append(f'{format_fixed(math.degrees(remaining.angle), 1)} deg')
    source = ' by odometry' if remaining.by_odometry else ' by commands'
    return _row('this step', f'{", ".join(figures)} left{source if len(figures) > 1 else ""}')


def _velocity(label: str, velocity: Velocity | None, *more: str) -> Text:
    if velocity is None:
        return _row(label, 'nothing yet')
    return _row(label, f'{format_fixed(velocity.linear_x, 3):>6} m/s',
                f'{format_fixed(velocity.angular_z, 3):>6} rad/s', *more)


def _row(label: str, *cells: str) -> Text:
    return Text(f'{label:{LABEL_WIDTH}} {"   ".join(cells)}')
