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
"""What reads a drive afterwards is right when it was paused, or driven at less speed."""

from itertools import pairwise
import math

from example_counts import examples
from hypothesis import example, given, settings
from hypothesis import strategies as st
from kachaka_simple_control.analysis.message_timing import timing
from kachaka_simple_control.analysis.summary import SpeedInterval, Summary
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.motion.steps import Forward, Motion, Move, Turn, Wait
from kachaka_simple_control.report.report_program import write_report
from kachaka_simple_control.report.text_tables import drive_table
from outcome_logs import done
import pytest
from simulated_drive import SimulatedDrive

#: Paths from rest to rest, velocities for a time, and rests, in all orders of two.
MIXED = Motion('mixed', [
    Forward(0.2), Turn(0.5), Move(0.1, 0.0, 0.7), Move(0.1, 0.4, 0.5), Wait(0.4), Wait(0.3),
    Move(-0.1, 0.0, 0.33), Forward(-0.1), Wait(0.2), Turn(-0.4)])
PAUSED, FULL = {'pause': 0.0}, {}
EXACT = SimulationParameters()
#: When the factor changes [s after the last change], and to what.
CHANGES = st.lists(
    st.tuples(st.floats(0.01, 1.5), st.sampled_from([0.0, 0.0, 1.0]) | st.floats(0.05, 1.0)),
    max_size=8)


def drive(factors, motion=MIXED, rate=20.0, until=math.inf, reason=None, **options):
    """Return the log of a drive whose speed factor changes."""
    simulated = SimulatedDrive(rate, **options)
    simulated.drive(motion, until, reason, factors=factors)
    return simulated.close() if reason or until == math.inf else simulated.drive_log


def on_time(number):
    """Return no lateness for any message."""
    del number
    return 0.0


def timed(changes):
    """Return changes with their times since t = 0; in the end the factor is 1."""
    time, factors = 0.0, []
    for after, factor in [*changes, (0.3, 1.0)]:
        factors.append((time, {'override': factor} if factor < 1.0 else FULL))
        time += after
    return [*factors, (time, FULL)]


@pytest.mark.parametrize(('factor', 'is_held'), [(0.0, True), (0.009, True), (0.01, False)])
def test_who_is_held_at_rest_is_paused_whatever_the_factor(factor, is_held):
    assert SpeedInterval(None, {'obstacle': factor}, 0.0, 1.0, 0.0, 0.0).is_pause is is_held


@pytest.mark.slow
@settings(max_examples=examples(20))
@given(CHANGES, st.sampled_from([5.0, 20.0, 50.0]))
@example([(3.0, 0.0), (2.0, 0.0)], 20.0)
def test_each_step_was_sent_what_it_asks_for(changes, rate):
    log = drive(timed(changes), rate=rate, lateness=on_time, odometry_period=None)
    (motion,) = log.motions
    results = Summary(log).steps
    assert len(results) == len(MIXED.steps)
    for result in results:
        assert result.log.is_complete
        assert result.sent.distance == pytest.approx(result.requested.distance, abs=1e-6)
        assert result.sent.angle == pytest.approx(result.requested.angle, abs=1e-6)
    for before, after in pairwise(motion.steps):
        assert before.sent[-1] is after.sent[0]
        assert before.began + before.driven_duration == pytest.approx(after.began, abs=1e-6)
    assert motion.own_messages[0].time == motion.began
    assert motion.own_messages[-1].time == motion.ended
    found = timing([motion])
    assert (found.late, found.lost) == (0, 0)
    assert found.due + found.unjudged == len(motion.own_messages) - 1


def test_odometry_of_each_step_is_its_own_after_a_pause():
    """One pause in the middle of a step, one across the end of another that does not rest."""
    log = drive([(0.5, PAUSED), (3.5, FULL), (5.62, PAUSED), (8.0, FULL)], parameters=EXACT)
    for result in Summary(log).steps:
        assert result.error.distance == pytest.approx(0.0, abs=0.004)
        assert result.error.angle == pytest.approx(0.0, abs=0.02)
    row = drive_table(log, 0.1).splitlines()[2]
    assert row.count('0.2000 m') >= 2


def test_a_motion_that_begins_paused_has_its_zeros_in_its_first_step():
    log = drive([(0.0, PAUSED), (2.0, FULL)])
    (motion,) = log.motions
    first = motion.steps[0]
    assert first.began == pytest.approx(motion.began)
    assert sum(message.velocity.is_zero for message in first.sent) >= 40
    assert Summary(log).speed[0].step is motion.plan.steps[0]
    found = timing([motion])
    assert (found.due, found.unjudged) == (0, len(motion.own_messages) - 1)


def test_timing_is_judged_up_to_the_first_delay():
    lateness = {15: 0.02}
    log = drive([(2.0, {'override': 0.5})], lateness=lambda number: lateness.get(number, 0.0))
    found = Summary(log).timing
    assert (found.due, found.late, found.lost) == (41, 1, 0)
    assert found.unjudged == len(log.motions[0].own_messages) - 1 - found.due


def test_planned_and_sent_lie_on_each_other_outside_of_the_brakes():
    pytest.importorskip('matplotlib', reason='needs matplotlib')
    from kachaka_simple_control.report.drive_plots import _velocity_lines
    from kachaka_simple_control.report.plot_style import LINEAR
    motion = Motion('straight', [Forward(0.3), Wait(1.0), Forward(-0.3)])
    log = drive([(0.7, PAUSED), (4.0, FULL)], motion, lateness=on_time)
    lines = _velocity_lines(Summary(log).aligned, LINEAR)

    def value(line, time):
        return [value for at, value in lines[line] if at <= time + 1e-6][-1]

    times = [time for time, _ in lines['sent'] if not 0.65 < time < 7.0]
    assert len(times) > 30
    for time in times:
        assert value('planned', time) == pytest.approx(value('sent', time), abs=1e-9)


def test_the_page_shows_pauses_and_nothing_of_them_where_there_was_none(tmp_path):
    pytest.importorskip('jinja2', reason='needs Jinja2')
    pytest.importorskip('matplotlib', reason='needs matplotlib')
    shown = ('<h2>Speed</h2>', 'paused, speed 50 %', 'paused: 2.500 s',
             'pauses are shaded', ' s, planned: ', 'not sent as planned')
    for name, log, is_shown in (
            ('paused', drive([(0.5, {'pause': 0.0, 'override': 0.5}), (3.0, FULL)]), True),
            ('plain', done(), False)):
        folder = tmp_path / name
        folder.mkdir()
        write_report(log, folder, None)
        page, told = (
            (folder / file).read_text().replace('\N{NO-BREAK SPACE}', ' ')
            for file in ('report.html', 'run.json'))
        assert [text in page for text in shown] == [is_shown] * len(shown)
        assert ('pause' in page) == is_shown
        for field in ('speed', 'unjudged', 'plan_start_s'):
            assert (f'"{field}"' in told) == is_shown
