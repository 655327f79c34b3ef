#!/usr/bin/env python3
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
"""
Draw the documentation's picture of corners: ``draw_corners.py [DIRECTORY]``.

It is ``corners.svg``, the paths of the library's square at several tolerances.  The directory is
docs/images by default.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from kachaka_simple_control.analysis.plan_view import PlanView
from kachaka_simple_control.files.library import find
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.motion.geometry import Area
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.report.output_file import check_plot_file, save_figure
from kachaka_simple_control.report.plan_plot import draw_path
from kachaka_simple_control.report.plot_style import add_axes, draw_figure
from kachaka_simple_control.text import format_fixed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

IMAGES = Path(__file__).parent.parent / 'docs' / 'images'
#: How far the path may be from a corner [m].
TOLERANCES = (0.0, 0.02, 0.05, 0.1)
#: The rate of the plans [Hz].
RATE = 20.0
#: The area that each map shows [m].
AREA = Area(-0.19, -0.19, 0.88, 0.88)
# Sizes [inch].
SIZE, LEFT, BOTTOM, ABOVE, RIGHT = 2.45, 0.75, 0.5, 0.4, 0.1


def main() -> None:
    """Draw the picture."""
    directory = Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGES
    save_figure(draw_figure(_draw), check_plot_file(directory / 'corners.svg'))


def _view(tolerance: float) -> PlanView:
    motion = replace(find('square').motion, corners=tolerance)
    limits = KACHAKA.limits
    return PlanView(
        motion.name, KACHAKA.name, plan(motion, limits, RATE), limits, KACHAKA.footprint)


def _draw(figure: Figure) -> None:
    cell = LEFT + SIZE + RIGHT
    figure.set_size_inches(len(TOLERANCES) * cell, BOTTOM + SIZE + ABOVE)
    for place, tolerance in enumerate(TOLERANCES):
        # Without an outline, so that nothing covers the path.
        view = replace(_view(tolerance), footprint=None)
        axes = add_axes(figure, LEFT + place * cell, BOTTOM, SIZE, SIZE)
        draw_path(axes, view, AREA)
        for patch in axes.findobj(lambda artist: artist.get_gid() == 'floor'):
            patch.remove()
        axes.set_title(f'{format_fixed(100.0 * tolerance, 0)} cm: '
                       f'{format_fixed(view.plan.duration, 1)} s')


if __name__ == '__main__':
    main()
