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
"""The table of a plan."""

import math
import re

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.control.tick_scheduler import TickScheduler
from kachaka_simple_control.motion.geometry import Disc
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.steps import Arc, Forward, Motion, Move, Repeat, Turn, Wait
from kachaka_simple_control.report.text_tables import fold, Gap, plan_table
from plans import ABRUPT, BOX, EMPTY, HOUR, LESSON, preview, SPIN, SQUARE, SQUARE_CW
import pytest
from strategies import LIMITS, MOTIONS, RATES


def lines_of(*previews):
    """Return the lines of a table."""
    return plan_table(previews).splitlines()


def cells(line):
    """Return the words of a line."""
    return line.split()


def test_square_has_the_figures_of_elementary_geometry():
    """Half a metre at 0.25 m/s is 2 s, a quarter turn at 1 rad/s is pi / 2 s."""
    lines = lines_of(preview(SQUARE, ABRUPT))
    assert lines[0] == 'square on kachaka at 20 Hz'
    assert cells(lines[2]) == [
        'step', 'start', 'takes', 'length', 'x', 'y', 'heading', 'linear', 'angular']
    assert cells(lines[3]) == [
        '[s]', '[s]', '[m]', '[m]', '[m]', '[deg]', '[m/s]', '[rad/s]']
    corners = [(0.5, 0.0), (0.5, 0.5), (0.0, 0.5), (0.0, 0.0)]
    side, turn = 2.0, math.pi / 2.0
    for number, (x, y) in enumerate(corners):
        start = number * (side + turn)
        heading = 90.0 * number
        assert cells(lines[5 + 2 * number]) == [
            str(2 * number + 1), 'forward', '0.5', 'm', str(number + 1), 'of', '4', f'{start:.3f}',
            '2.000', '0.500', f'{x:.3f}', f'{y:.3f}', f'{heading:.1f}', '0.250', '0.000']
        assert cells(lines[6 + 2 * number]) == [
            str(2 * number + 2), 'turn', '90', 'deg', str(number + 1), 'of', '4',
            f'{start + side:.3f}', '1.571', '0.000', f'{x:.3f}', f'{y:.3f}',
            f'{heading + 90.0:.1f}', '0.000', '1.000']
    assert cells(lines[14]) == [
        '8', 'steps', f'{4 * (side + turn):.3f}', '2.000', '0.000', '0.000', '360.0', '0.250',
        '1.000']


def test_messages_and_limits_are_below_the_table():
    limits = Limits(0.3, 1.57, 0.5, 2.5, max_backward_velocity=0.1, max_linear_deceleration=1.0)
    lines = lines_of(preview(LESSON, limits, rate=10.0))
    assert 'Sent: 90 velocities, 100 ms apart or less, then the stop' in lines
    assert 'Limits: 0.3 m/s, 0.1 m/s backwards, 1 m/s^2 braking, 0.5 m/s^2' not in lines
    assert 'Limits: 0.3 m/s, 0.1 m/s backwards, 0.5 m/s^2, 1 m/s^2 braking' in lines
    assert '        1.57 rad/s, 2.5 rad/s^2' in lines
    assert lines[-1].startswith('Poses: at the end')


@pytest.mark.parametrize('motion, footprint, width, depth', [
    # BOX is 0.4 m long, 0.2 m wide, and 0.25 m of it are ahead of the axle.
    (EMPTY, BOX, 0.4, 0.2),
    (Motion('ahead', [Forward(1.0)]), BOX, 1.4, 0.2),
    (Motion('ahead', [Forward(1.0)]), None, 1.0, 0.0),
    (SPIN, BOX, 2 * math.hypot(0.25, 0.1), 2 * math.hypot(0.25, 0.1)),
    (SPIN, Disc(0.2), 0.4, 0.4),
    (Motion('half', [Arc(0.5, math.pi)]), None, 0.5, 1.0),
])
def test_the_floor_is_what_path_and_outline_need(motion, footprint, width, depth):
    view = preview(motion, footprint=footprint)
    assert view.floor[2:] == pytest.approx((width, depth), abs=0.002)
    (line,) = (line for line in lines_of(view) if line.startswith('Floor: '))
    assert float(line.split()[1]) == pytest.approx(width + 0.005, abs=0.0051)
    assert ('not known' in line) == (footprint is None)


def test_repeated_steps_of_a_long_motion_are_shown_twice():
    lines = lines_of(preview(HOUR, ABRUPT))
    assert len(lines) < 20
    assert cells(lines[5])[:7] == ['1', 'forward', '0.5', 'm', '1', 'of', '1000']
    assert cells(lines[6])[:7] == ['2', 'turn', '90', 'deg', '1', 'of', '1000']
    # A thousand sides of 2 s and turns of pi / 2 s, but for the first of each and the last.
    assert lines[7] == '... 1996 steps, from 3.571 s to 3567.2 s, as above ...'
    assert cells(lines[8])[:7] == ['1999', 'forward', '0.5', 'm', '1000', 'of', '1000']
    assert cells(lines[9])[:7] == ['2000', 'turn', '90', 'deg', '1000', 'of', '1000']


def test_a_long_motion_without_repeats_is_cut_in_the_middle():
    motion = Motion('long', [Move(0.1, 0.0, 1.0)] * 300)
    lines = lines_of(preview(motion))
    assert len(lines) <= 60
    assert '... 262 steps, from 19.000 s to 281.000 s ...' in lines
    numbers = [int(cells(line)[0]) for line in lines if 'move' in line]
    assert numbers == [*range(1, 20), *range(282, 301)]


@given(st.lists(st.sampled_from('abcd') | st.integers(0, 99), max_size=60), st.integers(5, 40))
def test_a_folded_table_accounts_for_every_step(keys, most):
    entries = fold(keys, most)
    assert len(entries) <= max(most, len(set(keys))), 'it has at most so many lines'
    if len(keys) <= most:
        assert entries == list(range(len(keys))), 'a short one shows all'
    covered = []
    for entry in entries:
        if isinstance(entry, Gap):
            above = {keys[index] for index in entries[:entries.index(entry)]
                     if not isinstance(index, Gap)}
            inside = range(entry.before + 1, entry.after)
            assert entry.again == all(keys[index] in above for index in inside)
            covered += inside
        else:
            covered.append(entry)
    assert covered == list(range(len(keys))), 'each is shown or in a gap, in order'


def test_two_motions_are_shown_in_steps_and_side_by_side():
    lines = lines_of(preview(SQUARE, ABRUPT), preview(SQUARE_CW, ABRUPT))
    assert len(lines) <= 60
    assert 'square on kachaka at 20 Hz' in lines
    assert 'square_cw on kachaka at 20 Hz' in lines
    assert sum('of 4' in line for line in lines) == 16
    place = lines.index('2 motions on kachaka at 20 Hz')
    assert [cells(line) for line in lines[place + 5:place + 7]] == [
        ['square', '8', '14.283', '2.000', '0.000', '0.000', '360.0', '0.250', '1.000', '288'],
        ['square_cw', '8', '14.283', '2.000', '0.000', '0.000', '-360.0', '0.250', '1.000',
         '288']]


@pytest.mark.parametrize('step, words', [
    (Forward(0.5), 'forward 0.5 m'),
    (Forward(-0.5, 0.1), 'forward -0.5 m'),
    (Turn(math.pi / 2.0), 'turn 90 deg'),
    (Turn(-1.0), 'turn -57.296 deg'),
    (Arc(-0.3, math.pi), 'arc -0.3 m, 180 deg'),
    (Wait(2), 'wait 2 s'),
    (Move(0.1, -0.0, 3.0), 'move 0.1 m/s, 0 rad/s'),
    (Repeat(4, [Wait(1.0)]), 'repeat 4 times'),
])
def test_steps_in_words(step, words):
    assert step.describe() == words


def wide(text):
    """Return how many columns a text takes: Japanese letters take two."""
    return sum(2 if '　' <= letter <= '￠' else 1 for letter in text)


@given(MOTIONS, LIMITS, RATES)
def test_any_table_fits_a_terminal(motion, limits, rate):
    for count in (1, 2, 7):
        lines = lines_of(*[preview(motion, limits, rate)] * count)
        assert max(map(len, lines)) <= 99
        assert len(lines) <= 60
        assert not re.search(r'-0\.0+(?![0-9.])', ' '.join(lines))


@pytest.mark.parametrize('widest, head', [
    (None, 'step start takes length x y heading linear angular'),
    (200, 'step start takes length x y heading linear angular'),
    (60, 'step takes length x y heading'), (40, 'step takes x y')])
def test_a_narrow_terminal_gets_fewer_columns(widest, head):
    """What it still says is whole; the velocities are not explained where they are left out."""
    for previews in ([preview(SQUARE)], [preview(HOUR)], [preview(SQUARE), preview(SPIN)]):
        lines = plan_table(previews, widest).splitlines()
        assert max(map(len, lines)) <= (widest or 99)
        text = ' '.join(lines)
        assert ('Velocities' in text) == ('linear' in text)
    lines = plan_table([preview(SQUARE)], widest).splitlines()
    assert lines[2].split() == head.split()
    assert '...' not in ' '.join(lines)
    assert ('linear' in head) == (lines == lines_of(preview(SQUARE)))


@given(MOTIONS, LIMITS, RATES)
def test_as_many_velocities_are_shown_as_are_sent(motion, limits, rate):
    one = preview(motion, limits, rate)
    scheduler = TickScheduler(one.plan)
    sent, now = 0, 0.0
    while sent < 3000 and (due := scheduler.due(now)) is not None:
        sent, now = sent + 1, due.deadline
    assert sent in (3000, one.messages)
