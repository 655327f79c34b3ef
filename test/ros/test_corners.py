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
"""Which tolerance of corners a node drives a motion with, and who refuses corners."""

from __future__ import annotations

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.motion.steps import Forward, Motion, Turn
from program import COMMAND, program
import pytest

pytestmark = [pytest.mark.ros, pytest.mark.needs('rclpy', 'nav_msgs', 'jsonschema')]

STEPS = (Forward(0.5), Turn(1.0), Forward(0.5))


class SeenError(Exception):
    """Ends a drive before it begins."""


@pytest.mark.parametrize('parameters, in_motion, used', [
    ({}, 0.0, 0.0), ({}, 0.05, 0.05), ({'corners': 0.1}, 0.0, 0.1), ({'corners': 0.1}, 0.05, 0.1),
    ({'corners': 0.0}, 0.05, 0.05)])
def test_a_parameter_above_0_replaces_the_corners_of_a_motion(
        make, monkeypatch, parameters, in_motion, used):
    orders = []

    def drive(given, request):
        orders.append((*given.values(), request))
        raise SeenError

    node = make(**parameters)
    monkeypatch.setattr(node.commander, 'drive', drive)
    with pytest.raises(SeenError):
        node.run(Motion('corner', STEPS, corners=in_motion))
    (order, request), = orders
    assert (order.motion.corners, request) == (used, None)
    assert (order.plan.saved_time > 0.0) == (used > 0.0)


def test_corners_out_of_range_are_refused(make):
    with pytest.raises(UsageError, match='corners.*from 0 to 1'):
        make(corners=2.0)


@pytest.mark.parametrize('words', [
    ['--corners', '5cm'], ['--corners', '0'], ['--ros-args', '-p', 'corners:=0.05']])
def test_the_lesson_refuses_corners_in_one_line(tmp_path, words):
    with program([*COMMAND, *words], tmp_path) as started:
        assert started.end() == 2
    line, = started.text.splitlines()
    assert 'corners are for motions: the lesson calls move_robot()' in line
