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
"""The contact of a simulated robot with its floor, found along its true motion."""

from __future__ import annotations

import math
from typing import NamedTuple

from kachaka_simple_control.motion.floor import Floor
from kachaka_simple_control.motion.geometry import compose, Footprint, ORIGIN, Pose
from kachaka_simple_control.motion.separation import Hull

#: The robot is looked at again when a point of it may have moved this far at the latest [m]: so
#: deep it may be in what it touches.
STEP = 0.001


class Contact(NamedTuple):
    """
    A contact of a robot with something on its floor.

    :param kind: what it touched: ``wall``, ``post`` or ``person``
    :param time: when [s since the floor was set up]
    :param pose: of the robot, on the floor
    """

    kind: str
    time: float
    pose: Pose

    def __str__(self) -> str:
        """Return what it touched, and where it was then, in one line."""
        pose = self.pose
        return (f'contact with a {self.kind} at x {pose.x + 0.0:.3f} m, y {pose.y + 0.0:.3f} m, '
                f'{math.degrees(pose.theta) + 0.0:.1f} deg after {self.time:.2f} s: the robot '
                'stays there')


class ContactFinder:
    """
    Finds the contact of a moving robot with its floor.

    A robot that stands is not looked at: who walks into it then is touched when it moves again.

    :param footprint: the outline of the robot
    :param start: when the floor was set up [s]
    :param place: where the robot starts on the floor
    """

    def __init__(
            self, floor: Floor, footprint: Footprint, start: float,
            place: Pose = ORIGIN) -> None:
        self._floor = floor
        self._hull = Hull.of(footprint)
        self._start = start
        self._place = place
        self._pose, self._time = ORIGIN, start
        #: how far the robot and people can still move without a contact [m], and when somebody
        #: comes, so that this says nothing any more [s]
        self._free, self._valid_until = 0.0, -math.inf

    def find(self, pose: Pose, now: float) -> Contact | None:
        """
        Return the contact of the robot at the next pose of its path; None if it is free.

        :param pose: seen from where the robot started; a few mm from the last one at most
        """
        last = self._pose
        self._free -= (
            math.hypot(pose.x - last.x, pose.y - last.y)
            + self._hull.reach * abs(pose.theta - last.theta)
            + self._floor.walking_speed * (now - self._time))
        self._pose, self._time = pose, now
        if self._free > 0.0 and now < self._valid_until:
            return None
        place, time = compose(self._place, pose), now - self._start
        nearest = self._floor.nearest(self._hull, place, time)
        if nearest.distance <= 0.0:
            return Contact(nearest.kind, time, place)
        self._free = max(nearest.distance, STEP)
        self._valid_until = self._start + self._floor.next_arrival(time)
        return None
