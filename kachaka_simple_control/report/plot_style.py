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
"""What all plots share: colours, axes, round scales."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TYPE_CHECKING

from kachaka_simple_control.errors import UsageError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Colours of Okabe and Ito, which the colour-blind can tell apart.
BLUE, ORANGE, GREEN = '#0072B2', '#D55E00', '#009E73'
SKY = '#56B4E9'
GREY, FAINT = '#666666', '#dddddd'

# Three lines that often coincide: told apart by width, colour and dashes alike.
PLANNED: dict[str, Any] = {
    'color': SKY, 'linewidth': 5.0, 'alpha': 0.6, 'zorder': 3.0, 'solid_capstyle': 'round'}
SENT: dict[str, Any] = {'color': '#003f63', 'linewidth': 1.5, 'zorder': 3.5}
ODOMETRY: dict[str, Any] = {
    'color': ORANGE, 'linewidth': 1.5, 'linestyle': (0, (3, 1.6)), 'zorder': 4.0}

#: Settings on top of matplotlib's default style, whatever the user's own settings are.
#: Lines lose points that lie less than 0.3 pixels beside them.
SETTINGS: Any = {
    'font.size': 9.0, 'svg.hashsalt': 'kachaka_simple_control', 'path.simplify': True,
    'path.simplify_threshold': 0.3}
#: Distance of an axis's label from the axis [inch]: six characters fit between.
LABEL = 0.56


def add_axes(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Add axes at a place of a figure [inch], whose size is set."""
    total_width, total_height = figure.get_size_inches()
    return figure.add_axes((
        left / total_width, bottom / total_height, width / total_width, height / total_height))


def style_axes(axes: Axes, width: float | None = None) -> None:
    """
    Add a grid to axes and hide the sides of their frame that have no numbers.

    :param axes: the axes
    :param width: their width [inch], to align the y labels of all axes; None: as matplotlib does
    """
    if width is not None:
        axes.yaxis.set_label_coords(-LABEL / width, 0.5)
    axes.grid(visible=True, color=FAINT, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[['top', 'right']].set_visible(False)


def set_map_limits(
        axes: Axes, left: float, bottom: float, width: float, height: float,
        tick_distance: float) -> None:
    """
    Make axes a map in metres with a square grid.

    :param tick_distance: at least this far apart are the lines of the grid [m]
    """
    from matplotlib.ticker import MultipleLocator

    axes.set(xlim=(left, left + width), ylim=(bottom, bottom + height), xlabel='x [m]',
             ylabel='y [m]')
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MultipleLocator(round_step(tick_distance)))


def round_step(size: float) -> float:
    """
    Return the step of a scale: 1, 2 or 5 times a power of ten, not below a size above 0.

    Both axes of a map share one step, so matplotlib's locator is asked once for both.
    """
    from matplotlib.ticker import MaxNLocator

    # What is larger by rounding alone is the size itself.
    locator = MaxNLocator(1, steps=(1, 2, 5, 10), min_n_ticks=1)
    first, second, *_ = locator.tick_values(0.0, size * (1.0 - 1e-9))
    return float(second - first)


@contextmanager
def default_style() -> Iterator[None]:
    """
    Draw in matplotlib's default style, whatever the user's own settings are.

    :raises UsageError: if matplotlib is missing
    """
    try:
        from matplotlib import rc_context
        from matplotlib import style as styles
    except ModuleNotFoundError as error:
        if error.name != 'matplotlib':
            raise
        raise UsageError(
            'a plot needs matplotlib: pip install matplotlib, or sudo apt install '
            'python3-matplotlib') from None
    with styles.context('default'), rc_context(SETTINGS):
        yield
