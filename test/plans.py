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
"""Motions with simple geometry, and some very long ones."""

import math

from kachaka_simple_control.analysis.plan_view import PlanView
from kachaka_simple_control.motion.geometry import Box, Disc
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Arc, Forward, Motion, Move, Repeat, Turn, Wait

#: Without acceleration limits: a step takes its length over its speed.
ABRUPT = Limits(0.25, 1.0)
#: With acceleration and jerk limits.
GENTLE = Limits(0.3, 1.57, 0.5, 2.5, 2.0, 10.0)
BOX = Box(length=0.4, width=0.2, ahead=0.05)
DISC = Disc(radius=0.2)

QUARTER = math.pi / 2.0
SQUARE = Motion('square', [Repeat(4, [Forward(0.5), Turn(QUARTER)])])
SQUARE_CW = Motion('square_cw', [Repeat(4, [Forward(0.5), Turn(-QUARTER)])])
LESSON = Motion('lesson', [
    Move(0.0, 0.0, 1.0), Move(0.1, 0.0, 1.0), Move(0.0, 0.0, 1.0), Move(0.0, 0.5, 2.0),
    Move(0.0, 0.0, 1.0), Move(0.0, -0.5, 2.0), Move(0.0, 0.0, 1.0)])
EIGHT = Motion('figure_eight', [Arc(0.3, math.tau, 0.15), Arc(-0.3, math.tau, 0.15)])
SPIN = Motion('spin', [Turn(math.tau, 0.8)])
BACK = Motion('back', [Forward(-1.0), Wait(0.5), Arc(0.5, -QUARTER)])
EMPTY = Motion('empty', [])
#: More than an hour, and nearly 2000 steps.
HOUR = Motion('hour', [Repeat(250, SQUARE.steps)])


def preview(motion, limits=GENTLE, rate=20.0, footprint=BOX, robot='kachaka'):
    """Return the view of a motion's plan."""
    return PlanView(motion.name, robot, plan(motion, limits, rate), limits, footprint)
