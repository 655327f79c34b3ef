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
"""What a fleet tells first to a program that commands it."""

from kachaka_simple_control.commands.fleet_reports import fleet_report
from kachaka_simple_control.files.fleet_file import find_fleet, read_fleet
from kachaka_simple_control.files.protocol import MAX_SIZE, write_line
from kachaka_simple_control.fleet.fleet_plan import plan_fleet
import pytest

pytestmark = pytest.mark.needs('yaml', 'jsonschema')

FLEET = """
robots:
  r1: {motion: ./ahead.yaml, with: {far: 0.25 m}, start: {x: 1 m, y: 2 m, heading: 90 deg}}
repeat: 3
"""


def test_it_has_the_paths_on_the_floor_and_each_outline_once():
    report = fleet_report(plan_fleet(find_fleet('minuet')))
    assert (report.name, report.rounds, len(report.robots)) == ('minuet', 2, 2)
    assert len(report.outlines) == 1
    assert {robot.outline for robot in report.robots} == {0}
    first, second = report.robots
    assert (first.name, second.name) == ('r1', 'r2')
    assert first.start == (0.0, 0.4, 0.0)
    assert first.path[0] == first.path[-1] == pytest.approx((0.0, 0.4), abs=1e-3)
    assert len(first.path) == 5, 'the corners of a square'
    assert report.duration == pytest.approx(max(first.duration, second.duration))


def test_it_shows_all_rounds_of_a_robot_that_does_not_come_back(tmp_path):
    (tmp_path / 'ahead.yaml').write_text('parameters: {far: }\nsteps: [forward: $far]\n')
    report = fleet_report(plan_fleet(read_fleet(FLEET, str(tmp_path / 'two.yaml'))))
    assert report.robots[0].path == ((1.0, 2.0), (1.0, 2.75))
    assert report.robots[0].motion == 'ahead (far 0.25 m)'


def test_the_largest_fleet_fits_a_line():
    robots = ''.join(
        f'  robot_{number}: {{motion: flowing_eight, start: {{x: {4 * number} m}}}}\n'
        for number in range(255))
    report = fleet_report(plan_fleet(read_fleet(f'robots:\n{robots}', 'large.yaml')))
    assert len(write_line(report)) <= MAX_SIZE + 1
    assert all(len(robot.path) >= 3 for robot in report.robots)
