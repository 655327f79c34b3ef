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
"""Velocities as they were sent, for tests of what reads them."""

from __future__ import annotations

from kachaka_simple_control.control.events import VelocityKind, VelocitySent
from kachaka_simple_control.motion.geometry import Velocity, ZERO


def of_plan(
        time: float, velocity: Velocity = ZERO, began: float = 0.0, due: float | None = None,
        plan_time: float | None = None, **others: object) -> VelocitySent:
    """
    Return a velocity of a plan.

    :param time: when it was sent [s on the steady clock]
    :param began: t = 0 of its motion [s on the steady clock]
    :param due: when it was due [s after t = 0]; None: when it was sent
    :param plan_time: where on the plan that is [s of the plan]; None: as planned
    """
    due = time - began if due is None else due
    return VelocitySent(
        time, velocity, VelocityKind.PLAN, due, due if plan_time is None else plan_time, **others)


def of_stop(time: float) -> VelocitySent:
    """Return a zero of a stop, sent at a time [s on the steady clock]."""
    return VelocitySent(time, ZERO, VelocityKind.STOP)


def of_prime(time: float) -> VelocitySent:
    """Return a zero before a motion, sent at a time [s on the steady clock]."""
    return VelocitySent(time, ZERO, VelocityKind.PRIME)
