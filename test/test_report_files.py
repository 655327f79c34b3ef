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
"""The files of a report: what they say, for every ending, and that they are always there."""

from dataclasses import replace
from itertools import pairwise
import json
import math
import re
import sys
import time

from drives import (
    done,
    ended_on_request,
    faulted,
    HELD_UP,
    hour,
    killed,
    lesson,
    never_began,
    NOBODY,
    stopped,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from kachaka_simple_control.motion.kinematics import ORIGIN, Pose, Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Motion, Move, Turn
from kachaka_simple_control.report.events import Answered, Began, Closed, Ended, Planned, Sent
from kachaka_simple_control.report.frames import apart, composed, seen_from
from kachaka_simple_control.report.naive import EXTRA, naive
from kachaka_simple_control.report.page.page import page
from kachaka_simple_control.report.pictures.period_picture import histogram
from kachaka_simple_control.report.quantiles import Quantiles, quantiles
from kachaka_simple_control.report.reckoning import Reckoning
from kachaka_simple_control.report.record import Record
from kachaka_simple_control.report.report import write_report
from kachaka_simple_control.report.run_json import fields, run_json
from kachaka_simple_control.report.summary import Summary
from kachaka_simple_control.report.thinning import bands, straightened
from kachaka_simple_control.report.timing import due_times, timing
from kachaka_simple_control.report.verdict import Ending, verdict
from plans import EMPTY, LESSON, SQUARE
import pytest
from rehearsal import EPOCH, Rehearsal
from strategies import MOTIONS, UNHURRIED

LIMITS = Limits(1.0, 2.0)
SECOND = Motion('second', [Move(0.1, 0.0, 1.0)])
EVIL = '<script>alert("x")</script>&$x_1$\x00'


def drawn():
    """Skip a test where there is nothing to draw with."""
    pytest.importorskip('matplotlib', reason='pictures need matplotlib')


@pytest.mark.parametrize(('drive', 'ending', 'headline', 'says'), [
    (done, Ending.DONE, 'Done', 'Its motion was driven to its end, all 8 steps.'),
    (lesson, Ending.DONE, 'Done', '7 motions were driven to their end, 7 steps in all.'),
    (stopped, Ending.STOPPED, 'Stopped by SIGINT',
     'The motion ended in step 3 of 8, 5.03 s after its t = 0, of 17.58 s.'),
    (faulted, Ending.FAULTED, 'Faulted',
     HELD_UP[1:] + '. The motion ended in step 3 of 8, 6.40 s'),
    (ended_on_request, Ending.STOPPED, 'Stopped on request',
     'The movement was ended by stop_robot(). The motion ended in step 3 of 8, 5.03 s'),
    (killed, Ending.KILLED, 'Killed', 'The motion ended in step 3 of 8, 4.99 s'),
    (never_began, Ending.NEVER_BEGAN, 'Never began', NOBODY[1:] + '.'),
    (Record, Ending.KILLED, 'Killed', 'No motion had begun.'),
])
def test_the_verdict_says_how_it_ended_and_why(drive, ending, headline, says):
    found = verdict(drive())
    assert (found.ending, found.headline) == (ending, headline)
    assert says in found.why


@pytest.mark.parametrize(('signum', 'name'), [
    (1, 'SIGHUP'), (2, 'SIGINT'), (15, 'SIGTERM'), (99, 'signal 99')])
def test_each_signal_is_named(signum, name):
    record = stopped(signum, name)
    assert verdict(record).headline == f'Stopped by {name}'
    assert fields(Summary(record), None)['verdict']['signal'] == name


def test_a_fault_before_the_signal_is_told_too():
    """Standing by, a program goes on after a motion that came to nothing."""
    rehearsal = Rehearsal(20.0)
    rehearsal.drive(SQUARE, 6.4, HELD_UP)
    rehearsal.drive(SECOND)
    found = verdict(rehearsal.close(signal=2))
    assert found.ending is Ending.STOPPED
    assert HELD_UP[1:] in found.why
    assert 'of 2 motions 1 were driven to their end' in found.why


def test_an_error_after_the_last_motion_is_a_fault():
    rehearsal = Rehearsal()
    rehearsal.drive(SECOND)
    found = verdict(rehearsal.close(error='the disk is full'))
    assert found.ending is Ending.FAULTED
    assert found.why == 'The disk is full. Its motion was driven to its end, 1 step.'


def test_run_json_has_the_figures_of_the_record(tmp_path):
    record = done()
    write_report(record, tmp_path, None)
    told = json.loads((tmp_path / 'run.json').read_text())
    (motion,) = record.motions
    own = motion.own_messages
    assert told['format'] == 1
    assert told['verdict']['ending'] == 'done'
    assert told['duration'] == {
        'planned_s': pytest.approx(motion.plan.duration),
        'driven_s': pytest.approx(own[-1].time - own[0].time)}
    assert told['timing']['due'] == len(own) - 1
    assert told['timing']['late'] == told['timing']['lost'] == 0
    assert [step['step'] for step in told['steps']] == ['forward 0.5 m', 'turn 90 deg'] * 4
    assert [step['requested']['distance_m'] for step in told['steps']] == [0.5, 0.0] * 4
    assert all(step['messages'] == len(movement.sent) - 1
               for step, movement in zip(told['steps'], record.movements))
    # The robot's gains are 0.985 and 1.012.
    for step in told['steps'][::2]:
        assert step['odometry']['distance_m'] == pytest.approx(0.5 * 0.985, abs=0.003)
        assert step['error']['distance_m'] == pytest.approx(-0.0075, abs=0.003)
    for step in told['steps'][1::2]:
        assert step['odometry']['angle_rad'] == pytest.approx(math.pi / 2 * 1.012, abs=0.01)
    first, last = record.odometry[0].pose, record.odometry[-1].pose
    seen, end = seen_from(first, last), told['end']['odometry']
    assert (end['x_m'], end['y_m']) == pytest.approx((seen.x, seen.y), abs=1e-3)
    assert math.remainder(end['heading_rad'] - seen.theta, math.tau) == pytest.approx(0, abs=1e-3)
    assert told['end']['odometry_from_planned']['distance_m'] == pytest.approx(
        math.hypot(end['x_m'] - told['end']['planned']['x_m'],
                   end['y_m'] - told['end']['planned']['y_m']), abs=1e-6)
    assert told['stop'] == {'confirmed_after_s': 0.12}
    assert told['recording'] == {'is_whole': True, 'why_not': None}
    assert told['settings']['guardian'] is True
    assert told['limits']['max_linear_velocity'] == 0.3
    assert told['limits']['max_backward_velocity'] is None
    assert told['began'].startswith('2026-11-21T')
    assert EPOCH < motion.began + EPOCH


def test_the_lesson_is_one_chain():
    told = fields(Summary(lesson()), None)
    starts = [step['start_s'] for step in told['steps']]
    assert starts[0] == 0.0
    assert starts == sorted(starts)
    assert starts[-1] == pytest.approx(8.0, abs=0.05)
    end = told['end']
    assert end['planned'] == {
        'x_m': pytest.approx(0.1), 'y_m': pytest.approx(0.0),
        'heading_rad': pytest.approx(0.0, abs=1e-9)}
    assert end['odometry']['x_m'] == pytest.approx(0.0985, abs=0.001)
    assert [motion['name'] for motion in told['motions']] == ['move_robot'] * 7


def test_odometry_is_laid_onto_the_start_wherever_its_frame_is():
    record = done()
    plain = Summary(record).path.odometry[-1].pose
    elsewhere = Pose(3.0, -2.0, 2.5)
    record.odometry = [
        replace(answer, pose=composed(elsewhere, answer.pose)) for answer in record.odometry]
    moved = Summary(record).path.odometry[-1].pose
    assert (moved.x, moved.y, moved.theta) == pytest.approx((plain.x, plain.y, plain.theta))


def test_after_a_motion_cut_short_the_next_plan_begins_where_the_messages_led():
    rehearsal = Rehearsal(20.0)
    rehearsal.drive(SQUARE, 2.6, HELD_UP)
    rehearsal.drive(SECOND)
    first, second = Summary(rehearsal.close()).path.starts
    assert first.pose == ORIGIN
    assert second.pose.x == pytest.approx(0.5, abs=0.001)
    assert second.pose.y == pytest.approx(0.0, abs=0.001)


def sent_at(*times, motion=SECOND, reason=None):
    """Return a motion at 10 Hz of which messages were sent at these times, and its end."""
    record = Record()
    record.hear(Planned(motion, LIMITS, 10.0))
    record.hear(Began(100.0))
    for moment in times:
        record.hear(Sent(100.0 + moment, Velocity(0.1, 0.0)))
    record.hear(Sent(101.0 if reason is None else 100.0 + max(times) + 0.5, ZERO))
    record.hear(Ended(101.1, reason))
    return record.motions


def test_messages_on_time_are_neither_late_nor_lost():
    found = timing(sent_at(*(number / 10 for number in range(10))))
    assert (found.due, found.late, found.lost) == (10, 0, 0)
    assert found.jitter.worst == pytest.approx(0.0, abs=1e-9)
    assert found.periods == (0.1,)


def test_late_and_lost_are_counted_as_the_benchmarks_do():
    """A quarter of a period is late; more than a half, and the tick is lost."""
    found = timing(sent_at(0.0, 0.1, 0.224, 0.326, 0.445, 0.6, 0.7, 0.8, 0.9))
    assert (found.due, found.late, found.lost) == (10, 2, 1)
    assert found.lateness.worst == pytest.approx(0.045)
    assert max(found.uneven) == pytest.approx(0.055)


def test_what_the_stop_came_before_was_not_lost():
    found = timing(sent_at(0.0, 0.1, 0.2, reason='held up'))
    # The zero came at 0.7 s: what was due at 0.3 to 0.6 s is lost.
    assert (found.due, found.late, found.lost) == (7, 0, 4)


@given(MOTIONS, st.sampled_from([5.0, 20.0, 37.0]))
@UNHURRIED
def test_the_times_at_which_messages_are_due_are_the_players(motion, rate):
    from kachaka_simple_control.execution.player import Player
    planned = plan(motion, Limits(5.0, 10.0), rate)
    player, now, asked = Player(planned), 0.0, []
    while (due := player.due(now)) is not None:
        asked.append(now)
        now = due.deadline
    assert due_times(planned, math.inf) == pytest.approx(asked)


def test_the_loop_of_the_lesson_holds_a_second_too_long():
    """At 10 Hz ten turns take 1.008 s; at 100 Hz 93 turns fill the second."""
    for rate, turns in ((10.0, 10), (100.0, 93)):
        found = naive([plan(SECOND, LIMITS, rate)])
        assert found.longer == pytest.approx(turns * (1.0 / rate + EXTRA) - 1.0)
        assert found.missing == rate - turns
        assert found.distance == pytest.approx(0.1 * found.longer)


def test_the_loop_of_the_lesson_turns_too_far():
    found = naive([plan(Motion('turn', [Move(0.0, 0.5, 2.0)]), LIMITS, 10.0)])
    assert found.angle == pytest.approx(0.5 * 20 * EXTRA)
    assert naive([plan(LESSON, LIMITS, 10.0)]).longer == pytest.approx(90 * EXTRA)


POSES = st.builds(Pose, st.floats(-9, 9), st.floats(-9, 9), st.floats(-3, 3))


@given(POSES, POSES)
def test_a_pose_seen_from_another_and_back(frame, pose):
    distance, angle = apart(composed(frame, seen_from(frame, pose)), pose)
    assert distance == pytest.approx(0.0, abs=1e-9)
    assert angle == pytest.approx(0.0, abs=1e-9)


def test_a_receiver_keeps_a_velocity_for_its_hold_at_most():
    way = Reckoning([Sent(1.0, Velocity(0.2, 0.0)), Sent(3.0, Velocity(0.2, 0.0))], 0.3)
    assert way.at(0.0) == ORIGIN
    assert way.at(1.1).x == pytest.approx(0.02)
    assert way.at(2.9).x == pytest.approx(0.06)
    assert way.end.x == pytest.approx(0.12)


POINTS = st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=1, max_size=60)


@given(POINTS, st.floats(0.01, 1.0))
def test_a_straightened_path_passes_all_its_points(points, grain):
    kept = straightened(points, grain, 1000)
    assert kept[0] == points[0]
    assert kept[-1] == points[-1]
    for point in points:
        away = min((beside(point, one, two) for one, two in pairwise(kept)),
                   default=math.dist(point, kept[0]))
        assert away <= 2.0 * grain + 1e-9


def beside(point, one, two):
    """Return how far a point is from the line between two others."""
    length = math.dist(one, two)
    along = 0.0 if length == 0.0 else sum(
        (p - a) * (b - a) for p, a, b in zip(point, one, two)) / length ** 2
    along = min(1.0, max(0.0, along))
    return math.dist(point, [a + along * (b - a) for a, b in zip(one, two)])


def test_a_straight_path_keeps_its_ends_and_turning_points():
    there = [(0.01 * number, 0.0) for number in range(101)]
    assert straightened(there + there[::-1], 0.001, 1000) == [
        (0.0, 0.0), (pytest.approx(1.0), 0.0), (0.0, 0.0)]
    assert len(straightened([(math.cos(a), math.sin(a)) for a in range(999)], 1e-6, 100)) <= 100


@given(st.lists(st.tuples(st.floats(0, 10), st.floats(-1, 1)), min_size=1, max_size=80))
def test_bands_hold_every_value(corners):
    corners.sort()
    found = bands(corners, 10.1, 7)
    for moment, value in corners:
        (band,) = (band for band in found if band.begin <= moment < band.begin + 10.1 / 7 - 1e-12
                   or math.isclose(band.begin, moment)) if len(found) == 1 else (
            max((band for band in found if band.begin <= moment), key=lambda band: band.begin),)
        assert band.lowest <= value <= band.highest


def test_a_value_lasts_into_the_bands_after_it():
    assert bands([(0.0, 1.0), (2.5, 0.0)], 4.0, 4) == [
        (0.0, 1.0, 1.0), (1.0, 1.0, 1.0), (2.0, 0.0, 1.0)]


@given(st.lists(st.floats(-50, 50), max_size=50))
def test_the_histogram_counts_everything(values):
    reach, counts = histogram(values)
    assert sum(counts) == len(values)
    assert reach >= max(map(abs, values), default=0.0)
    assert len(counts) % 2 == 1


def test_quantiles_lie_between_the_two_nearest_values():
    assert quantiles([]) is None
    assert quantiles([3.0]) == Quantiles(3.0, 3.0, 3.0)
    assert quantiles([float(number) for number in range(1, 1001)]) == Quantiles(
        500.5, pytest.approx(990.01), 1000)


@pytest.mark.parametrize('drive', [done, lesson, stopped, faulted, killed, never_began])
def test_every_ending_leaves_its_files(drive, tmp_path):
    drawn()
    write_report(drive(), tmp_path, None)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        'path.png', 'report.html', 'run.json']
    text = (tmp_path / 'report.html').read_text()
    assert verdict(drive()).headline in text
    assert 'There are no pictures' not in text
    assert text.count('<figure') >= 2
    assert (tmp_path / 'path.png').read_bytes().startswith(b'\x89PNG')


def test_the_page_refers_to_nothing_outside(tmp_path):
    drawn()
    write_report(done(), tmp_path, None)
    text = (tmp_path / 'report.html').read_text()
    assert 'http' not in text.replace('http-equiv', '')
    assert '<script' not in text
    assert not re.search(r'@import|url\((?!#)', text)
    assert re.findall(r'(?:href|src)="(?!#)([^"]*)"', text) == ['data:,']
    ids = re.findall(r'\bid="([^"]*)"', text)
    assert len(ids) == len(set(ids))
    # What is referred to within the page is there.
    assert set(re.findall(r'(?:href="|url\()#([^")]*)', text)) <= set(ids)


def test_the_same_drive_leaves_the_same_bytes(tmp_path):
    drawn()
    found = []
    for name in 'ab':
        (tmp_path / name).mkdir()
        write_report(done(), tmp_path / name, None)
        found.append([path.read_bytes() for path in sorted((tmp_path / name).iterdir())])
    assert found[0] == found[1]


def test_without_matplotlib_the_page_says_so(tmp_path, monkeypatch):
    (tmp_path / 'path.png').write_bytes(b'of the drive before')
    monkeypatch.setitem(sys.modules, 'matplotlib', None)
    write_report(done(), tmp_path, None)
    text = (tmp_path / 'report.html').read_text()
    assert 'There are no pictures: a plot needs matplotlib: pip install matplotlib' in text
    assert '<figure' not in text
    assert 'forward 0.5 m' in text
    assert sorted(path.name for path in tmp_path.iterdir()) == ['report.html', 'run.json']


def test_a_picture_that_fails_does_not_cost_the_page(tmp_path, monkeypatch):
    drawn()
    monkeypatch.setattr(
        'kachaka_simple_control.report.pictures.drive_pictures.draw_drive_path', lambda *_: 1 / 0)
    write_report(done(), tmp_path, None)
    assert 'drawing them failed (ZeroDivisionError' in (tmp_path / 'report.html').read_text()
    assert json.loads((tmp_path / 'run.json').read_text())['verdict']['ending'] == 'done'


def test_a_folder_that_cannot_be_written_to_is_an_os_error(tmp_path):
    with pytest.raises(OSError, match='nowhere'):
        write_report(done(), tmp_path / 'nowhere', None)


def test_why_there_is_no_recording_is_told():
    summary = Summary(done())
    assert 'run.mcap</code>, the recording.' in page(summary, {}, None, None)
    why = 'It needs mcap-ros2-support: pip install <it>.'
    assert 'pip install &lt;it&gt;.' in page(summary, {}, None, why)
    assert json.loads(run_json(summary, why))['recording'] == {'is_whole': False, 'why_not': why}


def test_what_comes_from_outside_is_escaped(tmp_path):
    rehearsal = Rehearsal(title=EVIL)
    rehearsal.tell(replace(
        rehearsal.record.opened, robot=EVIL, settings={EVIL: EVIL}, versions={EVIL: EVIL},
        velocity_topic=EVIL, odometry_topic=EVIL))
    rehearsal.drive(replace(SECOND, name=EVIL))
    rehearsal.drive(replace(SECOND, name='other'), 0.5, EVIL)
    write_report(rehearsal.close(error=EVIL), tmp_path, EVIL)
    text = (tmp_path / 'report.html').read_text()
    assert '<script' not in text
    assert text.count('&lt;script&gt;') >= 10
    assert json.loads((tmp_path / 'run.json').read_text())['title'] == EVIL


def headings(record):
    """Return the headings in the table of where a drive ended [degrees]."""
    text = page(Summary(record), {}, None, None)
    rows = re.findall(r'"row">(?:planned|sent|odometry)</th>(?:<td class="n">([^<]*)</td>)'
                      r'(?:<td class="n">([^<]*)</td>)(?:<td class="n">([^<]*)</td>)', text)
    return [float(heading) for _, _, heading in rows]


def test_headings_tell_where_it_looks_and_not_how_often_it_turned():
    assert headings(done()) == [0.0, pytest.approx(0.0, abs=0.1), pytest.approx(4.3, abs=0.1)]
    assert headings(stopped()) == [0.0, pytest.approx(90.0, abs=0.1), pytest.approx(91.1, abs=0.1)]
    half = Motion('half', [Turn(3.14)])
    rehearsal = Rehearsal(20.0)
    rehearsal.drive(half)
    planned, _, odometry = headings(rehearsal.close())
    assert planned == pytest.approx(179.9, abs=0.1)
    assert odometry == pytest.approx(182.1, abs=0.2)


def test_of_very_many_steps_the_first_and_the_last_are_shown(tmp_path):
    rehearsal = Rehearsal(10.0, odometry_period=0.2)
    rehearsal.drive(Motion('many', [Move(0.1, 0.0, 0.1), Turn(0.0)] * 200))
    record = rehearsal.close()
    text = page(Summary(record), {}, None, None)
    assert '<td class="n">150</td>' in text
    assert '<td class="n">151</td>' not in text
    assert '100 steps left out here' in text
    assert '<td class="n">400</td>' in text
    assert len(fields(Summary(record), None)['steps']) == 400


@pytest.mark.slow
def test_an_hour_is_reported_small_and_soon(tmp_path):
    drawn()
    record = hour()
    assert len(record.sent) >= 180_000
    assert len(record.odometry) >= 72_000
    begin = time.process_time()
    write_report(record, tmp_path, None)
    # The bar is 5 s; docs/report.md says what was measured.  This machine may be any.
    assert time.process_time() - begin < 20.0
    assert (tmp_path / 'report.html').stat().st_size < 2_000_000


TIMES = st.floats(99.0, 104.0)
VELOCITIES = st.builds(Velocity, st.floats(-0.3, 0.3), st.floats(-1.5, 1.5)) | st.just(ZERO)
ODD = st.floats() | st.floats(-2.0, 2.0)
EVENTS = st.one_of(
    st.builds(Planned, st.sampled_from([SECOND, LESSON, EMPTY]), st.just(LIMITS), st.just(10.0)),
    st.builds(Began, TIMES),
    st.builds(Sent, TIMES, VELOCITIES), st.builds(Sent, TIMES, VELOCITIES),
    st.builds(Answered, TIMES, st.builds(Pose, ODD, ODD, ODD), st.builds(Velocity, ODD, ODD)),
    st.builds(Ended, TIMES, st.none() | st.text()),
    st.builds(Closed, TIMES, st.none() | ODD, st.none() | st.integers(-1, 99),
              st.none() | st.text()))


@given(st.lists(EVENTS, max_size=40))
@UNHURRIED
def test_whatever_happened_there_is_a_report(events):
    """Even what cannot happen, as messages back in time."""
    record = Record()
    for event in events:
        # Before the first plan nothing but odometry comes.
        if record.motions or isinstance(event, (Planned, Answered, Closed)):
            record.hear(event)
    summary = Summary(record)
    assert json.loads(run_json(summary, None))['verdict']['headline'] == summary.verdict.headline
    assert '</html>' in page(summary, {}, 'not now', None)


@given(st.lists(EVENTS, max_size=30))
@settings(deadline=None, max_examples=20)
def test_whatever_happened_there_are_pictures(events):
    drawn()
    from kachaka_simple_control.report.pictures.drive_pictures import draw_pictures
    record = Record()
    record.hear(Planned(SECOND, LIMITS, 10.0))
    for event in events:
        record.hear(event)
    assert 'velocities' in draw_pictures(Summary(record)).svg
