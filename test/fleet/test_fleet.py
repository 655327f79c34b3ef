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
"""A fleet in Python: what drives, what is refused, and what is left behind."""

from __future__ import annotations

import os

from kachaka_simple_control import find, Forward, InvalidMotionError, Motion, UsageError
from kachaka_simple_control.errors import MotionRefusedError
from kachaka_simple_control.process.processes import is_running
from optional_libraries import optional_imports
from program import children_of
import pytest
from waiting import wait_until

with optional_imports():
    from kachaka_simple_control import Fleet
    import rclpy

pytestmark = [
    pytest.mark.ros, pytest.mark.distro,
    pytest.mark.needs('rclpy', 'nav_msgs', 'jsonschema')]

OUT, BACK = Motion('out', (Forward(0.2),)), Motion('back', (Forward(-0.1),))


@pytest.fixture
def simulated():
    """Yield a function that makes a fleet of simulated robots."""
    fleets = []

    def make(robots, parameters=None, **more):
        fleets.append(Fleet(robots, {'prime_time': 0.2, **(parameters or {})}, sim=True, **more))
        return fleets[-1]
    yield make
    for fleet in fleets:
        fleet.close()
    rclpy.try_shutdown()


def test_each_drives_its_motion_and_nothing_is_left(simulated):
    before = set(children_of(os.getpid()))
    fleet = simulated({'one': OUT, 'two': BACK})
    children = {*children_of(os.getpid())} - before
    with fleet:
        fleet.run()
        ends = {name: robot.pose for name, robot in fleet.node.robots.items()}
    assert ends['one'].x == pytest.approx(0.2, abs=0.03)
    assert ends['two'].x == pytest.approx(-0.1, abs=0.03)
    assert children
    assert wait_until(lambda: not any(map(is_running, children)))


def test_a_motion_may_have_values_of_parameters(simulated):
    fleet = simulated({'one': OUT, 'two': find('straight', distance='25 cm')})
    assert [robot.end.x for robot in fleet.plan.robots] == pytest.approx([0.2, 0.25])


def test_robots_have_the_floor_that_the_program_names(simulated, tmp_path):
    """A wall is touched after 6 cm."""
    floor = tmp_path / 'floor.yaml'
    floor.write_text('walls: [[[0.3 m, -1 m], [0.3 m, 1 m]]]')
    with simulated({'one': OUT}, floor=floor) as fleet:
        fleet.run()
        assert fleet.node.robots['one'].pose.x == pytest.approx(0.063, abs=0.002)


def test_it_drives_in_a_thread_until_somebody_stops_it(simulated):
    fleet = simulated({'one': Motion('far', (Forward(3.0),))})
    assert fleet.start() == 'started'
    with pytest.raises(MotionRefusedError):
        fleet.start()
    commander = fleet.node.commander
    assert wait_until(lambda: fleet.node.robots['one'].drive.progress.plan_time)
    commander.stop('the test')
    assert wait_until(lambda: not commander.is_driving())
    assert 'the test' in commander.states()[0].ended_by


@pytest.mark.parametrize(('robots', 'kind', 'text'), [
    ({}, UsageError, 'robots'), ({'1st': OUT}, UsageError, 'namespace'),
    ({'one': 'sqare'}, InvalidMotionError, "did you mean 'square'"),
    ({'one': Motion('fast', (Forward(1.0, speed=9.0),))}, UsageError, '9.0 m/s')])
def test_what_cannot_be_driven_makes_no_node(robots, kind, text):
    with pytest.raises(kind, match=text):
        Fleet(robots)
    assert not rclpy.ok()


@pytest.mark.parametrize('parameters, kind, text', [
    ({'watch': True}, UsageError, 'driven backwards, where the laser'),
    ({'rate': 20.0}, UsageError, 'rate: the motion of each robot says it'),
])
def test_what_no_robot_can_do_is_refused_before_one_moves(parameters, kind, text):
    with pytest.raises(kind, match=text):
        Fleet({'one': OUT, 'two': BACK}, parameters)
    assert not rclpy.ok()


def test_a_watch_holds_a_robot_of_a_fleet(simulated, tmp_path):
    floor = tmp_path / 'floor.yaml'
    floor.write_text('walls: [[[0.5 m, -1 m], [0.5 m, 1 m]]]')
    with simulated({'one': Motion('far', (Forward(1.0),))}, {'watch': True},
                   floor=floor) as fleet:
        fleet.start()
        robot = fleet.node.robots['one']
        assert wait_until(lambda: robot.speed_factor.is_hold, 15.0)
        assert fleet.node.commander.stop('enough')
