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
"""The picture that a person sees before a drive: where a plan goes, and how fast."""

from __future__ import annotations

from collections.abc import Sequence
import io
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING
import warnings

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.report.columns import one_line
from kachaka_simple_control.report.pictures.looks import framed, style
from kachaka_simple_control.report.pictures.path_picture import draw_key, draw_path, extent
from kachaka_simple_control.report.pictures.velocity_picture import (
    ANGULAR,
    draw_velocity,
    LINEAR,
    scale,
)
from kachaka_simple_control.report.preview import amount, counted, fixed, Preview

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: What each kind of file says of itself is left out: two runs give the same bytes.
METADATA: dict[str, dict[str, None]] = {
    '.png': {'Software': None},
    '.svg': {'Date': None, 'Creator': None},
    '.pdf': {'CreationDate': None, 'Creator': None, 'Producer': None},
}
#: Pixels an inch, where there are pixels.
RESOLUTION = 110
#: A taller picture is more than people look at, and png has its limits.
MOST = 12

# Sizes and places [inch].
WIDTH = 11.0
ROW, KEY = 4.35, 0.4
PATH_LEFT, PATH_WIDTH = 0.75, 4.35
VELOCITY_LEFT, VELOCITY_WIDTH = 6.1, 4.7
BOTTOM, HEIGHT, BETWEEN = 0.5, 3.2, 0.3
NAME_TOP, FIGURES_TOP = 0.17, 0.42


def save_plot(file: str | os.PathLike[str], previews: Sequence[Preview]) -> None:
    """
    Draw plans, one below the other and to the same scales, and save the picture.

    On the left each path with the robot at the start and at the end of each step; on the right the
    velocities as they are sent, with the limits dashed.

    :param file: where to; its ending says what it becomes: .png, .svg or .pdf
    :param previews: the plans, 1 to 12
    :raises UsageError: if there is no such place, matplotlib is absent, or there are too many
    """
    path = check_plot_file(file)
    figure = draw(previews)
    data = io.BytesIO()
    suffix = path.suffix.lower()
    with style(), warnings.catch_warnings():
        # A letter that the font lacks becomes a box; the name is still in the table.
        warnings.filterwarnings('ignore', message='Glyph')
        figure.savefig(data, format=suffix[1:], metadata=METADATA[suffix])
    try:
        path.write_bytes(data.getvalue())
    except OSError as error:
        raise UsageError(f'{path}: it cannot be written: {error.strerror}') from None


def check_plot_file(file: str | os.PathLike[str]) -> Path:
    """
    Refuse a file that no picture can be saved to; nothing is drawn or imported for it.

    :param file: where to save it
    :returns: its path
    :raises UsageError: if it has no ending that we can draw, or no folder to be in
    """
    path = Path(file)
    if path.suffix.lower() not in METADATA:
        raise UsageError(f'{path}: a plot is .png, .svg or .pdf; take one of these as its ending')
    if not path.parent.is_dir():
        raise UsageError(f'{path}: there is no folder {path.parent}; make it first')
    if path.is_dir():
        raise UsageError(f'{path}: this is a folder; name a file in it')
    target = path if path.exists() else path.parent
    if not os.access(target, os.W_OK):
        raise UsageError(f'{path}: you are not allowed to write there')
    return path


def draw(previews: Sequence[Preview]) -> Figure:
    """
    Draw plans, one below the other and to the same scales.

    :param previews: the plans, 1 to 12
    :returns: the picture
    :raises UsageError: if matplotlib is absent, or there are too many plans
    """
    if not 1 <= len(previews) <= MOST:
        raise UsageError(f'a plot shows 1 to {MOST} motions, not {len(previews)}; name fewer')
    with style():
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(WIDTH, len(previews) * ROW + KEY), dpi=RESOLUTION)
        FigureCanvasAgg(figure)
        area = extent(previews, PATH_WIDTH / HEIGHT)
        scales = [scale(previews, kind) for kind in (LINEAR, ANGULAR)]
        for number, preview in enumerate(previews):
            row = _Row(figure, len(previews), number)
            row.title(preview)
            draw_path(row.axes(PATH_LEFT, 0.0, PATH_WIDTH, HEIGHT), preview, area)
            part = (HEIGHT - BETWEEN) / 2.0
            above = row.axes(VELOCITY_LEFT, part + BETWEEN, VELOCITY_WIDTH, part)
            below = row.axes(VELOCITY_LEFT, 0.0, VELOCITY_WIDTH, part)
            draw_velocity(above, preview, scales[0], with_time=False)
            draw_velocity(below, preview, scales[1], with_time=True)
        draw_key(figure, (PATH_LEFT / WIDTH, 0.1 / figure.get_figheight()))
    return figure


class _Row:
    """The place of one plan in the picture."""

    def __init__(self, figure: Figure, count: int, number: int) -> None:
        self._figure = figure
        self._height = count * ROW + KEY
        self._base = KEY + (count - 1 - number) * ROW

    def axes(self, left: float, bottom: float, width: float, height: float) -> Axes:
        bottom += self._base + BOTTOM
        axes = self._figure.add_axes((
            left / WIDTH, bottom / self._height, width / WIDTH, height / self._height))
        framed(axes, width)
        return axes

    def title(self, preview: Preview) -> None:
        for text, top, look in (
                (_name(preview), NAME_TOP, {'fontsize': 12.0, 'fontweight': 'bold'}),
                (_figures(preview), FIGURES_TOP, {'color': '#444444'})):
            self._figure.text(
                PATH_LEFT / WIDTH, (self._base + ROW - top) / self._height, text, va='top', **look)


def _name(preview: Preview) -> str:
    return _plain(f'{one_line(preview.name, 50)} on {one_line(preview.robot, 30)}')


def _figures(preview: Preview) -> str:
    plan = preview.plan
    end = plan.pose
    return (f'{plan.duration:.3f} s, {plan.length:.3f} m, {counted(len(plan.stages), "step")}; '
            f'ends at x {fixed(end.x, 3)} m, y {fixed(end.y, 3)} m, heading '
            f'{fixed(math.degrees(end.theta), 1)}°; '
            f'{counted(preview.messages, "velocity", "velocities")} at '
            f'{amount(preview.rate)} Hz')


def _plain(text: str) -> str:
    # Between two dollars matplotlib reads a formula.
    return text.replace('$', r'\$')
