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
"""A drive by hand that is recorded, and driven again from its record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import itertools
import math
import random
import time

from benchmarks.console_matrix.raw_client import RawClient
from benchmarks.console_matrix.stage import Stage
from benchmarks.console_matrix.trial import Expectation, Trial
from kachaka_simple_control.files.motion_reader import loads
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.motion.drive_order import DriveOrder
from kachaka_simple_control.motion.geometry import integrate, ORIGIN, Pose, relative_to, Velocity
from kachaka_simple_control.motion.paths import sample_path
from kachaka_simple_control.motion.steps import Move
from listener import SentVelocity
from waiting import poll

DURATION = 30.0
PERIOD = 0.05
#: The longest time that the hand wants the same velocity [s], and the largest velocities that it
#: wants [m/s, rad/s].
HOLD, LINEAR, ANGULAR = 1.5, 0.25, 0.8
#: So long the robot rests before its pose is read [s].
REST = 1.0
#: The largest difference of what was recorded and what is planned [m], and of the poses of the
#: simulated robot [m, degrees].
MAX_PLANNED, MAX_DISTANCE, MAX_ANGLE = 1e-6, 0.002, 0.2
#: How long a replay may take [s].
PATIENCE = DURATION + 30.0


class EndedEarlyError(Exception):
    """The drive process has ended during a trial."""


@dataclass(frozen=True)
class ReplayRow:
    """A row in which a hand drives for 30 s, and its record is driven."""

    expectation: Expectation
    full: int = 5
    quick: int = 0

    def run(self, stage: Stage) -> Trial:
        """Run one trial."""
        stage.leave_page()
        console = stage.console
        with RawClient(console.port).greet() as client:
            client.take()
            time.sleep(REST)
            start, began = _driven(client), time.time()
            text = _record(client)
            time.sleep(REST)
            by_hand, sent = relative_to(start, _driven(client)), _displacement(
                console.recorder.sent_since(began))
            start, began = _driven(client), time.time()
            answer = client.ask('run', text=text, name='record.yaml')
            if not answer['is_done']:
                return Trial(broken=(f'the record is refused: {answer["text"]}',))
            client.until(lambda: client.state['state'] == 'driving')
            client.until(lambda: client.state['state'] != 'driving', PATIENCE)
            time.sleep(REST)
            replayed, sent_again = relative_to(start, _driven(client)), _displacement(
                console.recorder.sent_since(began))
        planned = _difference(*recorded_and_planned(text))[0]
        distance, angle = _difference(by_hand, replayed)
        on_the_wire = _difference(sent, sent_again)[0]
        broken = [f'{what} differs by {value:.3g} {unit}, more than {most:g} {unit}'
                  for what, value, most, unit in (
                      ('the plan', planned, MAX_PLANNED, 'm'),
                      ('the pose', distance, MAX_DISTANCE, 'm'),
                      ('the heading', angle, MAX_ANGLE, 'degrees')) if value > most]
        count = text.count('- move')
        return Trial(broken=tuple(broken), note=(
            f'{count} steps; plan {1e9 * planned:.2g} nm, wire {1e3 * on_the_wire:.2f} mm, robot '
            f'{1e3 * distance:.2f} mm and {angle:.3f} deg off'))


def _record(client: RawClient) -> str:
    """Drive by hand at random, and return the record as the text of a motion."""
    client.messages.pop('recorded', None)
    client.ask('record', on=True)
    client.hand(0.0)
    end, until = time.monotonic() + DURATION, 0.0
    linear = angular = 0.0
    while (now := time.monotonic()) < end:
        if now >= until:
            until = now + random.uniform(0.2, HOLD)
            linear, angular = random.uniform(-LINEAR, LINEAR), random.uniform(-ANGULAR, ANGULAR)
        client.hand(linear, angular_z=angular)
        time.sleep(PERIOD)
    client.hand(0.0)
    time.sleep(REST)
    client.ask('record', on=False)
    recorded = poll(lambda: client.messages.get('recorded'), 10.0)
    if recorded is None:
        raise RuntimeError('there is no record')
    return str(recorded['text'])


def _driven(client: RawClient) -> Pose:
    # Not an error with which a trial may begin again: without a pose, the drive has ended.
    if client.state['driven'] is None:
        raise EndedEarlyError(f'{client.state["state"]}: {client.state["reason"]}')
    return Pose(*client.state['driven'])


def _displacement(velocities: Sequence[SentVelocity]) -> Pose:
    """Return the pose to which the sent velocities lead, each held until the next one."""
    pose = ORIGIN
    for one, following in itertools.pairwise(velocities):
        pose = integrate(
            pose, Velocity(one.linear_x, one.angular_z), following.time - one.time)
    return pose


def recorded_and_planned(text: str) -> tuple[Pose, Pose]:
    """Return the ends of the recorded steps, and of their plan."""
    file = loads(text, 'record')
    recorded = ORIGIN
    for step in file.motion.steps:
        assert isinstance(step, Move)
        recorded = integrate(recorded, step.velocity, step.duration)
    limits = file.check(KACHAKA.planning_limits, KACHAKA.name)
    plan = DriveOrder.of(file.motion, KACHAKA.planning_limits, 10.0, limits).plan
    return recorded, [*sample_path(plan)][-1]


def _difference(one: Pose, other: Pose) -> tuple[float, float]:
    """Return the distance [m] and the difference of the headings [degrees] of two poses."""
    return (math.hypot(one.x - other.x, one.y - other.y),
            abs(math.degrees(math.remainder(one.theta - other.theta, math.tau))))
