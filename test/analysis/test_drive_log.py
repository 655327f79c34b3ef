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
"""The drive log of drives that did not go as planned."""

from dataclasses import replace
import re

from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.analysis.summary import Summary
from kachaka_simple_control.control.events import (
    MotionEnded,
    MotionPlanned,
    MotionStarted,
)
from kachaka_simple_control.motion.drive_order import MotionText
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.steps import Motion, Move
from kachaka_simple_control.report.text_tables import drive_table
from messages import of_plan, of_prime, of_stop
import pytest
from simulated_drive import SimulatedDrive

MOTION = Motion('two', (Move(0.1, 0.0, 1.0), Move(0.0, 0.0, 1.0), Move(0.0, 0.5, 1.0)))


def stopped(after, reason='stopped by SIGINT'):
    """Return the record of a motion at 10 Hz that was stopped some time after t = 0."""
    record, ticks = DriveLog(), round(after * 10)
    record.on_event(MotionPlanned(MOTION, Limits(0.3, 1.5), 10.0))
    for zero in range(3):
        record.on_event(of_prime(99.5 + zero / 10))
    record.on_event(MotionStarted(100.0))
    for tick in range(ticks):
        step = MOTION.steps[min(tick // 10, 2)]
        record.on_event(of_plan(100.0 + tick / 10, step.velocity, 100.0))
    for zero in range(5):
        record.on_event(of_stop(100.0 + after - 0.03 + zero / 20))
    if reason:
        record.on_event(MotionEnded(100.5 + after, reason))
    return record


def test_the_file_of_a_motion_is_known_if_there_was_one():
    one, other = (MotionText(name, '', {}, {}) for name in 'ab')
    drive = SimulatedDrive()
    assert drive.drive_log.motion_file is None
    drive.publish(replace(drive.drive_log.session_started, motion_file=one))
    assert drive.drive_log.motion_file == one  # before anything was planned
    for planned, known in ((other, other), (other, other), (one, None), (None, None)):
        drive.publish(MotionPlanned(MOTION, Limits(0.3, 1.5), 10.0, motion_file=planned))
        assert drive.drive_log.motion_file == known


@pytest.mark.parametrize('reason', ['stopped by SIGINT', None])
@pytest.mark.parametrize(('after', 'wholes'), [
    (0.5, [False]), (1.5, [True, False]), (2.5, [True, True, False])])
def test_a_stopped_motion_has_the_steps_that_were_begun(after, wholes, reason):
    """Whether it was stopped or killed."""
    (motion,) = stopped(after, reason).motions
    assert [movement.is_complete for movement in motion.steps] == wholes
    assert not motion.is_complete
    assert motion.own_messages[0].time == 100.0
    assert all(not sent.velocity.is_zero or sent.time >= 101.0
               for sent in motion.own_messages[:-1])


def test_the_zero_of_the_stop_ends_the_step_it_fell_into():
    movement = stopped(0.5).steps[-1]
    assert movement.sent[-1] == of_stop(pytest.approx(100.47))
    assert {sent.velocity for sent in movement.sent[:-1]} == {Velocity(0.1, 0.0)}


def test_a_calibrated_drive_is_logged_as_what_the_robot_makes_of_it():
    """A report compares displacements: 2 cm more is sent to a robot that drives 2 cm too short."""
    log = DriveLog()
    log.on_event(MotionPlanned(MOTION, Limits(0.3, 1.5), 10.0))
    log.on_event(MotionStarted(100.0))
    for tick in range(31):
        velocity = MOTION.steps[min(tick // 10, 2)].velocity if tick < 30 else ZERO
        log.on_event(of_plan(
            100.0 + tick / 10, Velocity(velocity.linear_x / 0.8, velocity.angular_z), 100.0,
            expected=velocity))
    log.on_event(MotionEnded(103.0))
    assert '0.1000 m  0.0000 rad   0.1000 m  0.0000 rad' in drive_table(log, 0.1)


def test_the_table_counts_a_velocity_for_the_command_timeout_at_most():
    """As the report does: after 0.8 s without a message a Kachaka has moved for 0.3 s."""
    drive = SimulatedDrive()
    drive.drive(Motion('second', (Move(0.1, 0.0, 1.0),)), lost=(0.1, 0.8))
    log = drive.close()
    (result,) = Summary(log).steps
    (row,) = drive_table(log, 0.1).splitlines()[2:-2]
    requested, sent, _ = re.findall(r'\d\.\d{4} m ', row)
    assert requested == '0.1000 m '
    assert float(sent[:-3]) == pytest.approx(result.sent.distance, abs=1e-4)
    assert result.sent.distance == pytest.approx(0.05, abs=0.001)
