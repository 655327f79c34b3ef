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
"""The pictures of a report: as SVG for its page, and the path as PNG."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import io
import re
from typing import Any, TYPE_CHECKING
import warnings

from kachaka_simple_control.report.pictures.drive_path_picture import draw_drive_path
from kachaka_simple_control.report.pictures.drive_time_picture import (
    draw_drive_errors,
    draw_drive_velocities,
)
from kachaka_simple_control.report.pictures.looks import style
from kachaka_simple_control.report.pictures.period_picture import draw_periods
from kachaka_simple_control.report.summary import Summary

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Letters stay letters: they can be found, copied and read aloud.
SVG: Any = {'svg.fonttype': 'none', 'path.simplify': True}
#: What a file says of itself is left out: the same drive gives the same bytes.
NOTHING = {'Date': None, 'Creator': None, 'Format': None, 'Type': None}
#: Pixels an inch of the PNG.
RESOLUTION = 200
#: Names of the pictures.
PATH, VELOCITIES, ERRORS, PERIODS = 'path', 'velocities', 'errors', 'periods'


@dataclass(frozen=True)
class Pictures:
    """
    The pictures that could be drawn.

    :param svg: the text of each by its name, ready to stand in a page
    :param png: the path
    """

    svg: dict[str, str]
    png: bytes


def draw_pictures(summary: Summary) -> Pictures:
    """
    Draw what there is to see of a drive.

    :param summary: the drive
    :returns: its pictures; what nobody sent or saw is not drawn
    :raises UsageError: if matplotlib is absent
    """
    with style(), warnings.catch_warnings():
        from matplotlib import rc_context
        # A letter that the font lacks becomes a box.
        warnings.filterwarnings('ignore', message='Glyph')
        drawn = {name: _figure(draw) for name, draw in _wanted(summary).items()}
        png = io.BytesIO()
        if PATH in drawn:
            drawn[PATH].savefig(png, format='png', dpi=RESOLUTION, metadata={'Software': None})
        with rc_context(SVG):
            return Pictures(
                {name: _svg(figure, name) for name, figure in drawn.items()}, png.getvalue())


def _wanted(summary: Summary) -> dict[str, Callable[[Figure], None]]:
    record, path = summary.record, summary.path
    if not record.motions:
        return {}
    opened = record.opened
    limits = [motion.planned.limits for motion in record.motions] if opened is None else [
        opened.limits]
    footprint = None if opened is None else opened.footprint
    wanted: dict[str, Callable[[Figure], None]] = {
        PATH: lambda figure: draw_drive_path(figure, path, footprint),
        VELOCITIES: lambda figure: draw_drive_velocities(figure, path, limits[:1])}
    if path.odometry:
        wanted[ERRORS] = lambda figure: draw_drive_errors(figure, path)
    if summary.timing.uneven:
        wanted[PERIODS] = lambda figure: draw_periods(figure, summary.timing.uneven)
    return wanted


def _figure(draw: Callable[[Figure], None]) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure()
    FigureCanvasAgg(figure)
    draw(figure)
    return figure


def _svg(figure: Figure, name: str) -> str:
    data = io.BytesIO()
    figure.savefig(data, format='svg', metadata=NOTHING)
    return in_page(data.getvalue().decode(), name)


def in_page(svg: str, name: str) -> str:
    """
    Make an SVG file a part of a page.

    :param svg: the text of the file, from matplotlib
    :param name: put before each id that it refers to, so that pictures do not share any
    :returns: the element alone, as wide as there is room, without addresses and a style for all
    """
    svg = svg[svg.index('<svg'):]
    svg = re.sub(r'<metadata>.*?</metadata>', '', svg, flags=re.DOTALL)
    svg = re.sub(r'<defs>\s*<style[^>]*>.*?</style>\s*</defs>', '', svg, flags=re.DOTALL)
    svg = re.sub(r' xmlns(:\w+)?="[^"]*"', '', svg)
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*"', r'\1', svg, count=1)
    svg = re.sub(r'(<svg[^>]*?) height="[^"]*"', r'\1', svg, count=1)
    referred = set(re.findall(r'(?:href="|url\()#([^")]*)', svg))
    svg = re.sub(r' id="([^"]*)"', lambda found: (
        f' id="{name}-{found[1]}"' if found[1] in referred else ''), svg)
    svg = re.sub(r'(href="#|url\(#)', rf'\g<1>{name}-', svg)
    return re.sub(r'\n+\s*', '\n', svg)
