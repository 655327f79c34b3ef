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
"""Which simulated robots a fleet file brings."""

from __future__ import annotations

from dataclasses import fields
import math

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.files.fleet_file import FleetFileError, read_fleet
from kachaka_simple_control.kachaka.simulated_fleet import robots_text, simulated_robots
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.motion.geometry import Pose
import pytest

pytestmark = [pytest.mark.needs('yaml'), pytest.mark.needs('jsonschema')]
#: All figures may have these; ratios of the odometry have narrow bounds.
FIGURES = st.fixed_dictionaries({}, optional={
    figure.name: st.floats(0.9, 0.99) for figure in fields(SimulationParameters)})
PARAMETERS = FIGURES.map(lambda figures: SimulationParameters(**figures))
NUMBERS = st.floats(-1e6, 1e6)
POSES = st.builds(Pose, NUMBERS, NUMBERS, st.floats(-10.0, 10.0))
NAMES = st.one_of(st.sampled_from(['yes', 'null', 'on', 'r1', '_']),
                  st.from_regex('[A-Za-z][A-Za-z0-9]{0,9}', fullmatch=True))


@given(st.dictionaries(NAMES, st.tuples(POSES, PARAMETERS), min_size=1, max_size=4))
def test_what_a_text_says_is_what_it_was_made_from(robots):
    read = simulated_robots(read_fleet(robots_text(robots), 'robots.yaml'))
    assert [*read] == [*robots]
    for name, (pose, parameters) in robots.items():
        assert read[name] == (pose, parameters)


@pytest.mark.parametrize('value', [1e-7, 1e-300, -0.0, 5e-324, 123456789.123])
def test_no_number_is_rounded_or_taken_for_a_text(value):
    robots = {'r1': (Pose(value, 0.0, 0.0), SimulationParameters(linear_gain=value))}
    assert simulated_robots(read_fleet(robots_text(robots), 'robots.yaml')) == robots


@pytest.mark.parametrize('robot, text', [
    ('{motion: straight, simulation: {undock_velocity: -0.1 m/s}}',
     'r.yaml:3: robots.r2.simulation.undock_velocity: -0.1 m/s; it must be above 0 m/s'),
    ('{motion: straight, simulation: {wheel_ratio: 0}}',
     'r.yaml:3: robots.r2.simulation.wheel_ratio: '),
    ('{motion: straight, robot: turtlebot3}',
     'r.yaml:3: robots.r2: this robot is a turtlebot3; only a kachaka can be simulated')])
def test_a_robot_that_cannot_be_simulated_is_refused_with_its_line(robot, text):
    fleet = read_fleet(f'robots:\n  r1: {{motion: straight}}\n  r2: {robot}\n', 'r.yaml')
    with pytest.raises(FleetFileError) as caught:
        simulated_robots(fleet)
    (line,) = str(caught.value).splitlines()
    assert line.startswith(text)


def test_a_robot_without_errors_is_ideal_and_starts_where_the_file_says():
    fleet = read_fleet(
        'robots: {r1: {motion: square, start: {x: 50 cm, heading: 90 deg}}}', 'r.yaml')
    assert simulated_robots(fleet) == {
        'r1': (Pose(0.5, 0.0, math.pi / 2.0), SimulationParameters())}
