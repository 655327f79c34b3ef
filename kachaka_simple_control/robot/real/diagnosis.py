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
"""The state of link and robot, for ``/diagnostics``; pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
import math

from kachaka_simple_control.robot.real.error_texts import ErrorTexts, Level
from kachaka_simple_control.robot.real.link import Link

#: A robot that takes longer to answer than this [s] leaves little of its hold.
SLOW = 0.15


@dataclass(frozen=True)
class Status:
    """
    One entry of diagnostics.

    :param level: how bad it is
    :param name: of what
    :param message: how it is
    :param values: more of it
    """

    level: Level
    name: str
    message: str
    values: dict[str, str] = field(default_factory=dict)


def link_status(
        link: Link, address: str, round_trip: float, dropped: int, now: float) -> Status:
    """
    Return how the link is.

    :param link: the link
    :param address: of the robot
    :param round_trip: how long the robot took to answer a velocity last [s]; NaN for never
    :param dropped: how many velocities gave way to newer ones, or grew too old
    :param now: the time [s, steady clock]
    :returns: the entry
    """
    values = {'address': address, 'times lost': str(link.losses),
              'velocities dropped': str(dropped)}
    if not math.isnan(round_trip):
        values['last answer to a velocity after [ms]'] = f'{1e3 * round_trip:.1f}'
    if not link.is_up:
        since = '' if math.isnan(link.since) else f' for {now - link.since:.0f} s'
        return Status(Level.ERROR, 'link', f'lost{since}: {link.reason}', values)
    if round_trip > SLOW:
        text = f'slow: the robot answered after {1e3 * round_trip:.0f} ms'
        return Status(Level.WARN, 'link', text, values)
    return Status(Level.OK, 'link', 'up', values)


def robot_status(link: Link, codes: Sequence[int], texts: ErrorTexts) -> Status:
    """
    Return what is wrong with the robot.

    :param link: the link, without which nothing is known of it
    :param codes: the errors that it reports
    :param texts: what they mean
    :returns: the entry
    """
    if not link.is_up:
        return Status(Level.ERROR, 'robot', 'unknown: the link is lost')
    if not codes:
        return Status(Level.OK, 'robot', 'no errors')
    return Status(
        max(texts.find(code).level for code in codes), 'robot',
        '; '.join(texts.describe(code) for code in codes),
        {str(code): texts.find(code).title for code in codes})
