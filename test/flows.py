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
"""Random flows, and the checks of what is sent for them."""

from collections.abc import Sequence
from itertools import pairwise
import math
from typing import NamedTuple

from hypothesis import strategies as st
from kachaka_simple_control.motion.geometry import advance, integrate, ORIGIN, Pose, Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.steps import Forward, Motion, Step, Turn
from strategies import or_infinite, spread

#: The limits of a Kachaka as measured, with braking as strong as speeding up.
KACHAKA = Limits(0.3, 1.57, 0.5, 2.5, 2.0, 10.0)
#: From a slow robot to a fast one; jerk and braking may be without limit or differ.
FLOW_LIMITS = st.builds(
    Limits,
    max_linear_velocity=st.floats(0.05, 1.5), max_angular_velocity=st.floats(0.2, 4.0),
    max_linear_acceleration=st.floats(0.1, 3.0), max_angular_acceleration=st.floats(0.5, 12.0),
    max_linear_jerk=or_infinite(st.floats(0.3, 20.0)),
    max_angular_jerk=or_infinite(st.floats(2.0, 100.0)),
    max_linear_deceleration=st.none() | st.floats(0.1, 3.0),
    max_angular_deceleration=st.none() | st.floats(0.5, 12.0))
FLOW_RATES = st.floats(5.0, 100.0)
TOLERANCES = spread(0.001, 0.2)
#: Up to 174 degrees: a larger turn is a stop.
TURNS = st.tuples(st.sampled_from((-1.0, 1.0)), st.floats(1.0, 174.0)).map(
    lambda pair: Turn(pair[0] * math.radians(pair[1])))


@st.composite
def flows(draw, forwards: bool = False) -> Motion:
    """Return a motion of legs in one direction, with corners or straight joints between them."""
    sign = 1.0 if forwards else draw(st.sampled_from((1.0, 1.0, -1.0)))
    steps: list[Step] = []
    for index in range(draw(st.integers(2, 8))):
        if index and draw(st.integers(0, 9)):
            steps.append(draw(TURNS))
        steps.append(Forward(sign * draw(spread(0.01, 2.0))))
    return Motion('flow', steps, corners=draw(TOLERANCES))


class Message(NamedTuple):
    """A velocity and the time until the next one [s]."""

    velocity: Velocity
    duration: float


class Excess(NamedTuple):
    """By what fraction of the limit the largest value exceeds it; below 0 within the limit."""

    velocity: float
    acceleration: float
    #: of equally long messages, and of others
    jerk: float
    jerk_unequal: float


def messages(segments) -> list[Message]:
    """Return the velocities of a plan's segments."""
    return [Message(one.velocity, one.end - one.start) for one in segments]


def excesses(sent: Sequence[Message], limits: Limits, period: float) -> dict[str, Excess]:
    """Return how near a drive from rest to rest comes to the limits, for each axis."""
    rest = Message(ZERO, period)
    whole = [rest, *sent, rest]
    return {
        'linear': _excess(
            [(one.velocity.linear_x, one.duration) for one in whole],
            limits.max_linear_velocity, limits.max_linear_acceleration,
            limits.linear_deceleration, limits.max_linear_jerk),
        'angular': _excess(
            [(one.velocity.angular_z, one.duration) for one in whole],
            limits.max_angular_velocity, limits.max_angular_acceleration,
            limits.angular_deceleration, limits.max_angular_jerk)}


def needed_time(one: float, two: float, acceleration: float, deceleration: float) -> float:
    """Return the least time for a change of a velocity; one of the sign first comes to rest."""
    if one * two < 0.0:
        return abs(one) / deceleration + abs(two) / acceleration
    return abs(two - one) / (acceleration if abs(two) > abs(one) else deceleration)


def _excess(
        sent: list[tuple[float, float]], top: float, acceleration: float, deceleration: float,
        jerk: float) -> Excess:
    # From the middle of a message to the middle of the next.
    times = [(before + after) / 2.0 for (_, before), (_, after) in pairwise(sent)]
    changes = [(two - one) / time for time, ((one, _), (two, _)) in zip(times, pairwise(sent))]
    parts = [needed_time(one, two, acceleration, deceleration) / time
             for time, ((one, _), (two, _)) in zip(times, pairwise(sent))]
    jerks = {True: [0.0], False: [0.0]}
    for (first, second), (one, two, three) in zip(
            pairwise(changes), zip(sent, sent[1:], sent[2:])):
        durations = one[1], two[1], three[1]
        # A message has the mean of the velocity over its time.  Of means over times of any length,
        # this is the difference that is exact for a constant jerk.
        apart = sum(durations) / 3.0
        is_equal = max(durations) - min(durations) < 1e-9 * max(durations)
        jerks[is_equal].append(abs(second - first) / apart / jerk)
    return Excess(
        max(abs(one) for one, _ in sent) / top - 1.0, max(parts) - 1.0,
        max(jerks[True]) - 1.0, max(jerks[False]) - 1.0)


def end_of(sent: Sequence[Message]) -> Pose:
    """Return the pose of a robot that drives what is sent from the origin."""
    pose = ORIGIN
    for velocity, duration in sent:
        pose = integrate(pose, velocity, duration)
    return pose


def skeleton(motion: Motion) -> list[Pose]:
    """Return the poses at the ends of the steps, each from rest to rest."""
    poses = [ORIGIN]
    for step in motion.steps:
        for path in step.path():
            poses.append(advance(poses[-1], path.length, path.angle))
    return poses


def fine_path(sent: Sequence[Message], parts: int = 4) -> list[Pose]:
    """Return the poses of what is sent, several in each message."""
    poses = [ORIGIN]
    for velocity, duration in sent:
        for _ in range(parts):
            poses.append(integrate(poses[-1], velocity, duration / parts))
    return poses


def hausdorff(one: Sequence[Pose], two: Sequence[Pose]) -> float:
    """Return the Hausdorff distance of two polylines, from the points of each to the other [m]."""
    first, second = [[(pose.x, pose.y) for pose in poses] for poses in (one, two)]
    return max(_furthest(first, second), _furthest(second, first))


def _furthest(points: Sequence[tuple[float, float]], line: Sequence[tuple[float, float]]) -> float:
    return max(min(_distance(point, *part) for part in pairwise(line)) for point in points)


def _distance(
        point: tuple[float, float], begin: tuple[float, float],
        end: tuple[float, float]) -> float:
    x, y = end[0] - begin[0], end[1] - begin[1]
    length = x * x + y * y
    along = (point[0] - begin[0]) * x + (point[1] - begin[1]) * y
    part = min(max(0.0, along / length), 1.0) if length else 0.0
    return math.hypot(point[0] - begin[0] - part * x, point[1] - begin[1] - part * y)


def apart(one: Pose, two: Pose) -> float:
    """Return the largest difference of two poses [m or rad]."""
    return max(abs(one.x - two.x), abs(one.y - two.y), abs(one.theta - two.theta))
