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
"""A drive as a panel of a few lines for a terminal; needs rich."""

from __future__ import annotations

from collections.abc import Iterable
import math
import textwrap

from kachaka_simple_control.display.drive_status import DriveState, DriveStatus
from kachaka_simple_control.display.renderers import which
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.report.plan_view import format_fixed
from kachaka_simple_control.report.plot_style import BLUE, GREY, ORANGE
from kachaka_simple_control.report.text_tables import one_line
from rich.console import Console
from rich.text import Text

HEIGHT = 6
#: In a terminal with less room, a panel helps nobody.
MIN_COLUMNS, MIN_ROWS = 60, 12
#: A bar any wider tells nothing more.
MAX_COLUMNS = 120
NAME = 28
#: Odometry older than this [s] says nothing of now.
ODOMETRY_MAX_AGE = 0.5
LABEL = 11
#: By number, for many terminals show a bold "black" as grey.
WHITE, BLACK = '#ffffff', '#000000'
#: Each state has a word; its colours can be told apart by the colour-blind as well.
_STYLES = {
    DriveState.DRIVING: f'bold {WHITE} on {BLUE}',
    DriveState.STOPPING: f'bold {BLACK} on {ORANGE}',
    DriveState.CUT_SHORT: f'bold {BLACK} on {ORANGE}',
}
_OTHER_STYLE = 'bold reverse'
_WORDS = {
    DriveState.READY: 'nothing to drive yet',
    DriveState.WAITING: 'for the robot to listen',
    DriveState.CONNECTING: 'the robot is there; zeros first',
    DriveState.STOPPING: 'zeros are sent until the robot stands still',
    DriveState.STOPPED: 'the stop was sent',
}


def render_panel(console: Console, columns: int, glance: DriveStatus, hint: str) -> list[str]:
    """
    Draw what there is to see.

    :param console: knows which colours and characters there are
    :param columns: how wide the terminal is
    :param glance: what there is to see
    :param hint: how to stop
    :returns: as many lines as the panel is high, none wider than the terminal
    """
    # One column is left free: a terminal may break a line that fills it.
    width = min(columns - 1, MAX_COLUMNS)
    console.width = columns
    signs = '\u2501\u2500' if console.encoding.startswith('utf') else '#-'
    rows = [
        _head(glance, hint, signs[1], width), *_state(glance, width),
        _bar(glance, signs, width), _commanded(glance), _odometry(glance)]
    return [_drawn(console, row, width) for row in rows]


def _drawn(console: Console, row: Text, width: int) -> str:
    row.truncate(width, overflow='ellipsis')
    with console.capture() as capture:
        console.print(row, no_wrap=True, overflow='ellipsis', width=width, end='')
    return capture.get().rstrip('\n')


def _head(glance: DriveStatus, hint: str, line: str, width: int) -> Text:
    names = [one_line(name, NAME) for name in (glance.title, glance.robot) if name]
    room = max(1, width - len(hint) - 3)
    text = Text(' on '.join(names), style='bold')
    if text.cell_len > room:
        text = Text(names[0], style='bold')
    text.truncate(room, overflow='ellipsis')
    rule = line * max(1, width - text.cell_len - len(hint) - 2)
    return Text.assemble(text, (f' {rule} ', GREY), (hint, 'bold'))


def _state(glance: DriveStatus, width: int) -> list[Text]:
    word = f' {glance.state.value.upper()} '
    words = _words(glance)
    style = _STYLES.get(glance.state, _OTHER_STYLE)
    if glance.state is not DriveState.CUT_SHORT:
        return [Text.assemble((word, style), f'  {words}'), _step(glance)]
    # The reason may be long, and there is no step to tell of.
    parts = textwrap.wrap(words, width - len(word) - 2) or ['']
    return [Text.assemble((word, style), f'  {parts[0]}'),
            Text(' ' * (len(word) + 2) + ' '.join(parts[1:]))]


def _words(glance: DriveStatus) -> str:
    if glance.silent_for is not None:
        return f'no news for {glance.silent_for:.0f} s: the program is held up'
    if glance.state is DriveState.DRIVING and glance.step is not None:
        return f'{which(glance.step)}: {glance.step.words}'
    if glance.state is DriveState.CUT_SHORT:
        return one_line(glance.reason or '', 2 * MAX_COLUMNS)
    if (glance.state is DriveState.STOPPED and glance.seen is not None
            and glance.seen_ago < ODOMETRY_MAX_AGE):
        return 'odometry sees the robot stand still'
    return _WORDS.get(glance.state, '')


def _bar(glance: DriveStatus, signs: str, width: int) -> Text:
    if glance.duration is None:
        return Text()
    figures = (
        f'  {100.0 * glance.fraction:3.0f} %   {format_fixed(glance.time_left, 1)} s left of '
               f'{format_fixed(glance.duration, 1)} s')
    room = max(1, width - len(figures))
    done = min(room, max(0, round(glance.fraction * room)))
    # Two signs, for there may be no colours.
    return Text.assemble(
        (signs[0] * done, f'bold {BLUE}'), (signs[1] * (room - done), GREY), figures)


def _step(glance: DriveStatus) -> Text:
    if glance.step is None:
        return _row('this step', ['none'])
    left = glance.step.left
    ways = [f'{format_fixed(glance.step.time_left, 1)} s']
    if left.distance is not None:
        ways.append(f'{format_fixed(left.distance, 3)} m')
    if left.angle is not None:
        ways.append(f'{format_fixed(math.degrees(left.angle), 1)} deg')
    by = ' by odometry' if left.is_seen else ' by commands'
    return _row('this step', [f'{", ".join(ways)} left{by if len(ways) > 1 else ""}'])


def _commanded(glance: DriveStatus) -> Text:
    return _row('commanded', ['nothing yet'] if glance.commanded is None else
                _velocity(glance.commanded))


def _odometry(glance: DriveStatus) -> Text:
    if glance.seen is None:
        return _row('odometry', ['nothing yet'])
    return _row('odometry', [*_velocity(glance.seen), f'{format_fixed(glance.seen_ago, 1)} s ago'])


def _velocity(velocity: Velocity) -> list[str]:
    return [f'{format_fixed(velocity.linear_x, 3):>6} m/s',
        f'{format_fixed(velocity.angular_z, 3):>6} rad/s']


def _row(label: str, cells: Iterable[str]) -> Text:
    return Text(f'{label:{LABEL}} {"   ".join(cells)}')
