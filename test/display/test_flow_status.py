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
"""The status of a drive with corners that are driven without a stop."""

from itertools import pairwise

from flow_motions import QUARTER, ROUNDED, TIGHT
from kachaka_simple_control.control.events import OdometryReceived, VelocitySent
from kachaka_simple_control.display.drive_status import DriveTracker
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.motion.plan import plan
from plans import GENTLE
import pytest
from simulated_drive import SimulatedDrive

#: The longest way and the largest turn between two events, at 0.3 m/s and 1.57 rad/s [m, rad].
STEP = 0.3 * 0.06, 1.57 * 0.06


def statuses(motion, kind, **options):
    """Return the status after each event of a kind, and its time in the plan."""
    simulated = SimulatedDrive(20.0, lambda number: 0.0, title=motion.name, **options)
    simulated.drive(motion)
    simulated.close()
    tracker, found = DriveTracker(), []
    for event in simulated.events:
        tracker.on_event(event)
        if isinstance(event, kind) and tracker.is_under_way:
            found.append(tracker.status_at(event.time))
    return found


@pytest.mark.parametrize('motion', [ROUNDED, TIGHT])
def test_steps_and_times_are_those_of_the_plan_that_is_driven(motion):
    planned = plan(motion, GENTLE, 20.0)
    for status in statuses(motion, VelocitySent):
        assert status.duration == pytest.approx(planned.duration)
        step = planned.steps[status.step.number - 1]
        assert status.step.duration == pytest.approx(step.duration)
        elapsed = planned.duration - status.time_left
        assert step.start - 1e-6 <= elapsed <= step.end + 1e-6


@pytest.mark.parametrize('odometry_period', [0.02, None])
@pytest.mark.parametrize('motion', [ROUNDED, TIGHT])
def test_what_remains_of_a_step_falls_from_what_is_planned_to_nearly_nothing(
        motion, odometry_period):
    planned = plan(motion, GENTLE, 20.0)
    kind = VelocitySent if odometry_period is None else OdometryReceived
    found = statuses(motion, kind, parameters=SimulationParameters(),
                     odometry_period=odometry_period)
    steps = [status.step for status in found]
    numbers = [step.number for step in steps]
    assert set(numbers) >= {number for number, step in enumerate(planned.steps, 1)
                            if step.duration > 0.1}
    for index, (one, two) in enumerate(pairwise(steps)):
        for name, jump in zip(('distance', 'angle'), STEP):
            before, after = (getattr(step.remaining, name) for step in (one, two))
            if one.number == two.number:
                assert (before is None) == (after is None)
                assert before is None or -1e-9 <= before - after <= jump
                continue
            total = abs(getattr(planned.steps[two.number - 1].displacement, name))
            if after is not None:
                # The end of the step before, if it turned the other way, may come after the sample
                # that begins this one.
                assert total - jump <= after <= total + 1e-4
            if before is not None and index:
                assert 0.0 <= before <= jump


def test_a_corner_has_a_distance_and_an_angle():
    first = next(status.step for status in statuses(ROUNDED, VelocitySent)
                 if status.step.number == 2)
    assert first.description == 'turn 90 deg'
    assert first.remaining.distance == pytest.approx(0.44, abs=0.02)
    assert first.remaining.angle == pytest.approx(QUARTER, abs=0.05)
