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
"""
Plans stay the same to the last bit, also where the code that makes them is written anew.

A plan is the one thing about a drive that can be known for certain before it: what is shown,
checked, recorded and calibrated rests on it.  A difference in the last bit is harmless on the
floor, but it shows that a formula was changed where only its form should have been, and nothing
else notices that.  So the plans of random motions and of the library are frozen in
``frozen_plans.json``, which nothing writes anew: whoever changes plans on purpose says so in the
changelog, and freezes others by hand.

The bits are compared where sine and cosine have the bits that they had when the plans were
frozen.  Everywhere the durations, poses and some velocities are compared to 1e-12.
"""

from __future__ import annotations

from collections.abc import Iterator
import hashlib
import json
import math
from pathlib import Path
from random import Random
import struct

from kachaka_simple_control.control.tick_scheduler import TickScheduler
from kachaka_simple_control.files.library import find, library
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import Plan, plan
from kachaka_simple_control.motion.steps import (
    Arc,
    Forward,
    Motion,
    Move,
    Repeat,
    Settle,
    Step,
    Turn,
    Wait,
)
import pytest

FROZEN = Path(__file__).with_name('frozen_plans.json')
RANDOM_PLANS = 800
#: Those of the library are planned at these rates [Hz], and at their own if they have one.
LIBRARY_RATES = (10.0, 50.0)


class Drawn:
    """
    Random limits, rates and steps.

    Only ``random()`` is used, whose numbers are the same in every version of Python, and of its
    results only sums and products, which are the same on every machine.
    """

    def __init__(self, seed: int) -> None:
        self._random = Random(seed).random
        self.limits = self._limits()
        self.rate = (4.0 + 96.0 * self._random() * self._random() if self._happens(0.5)
                     else self._one_of((4.0, 5.0, 10.0, 20.0, 30.0, 50.0, 100.0)))
        self.motion = Motion('drawn', self._steps(3))

    def _happens(self, probability):
        return self._random() < probability

    def _one_of(self, values):
        return values[int(self._random() * len(values))]

    def _spread(self, low, doublings):
        """Return a number from low on, in each of some doublings as often."""
        return low * (1 << int(self._random() * doublings)) * (1.0 + self._random())

    def _or_infinite(self, value):
        return math.inf if self._happens(0.2) else value

    def _or_none(self, value):
        return None if self._happens(0.4) else value

    def _limits(self):
        linear, angular = self._spread(0.05, 6), self._spread(0.1, 6)
        # By how much in a second, in velocities; the jerk in accelerations.
        linear_start, angular_start = self._spread(0.3, 6), self._spread(0.3, 6)
        return Limits(
            max_linear_velocity=linear, max_angular_velocity=angular,
            max_linear_acceleration=self._or_infinite(linear * linear_start),
            max_angular_acceleration=self._or_infinite(angular * angular_start),
            max_linear_jerk=self._or_infinite(linear * linear_start * self._spread(1.0, 6)),
            max_angular_jerk=self._or_infinite(angular * angular_start * self._spread(1.0, 6)),
            max_linear_deceleration=self._or_none(
                self._or_infinite(linear * self._spread(0.3, 6))),
            max_angular_deceleration=self._or_none(
                self._or_infinite(angular * self._spread(0.3, 6))),
            max_backward_velocity=self._or_none(linear * self._spread(0.2, 3)))

    def _steps(self, nesting):
        count = 1 + int(3.0 * self._random())
        return tuple(self._step(nesting) for _ in range(count))

    def _step(self, nesting: int) -> Step:
        if nesting and self._happens(0.25):
            return Repeat(int(4.0 * self._random()), self._steps(nesting - 1))
        make = self._one_of((
            self._move, self._forward, self._forward, self._turn, self._turn, self._arc,
            self._arc, self._arc, self._pause))
        return make()

    def _amount(self, largest):
        """Return how much of something: often little of it, seldom nothing."""
        return 0.0 if self._happens(0.03) else largest * self._random() * self._random()

    def _sign(self):
        return self._one_of((1.0, -1.0))

    def _forward_velocity(self, sign):
        return self.limits.max_linear_velocity if sign > 0.0 else self.limits.backward_velocity

    def _speed(self, largest):
        return self._or_none(largest * (0.05 + 0.95 * self._random()))

    def _move(self):
        sign = self._sign()
        return Move(
            self._one_of((sign, 0.0)) * self._random() * self._forward_velocity(sign),
            self._one_of((self._sign(), 0.0)) * self._random() * self.limits.max_angular_velocity,
            self._amount(4.0))

    def _forward(self):
        sign = self._sign()
        velocity = self._forward_velocity(sign)
        return Forward(sign * velocity * self._amount(4.0), self._speed(velocity))

    def _turn(self):
        velocity = self.limits.max_angular_velocity
        return Turn(self._sign() * velocity * self._amount(4.0), self._speed(velocity))

    def _arc(self):
        sign, radius = self._sign(), self._spread(0.01, 12)
        velocity = min(
            self._forward_velocity(sign), self.limits.max_angular_velocity * radius)
        return Arc(
            self._sign() * radius, sign * velocity / radius * self._amount(4.0),
            self._speed(velocity))

    def _pause(self):
        return self._one_of((Wait, Settle))(self._amount(2.0))


def plans() -> Iterator[tuple[str, Plan]]:
    """Yield the plans that are frozen, each with its name."""
    for seed in range(RANDOM_PLANS):
        drawn = Drawn(seed)
        yield f'random {seed}', plan(drawn.motion, drawn.limits, drawn.rate)
    for name in library():
        file = find(name)
        if file.motion.corners:  # a flow uses sines, whose last bits depend on the C library
            continue
        limits = file.check(KACHAKA.limits)
        for rate in sorted({*LIBRARY_RATES, file.rate or LIBRARY_RATES[0]}):
            yield f'{name} at {rate:g} Hz', plan(file.motion, limits, rate)


def ends(planned: Plan) -> tuple[float, ...]:
    """Return the duration [s] and the pose at the end [m, rad]."""
    return planned.duration, planned.pose.x, planned.pose.y, planned.pose.theta


def components(velocity: Velocity) -> tuple[float, float]:
    """Return the linear velocity [m/s] and the angular one [rad/s]."""
    return velocity.linear_x, velocity.angular_z


def digest(planned: Plan) -> str:
    """Return a digest of the bits of what is planned, and of what is sent of it when."""
    figures = [planned.period, *ends(planned)]
    for segment in planned.segments:
        figures += (*components(segment.velocity), segment.start, segment.end)
    scheduler = TickScheduler(planned)
    tick = scheduler.due(0.0)
    while tick is not None:
        figures += (*components(tick.velocity), tick.start, tick.deadline)
        tick = scheduler.due(tick.deadline)
    return digest_of(figures)


def digest_of(figures: list[float]) -> str:
    """Return a digest of the bits of some numbers."""
    return hashlib.sha256(struct.pack(f'<{len(figures)}d', *figures)).hexdigest()[:16]


def sample(planned: Plan) -> list[float]:
    """Return the duration [s], the pose at the end, and the velocities at a third and two."""
    count = len(planned.segments)
    return [*ends(planned), *(
        component for index in (count // 3, 2 * count // 3) if count
        for component in components(planned.segments[index].velocity))]


def libm() -> str:
    """Return a digest of what the C library of this machine computes."""
    angles = [0.007 * index for index in range(-2000, 2000)]
    return digest_of([
        value for angle in angles for value in (
            math.sin(angle), math.cos(angle), math.sqrt(abs(angle)), math.atan2(angle, 0.7),
            math.exp(angle))])


@pytest.fixture(scope='module')
def frozen() -> dict[str, list]:
    """Return digest and sample of each frozen plan."""
    return json.loads(FROZEN.read_text())['plans']


@pytest.fixture(scope='module')
def today() -> dict[str, Plan]:
    """Return the plans as they are made now."""
    return dict(plans())


@pytest.mark.needs('yaml', 'jsonschema')
def test_plans_are_the_frozen_ones_to_the_last_bit(frozen, today):
    if json.loads(FROZEN.read_text())['libm'] != libm():
        pytest.skip('sine and cosine have other bits on this machine')
    assert [name for name, (bits, _) in frozen.items() if digest(today[name]) != bits] == []


@pytest.mark.needs('yaml', 'jsonschema')
def test_plans_are_the_frozen_ones_on_any_machine(frozen, today):
    assert len(frozen) >= RANDOM_PLANS
    for name, (_, figures) in frozen.items():
        assert sample(today[name]) == pytest.approx(figures, rel=1e-12, abs=1e-12), name


def write() -> None:
    """
    Write the file, once.

    :raises FileExistsError: if it is there
    """
    entries = [
        f'{json.dumps(name)}: {json.dumps([digest(planned), sample(planned)])}'
        for name, planned in plans()]
    with FROZEN.open('x') as file:
        file.write(f'{{"libm": "{libm()}", "plans": {{\n' + ',\n'.join(entries) + '\n}}\n')


if __name__ == '__main__':
    write()
