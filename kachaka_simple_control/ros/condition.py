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
"""How a drive goes, as a diagnosis: a level, a sentence, and figures; pure, told what there is."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from kachaka_simple_control.ros.standing import Standing
from kachaka_simple_control.ros.tally import Tally

#: Odometry older than this is worth a warning [s]: it comes 10 times a second and more.
OLD = 1.0


class Severity(IntEnum):
    """The levels of ``diagnostic_msgs/msg/DiagnosticStatus``."""

    OK = 0
    WARN = 1
    ERROR = 2


class Condition(NamedTuple):
    """
    What is told once a second.

    :param level: how bad it is
    :param message: the worst of it, in a sentence
    :param values: what there is to know, by name
    """

    level: Severity
    message: str
    values: dict[str, str]


def condition(tally: Tally, standing: Standing, now: float) -> Condition:
    """
    Judge.

    :param tally: how the drive goes
    :param standing: how the node stands with its robot
    :param now: the time [s on the steady clock]
    :returns: the diagnosis
    """
    state = _state(tally, standing)
    level, message = _worst(tally, standing, state)
    age = standing.odometry_age
    return Condition(level, message, {
        'state': state,
        'motion': tally.motion or 'none',
        'step': '{} of {}'.format(*tally.step(now)),
        'late ticks': str(tally.late),
        'skipped ticks': str(tally.skipped),
        'listeners': str(standing.listeners),
        'other publishers': ', '.join(standing.others) or 'none',
        'guardian': standing.guardian,
        'odometry age': 'never heard' if age is None else f'{age:.2f} s',
        'manual control': standing.manual_control,
    })


def _state(tally: Tally, standing: Standing) -> str:
    if standing.halted_by is not None:
        return 'halted'
    if tally.is_on:
        return 'driving' if tally.has_begun else 'meeting the robot'
    if not tally.motion:
        return 'nothing to drive yet'
    return 'at rest' if tally.failure is None else 'stopped early'


def _worst(tally: Tally, standing: Standing, state: str) -> tuple[Severity, str]:
    if standing.halted_by is not None:
        return Severity.ERROR, f'halted for good: {standing.halted_by}'
    if standing.guardian.startswith('stopped'):
        return Severity.ERROR, f'the guardian {standing.guardian}'
    if tally.failure is not None:
        return Severity.WARN, f'the last motion was over before its end: {tally.failure}'
    doubts = [
        ('nobody takes our velocities', not standing.listeners),
        (f'others have publishers of velocities: {", ".join(standing.others)}', standing.others),
        ('odometry is silent', (standing.odometry_age or 0.0) > OLD),
        ('velocities were skipped', tally.skipped),
    ]
    for doubt, is_so in doubts:
        if is_so:
            return Severity.WARN, doubt
    return Severity.OK, state
