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
"""Draw a drive over time: velocities with their limits, and how far odometry was off."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
from operator import attrgetter
from typing import Any, TYPE_CHECKING

from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.report.driven_path import DrivenPath, Odometry
from kachaka_simple_control.report.pictures.looks import (
    BLUE,
    framed,
    GREY,
    ODOMETRY,
    ORANGE,
    PLANNED,
    SENT,
)
from kachaka_simple_control.report.pictures.velocity_picture import (
    ANGULAR,
    draw_limits,
    Kind,
    LINEAR,
    LONG,
    MOST,
    room,
    Scale,
)
from kachaka_simple_control.report.staircase import Corner, staircase
from kachaka_simple_control.report.thinning import bands

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Sizes and places [inch].
WIDTH = 5.4
LEFT, RIGHT = 0.78, 0.14
ROW, BETWEEN, TOP, BOTTOM = 1.45, 0.2, 0.1, 0.52
KEY = 0.28
#: Lines of what is held until the next message.
HELD = ('planned', 'sent')
#: With more corners than these a line is drawn as a band, in so many stretches of time.
CORNERS, STRETCHES = 6000, 180


def draw_drive_velocities(figure: Figure, path: DrivenPath, limits: Sequence[Limits]) -> None:
    """
    Draw both components of the velocity over time, with limits dashed.

    :param figure: the picture, empty; its size is set
    :param path: the drive
    :param limits: what it was to keep to; the first is shown
    """
    above, below = _rows(figure, KEY)
    end = end_of(path)
    for axes, kind in ((above, LINEAR), (below, ANGULAR)):
        lines = _velocities(path, kind)
        values = [value for corners in lines.values() for _, value in corners]
        scale = room(kind, values or [0.0], limits, end)
        _frame(axes, path, scale)
        for (name, corners), look in zip(lines.items(), (PLANNED, SENT, ODOMETRY)):
            draw = _draw_band if is_dense(path) else _draw_line
            draw(axes, corners, end, {**look, 'label': name, 'gid': name})
        if limits:
            draw_limits(axes, kind, limits[0])
    _finish(above, below, end)
    figure.legend(
        *above.get_legend_handles_labels(), loc='lower left', ncol=3, frameon=False,
        bbox_to_anchor=(LEFT / WIDTH, 0.02 / figure.get_figheight()), borderpad=0.2,
        borderaxespad=0.0, handlelength=2.6, columnspacing=1.8)


def draw_drive_errors(figure: Figure, path: DrivenPath) -> None:
    """
    Draw how far odometry was from where the messages should have brought the robot.

    :param figure: the picture, empty; its size is set
    :param path: the drive, with odometry
    """
    above, below = _rows(figure, 0.0)
    end = end_of(path)
    parts: tuple[tuple[Axes, str, str, Callable[[Odometry], float], dict[str, Any]], ...] = (
        (above, 'distance [mm]', 'distance', lambda seen: 1e3 * seen.distance, {'color': BLUE}),
        (below, 'heading [°]', 'heading', lambda seen: math.degrees(seen.angle),
         {'color': ORANGE, 'linestyle': '-'}))
    for axes, label, name, value_of, look in parts:
        corners = [(seen.time, value_of(seen)) for seen in path.odometry]
        values = [0.0, *(value for _, value in corners)]
        span = max(max(values) - min(values), 1e-3)
        _frame(axes, path, Scale(
            LINEAR, min(values) - 0.08 * span * (min(values) < 0.0), max(values) + 0.08 * span,
            end))
        axes.set_ylabel(label)
        draw = _draw_band if is_dense(path) else _draw_line
        draw(axes, corners, end, {**look, 'linewidth': 1.4, 'gid': name})
    _finish(above, below, end)


def _velocities(path: DrivenPath, kind: Kind) -> dict[str, list[Corner]]:
    value_of = attrgetter(kind.component)
    planned: list[Corner] = []
    for start in path.starts:
        if start.time is not None or not path.sent:
            offset = start.time or (planned[-1][0] if planned else 0.0)
            planned += [(offset + time, value)
                        for time, value in staircase(start.motion.plan, kind.component)]
    lines = {'planned': planned}
    if path.sent:
        lines['sent'] = [(sent.time - path.began, value_of(sent.velocity)) for sent in path.sent]
    if path.odometry:
        lines['odometry'] = [(seen.time, value_of(seen.answer.velocity))
                             for seen in path.odometry]
    return lines


def _rows(figure: Figure, key: float) -> tuple[Axes, Axes]:
    height = TOP + 2.0 * ROW + BETWEEN + BOTTOM + key
    figure.set_size_inches(WIDTH, height)
    inner = WIDTH - LEFT - RIGHT
    above, below = (figure.add_axes((
        LEFT / WIDTH, bottom / height, inner / WIDTH, ROW / height))
        for bottom in (BOTTOM + key + ROW + BETWEEN, BOTTOM + key))
    return above, below


def _frame(axes: Axes, path: DrivenPath, scale: Scale) -> None:
    unit = _unit(scale.duration)[1]
    right = scale.duration / unit
    framed(axes, WIDTH - LEFT - RIGHT)
    axes.set(xlim=(-0.01 * right, 1.01 * right), ylim=(scale.lowest, scale.highest),
             ylabel=scale.kind.label)
    axes.axhline(0.0, color=GREY, linewidth=0.6, zorder=1.0)
    ends = [((start.time or 0.0) + stage.end) / unit for start in path.starts
            if start.time is not None for stage in start.motion.plan.stages]
    if len(ends) <= MOST:
        axes.vlines(ends, 0.0, 1.0, transform=axes.get_xaxis_transform(), color=GREY,
                    linewidth=0.5, alpha=0.5, zorder=1.0, gid='boundaries')


def is_dense(path: DrivenPath) -> bool:
    """
    Return whether so much was sent or seen that lines would be a wall of colour.

    :param path: the drive
    :returns: whether bands are drawn instead
    """
    return max(len(path.sent), len(path.odometry)) > CORNERS


def _draw_line(
        axes: Axes, corners: Sequence[Corner], end: float, look: dict[str, Any]) -> None:
    unit = _unit(end)[1]
    # What is told is held until the next; what is seen changes from one sample to the next.
    held = look['gid'] in HELD
    axes.plot([time / unit for time, _ in corners], [value for _, value in corners],
              drawstyle='steps-post' if held else 'default', **look)


def _draw_band(
        axes: Axes, corners: Sequence[Corner], end: float, look: dict[str, Any]) -> None:
    unit = _unit(end)[1]
    found = bands(corners, end, STRETCHES)
    times = [(band.begin + 0.5 * end / STRETCHES) / unit for band in found]
    lows, highs = [band.lowest for band in found], [band.highest for band in found]
    if look['gid'] == 'planned':
        axes.fill_between(times, lows, highs, color=look['color'], alpha=0.35, linewidth=0.0,
                          label=look['label'], gid=look['gid'])
        return
    axes.plot(times, highs, **look)
    axes.plot(times, lows, **{**look, 'label': None})
    if look['gid'] not in HELD and look['gid'] != 'odometry':
        axes.fill_between(times, lows, highs, color=look['color'], alpha=0.3, linewidth=0.0)


def _finish(above: Axes, below: Axes, end: float) -> None:
    above.tick_params(labelbottom=False)
    below.set_xlabel(f'time since t = 0 [{_unit(end)[0]}]')


def _unit(end: float) -> tuple[str, float]:
    return ('min', 60.0) if end > LONG else ('s', 1.0)


def end_of(path: DrivenPath) -> float:
    """
    Return how long the axis of time is.

    :param path: the drive
    :returns: its length [s]
    """
    return max(path.duration, path.odometry[-1].time if path.odometry else 0.0) or 1.0
