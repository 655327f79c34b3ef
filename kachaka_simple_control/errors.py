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
"""The errors that refuse or end a motion, each with one line for a person to read."""

from __future__ import annotations


class ControlError(RuntimeError):
    """Base of the errors that end a run; ``InvalidMotionError`` comes before there is one."""


class UsageError(ControlError):
    """An option or a parameter cannot work as it is; nothing moved."""


class RobotNotFoundError(ControlError):
    """No robot listened, or none could be taken, within the time allowed; nothing moved."""


class RobotTakenError(RobotNotFoundError):
    """Another program drives the robot, or shows one under its names; nothing moved."""


class MotionRefusedError(ControlError):
    """The node may not move now: it was stopped for good, or is asked from a wrong place."""


class RunFaultError(ControlError):
    """A run could not go on as planned; the robot was stopped."""


class InvalidMotionError(ValueError):
    """
    A motion was refused before anything moved: a value is missing, wrong or beyond a limit.

    :ivar message: what is wrong, in one line, without the place
    :ivar path: the place in the motion, as in ``steps[2].turn.speed``; None if there is none
    """

    def __init__(self, message: str, path: str | None = None) -> None:
        """
        Say what is wrong, and where.

        :param message: what is wrong: the value with its unit, the bound, what to do
        :param path: the place in the motion
        """
        super().__init__(message if path is None else f'{path}: {message}')
        self.message = message
        self.path = path
