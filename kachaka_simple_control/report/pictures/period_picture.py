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
"""Draw how even the period was."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import TYPE_CHECKING

from kachaka_simple_control.report.pictures.looks import BLUE, framed, GREY, nice

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Sizes and places [inch].
WIDTH, HEIGHT = 5.4, 2.5
LEFT, RIGHT, TOP, BOTTOM = 0.78, 0.14, 0.1, 0.52
#: Bars on either side of the middle.
BARS = 25
#: The least that is shown on either side [ms].
LEAST = 0.5


def draw_periods(figure: Figure, uneven: Sequence[float]) -> None:
    """
    Draw a histogram of how much longer than due the intervals between messages were.

    :param figure: the picture, empty; its size is set
    :param uneven: the differences [s]
    """
    figure.set_size_inches(WIDTH, HEIGHT)
    inner = WIDTH - LEFT - RIGHT
    axes = figure.add_axes((
        LEFT / WIDTH, BOTTOM / HEIGHT, inner / WIDTH, (HEIGHT - TOP - BOTTOM) / HEIGHT))
    framed(axes, inner)
    reach, counts = histogram([1e3 * one for one in uneven])
    width = 2.0 * reach / len(counts)
    lefts = [-reach + number * width for number in range(len(counts))]
    # A bar of one must be seen beside one of thousands.
    axes.bar(lefts, counts, width, align='edge', color=BLUE, edgecolor='white', linewidth=0.4,
             gid='periods')
    axes.set_yscale('log')
    axes.set(xlim=(-reach, reach), ylim=(0.6, 2.0 * max(10, *counts)),
             xlabel='interval, longer than due by [ms]', ylabel='intervals')
    axes.yaxis.set_major_formatter('{x:.0f}')
    axes.minorticks_off()
    axes.axvline(0.0, color=GREY, linewidth=1.0, linestyle='--')


def histogram(values: Sequence[float]) -> tuple[float, list[int]]:
    """
    Count values in bars of equal width, with zero in the middle of one.

    :param values: the values [ms]
    :returns: how far the bars reach on either side [ms], and the counts from left to right
    """
    known = [value for value in values if math.isfinite(value)]
    largest = max((abs(value) for value in known), default=0.0)
    bars = 2 * BARS + 1
    width = nice(max(largest, LEAST) / (BARS + 0.5))
    counts = [0] * bars
    for value in known:
        counts[min(bars - 1, max(0, math.floor(value / width + BARS + 0.5)))] += 1
    side = next((number for number in range(bars) if counts[number] or counts[-1 - number]), BARS)
    side = min(side, BARS - 5)
    return width * (BARS + 0.5 - side), counts[side:bars - side]
