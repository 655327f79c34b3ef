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
"""The result of one trial: a program, a fault, and what was measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Trial:
    """
    The result of one trial; its fields are the keys of a results file.

    :param zero: time from the fault to the first zero [s]; None if none was received
    :param zeros: number of zeros received since the motion began
    :param late: number of our non-zero velocities after the first zero; without any zero, after
        the fault
    :param metres: distance the simulated robot drove after the fault [m]; None if unknown
    :param code: exit code, as a shell gives it; None if the program did not end
    :param message: last line that the program printed
    :param broken: what else did not go as expected, one sentence each
    :param began: when it began to be measured [s, steady clock]; 0 if unknown
    :param ended: when it had ended [s, steady clock]; 0 if unknown
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
        """Return a trial from its fields, as ``dataclasses.asdict`` and JSON give them."""
        return Trial(**{**data, 'broken': tuple(data['broken'])})
