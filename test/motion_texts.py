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
"""Random motions and the texts of motion files."""

from __future__ import annotations

from hypothesis import strategies as st
from kachaka_simple_control.files.document import MotionFileError
from kachaka_simple_control.files.motion_reader import loads
from kachaka_simple_control.motion.steps import Arc, Forward, Motion, Move, Repeat, Turn, Wait
from kachaka_simple_control.motion.waypoints import Goto, Waypoints

#: Every kind of step, with all its fields.
EVERYTHING = """\
name: everything
description: One of each.
robot: kachaka
limits: {max_linear_velocity: 0.2 m/s, max_angular_jerk: 90 deg/s^3}
rate: 20 Hz
steps:
  - forward: 0.5 m
  - turn: 90 deg
  - arc: {radius: 0.3 m, angle: 180 deg, speed: 0.15 m/s}
  - move: {linear_x: 0.1, angular_z: 0.0, duration: 1.0}
  - wait: 2 s
  - forward: {distance: -20 cm, speed: 100 mm/s}
  - turn: {angle: -1 rad, speed: 45 deg/s}
  - wait: {duration: 500 ms}
  - repeat:
      times: 4
      steps:
        - wait: 1 min
        - repeat: {times: 0, steps: []}
  - goto: [1 m, 0.5 m]
  - goto: {point: [0 m, -50 cm], heading: 0 deg, speed: 0.2 m/s}
  - waypoints: [[1 m, 0 m]]
  - waypoints:
      points: [[1 m, 1 m], [0 m, 1 m]]
      heading: 90 deg
      speed: 0.2 m/s
      corners: 10 cm
corners: 5 cm
"""

FINITE = st.floats(allow_nan=False, allow_infinity=False)
SPEEDS = st.none() | st.floats(min_value=0.0, exclude_min=True, allow_infinity=False)
RADII = FINITE.filter(lambda radius: abs(radius) > 1e-3)
TOLERANCES = st.floats(0.0, 1.0)
TIMES = st.floats(min_value=0.0, allow_infinity=False)
POINTS = st.tuples(FINITE, FINITE)
SIMPLE = st.one_of(
    st.builds(Move, FINITE, FINITE, TIMES),
    st.builds(Forward, FINITE, SPEEDS),
    st.builds(Turn, FINITE, SPEEDS),
    st.builds(Arc, RADII, FINITE, SPEEDS),
    st.builds(Wait, TIMES),
    st.builds(Goto, POINTS, st.none() | FINITE, SPEEDS),
    st.builds(
        Waypoints, st.lists(POINTS, min_size=1, max_size=3), st.none() | FINITE, SPEEDS,
        st.none() | TOLERANCES))
STEPS = st.recursive(
    SIMPLE, lambda steps: st.builds(Repeat, st.integers(0, 9), st.lists(steps, max_size=3)),
    max_leaves=8)
#: A file cannot have lone surrogates.
TEXTS = st.text(st.characters(blacklist_categories=['Cs']), max_size=20)
MOTIONS = st.builds(Motion, TEXTS, st.lists(STEPS, max_size=6), TEXTS, TOLERANCES)


def refusal(text: str, name: str = 'bad.yaml') -> list[str]:
    """Return the lines of the error of a text."""
    try:
        file = loads(text, name)
    except MotionFileError as error:
        return str(error).splitlines()
    raise AssertionError(f'it was read: {file}')


def step_refusal(step: str) -> str:
    """Return the one-line error of a motion of one step, without its location."""
    lines = refusal(f'steps:\n  - {step}\n')
    assert len(lines) == 1, lines
    start = 'bad.yaml:2: step 1: '
    assert lines[0].startswith(start), lines
    return lines[0].removeprefix(start)
