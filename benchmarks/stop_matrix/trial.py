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
"""What was seen when something happened to a program in mid-motion."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Trial:
    """
    One program, and what happened to it.

    :param zero: the time from the fault to the first zero [s]; None if none came
    :param zeros: how many zeros were received from then on
    :param late: how many velocities of ours that move followed the first zero; where no zero
        came, how many followed the fault
    :param metres: how far the simulated robot drove after the fault [m]; None if nobody can tell
    :param code: the exit code, as a shell tells it; None if the program did not end
    :param message: what the program said last
    :param broken: what else was promised and not kept, a sentence each
    """

    zero: float | None
    zeros: int
    late: int
    metres: float | None
    code: int | None
    message: str
    broken: tuple[str, ...] = ()

    def data(self) -> dict[str, Any]:
        """
        Return the trial as plain data.

        :returns: what ``Trial.of`` takes
        """
        return asdict(self)

    @staticmethod
    def of(data: dict[str, Any]) -> Trial:
        """
        Return a trial from plain data.

        :param data: as ``data`` returned it, or JSON made of that
        :returns: the trial
        """
        return Trial(**{**data, 'broken': tuple(data['broken'])})
