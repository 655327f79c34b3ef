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
"""Motions with corners that the robot drives through without a stop."""

import math

from hypothesis import strategies as st
from kachaka_simple_control.motion.steps import Forward, Motion, Repeat, Turn, Wait

QUARTER = math.pi / 2.0
SIDE = (Forward(0.5), Turn(QUARTER))
#: A square: three corners, and a turn at the end.
ROUNDED = Motion('square', SIDE * 4, corners=0.05)
#: Two equal corners are a stop or nearly one, because the leg between them is 5 cm long.
TIGHT = Motion(
    'tight', (Forward(0.5), Turn(QUARTER), Forward(0.05), Turn(-QUARTER), Forward(0.5)),
    corners=0.1)
#: Two flows with a rest between them.
TWO = Motion('two', (*SIDE, Forward(0.5), Wait(1.0), *SIDE, Forward(0.5)), corners=0.05)
#: Two legs without a turn between them.
STRAIGHT = Motion('straight', (Forward(0.5), Forward(0.5)), corners=0.05)
#: Many rounds of the square.
ROUNDS = Motion('rounds', (Repeat(400, SIDE),), corners=0.05)

LEGS = st.builds(Forward, st.floats(0.01, 2.0))
TURNS = st.builds(Turn, st.floats(0.02, 3.0) | st.floats(-3.0, -0.02))
#: Forward legs, with a turn after each of them.
FLOWS = st.builds(
    lambda pairs, last, corners: Motion('flow', (
        *(step for pair in pairs for step in pair), last), corners=corners),
    st.lists(st.tuples(LEGS, TURNS), min_size=1, max_size=6), LEGS, st.floats(0.001, 0.2))
