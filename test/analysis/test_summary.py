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
"""Where a drive ended: by its plans, by its messages, and by odometry."""

from dataclasses import replace

from kachaka_simple_control.analysis.summary import Summary
from kachaka_simple_control.motion.geometry import (
    compose,
    ORIGIN,
    Pose,
)
from kachaka_simple_control.motion.steps import Motion, Move
from kachaka_simple_control.report.json_export import fields
from outcome_logs import done, HELD_UP, lesson
from plans import SQUARE
import pytest
from simulated_drive import SimulatedDrive

SECOND = Motion('second', [Move(0.1, 0.0, 1.0)])


def test_the_motions_of_the_lesson_follow_each_other():
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


def test_odometry_is_aligned_with_the_start_wherever_its_frame_is():
    record = done()
    plain = Summary(record).aligned.odometry[-1].pose
    elsewhere = Pose(3.0, -2.0, 2.5)
    record.odometry = [
        replace(answer, pose=compose(elsewhere, answer.pose)) for answer in record.odometry]
    moved = Summary(record).aligned.odometry[-1].pose
    assert (moved.x, moved.y, moved.theta) == pytest.approx((plain.x, plain.y, plain.theta))


def test_after_a_motion_cut_short_the_next_plan_begins_where_the_messages_led():
    simulated = SimulatedDrive(20.0)
    simulated.drive(SQUARE, 2.6, HELD_UP)
    simulated.drive(SECOND)
    first, second = Summary(simulated.close()).aligned.motion_starts
    assert first.pose == ORIGIN
    assert second.pose.x == pytest.approx(0.5, abs=0.001)
    assert second.pose.y == pytest.approx(0.0, abs=0.001)
