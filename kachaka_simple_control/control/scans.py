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
The time and the points of a scan of a laser.

Tested by test/control/test_scans.py.
"""

from __future__ import annotations

from functools import lru_cache
import math

from kachaka_simple_control.control.timing import SCAN_TIMEOUT
from kachaka_simple_control.files.cdr import NANO, Scan
from kachaka_simple_control.motion.geometry import Point, Pose

#: A scan counts if at least this part of its ranges says something: a distance, or that nothing is
#: near.  A laser that is covered has none.
LEAST_KNOWN = 0.1
#: By how much two clocks may drift apart [s/s].  Chosen: twice the rate at which NTP moves one.
DRIFT = 1e-3
#: A larger distance is no distance [m].
FARTHEST = 1000.0
#: A range of 0 means that there is none [m].
NEAREST = 1e-6


class ScanClock:
    """
    Tells when a scan was taken by its stamp, whatever the clock of the laser says.

    The scan that was quickest to arrive so far is the reference; it is taken for slower by DRIFT,
    so that clocks may drift.
    """

    def __init__(self) -> None:
        self._offset, self._arrived = math.inf, math.inf
        self._newest = 0

    def taken(self, arrived: float, stamp: int) -> float | None:
        """
        Return when a scan was taken [s], by when it arrived and its stamp [ns].

        :returns: None for a scan that does not count: it is not newer than the one before, it is
            old, or its stamp is from the future
        """
        offset = arrived - stamp / NANO
        if stamp <= self._newest or offset < self._offset - SCAN_TIMEOUT < math.inf:
            return None
        reference = self._offset + DRIFT * max(0.0, arrived - self._arrived)
        self._newest, self._offset, self._arrived = stamp, min(reference, offset), arrived
        taken = stamp / NANO + self._offset
        return taken if arrived - taken <= SCAN_TIMEOUT else None


def points_of(scan: Scan, laser: Pose) -> tuple[Point, ...] | None:
    """
    Return what a scan has seen, in the frame of the robot; None if the scan says nothing.

    :param laser: the pose of the laser in the frame of the robot
    """
    count = len(scan.ranges)
    if not math.isfinite(abs(scan.angle) + abs(scan.increment) * count):
        return None
    directions = _directions(scan.angle + laser.theta, scan.increment, count)
    least, most = max(scan.nearest, NEAREST), min(scan.farthest, FARTHEST)
    x, y = laser.x, laser.y
    # A comparison with NaN is false.
    points = tuple([
        (x + distance * cosine, y + distance * sine)
        for distance, (cosine, sine) in zip(scan.ranges, directions) if least <= distance <= most])
    # An infinite range says that nothing was near.
    known = len(points) + scan.ranges.count(math.inf)
    return points if known and known >= LEAST_KNOWN * count else None


@lru_cache(8)
def _directions(angle: float, increment: float, count: int) -> list[tuple[float, float]]:
    """Return the cosine and the sine of the direction of each range."""
    angles = [angle + increment * index for index in range(count)]
    return [(math.cos(one), math.sin(one)) for one in angles]
