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
"""The displacements of the steps of a drive, and the table of them."""

from dataclasses import replace
import math

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.analysis.step_results import driven, segment_odometry, sent
from kachaka_simple_control.control.events import (
    MotionEnded,
    MotionPlanned,
    MotionStarted,
    OdometryReceived,
)
from kachaka_simple_control.motion.geometry import (
    Displacement,
    integrate,
    ORIGIN,
    Pose,
    Velocity,
    ZERO,
)
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Arc, Forward, Motion, Move, Turn, Wait
from kachaka_simple_control.report.text_tables import drive_table
from messages import of_plan, of_prime, of_stop
import pytest

STEPS = [Move(0.0, 0.0, 1.0), Move(0.1, 0.0, 1.0), Move(0.0, 0.0, 1.0), Move(0.0, 0.5, 2.0),
         Move(-0.1, 0.5, 2.0), Move(0.0, 0.0, 1.0)]
LIMITS = Limits(1.0, 2.0)


def planned(*steps, limits=LIMITS, rate=10.0):
    """Return the event before steps are driven in one run."""
    return MotionPlanned(Motion('test', steps), limits, rate)


def record_of(steps, delay=0.004, period=0.02, start=100.0):
    """Return the record of a robot that follows its velocities after a delay [s]."""
    record, now, pose, told = DriveLog(), start, ORIGIN, []
    for step in steps:
        told.append((now, step.velocity))
        record.on_event(planned(step))
        record.on_event(MotionStarted(now))
        for tick in range(round(step.duration * 10)):
            record.on_event(of_plan(now + tick / 10, step.velocity, now))
        record.on_event(of_plan(now + step.duration, ZERO, now))
        now += step.duration
        record.on_event(MotionEnded(now))
    told.append((now, ZERO))
    for sample in range(round((now - start + 0.5) / period)):
        time = start - 0.1 + sample * period
        pose = ORIGIN
        for (begin, velocity), (end, _) in zip(told, [*told[1:], (math.inf, ZERO)]):
            pose = integrate(pose, velocity, min(max(time - delay - begin, 0.0), end - begin))
        wrapped = Pose(pose.x, pose.y, math.remainder(pose.theta, math.tau))
        record.on_event(OdometryReceived(time, wrapped))
    return record


def test_each_movement_gets_what_it_moved():
    """Whatever odometry is late by, and wherever its samples fall."""
    record = record_of(STEPS)
    cuts = segment_odometry(record.steps, record.odometry)
    for movement, begin, end in zip(record.steps, cuts, cuts[1:]):
        seen, wanted = driven(record.odometry, begin, end), movement.step.displacement
        assert seen is not None
        # Where two movements meet without a rest, the cut is blurred by odometry's delay.
        assert seen.distance == pytest.approx(wanted.distance, abs=0.001)
        assert seen.angle == pytest.approx(wanted.angle, abs=0.003)


@pytest.mark.parametrize('delay', [0.004, 0.03])
def test_the_last_movement_gets_all_that_it_moved(delay):
    """Odometry shows the end of it after the last zero velocity."""
    record = record_of([Move(0.3, 0.0, 1.0)], delay)
    cuts = segment_odometry(record.steps, record.odometry)
    assert driven(record.odometry, *cuts).distance == pytest.approx(0.3, abs=1e-9)


@pytest.mark.parametrize('asleep', [0.2, 0.35, 4.0])
def test_a_node_that_slept_through_its_stop_shows_the_whole_movement(asleep):
    """It gets no odometry from 0.1 s before the zero of its guardian until it wakes up."""
    record = record_of([Move(0.3, 0.0, 1.0)], 0.03)
    frozen = 100.9
    after = [replace(record.odometry[-1], time=frozen + asleep + 0.02 * number)
             for number in range(20)]
    record.odometry[:] = [seen for seen in record.odometry if seen.time < frozen] + after
    cuts = segment_odometry(record.steps, record.odometry)
    assert driven(record.odometry, *cuts).distance == pytest.approx(0.3, abs=1e-9)


def test_the_steps_of_one_run_share_its_messages():
    """What is sent for each is what it asks for, up to rounding of times."""
    steps = [Forward(0.2), Wait(0.5), Arc(-0.3, 1.0), Turn(-2.0), Move(0.1, 0.2, 0.33)]
    event = planned(*steps, limits=Limits(0.3, 1.5, 0.5, 2.0, 2.0, 8.0), rate=20.0)
    whole = plan(event.motion, event.limits, event.rate)
    record, began = DriveLog(), 1000.0
    record.on_event(event)
    for zero in range(10):
        record.on_event(of_prime(began - 0.5 + zero / 25))
    record.on_event(MotionStarted(began))
    for segment in whole.segments:
        record.on_event(of_plan(began + segment.start, segment.velocity, began))
    record.on_event(of_plan(began + whole.duration, ZERO, began))
    for zero in range(5):
        record.on_event(of_stop(began + whole.duration + zero / 20))
    record.on_event(MotionEnded(began + whole.duration + 0.1))
    assert [movement.step for movement in record.steps] == steps
    assert len(record.motions[0].own_messages) == len(whole.segments) + 1
    for movement in record.steps:
        told, wanted = sent(movement.sent), movement.step.displacement
        assert told.distance == pytest.approx(wanted.distance, abs=1e-9)
        assert told.angle == pytest.approx(wanted.angle, abs=1e-9)


@given(st.lists(st.tuples(st.floats(0.001, 1.0), st.floats(-0.3, 0.3)), min_size=1, max_size=20))
def test_what_was_sent_is_each_velocity_until_the_next(pairs):
    now, messages = 0.0, []
    for interval, speed in pairs:
        messages.append(of_plan(now, Velocity(speed, -speed)))
        now += interval
    messages.append(of_plan(now, ZERO))
    wanted = sum(interval * speed for interval, speed in pairs)
    assert sent(messages) == Displacement(pytest.approx(wanted), pytest.approx(-wanted))


def test_odometry_that_does_not_cover_a_movement_gives_no_displacement():
    assert driven([], 0.0, 1.0) is None
    assert driven([OdometryReceived(0.5, ORIGIN), OdometryReceived(2.0, ORIGIN)], 0.0, 1.0) is None


def test_the_table_shows_each_movement_and_where_it_ended():
    lines = drive_table(record_of(STEPS), 0.034).splitlines()
    assert lines[0].split() == ['movement', 'requested', 'sent', 'odometry']
    assert lines[3].startswith('0.1 m/s, 0 rad/s for 1 s')
    assert lines[3].count('0.1000 m') == 3
    assert len(lines) == 2 + len(STEPS) + 2
    assert lines[-2] == 'Stop: confirmed by odometry after 0.03 s'
    assert lines[-1].startswith('Final pose by odometry: x ')
