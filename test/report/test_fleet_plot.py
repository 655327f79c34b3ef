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
"""The plot of a fleet's floor."""

from __future__ import annotations

import math

from kachaka_simple_control.analysis.clearance import FleetView, FloorRobot, near_passes
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.motion.geometry import compose, Pose
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Forward, Motion
from kachaka_simple_control.report.fleet_plot import draw_fleet, save_plot
from plans import BOX, DISC, EMPTY, GENTLE, SPIN, SQUARE
import pytest

MARGIN = 0.1


def view(*robots):
    """Return the view of a fleet."""
    return FleetView('minuet $1$', robots, MARGIN, tuple(near_passes(robots, MARGIN)))


def robot(name, motion, x=0.0, y=0.0, theta=0.0, footprint=BOX):
    """Return a robot on the floor."""
    return FloorRobot(name, plan(motion, GENTLE, 10.0), Pose(x, y, theta), footprint)


FLEET = view(robot('r1', SQUARE), robot('r2', Motion([Forward(1.0)]), 2.0, 0.5, math.pi, DISC),
             robot('r3', EMPTY, 1.0, 1.5, 0.0, None))
NEAR = view(robot('r1', SQUARE), robot('r2', SPIN, 0.7, 0.0))


@pytest.fixture
def matplotlib():
    """Return matplotlib."""
    return pytest.importorskip('matplotlib', reason='needs matplotlib')


def marked(figure, gid):
    """Return the artists of a kind."""
    return figure.findobj(lambda artist: artist.get_gid() == gid)


def test_each_path_leads_from_start_to_end_on_the_floor(matplotlib):
    paths = [list(zip(*line.get_data())) for line in marked(draw_fleet(FLEET), 'path')]
    assert len(paths) == 3
    for points, one in zip(paths, FLEET.robots):
        end = compose(one.start, one.plan.pose)
        assert points[0] == pytest.approx((one.start.x, one.start.y), abs=1e-3)
        assert points[-1] == pytest.approx((end.x, end.y), abs=1e-3)


def test_the_outline_is_at_start_and_end_where_it_is_known(matplotlib):
    figure = draw_fleet(FLEET)
    for gid, centre in (('start', (2.0, 0.5)), ('end', (1.0, 0.5))):
        [outlines] = marked(figure, gid)
        box, disc = (path.get_extents() for path in outlines.get_paths())
        assert (box.width, box.height) == pytest.approx((BOX.length, BOX.width))
        assert ((disc.x0 + disc.x1) / 2.0, (disc.y0 + disc.y1) / 2.0) == pytest.approx(centre)
        assert len(marked(figure, f'{gid} heading')[0].get_segments()) == 3


def test_each_robot_has_its_name(matplotlib):
    assert [label.get_text() for label in marked(draw_fleet(FLEET), 'name')] == ['r1', 'r2', 'r3']


def test_a_near_pass_is_marked_where_it_is(matplotlib):
    assert not marked(draw_fleet(FLEET), 'near')
    [marks] = marked(draw_fleet(NEAR), 'near')
    assert list(zip(*marks.get_data())) == [pytest.approx(NEAR.passes[0].place)]
    [text] = marked(draw_fleet(NEAR), 'near text')
    assert text.get_text() == f'0 cm, {NEAR.passes[0].time:.1f} s'
    [legend] = draw_fleet(NEAR).legends
    assert 'nearer than 10 cm' in [words.get_text() for words in legend.get_texts()]


def test_the_map_shows_all_and_is_true_to_scale(matplotlib):
    figure = draw_fleet(FLEET)
    [axes] = figure.axes
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    assert left < -0.2
    assert right > 2.2
    assert bottom < -0.2
    assert top > 1.5
    box = axes.get_window_extent()
    assert box.width / (right - left) == pytest.approx(box.height / (top - bottom))


def test_a_large_fleet_is_drawn_without_names_over_each_other(matplotlib):
    spin = plan(SPIN, GENTLE, 10.0)
    robots = tuple(FloorRobot(f'robot_{number}', spin, Pose(number % 16, number // 16), BOX)
                   for number in range(255))
    figure = draw_fleet(FleetView('many', robots, MARGIN, ()))
    assert len(marked(figure, 'path')) == 255
    assert not marked(figure, 'arrow')
    renderer = figure.canvas.get_renderer()
    boxes = [label.get_window_extent(renderer) for label in marked(figure, 'name')]
    assert boxes
    assert not any(one.overlaps(two) for number, one in enumerate(boxes) for two in boxes[:number])


@pytest.mark.parametrize('suffix', ['svg', 'png', 'pdf'])
def test_a_plot_is_saved_and_the_same_each_time(matplotlib, tmp_path, suffix):
    files = [tmp_path / f'{name}.{suffix}' for name in 'ab']
    for file in files:
        save_plot(file, NEAR)
    one, two = (file.read_bytes() for file in files)
    assert one == two
    assert len(one) > 1000


def test_an_impossible_file_is_refused(tmp_path):
    with pytest.raises(UsageError, match='a plot is .png, .svg or .pdf'):
        save_plot(tmp_path / 'fleet.jpg', FLEET)
