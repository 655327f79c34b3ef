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
"""How long planning takes, and what each way of sending a goal makes of it; needs no ROS."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
import math
import time
import tracemalloc
from typing import Any

from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Arc, Forward, Motion, Step, Turn
from kachaka_simple_control.motion.trajectory import limits_along, PathLimits
from kachaka_simple_control.motion.velocity_profile import time_optimal_profile

#: The velocities that a Kachaka takes, and ramps that are gentle for it.
LIMITS = Limits(0.3, 1.57, 0.3, 1.5, 1.5, 8.0)
#: How often a velocity is sent where the time to plan is measured [Hz].
RATE = 50.0
#: How often each length is planned; the quickest counts, as the rest is the machine's.
TRIES = 5
RATES = (5, 10, 20, 50, 100)
GOALS: dict[str, Forward | Turn] = {
    'forward 0.5 m': Forward(0.5),
    'forward 0.05 m': Forward(0.05),
    'turn 90 deg': Turn(math.pi / 2.0)}
#: With a limit of jerk, and without: the trapezoid that most programs have.
SHAPES = {'S-curve': LIMITS, 'trapezoid': Limits(0.3, 1.57, 0.3, 1.5)}
#: When between two of its messages a smoother may be told of a change [parts of a period].
PHASES = tuple(number / 20.0 for number in range(20))


def measure_planning(lengths: Sequence[int], tries: int = TRIES) -> list[dict[str, Any]]:
    """
    Measure how long motions of some lengths take to plan, and how much memory.

    :param lengths: about how long the motions are [s]
    :param tries: how often each is timed
    :returns: for each length the number of steps and of segments, the duration of the motion [s],
        the least time it took [s], and the most memory held on the way [MB]
    """
    entries = []
    for length in lengths:
        motion = tour(length)
        times = []
        for _ in range(tries):
            begin = time.perf_counter()
            planned = plan(motion, LIMITS, RATE)
            times.append(time.perf_counter() - begin)
        entries.append({
            'length': length, 'steps': len(planned.steps), 'segments': len(planned.segments),
            'duration': planned.duration, 'time': min(times)})
        del planned
        # In a run of its own: what takes note of every allocation takes its time.
        entries[-1]['memory'] = _peak(motion)
    return entries


def tour(duration: float) -> Motion:
    """
    Return a motion in which no two steps are alike, so that nothing is found but once.

    :param duration: about how long it takes [s]; never less
    :returns: the motion: forwards, turns and arcs
    """
    steps: list[Step] = []
    taken = 0.0
    while taken < duration:
        # Multiples of the golden ratio, without their whole part, never meet.
        part = len(steps) * 0.6180339887498949 % 1.0
        leg = (Forward(0.2 + part), Turn(0.5 + 2.0 * part), Arc(0.5, part - 1.5))
        taken += plan(Motion('leg', leg), LIMITS, 1.0).duration
        steps += leg
    return Motion('tour', tuple(steps))


def _peak(motion: Motion) -> float:
    tracemalloc.start()
    try:
        plan(motion, LIMITS, RATE)
        return tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()


def measure_exactness(rates: Sequence[int] = RATES) -> list[dict[str, Any]]:
    """
    Reckon what each way of sending makes of some goals, for a robot that does as it is told.

    :param rates: how often a velocity is sent [Hz]
    :returns: for each goal, shape, rate and way what was asked, in metres or radians, and the
        least and the most that came out
    """
    entries = []
    for (name, goal), shape, rate, way in product(GOALS.items(), SHAPES, rates, WAYS):
        driven = WAYS[way](goal, SHAPES[shape], float(rate))
        entries.append({
            'goal': name, 'unit': 'rad' if isinstance(goal, Turn) else 'm', 'shape': shape,
            'rate': rate, 'way': way, 'asked': goal.path()[0].distance,
            'least': min(driven), 'most': max(driven)})
    return entries


def ours(goal: Forward | Turn, limits: Limits, rate: float) -> list[float]:
    """
    Return how far a goal goes as it is planned.

    :param goal: the goal
    :param limits: what the robot can do
    :param rate: how often a velocity is sent [Hz]
    :returns: velocity times interval, summed up [m or rad]
    """
    return [math.fsum(
        (segment.velocity.linear_x + segment.velocity.angular_z) * (segment.end - segment.start)
        for segment in plan(Motion('goal', (goal,)), limits, rate).segments)]


def sampled(goal: Forward | Turn, limits: Limits, rate: float) -> list[float]:
    """
    Return how far it goes if each message has the velocity that the profile has at its time.

    :param goal: the goal
    :param limits: what the robot can do
    :param rate: how often a velocity is sent [Hz]
    :returns: velocity times interval, summed up [m or rad]
    """
    way, = goal.path()
    profile = time_optimal_profile(way.distance, *limits_along(way, limits))
    count = math.ceil(profile.duration * rate)
    return [math.fsum(profile.velocity_at(index / rate) for index in range(count)) / rate]


def smoothed(goal: Forward | Turn, limits: Limits, rate: float) -> list[float]:
    """
    Return how far it goes if a velocity smoother is told the right velocity for the right time.

    It is told the largest velocity for as long as the way takes at that velocity, and then to
    stop.  At each message it goes as far towards that as acceleration and deceleration allow for
    a period, in open loop, as that of Nav2 does.  It knows no jerk.

    :param goal: the goal
    :param limits: what the robot can do
    :param rate: how often a velocity is sent [Hz]
    :returns: velocity times interval, summed up [m or rad], for each phase
    """
    way, = goal.path()
    return [_smoothed(way.distance, limits_along(way, limits), rate, phase) for phase in PHASES]


def _smoothed(distance: float, limits: PathLimits, rate: float, phase: float) -> float:
    wanted_for = distance / limits.velocity
    driven = velocity = 0.0
    index = 0
    while velocity > 0.0 or (index + phase) / rate < wanted_for:
        wanted = limits.velocity if (index + phase) / rate < wanted_for else 0.0
        velocity = max(velocity - limits.deceleration / rate,
                       min(wanted, velocity + limits.acceleration / rate))
        driven += velocity / rate
        index += 1
    return driven


#: What is compared.
WAYS: dict[str, Callable[[Forward | Turn, Limits, float], list[float]]] = {
    'ours': ours, 'samples': sampled, 'smoother': smoothed}
