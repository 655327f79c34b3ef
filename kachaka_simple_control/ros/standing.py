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
"""How a node stands with its robot, in a form to be shown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from kachaka_simple_control.errors import ControlError
from kachaka_simple_control.execution.guardian import Guardian, Unguarded
from kachaka_simple_control.execution.publisher_edge import Access, PublisherEdge
from kachaka_simple_control.execution.stillness import Stillness
from kachaka_simple_control.ros.manual_control import ManualControl
from kachaka_simple_control.ros.robot_link import RobotLink


@dataclass(frozen=True)
class Standing:
    """
    One look at it.

    :param listeners: how many take the node's velocities
    :param others: who else has a publisher of velocities: the names of their nodes
    :param guardian: what became of the guardian
    :param odometry_age: how old the newest odometry is [s]; None if there was none
    :param manual_control: whether manual control is on, as far as this node knows
    :param halted_by: why nothing moves any more; None if it does
    """

    listeners: int
    others: tuple[str, ...]
    guardian: str
    odometry_age: float | None
    manual_control: str
    halted_by: str | None


class Lookout:
    """Looks at the parts of a session, from any thread, and changes nothing."""

    def __init__(
            self, edge: PublisherEdge, link: RobotLink, guardian: Guardian | Unguarded,
            odometry: Stillness, manual_control: ManualControl,
            halted_by: Callable[[], ControlError | None]) -> None:
        """
        Look at nothing yet.

        :param edge: where velocities leave
        :param link: what the graph tells of the robot
        :param guardian: who stops the robot if this process cannot
        :param odometry: what odometry tells
        :param manual_control: what the robot may need beside a subscription
        :param halted_by: returns why nothing moves any more
        """
        self._edge = edge
        self._link = link
        self._guardian = guardian
        self._odometry = odometry
        self._manual_control = manual_control
        self._halted_by = halted_by

    @property
    def is_closed(self) -> bool:
        """Whether the robot was given back: nothing is to be published any more."""
        return self._edge.access is Access.CLOSED

    def look(self, now: float) -> Standing:
        """
        Look.

        :param now: the time [s on the steady clock]
        :returns: how it is now
        """
        halted_by = self._halted_by()
        return Standing(
            listeners=self._link.listeners,
            others=tuple(self._link.others()),
            guardian=_guardian(self._guardian),
            odometry_age=self._odometry.silence(now),
            manual_control=self._manual_control.state(now),
            halted_by=str(halted_by) if halted_by else None)


def _guardian(guardian: Guardian | Unguarded) -> str:
    if isinstance(guardian, Unguarded):
        return 'off'
    if guardian.stopped_because is not None:
        return f'stopped the robot because {guardian.stopped_because}'
    return 'matched' if guardian.is_matched else 'not matched yet'
