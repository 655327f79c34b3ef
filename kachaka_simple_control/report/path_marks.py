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
"""Draw marks on a path: arrows in the direction of travel, and step numbers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby
import math
from typing import Any, NamedTuple, TYPE_CHECKING

from kachaka_simple_control.analysis.paths import ArcSegment
from kachaka_simple_control.motion.geometry import Pose

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: The largest number of labels on a path; with more places, only every n-th place has a label.
MAX_LABELS = 12
#: The largest number of numbers or ranges in a label; a longer list is cut after two.
MAX_PARTS = 3
#: The distances between the path and a label, and between two labels [points].
AWAY, APART = 6.0, 2.0
#: The style of a label; its background is translucent.
LABEL: dict[str, Any] = {
    'color': '#222222', 'fontweight': 'bold', 'ha': 'center', 'va': 'center', 'zorder': 7.0,
    'textcoords': 'offset points', 'gid': 'step number',
    'bbox': {'facecolor': 'white', 'edgecolor': 'none', 'alpha': 0.7, 'pad': 0.5}}


class StepPlace(NamedTuple):
    """
    A place on a path with the numbers of the steps whose middle is there.

    :param numbers: the numbers of the steps, in order
    :param x: the x coordinate [m]
    :param y: the y coordinate [m]
    :param side: the direction to the outside of a curve, or to the right of a straight line [rad]
    """

    numbers: list[int]
    x: float
    y: float
    side: float

    @property
    def label(self) -> str:
        """Return the step numbers as text, for example '1, 3-5'; a long list is cut."""
        parts: list[str] = []
        for _, group in groupby(enumerate(self.numbers), key=lambda item: item[1] - item[0]):
            run = [number for _, number in group]
            parts += [f'{run[0]}-{run[-1]}'] if len(run) > 2 else map(str, run)
        return ', '.join(parts if len(parts) <= MAX_PARTS else [*parts[:2], '...'])


def step_places(
        steps: Iterable[tuple[int, Sequence[ArcSegment]]], grain: float) -> list[StepPlace]:
    """
    Return the places of the step numbers; steps that are close together share a place.

    :param steps: the number of each step and the segments of its path
    :param grain: the approximate distance below which steps share a place [m]
    """
    places: dict[tuple[int, int], StepPlace] = {}
    for number, segments in steps:
        if not segments:
            continue
        longest = max(segments, key=lambda segment: (abs(segment.distance), abs(segment.angle)))
        middle = longest.middle
        side = middle.theta - math.copysign(math.pi / 2.0, longest.angle)
        cell = (round(middle.x / grain), round(middle.y / grain))
        places.setdefault(cell, StepPlace([], middle.x, middle.y, side)).numbers.append(number)
    return list(places.values())


def draw_step_numbers(axes: Axes, places: Sequence[StepPlace]) -> None:
    """
    Draw step numbers beside the path; a number without free room is left out.

    :param axes: the axes; their range must be set before
    :param places: the places, most important first
    """
    canvas: Any = axes.figure.canvas  # a raster canvas, which can measure text
    pixels, renderer = axes.figure.dpi / 72.0, canvas.get_renderer()
    taken: list[Any] = []
    for place in places[::max(1, math.ceil(len(places) / MAX_LABELS))]:
        label = axes.annotate(place.label, (place.x, place.y), (0.0, 0.0), **LABEL)
        size = label.get_window_extent(renderer)
        for turned in (0.0, math.pi, -math.pi / 2.0, math.pi / 2.0):
            right, up = math.cos(place.side + turned), math.sin(place.side + turned)
            reach = AWAY + (abs(right) * size.width + abs(up) * size.height) / 2.0 / pixels
            label.set_position((reach * right, reach * up))
            box = label.get_window_extent(renderer).padded(APART * pixels)
            if _is_within(box, axes.bbox) and not any(map(box.overlaps, taken)):
                taken.append(box)
                break
        else:
            label.remove()


def _is_within(box: Any, outer: Any) -> bool:
    return bool(outer.x0 <= box.x0 and box.x1 <= outer.x1
                and outer.y0 <= box.y0 and box.y1 <= outer.y1)


def draw_arrows(axes: Axes, poses: Sequence[Pose], colour: str) -> None:
    """
    Draw arrow heads on a path.

    :param poses: the position and the direction of each arrow head
    """
    from matplotlib.path import Path
    from matplotlib.transforms import Affine2D

    head = Path([(-1.0, 0.8), (0.4, 0.0), (-1.0, -0.8), (-0.6, 0.0), (-1.0, 0.8)])
    for pose in poses:
        turned = Affine2D().rotate(pose.theta).transform_path(head)
        axes.plot(pose.x, pose.y, marker=turned, markersize=8.0, color=colour,
                  markeredgewidth=0.0, zorder=4.5, gid='arrow')
