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
"""The plot of a plan."""

import errno
from itertools import combinations
import math
from pathlib import Path
import re
import sys

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.steps import Forward, Motion
from kachaka_simple_control.report.output_file import check_plot_file
from kachaka_simple_control.report.plan_plot import draw_plans, save_plot
from kachaka_simple_control.report.text_tables import plan_table
from plans import (
    ABRUPT,
    BACK,
    BOX,
    DISC,
    EIGHT,
    EMPTY,
    GENTLE,
    HOUR,
    LESSON,
    preview,
    SPIN,
    SQUARE,
)
import pytest


@pytest.fixture
def matplotlib():
    """Return matplotlib."""
    return pytest.importorskip('matplotlib', reason='needs matplotlib')


def marked(figure, gid):
    """Return the artists of a kind."""
    return figure.findobj(lambda artist: artist.get_gid() == gid)


def data_of(figure, gid):
    """Return the points of the lines of a kind."""
    return [list(zip(*artist.get_data())) for artist in marked(figure, gid)]


@pytest.mark.parametrize('name', ['plan.jpg', 'plan', 'plan.', '.png', 'plan.svg.txt'])
def test_an_unknown_file_extension_is_refused(tmp_path, name):
    file = tmp_path / name
    with pytest.raises(UsageError) as refusal:
        check_plot_file(file)
    assert str(refusal.value) == (
        f'{file}: a plot is .png, .svg or .pdf; take one of these as its ending')


def test_an_impossible_path_is_refused_before_anything_is_drawn(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, 'matplotlib', None)
    with pytest.raises(UsageError) as refusal:
        save_plot(tmp_path / 'gone' / 'plan.svg', [preview(SQUARE)])
    assert str(refusal.value) == (
        f'{tmp_path}/gone/plan.svg: there is no folder {tmp_path}/gone; make it first')
    (tmp_path / 'plan.svg').mkdir()
    with pytest.raises(UsageError) as refusal:
        save_plot(str(tmp_path / 'plan.svg'), [preview(SQUARE)])
    assert str(refusal.value) == f'{tmp_path}/plan.svg: this is a folder; name a file in it'


@pytest.mark.needs('matplotlib')
def test_a_full_disk_leaves_the_old_plot_and_nothing_else(tmp_path, monkeypatch):
    file, write = tmp_path / 'plan.svg', Path.write_bytes

    def write_a_part(path, data):
        write(path, data[:100])
        raise OSError(errno.ENOSPC, 'No space left on device')

    file.write_text('old')
    monkeypatch.setattr(Path, 'write_bytes', write_a_part)
    with pytest.raises(UsageError, match='plan.svg: it cannot be written: No space left on'):
        save_plot(file, [preview(SQUARE)])
    assert [found.name for found in tmp_path.iterdir()] == ['plan.svg']
    assert file.read_text() == 'old'


def test_without_matplotlib_one_sentence_says_how_to_install_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, 'matplotlib', None)
    with pytest.raises(UsageError) as refusal:
        save_plot(tmp_path / 'plan.svg', [preview(SQUARE)])
    assert str(refusal.value) == (
        'a plot needs matplotlib: pip install matplotlib, or sudo apt install python3-matplotlib')
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize('motion', [SQUARE, LESSON, EIGHT, BACK, SPIN], ids=lambda m: m.name)
def test_every_step_is_drawn(matplotlib, motion):
    one = preview(motion)
    figure = draw_plans([one])
    [path], [headings], [robots] = (
        data_of(figure, 'path'), marked(figure, 'headings'), marked(figure, 'robots'))
    ticks = [segment.tolist() for segment in headings.get_segments()]
    assert len(ticks) == len(robots.get_paths())
    for stage in one.plan.steps:
        end = (stage.pose.x, stage.pose.y)
        assert any(point == pytest.approx(end, abs=1e-3) for point in path)
        nose = (end[0] + 0.25 * math.cos(stage.pose.theta),
                end[1] + 0.25 * math.sin(stage.pose.theta))
        assert any(tick[0] == pytest.approx(end, abs=2e-3)
                   and tick[1] == pytest.approx(nose, abs=5e-3) for tick in ticks)
    assert data_of(figure, 'start') == [[(0.0, 0.0)]]
    assert data_of(figure, 'end') == [[pytest.approx((one.plan.pose.x, one.plan.pose.y))]]


@pytest.mark.parametrize('motion, footprint', [
    (SQUARE, BOX), (BACK, BOX), (SPIN, DISC), (EIGHT, None)], ids=lambda part: repr(part)[:25])
def test_the_floor_of_the_table_is_drawn_and_told(matplotlib, motion, footprint):
    one = preview(motion, footprint=footprint)
    figure = draw_plans([one])
    (floor,) = marked(figure, 'floor')
    left, bottom, width, height = floor.get_bbox().bounds
    for robots in marked(figure, 'robots'):
        for x, y in (corner for path in robots.get_paths() for corner in path.vertices):
            assert left - 1e-9 <= x <= left + width + 1e-9
            assert bottom - 1e-9 <= y <= bottom + height + 1e-9
    (told,) = (text for text in (text.get_text() for text in figure.texts) if 'needs' in text)
    size = re.search(r'needs (\S+) m x (\S+) m', told)
    assert [float(number) for number in size.groups()] == pytest.approx(
        [width + 0.005, height + 0.005], abs=0.0051), 'rounded up to a centimetre'
    assert f'Floor: {size[0].removeprefix("needs ")}, ' in plan_table([one])
    assert ('and the robot' in told) == (footprint is None)
    (left, right), (bottom, top) = figure.axes[0].get_xlim(), figure.axes[0].get_ylim()
    assert left < floor.get_x() < floor.get_x() + width < right
    assert bottom < floor.get_y() < floor.get_y() + height < top


def test_velocities_are_drawn_as_they_are_held(matplotlib):
    """Half a metre at 0.25 m/s, then a quarter turn at 1 rad/s, four times."""
    figure = draw_plans([preview(SQUARE, ABRUPT)])
    linear, angular = marked(figure, 'sent')
    assert linear.get_drawstyle() == angular.get_drawstyle() == 'steps-post'
    side, turn = 2.0, math.pi / 2.0
    starts = [number * (side + turn) for number in range(4)]
    expected = [(time, value) for start in starts
                for time, value in ((start, 0.25), (start + side, 0.0))]
    assert list(zip(*linear.get_data()))[1:-1] == [
        pytest.approx(corner) for corner in expected]
    assert max(angular.get_ydata()) == 1.0
    assert angular.get_ydata()[-1] == linear.get_ydata()[-1] == 0.0


@pytest.mark.parametrize('motion, limits, expected, far', [
    (SQUARE, GENTLE, [0.3, 1.57], []),
    (LESSON, GENTLE, [0.3, 1.57, -1.57], []),
    (BACK, Limits(0.3, 0.9, max_backward_velocity=0.1), [-0.1, -0.9], []),
    (Motion('', [Forward(1.0, 0.1)]), Limits(math.inf, math.inf), [], []),
    (Motion('', [Forward(1.0, 0.1)]), Limits(2.0, math.inf), [], ['far above: limit 2 m/s']),
])
def test_limits_are_dashed_where_they_matter(matplotlib, motion, limits, expected, far):
    figure = draw_plans([preview(motion, limits)])
    lines = marked(figure, 'limit')
    assert all(line.get_linestyle() == '--' for line in lines)
    assert [line.get_ydata()[0] for line in lines] == expected
    texts = [text.get_text() for axes in figure.axes[1:] for text in axes.texts]
    units = ['m/s' if abs(value) < 0.5 else 'rad/s' for value in expected]
    assert texts == [f'limit {value:g} {unit}' for value, unit in zip(expected, units)] + far


#: What is drawn, by its name; planned when it is used.
SHOWN = {
    'square': lambda: [preview(SQUARE)],
    'three': lambda: [preview(SQUARE), preview(EIGHT), preview(LESSON)],
    'spin': lambda: [preview(SPIN, footprint=None)],
    'empty': lambda: [preview(EMPTY)],
    'nowhere': lambda: [preview(EMPTY, Limits(math.inf, math.inf), footprint=None)],
    'back': lambda: [preview(BACK, Limits(30.0, 1.57, max_backward_velocity=0.2), footprint=DISC)],
    'far': lambda: [
        preview(Motion('f' * 200, [Forward(-12345.678)]), Limits(0.3, 1e-6), robot='r' * 90)],
    'hour': lambda: [preview(HOUR)],
}


@pytest.mark.slow
@pytest.mark.parametrize('previews', SHOWN.values(), ids=SHOWN)
def test_no_text_is_clipped_or_overlaps(matplotlib, previews):
    figure = draw_plans(previews())
    figure.canvas.draw()
    renderer = figure.canvas.get_renderer()
    texts = words(figure)
    boxes = [text.get_window_extent(renderer) for text in texts]
    assert len(texts) > 15
    for text, box in zip(texts, boxes):
        assert 0.0 <= box.x0 < box.x1 <= figure.bbox.x1, text
        assert 0.0 <= box.y0 < box.y1 <= figure.bbox.y1, text
    for (one, first), (two, second) in combinations(zip(texts, boxes), 2):
        assert not first.overlaps(second), (one, two)
    # The legend is beside the pictures, not in them.
    key = figure.legends[0].get_window_extent(renderer)
    assert not any(key.overlaps(axes.get_window_extent()) for axes in figure.axes)


def words(figure):
    """Return all texts that can be seen: no numbers beyond the end of their axis."""
    texts = [*figure.texts, *figure.legends[0].get_texts()]
    for axes in figure.axes:
        texts += axes.texts
        for axis, view in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
            texts += [axis.label, *(
                tick.label1 for tick in axis.get_major_ticks()
                if view[0] <= tick.get_loc() <= view[1] and tick.label1.get_visible())]
    return [text for text in texts if text.get_text()]


@pytest.mark.parametrize('ending', ['png', 'svg', 'pdf'])
def test_two_runs_give_the_same_bytes(tmp_path, matplotlib, ending):
    files = [tmp_path / f'{number}.{ending}' for number in range(2)]
    for file in files:
        save_plot(file, [preview(SQUARE), preview(EIGHT)])
    one, two = (file.read_bytes() for file in files)
    assert one == two
    assert one.startswith({'png': b'\x89PNG', 'svg': b'<?xml', 'pdf': b'%PDF'}[ending])
    assert b'Matplotlib' not in one
