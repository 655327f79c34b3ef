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
"""Measure the time of planning and the accuracy of methods to reach a goal; needs no ROS."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise, product
import math
import time
import tracemalloc
from typing import Any

from kachaka_simple_control.motion.corner import CornerTurn, Shape
from kachaka_simple_control.motion.flow_leg import FlowLeg
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.path_segment import limits_along
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.roots import bisection
from kachaka_simple_control.motion.steps import Arc, Forward, Motion, Step, Turn
from kachaka_simple_control.motion.trajectory import PathLimits
from kachaka_simple_control.motion.velocity_profile import time_optimal_profile

#: The velocity limits of a Kachaka, with gentle accelerations.
LIMITS = Limits(0.3, 1.57, 0.3, 1.5, 1.5, 8.0)
#: The rate of velocities in the plans whose time is measured [Hz].
RATE = 50.0
#: The limits of a Kachaka for the comparison of flows, their rate [Hz], and their tolerance [m].
KACHAKA, FLOW_RATE, TOLERANCE = Limits(0.3, 1.57, 0.5, 2.5, 2.0, 10.0), 20.0, 0.05
#: The number of plans of each length; only the shortest time counts.
TRIES = 5
RATES = (5, 10, 20, 50, 100)
GOALS: dict[str, Forward | Turn] = {
    'forward 0.5 m': Forward(0.5),
    'forward 0.05 m': Forward(0.05),
    'turn 90 deg': Turn(math.pi / 2.0)}
#: The limits with a jerk limit (S-curve), and without (trapezoid, as in most programs).
SHAPES = {'S-curve': LIMITS, 'trapezoid': Limits(0.3, 1.57, 0.3, 1.5)}
#: The times between two messages at which a smoother receives a new target [periods].
PHASES = tuple(number / 20.0 for number in range(20))


def measure_planning(lengths: Sequence[int], tries: int = TRIES) -> list[dict[str, Any]]:
    """
    Measure the time and the memory of planning.

    :returns: for each motion the number of steps and segments, its duration [s], the shortest time
        to plan it [s], and the peak memory of planning [MB]
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
        # Measured in a separate run, because tracing allocations takes time.
        entries[-1]['memory'] = _peak(motion)
    return entries


def tour(duration: float) -> Motion:
    """
    Return a motion of at least a duration [s], in which no two steps are equal.

    The planner therefore cannot reuse the result of a step.
    """
    steps: list[Step] = []
    taken = 0.0
    while taken < duration:
        # The fractional parts of multiples of the golden ratio are all different.
        part = len(steps) * 0.6180339887498949 % 1.0
        more = (Forward(0.2 + part), Turn(0.5 + 2.0 * part), Arc(0.5, part - 1.5))
        taken += plan(Motion('part', more), LIMITS, 1.0).duration
        steps += more
    return Motion('tour', tuple(steps))


def _peak(motion: Motion) -> float:
    tracemalloc.start()
    try:
        plan(motion, LIMITS, RATE)
        return tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()


def measure_flows() -> list[dict[str, Any]]:
    """
    Compute the durations of motions with stops, at constant speed in corners, and as flows [s].

    The limits are those of a Kachaka, the tolerance is 5 cm, and the rate is 20 Hz.
    """
    return [{
        'motion': name,
        'stops': plan(Motion(name, steps), KACHAKA, FLOW_RATE).duration,
        'constant': constant_speed(steps),
        'flow': plan(Motion(name, steps, corners=TOLERANCE), KACHAKA, FLOW_RATE).duration,
    } for name, steps in FLOWS.items()]


def lawn_mower() -> list[Step]:
    """Return five rows of 2 m, 0.3 m apart."""
    steps: list[Step] = [Forward(2.0)]
    for row in range(4):
        turn = Turn(math.pi / 2.0 if row % 2 == 0 else -math.pi / 2.0)
        steps += [turn, Forward(0.3), turn, Forward(2.0)]
    return steps


def slalom() -> list[Step]:
    """Return a way through six points, 0.5 m apart along x and 0.2 m to either side of it."""
    ys = [0.0, 0.2, -0.2, 0.2, -0.2, 0.2, 0.0]
    bearings = [math.atan2(two - one, 0.5) for one, two in pairwise(ys)]
    steps: list[Step] = []
    for index, (one, two) in enumerate(pairwise(ys)):
        steps += [Turn(bearings[index] - bearings[index - 1])] if index else []
        steps.append(Forward(math.hypot(0.5, two - one)))
    return steps


def constant_speed(steps: Sequence[Step]) -> float:
    """
    Return the duration of a motion with curves at constant speed as corners [s].

    The curve is as fast as the tolerance and half of each leg allow.
    """
    legs = [step.path()[0] for step in steps if isinstance(step, Forward)]
    turns = [step.path()[0] for step in steps if isinstance(step, Turn)]
    bounds = limits_along(legs[0], KACHAKA)
    duration, speeds, tangents = 0.0, [0.0], [0.0]
    for index, (one, two) in enumerate(pairwise(legs)):
        turn = CornerTurn(
            turns[index], limits_along(turns[index], KACHAKA), bounds, 1.0, FLOW_RATE)
        room = min(one.distance, two.distance) / 2.0

        def is_too_fast(speed: float, turn: CornerTurn = turn, room: float = room) -> bool:
            tangent, deviation = turn.measure(Shape(speed, speed, 0.0))
            return tangent > room or deviation > TOLERANCE

        speed = bounds.velocity
        if is_too_fast(speed):
            speed = bisection(0.0, speed, is_too_fast)[0]
        speeds.append(speed)
        tangents.append(turn.measure(Shape(speed, speed, 0.0))[0])
        duration += turn.profile.duration
    speeds.append(0.0)
    tangents.append(0.0)
    for index, leg in enumerate(legs):
        left = leg.distance - tangents[index] - tangents[index + 1]
        duration += FlowLeg.between(
            leg._replace(distance=max(0.0, left)), bounds, *speeds[index:index + 2]).duration
    for turn_after in turns[len(legs) - 1:]:
        duration += plan(Motion('turn', (Turn(turn_after.angle),)), KACHAKA, FLOW_RATE).duration
    return duration


def measure_exactness(rates: Sequence[int] = RATES) -> list[dict[str, Any]]:
    """
    Compute the displacement of an ideal robot for each goal, profile, rate and method.

    :returns: for each case the requested displacement, the smallest result and the largest result
        [m or rad]
    """
    entries = []
    for (name, goal), shape, rate, method in product(GOALS.items(), SHAPES, rates, METHODS):
        driven = METHODS[method](goal, SHAPES[shape], float(rate))
        entries.append({
            'goal': name, 'unit': 'rad' if isinstance(goal, Turn) else 'm', 'shape': shape,
            'rate': rate, 'way': method, 'asked': goal.path()[0].distance,
            'least': min(driven), 'most': max(driven)})
    return entries


def ours(goal: Forward | Turn, limits: Limits, rate: float) -> list[float]:
    """Return the displacement of this package's plan, summed over its velocities [m or rad]."""
    return [math.fsum(
        (segment.velocity.linear_x + segment.velocity.angular_z) * (segment.end - segment.start)
        for segment in plan(Motion('goal', (goal,)), limits, rate).segments)]


def sampled(goal: Forward | Turn, limits: Limits, rate: float) -> list[float]:
    """Return the displacement if each message samples the velocity profile [m or rad]."""
    path = goal.path()[0]
    profile = time_optimal_profile(path.distance, *limits_along(path, limits))
    count = math.ceil(profile.duration * rate)
    return [math.fsum(
        profile.state_at(index / rate).velocity for index in range(count)) / rate]


def smoothed(goal: Forward | Turn, limits: Limits, rate: float) -> list[float]:
    """
    Return the displacement with a velocity smoother, for each phase [m or rad].

    The target is the largest velocity for the time that the path takes at this velocity, and then
    zero.  Each message changes the velocity by at most the acceleration or deceleration limit
    times the period, in open loop, like Nav2's smoother.  The smoother has no jerk limit.
    """
    path = goal.path()[0]
    limits_here = limits_along(path, limits)
    return [_smoothed(path.distance, limits_here, rate, phase) for phase in PHASES]


def _smoothed(distance: float, limits: PathLimits, rate: float, phase: float) -> float:
    hold_time = distance / limits.velocity
    driven = velocity = 0.0
    index = 0
    while velocity > 0.0 or (index + phase) / rate < hold_time:
        target = limits.velocity if (index + phase) / rate < hold_time else 0.0
        velocity = max(velocity - limits.deceleration / rate,
                       min(target, velocity + limits.acceleration / rate))
        driven += velocity / rate
        index += 1
    return driven


#: The compared methods.
METHODS: dict[str, Callable[[Forward | Turn, Limits, float], list[float]]] = {
    'ours': ours, 'samples': sampled, 'smoother': smoothed}
#: The motions of the comparison of flows.
FLOWS: dict[str, list[Step]] = {
    'square 0.5 m, three corners': [*[Forward(0.5), Turn(math.pi / 2.0)] * 3, Forward(0.5)],
    'square, four turns': [Forward(0.5), Turn(math.pi / 2.0)] * 4,
    'slalom, six points': slalom(),
    'lawn-mower, five rows': lawn_mower()}
