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

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Colours of Okabe and Ito, which the colour-blind can tell apart.
BLUE, ORANGE, GREEN = '#0072B2', '#D55E00', '#009E73'
GREY, FAINT = '#666666', '#dddddd'

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
