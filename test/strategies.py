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
"""Random limits, steps and motions, for properties that must hold for all of them."""

from __future__ import annotations

from collections.abc import Iterable
import math

from hypothesis import strategies as st
from kachaka_simple_control.motion.geometry import ORIGIN, Pose
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.steps import (
    Arc,
    Forward,
    Motion,
    Move,
    Repeat,
    Step,
    Turn,
    Wait,
)

#: The velocity limits of a Kachaka, with gentle accelerations.
KACHAKA = Limits(0.3, 1.57, 0.3, 1.5, 1.5, 8.0)


def spread(low: float, high: float) -> st.SearchStrategy[float]:
    """Return numbers between two, uniform in their logarithm."""
    return st.floats(math.log10(low), math.log10(high)).map(lambda power: 10.0 ** power)


def or_infinite(numbers: st.SearchStrategy[float]) -> st.SearchStrategy[float]:
    """Return numbers, and sometimes infinity."""
    return st.one_of(numbers, numbers, numbers, st.just(math.inf))


#: From a very slow robot to a very fast one.
LIMITS = st.builds(
    Limits,
    max_linear_velocity=spread(0.05, 5.0), max_angular_velocity=spread(0.1, 10.0),
    max_linear_acceleration=or_infinite(spread(0.05, 50.0)),
    max_angular_acceleration=or_infinite(spread(0.1, 100.0)),
    max_linear_jerk=or_infinite(spread(0.1, 500.0)),
    max_angular_jerk=or_infinite(spread(0.1, 1000.0)),
    max_linear_deceleration=st.none() | or_infinite(spread(0.05, 50.0)),
    max_angular_deceleration=st.none() | or_infinite(spread(0.1, 100.0)),
    max_backward_velocity=st.none() | spread(0.05, 5.0))
RATES = spread(1.0, 100.0)
ANGLES = st.floats(-7.0, 7.0)
RADII = st.one_of(spread(0.01, 100.0), spread(0.01, 100.0).map(lambda radius: -radius))

#: Steps without a speed of their own: every robot can drive them.
GOALS = st.one_of(
    st.builds(Forward, st.floats(-3.0, 3.0)),
    st.builds(Turn, ANGLES),
    st.builds(
        lambda radius, part: Arc(radius, part * min(7.0, 3.0 / abs(radius))),
        RADII, st.floats(-1.0, 1.0)))
#: The slowest robot can drive these; none turns so little that the closed form, by the circle's
#: centre, is inexact.
MOVES = st.builds(
    Move, st.floats(-0.04, 0.04),
    st.just(0.0) | st.floats(0.001, 0.09) | st.floats(-0.09, -0.001), st.floats(0.0, 20.0))
WAITS = st.builds(Wait, st.floats(0.0, 20.0))


def motions(
        leaves: st.SearchStrategy[Step], most: int = 4) -> st.SearchStrategy[Motion]:
    """Return motions of some steps, with repeats."""
    repeats = st.builds(Repeat, st.integers(0, 3), st.lists(leaves, max_size=2))
    nested = st.builds(Repeat, st.integers(0, 2), st.lists(leaves | repeats, max_size=2))
    steps = st.lists(st.one_of(leaves, leaves, repeats, nested), max_size=most)
    return st.builds(Motion, st.just('any'), steps)


MOTIONS = motions(st.one_of(GOALS, GOALS, MOVES, WAITS))


def expand(steps: Iterable[Step]) -> list[Step]:
    """Return steps with their repeats expanded."""
    return [leaf for step in steps for leaf in (
        expand(step.steps) * step.times if isinstance(step, Repeat) else [step])]


def closed_form(steps: Iterable[Step], start: Pose = ORIGIN) -> Pose:
    """Return the pose after some steps, by lines and by circles about their centre."""
    x, y, theta = start.x, start.y, start.theta
    for step in expand(steps):
        length, radius, angle = line_or_circle(step)
        if math.isinf(radius):
            x, y = x + length * math.cos(theta), y + length * math.sin(theta)
        else:
            centre = (x - radius * math.sin(theta), y + radius * math.cos(theta))
            x = centre[0] + radius * math.sin(theta + angle)
            y = centre[1] - radius * math.cos(theta + angle)
        theta += angle
    return Pose(x, y, theta)


def line_or_circle(step: Step) -> tuple[float, float, float]:
    """Return length, radius and angle of the line or circle of a step."""
    if isinstance(step, Forward):
        return step.distance, math.inf, 0.0
    if isinstance(step, Turn):
        return 0.0, 0.0, step.angle
    if isinstance(step, Arc):
        return abs(step.radius) * step.angle, step.radius, math.copysign(1.0, step.radius) * (
            step.angle)
    if isinstance(step, Move) and step.angular_z:
        return (step.linear_x * step.duration, step.linear_x / step.angular_z,
                step.angular_z * step.duration)
    return (step.linear_x * step.duration if isinstance(step, Move) else 0.0), math.inf, 0.0
