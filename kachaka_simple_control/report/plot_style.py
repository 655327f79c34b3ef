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
"""What pictures have in common: colours, frames, round numbers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import math
from typing import Any, TYPE_CHECKING

from kachaka_simple_control.errors import UsageError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Colours of Okabe and Ito, which the colour-blind can tell apart.
BLUE, ORANGE, GREEN = '#0072B2', '#D55E00', '#009E73'
SKY = '#56B4E9'
GREY, FAINT = '#666666', '#dddddd'

# Three lines that often lie on each other: told apart by width, colour and dashes alike.
PLANNED: dict[str, Any] = {
    'color': SKY, 'linewidth': 5.0, 'alpha': 0.6, 'zorder': 3.0, 'solid_capstyle': 'round'}
SENT: dict[str, Any] = {'color': '#003f63', 'linewidth': 1.5, 'zorder': 3.5}
ODOMETRY: dict[str, Any] = {
    'color': ORANGE, 'linewidth': 1.5, 'linestyle': (0, (3, 1.6)), 'zorder': 4.0}

#: Stands on the style that comes with matplotlib, whatever the user's own settings are.
SETTINGS: Any = {'font.size': 9.0, 'svg.hashsalt': 'kachaka_simple_control'}
#: How far beside the axis its label stands [inch]: there is room for six characters between.
LABEL = 0.56


def framed(axes: Axes, width: float) -> None:
    """
    Give a picture its grid, and leave away the frame where there are no numbers.

    :param axes: the picture
    :param width: how wide it is [inch]
    """
    axes.yaxis.set_label_coords(-LABEL / width, 0.5)
    axes.grid(visible=True, color=FAINT, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[['top', 'right']].set_visible(False)


def nice(step: float) -> float:
    """
    Return a round number for the steps of a scale.

    :param step: about how large, above zero
    :returns: 1, 2 or 5 times a power of ten, not below the step
    """
    power = 10.0 ** math.floor(math.log10(step))
    return next(power * factor for factor in (1.0, 2.0, 5.0, 10.0)
                if power * factor >= step * (1.0 - 1e-9))


@contextmanager
def style() -> Iterator[None]:
    """
    Draw in the style that comes with matplotlib, whatever the user's own settings are.

    :returns: a context manager
    :raises UsageError: if matplotlib is absent
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
