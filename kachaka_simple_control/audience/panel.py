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

from kachaka_simple_control.audience.glance import Glance, Left, State
from kachaka_simple_control.audience.step_lines import which
from kachaka_simple_control.motion.kinematics import Velocity
from kachaka_simple_control.report.columns import one_line
from kachaka_simple_control.report.looks import BLUE, GREY, ORANGE
from kachaka_simple_control.report.preview import fixed
from rich.console import Console
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

HEIGHT = 6
#: In a terminal with less room, a panel helps nobody.
MIN_COLUMNS, MIN_ROWS = 40, 12
#: A bar any wider tells nothing more.
WIDEST = 120
NAME = 28
#: Odometry older than this [s] says nothing of now.
FRESH = 0.5
LABEL = 11
#: Each state has a word; its colours can be told apart by the colour-blind as well.
_STYLES = {
    State.DRIVING: f'bold white on {BLUE}',
    State.STOPPING: f'bold black on {ORANGE}',
    State.CUT_SHORT: f'bold black on {ORANGE}',
}
_OTHER_STYLE = 'bold reverse'
_WORDS = {
    State.READY: 'nothing to drive yet',
    State.WAITING: 'for the robot to listen',
    State.MEETING: 'the robot is there; zeros first',
    State.STOPPING: 'zeros are sent until the robot stands still',
    State.STOPPED: 'the stop was sent',
}


def panel(console: Console, columns: int, glance: Glance, hint: str) -> list[str]:
    """
    Draw what there is to see.

    :param console: knows which colours and characters there are
    :param columns: how wide the terminal is
    :param glance: what there is to see
    :param hint: how to stop
    :returns: as many lines as the panel is high, none wider than the terminal
    """
    # One column is left free: a terminal may break a line that fills it.
    width = min(columns - 1, WIDEST)
    line = '\u2500' if console.encoding.startswith('utf') else '-'
    rows = [
        _head(glance, hint, line, width), _state(glance), _bar(glance, width),
        _step(glance), _commanded(glance), _odometry(glance)]
    return [_drawn(console, row, width) for row in rows]


def _drawn(console: Console, row: Text | Table, width: int) -> str:
    if isinstance(row, Text):
        row.truncate(width, overflow='ellipsis')
    with console.capture() as capture:
        console.print(row, no_wrap=True, overflow='ellipsis', width=width, end='')
    return capture.get().rstrip('\n')


def _head(glance: Glance, hint: str, line: str, width: int) -> Text:
    names = [one_line(name, NAME) for name in (glance.title, glance.robot) if name]
    text = Text(' on '.join(names), style='bold')
    end = Text(hint, style='bold')
    text.append(f' {line * max(1, width - text.cell_len - end.cell_len - 2)} ', style=GREY)
    return text + end


def _state(glance: Glance) -> Text:
    text = Text()
    text.append(f' {glance.state.value.upper()} ', _STYLES.get(glance.state, _OTHER_STYLE))
    text.append(f'  {_words(glance)}')
    return text


def _words(glance: Glance) -> str:
    if glance.silence is not None:
        return f'no news for {glance.silence:.0f} s: the program is held up'
    if glance.state is State.DRIVING and glance.step is not None:
        return f'{which(glance.step)}: {glance.step.words}'
    if glance.state is State.CUT_SHORT:
        return one_line(glance.reason or '', WIDEST)
    if glance.state is State.STOPPED and glance.seen is not None and glance.seen_ago < FRESH:
        return 'odometry sees the robot stand still'
    return _WORDS.get(glance.state, '')


def _bar(glance: Glance, width: int) -> Table | Text:
    if glance.duration is None:
        return Text()
    figures = (f'{100.0 * glance.part:3.0f} %  {fixed(glance.time_left, 1)} s left of '
               f'{fixed(glance.duration, 1)} s')
    grid = Table.grid(padding=(0, 2, 0, 0))
    bar = ProgressBar(
        total=1.0, completed=glance.part, width=max(1, width - len(figures) - 4),
        style=GREY, complete_style=BLUE, finished_style=BLUE)
    grid.add_row(bar, figures)
    return grid


def _step(glance: Glance) -> Text:
    if glance.step is None:
        return _row('this step', [])
    return _row('this step', [
        f'{fixed(glance.step.time_left, 1)} s left', *_left(glance.step.left)])


def _left(left: Left) -> Iterable[str]:
    ways = []
    if left.distance is not None:
        ways.append(f'{fixed(left.distance, 3)} m')
    if left.angle is not None:
        ways.append(f'{fixed(math.degrees(left.angle), 1)} deg')
    if ways:
        yield f'{", ".join(ways)} left {"by odometry" if left.is_seen else "by what was sent"}'


def _commanded(glance: Glance) -> Text:
    return _row('commanded', ['nothing yet'] if glance.commanded is None else
                _velocity(glance.commanded))


def _odometry(glance: Glance) -> Text:
    if glance.seen is None:
        return _row('odometry', ['nothing yet'])
    return _row('odometry', [*_velocity(glance.seen), f'{fixed(glance.seen_ago, 1)} s ago'])


def _velocity(velocity: Velocity) -> list[str]:
    return [f'{fixed(velocity.linear_x, 3):>6} m/s', f'{fixed(velocity.angular_z, 3):>6} rad/s']


def _row(label: str, cells: Iterable[str]) -> Text:
    return Text(f'{label:{LABEL}} {"   ".join(cells)}')
