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
"""Arrows and numbers on drawn paths."""

from itertools import combinations
import math

from kachaka_simple_control.analysis.summary import Summary
from kachaka_simple_control.motion.paths import step_segments
from kachaka_simple_control.motion.steps import Arc, Forward, Motion, Repeat, Turn
from kachaka_simple_control.report.map_plot import MAX_LABELS, step_places
from outcome_logs import done, faulted, lesson, never_began
from plans import BACK, BOX, HOUR, LESSON, preview, QUARTER, SQUARE, SQUARE_CW
import pytest

SPIRAL = Motion('spiral', [
    step for number in range(30) for step in (Forward(0.1 + 0.1 * number), Turn(1.0))])
#: Many steps in little room, and labels that are wide at the edge of a map without a robot.
SHUFFLE = Motion('shuffle', [Forward(0.02)] * 12)
ROUND = Motion('round', [
    Repeat(10, [Forward(1.36), Turn(QUARTER), Forward(1.0), Turn(QUARTER)])])


def places_of(motion):
    """Return where the numbers of a motion's steps belong, to a millimetre."""
    return step_places(enumerate(step_segments(preview(motion).plan), 1), 0.001)


def marked(figure, gid):
    """Return the artists of a kind."""
    return figure.findobj(lambda artist: artist.get_gid() == gid)


def labels(figure):
    """Return the numbers on a plot, in the order of the steps."""
    return [label.get_text() for label in marked(figure, 'step number')]


@pytest.fixture
def matplotlib():
    """Return matplotlib."""
    return pytest.importorskip('matplotlib', reason='needs matplotlib')


@pytest.fixture
def drive_path(matplotlib):
    """Return a function that draws the path of a drive."""
    from kachaka_simple_control.report.map_plot import draw_drive_path
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    def draw(log):
        figure = Figure()
        FigureCanvasAgg(figure)
        draw_drive_path(figure, Summary(log).aligned, log.session_started.footprint)
        return figure
    return draw


def test_a_number_belongs_to_the_middle_of_its_step():
    middles = [(0.25, 0.0), (0.5, 0.0), (0.5, 0.25), (0.5, 0.5), (0.25, 0.5), (0.0, 0.5),
               (0.0, 0.25), (0.0, 0.0)]
    places = places_of(SQUARE)
    assert [(place.x, place.y) for place in places] == [
        pytest.approx(middle, abs=1e-9) for middle in middles]
    assert [place.numbers for place in places] == [[number] for number in range(1, 9)]
    (arc,) = places_of(Motion('arc', [Arc(1.0, QUARTER)]))
    assert math.hypot(arc.x, arc.y - 1.0) == pytest.approx(1.0)
    assert arc.x == pytest.approx(math.sqrt(0.5))


@pytest.mark.slow
@pytest.mark.parametrize('footprint', [BOX, None])
@pytest.mark.parametrize('motion', [
    SQUARE, SQUARE_CW, LESSON, BACK, HOUR, SPIRAL, SHUFFLE, ROUND], ids=lambda one: one.name)
def test_numbers_are_few_and_lie_apart_within_the_map(matplotlib, motion, footprint):
    from kachaka_simple_control.report.plan_plot import draw_plans
    figure = draw_plans([preview(motion, footprint=footprint)])
    shown = marked(figure, 'step number')
    assert min(len(places_of(motion)), MAX_LABELS // 2) <= len(shown) <= MAX_LABELS
    assert labels(figure)[0][0] == '1'
    inner = figure.axes[0].get_window_extent()
    boxes = [label.get_window_extent(figure.canvas.get_renderer()) for label in shown]
    assert not any(one.overlaps(two) for one, two in combinations(boxes, 2))
    assert all(inner.x0 < box.x0 < box.x1 < inner.x1 and inner.y0 < box.y0 < box.y1 < inner.y1
               for box in boxes)


def direction(arrow):
    """Return in which direction the head of an arrow points [rad]."""
    _, tip, _, notch, _ = arrow.get_marker().vertices
    return math.atan2(tip[1] - notch[1], tip[0] - notch[0])


@pytest.mark.parametrize('motion, directions', [
    (SQUARE, [0.0, QUARTER, math.pi, -QUARTER]),
    # Backwards along x; then with the heading at -45 degrees, so towards 135.
    (BACK, [math.pi, 0.75 * math.pi])])
def test_arrows_point_in_the_direction_of_travel(matplotlib, motion, directions):
    from kachaka_simple_control.report.plan_plot import draw_plans
    arrows = [arrow for arrow in marked(draw_plans([preview(motion)]), 'arrow')
              if arrow.get_color() == '#0072B2']
    assert [math.remainder(direction(arrow) - wanted, math.tau)
            for arrow, wanted in zip(arrows, directions, strict=True)] == pytest.approx(
                [0.0] * len(directions), abs=1e-9)


@pytest.mark.parametrize('drive, numbers', [
    (done, ['1', '2', '3', '4', '5', '6', '7', '8']),
    (lesson, ['1', '2', '3-7']),
    # Of a drive that was cut short those that began: as many as its table has rows.
    (faulted, ['1', '2', '3']),
    (never_began, ['1', '2', '3', '4', '5', '6', '7', '8'])])
def test_the_path_of_a_drive_has_the_numbers_of_its_table(drive_path, drive, numbers):
    log = drive()
    assert labels(drive_path(log)) == numbers
    if drive is faulted:
        assert len(Summary(log).steps) == 3
