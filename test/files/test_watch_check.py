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
"""What the obstacle watch cannot watch: steps that are driven where the laser does not see."""

from __future__ import annotations

from dataclasses import replace
import math

from kachaka_simple_control.errors import InvalidMotionError, UsageError
from kachaka_simple_control.files.document import MotionFileError
from kachaka_simple_control.files.motion_reader import loads
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.files.watch_check import require_watchable, watch_text
from kachaka_simple_control.motion.steps import Arc, Forward, Motion, Move, Repeat, Turn, Wait
from kachaka_simple_control.motion.waypoints import Goto, Waypoints
import pytest

ALL_AROUND = replace(KACHAKA, laser=replace(KACHAKA.laser, view=math.tau))


@pytest.mark.parametrize('step', [
    Forward(-0.5), Move(-0.1, 0.3, 1.0), Arc(0.3, -1.0), Arc(-0.3, -1.0),
    Repeat(2, [Forward(-1.0)])])
def test_a_step_backwards_is_refused_where_the_laser_does_not_see(step):
    motion = Motion([Forward(1.0), step])
    with pytest.raises(InvalidMotionError, match='driven backwards, where the laser of kachaka '):
        require_watchable(motion, KACHAKA)
    require_watchable(motion, ALL_AROUND)


def test_what_is_driven_forwards_is_watched():
    require_watchable(Motion([
        Forward(1.0), Turn(-2.0), Arc(0.3, 1.0), Arc(-0.3, 1.0), Move(0.1, -0.3, 1.0), Wait(1.0),
        Move(0.0, 1.0, 1.0), Move(-0.1, 0.0, 0.0), Repeat(0, [Forward(-1.0)]), Goto((-1.0, 0.0)),
        Waypoints([(1.0, 0.0), (-1.0, 0.0)])]), KACHAKA)


@pytest.mark.parametrize('changes, text', [
    ({'laser': None}, 'watch needs a laser, and profile kachaka names none: add laser: '),
    ({'footprint': None}, 'watch needs the outline of the robot, and profile kachaka names none'),
])
def test_a_robot_without_laser_or_outline_cannot_watch(changes, text):
    with pytest.raises(UsageError, match=text):
        require_watchable(Motion([Forward(1.0)]), replace(KACHAKA, **changes))


@pytest.mark.needs('yaml', 'jsonschema')
def test_all_is_reported_at_once_with_its_line():
    file = loads("""\
watch: true
steps:
  - forward: {distance: -1 m, speed: 9 m/s}
  - repeat:
      times: 2
      steps:
        - arc: {radius: 0.3 m, angle: -90 deg}
        - move: {linear_x: -0.1, angular_z: 0, duration: 1}
""", 'back.yaml')
    with pytest.raises(MotionFileError) as caught:
        file.order(KACHAKA, 10.0, closed_loop=False, watch=True)
    why = ('driven backwards, where the laser of kachaka does not see: drive forward, or leave '
           'watch out')
    assert str(caught.value).split('\n') == [
        ("back.yaml:3: step 1: forward.speed: 9.0 m/s is above kachaka's limit of 0.3 m/s "
         'backwards'),
        f'back.yaml:3: step 1: forward: {why}',
        f'back.yaml:7: step 2: repeat: step 1: arc: {why}',
        f'back.yaml:8: step 2: repeat: step 2: move: {why}']


def test_the_plan_says_what_is_watched():
    assert watch_text(KACHAKA.laser) == (
        'Watched: the laser sees 270 deg around ahead; holds before what is nearer than 5 cm to '
        'the outline; no safety device')
    assert 'sees all around;' in watch_text(ALL_AROUND.laser)
