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
"""How exact three processes are: the computations of the benchmark, thresholds, and one run."""

from __future__ import annotations

import math

from benchmarks.experiments.three_processes import (
    errors,
    HEAD,
    main,
    MAX_ANGLE,
    MAX_OFFSET,
    missed,
    planned_as_driven,
    Run,
    table,
)
from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.motion.geometry import advance, ORIGIN, Pose
import pytest

LENGTHS = st.floats(-10.0, 10.0)
ANGLES = st.floats(-20.0, 20.0)
POSES = st.builds(Pose, LENGTHS, LENGTHS, ANGLES)
GOOD = Run('square', 0.0002, math.radians(0.02))


@given(POSES, LENGTHS, ANGLES)
def test_a_drive_as_planned_has_no_error_from_any_start(start, distance, angle):
    end = advance(start, distance, angle)
    # Odometry wraps the heading.
    reported = Pose(end.x, end.y, math.remainder(end.theta, math.tau))
    position, heading = errors(start, reported, advance(ORIGIN, distance, angle))
    assert position == pytest.approx(0.0, abs=1e-9)
    assert heading == pytest.approx(0.0, abs=1e-9)


@given(POSES, POSES, LENGTHS, LENGTHS, st.floats(-3.0, 3.0))
def test_the_errors_are_the_deviation_from_the_plan(start, planned, x, y, turn):
    cosine, sine = math.cos(start.theta), math.sin(start.theta)
    ahead, left = planned.x + x, planned.y + y
    end = Pose(start.x + cosine * ahead - sine * left, start.y + sine * ahead + cosine * left,
               start.theta + planned.theta + turn)
    position, heading = errors(start, end, planned)
    assert position == pytest.approx(math.hypot(x, y), abs=1e-9)
    assert heading == pytest.approx(abs(turn), abs=1e-9)


def test_plans_are_those_of_the_command():
    lesson, square = (planned_as_driven(name).pose for name in ('lesson', 'square'))
    assert (lesson.x, lesson.y, lesson.theta) == pytest.approx((0.1, 0.0, 0.0))
    assert (square.x, square.y, square.theta) == pytest.approx((0.0, 0.0, math.tau))


def test_the_table_has_a_row_for_each_motion_and_leaves_out_what_failed():
    runs = [GOOD, Run('square', 0.0004, math.radians(0.04)),
            Run('square', 1.0, 1.0, 'exit code 1: why'), Run('lesson', 1.0, 1.0, 'exit code 3: ')]
    shown = table(runs)
    assert shown.head == HEAD
    assert shown.rows == (
        ('square', '2 of 3', '0.30 / 0.40', '0.03 / 0.04'), ('lesson', '0 of 1', '-', '-'))


def test_thresholds_apply_to_the_median_and_every_run_must_reach_its_end():
    assert missed([GOOD] * 10) == []
    far, turned = Run('square', 2.0 * MAX_OFFSET, 0.0), Run('square', 0.0, 2.0 * MAX_ANGLE)
    assert missed([GOOD] * 6 + [far] * 4) == []
    assert missed([GOOD] * 4 + [far] * 6) == ['square: more than 3 mm off at the median']
    assert missed([GOOD] * 4 + [turned] * 6) == [
        'square: more than 0.5 degrees off at the median']
    assert missed([GOOD, Run('lesson', 0.0, 0.0, 'exit code 1: why')]) == [
        'lesson: exit code 1: why']


@pytest.mark.ros
@pytest.mark.slow
def test_one_run_through_three_processes(monkeypatch, capsys):
    """Only whether it works: a machine with other work cannot measure how exact it is."""
    pytest.importorskip('rclpy', reason='needs ROS 2')
    pytest.importorskip('nav_msgs', reason='needs nav_msgs')
    pytest.importorskip('kachaka_api.generated', reason="needs the robot's SDK")
    monkeypatch.setattr('benchmarks.experiments.three_processes.MAX_OFFSET', 0.1)
    monkeypatch.setattr('benchmarks.experiments.three_processes.MAX_ANGLE', math.radians(10.0))
    assert main(['--runs', '1', '--motions', 'straight']) == 0
    assert '| straight | 1 of 1 |' in capsys.readouterr().out
