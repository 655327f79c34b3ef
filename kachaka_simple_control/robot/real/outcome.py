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
"""How a call to the robot ended."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

SUCCESS = 0


class Trouble(Enum):
    """Why there is no answer."""

    #: none came in time; the robot may still do what it was asked
    LATE = 'late'
    #: there is no connection
    GONE = 'gone'
    #: the robot does not know this call, or broke down over it
    FAILED = 'failed'


@dataclass(frozen=True)
class Outcome:
    """
    The robot's answer to one call, or why there is none.

    :param code: the robot's error code, 0 for success; None without an answer
    :param trouble: why there is no answer
    :param text: the same for a person
    """

    code: int | None = None
    trouble: Trouble | None = None
    text: str = ''

    @property
    def is_success(self) -> bool:
        """Whether the robot did as it was asked."""
        return self.code == SUCCESS

    @property
    def is_heard(self) -> bool:
        """Whether the robot was there to answer."""
        return self.trouble in (None, Trouble.FAILED)
