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
The legs of a flow: lines and arcs that need not begin and end at rest.

Tested by test/motion/test_flow.py.
"""

from __future__ import annotations

from dataclasses import dataclass

from kachaka_simple_control.motion.path_segment import PathSegment
from kachaka_simple_control.motion.replanning import replan_through, replan_to_end, Replanned
from kachaka_simple_control.motion.trajectory import ProfiledPath
from kachaka_simple_control.motion.velocity_profile import PathLimits, PathState


@dataclass(frozen=True)
class FlowLeg(ProfiledPath):
    """
    A straight line or an arc of a flow, which need not begin and end at rest.

    :param start: the velocity at the start [m/s], not negative
    :param end: the velocity at the end [m/s], not negative
    """

    start: float = 0.0
    end: float = 0.0

    @classmethod
    def between(
            cls, segment: PathSegment, limits: PathLimits, start: float, end: float) -> FlowLeg:
        """Return the fastest leg between two velocities [m/s], not negative."""
        profile = replan_to_end(
            PathState(0.0, start), segment.distance, limits.velocity, end, limits)
        return cls(segment, limits, profile, start, end)

    @property
    def max_rate(self) -> float:
        """Return the largest planned velocity along the leg [m/s]."""
        # Rounding must not raise it above the limit.
        return min(self.profile.velocity, self.limits.velocity)

    @property
    def planned_start(self) -> PathState:
        """Return the planned position and velocity at the start of the leg."""
        return PathState(0.0, self.start)

    def first_state(self, factor: float, velocity: float) -> PathState:  # noqa: ARG002
        """
        Return the state at the start of the leg.

        :param velocity: that of the previous trajectory [m/s]; not used if the leg begins at rest
        """
        return PathState(0.0, velocity if self.start else 0.0)

    def replanned(self, state: PathState, factor: float) -> Replanned:
        """
        Plan the rest of the leg again, with its velocities multiplied by another speed factor.

        :param factor: 0 for a stop as soon as possible, which may need more than the rest of the
            leg
        """
        if not factor:
            return replan_through(state, self.segment.distance, 0.0, self.limits)
        return replan_to_end(
            state, self.segment.distance, factor * self.max_rate, factor * self.end, self.limits)
