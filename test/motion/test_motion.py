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
"""Steps, limits and plans: what is refused, and what comes out."""


from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Forward, Motion, Move
import pytest

KACHAKA = Limits(0.3, 1.57)


def test_a_plan_refuses_a_later_step_beyond_the_limits():
    """Nothing may fail in mid-motion that can be found before."""
    with pytest.raises(InvalidMotionError, match='linear_x is 0.4'):
        plan(Motion('late', (Move(0.1, 0.0, 1.0), Move(0.4, 0.0, 1.0))), KACHAKA, 10.0)


def test_the_lesson_ends_ten_centimetres_ahead_after_nine_seconds():
    lesson = Motion('lesson', (
        Move(0.0, 0.0, 1.0), Move(0.1, 0.0, 1.0), Move(0.0, 0.0, 1.0), Move(0.0, 0.5, 2.0),
        Move(0.0, 0.0, 1.0), Move(0.0, -0.5, 2.0), Move(0.0, 0.0, 1.0)))
    planned = plan(lesson, KACHAKA, 10.0)
    end = planned.path()[-1]
    assert planned.duration == 9.0
    assert (end.x, end.y, end.theta) == pytest.approx((0.1, 0.0, 0.0))


def test_steps_may_come_first_and_the_name_may_be_left_out():
    steps = [Forward(0.1)]
    named = Motion('there', steps, 'why', 0.1)
    assert Motion(steps, 'there', 'why', 0.1) == named == Motion(
        corners=0.1, description='why', steps=steps, name='there')
    assert Motion(steps) == Motion(steps=steps) == Motion('motion', steps)
    with pytest.raises(TypeError, match='steps'):
        Motion('there')
    with pytest.raises(TypeError, match='name'):
        Motion(steps, 'there', name='here')
