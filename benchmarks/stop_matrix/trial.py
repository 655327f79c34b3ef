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
"""The result of one trial, in which a fault is injected into a driving program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Trial:
    """
    The result of one trial; its fields are the keys of a results file.

    :param zero: the time from the fault to the first zero [s]; None if no zero was received
    :param zeros: the number of received zeros since the motion began
    :param late: the number of the program's nonzero velocities after the first zero, or after the
        fault if there was no zero
    :param metres: the distance that the simulated robot drove after the fault [m]; None if unknown
    :param code: the exit code, as a shell shows it; None if the program did not end
    :param message: the last line that the program printed
    :param broken: a sentence for each other violation
    :param began: the start of the measurement [s, steady clock]; 0 if unknown
    :param ended: the end of the trial [s, steady clock]; 0 if unknown
    """

    zero: float | None
    zeros: int
    late: int
    metres: float | None
    code: int | None
    message: str
    broken: tuple[str, ...] = ()
    began: float = 0.0
    ended: float = 0.0

    @staticmethod
    def from_json(data: dict[str, Any]) -> Trial:
        """Create a trial from its fields, as converted by ``dataclasses.asdict`` and JSON."""
        return Trial(**{**data, 'broken': tuple(data['broken'])})
