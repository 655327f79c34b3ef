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
"""The errors that refuse or end a motion; each message is one line for a user."""

from __future__ import annotations


class ControlError(RuntimeError):
    """Base of all errors of this package; one line, or one for each problem of a file."""


class UsageError(ControlError):
    """An option, a parameter or a name is invalid; nothing moved."""


class RobotNotFoundError(ControlError):
    """No robot was found, or none could be driven, within the timeout; nothing moved."""


class RobotTakenError(RobotNotFoundError):
    """Another program drives the robot, or is a bridge under its names; nothing moved."""


class MotionRefusedError(ControlError):
    """No motion is allowed now: a stop, another motion, or a call in a callback forbids it."""


class MotionRunningError(MotionRefusedError):
    """Another thread of this program drives the robot; that motion goes on."""


class MotionStoppedError(MotionRefusedError):
    """A motion was ended by a call that stops the robot: as somebody wanted."""


class RobotMovedError(MotionRefusedError):
    """A pause is not ended: somebody moved the robot meanwhile."""


class RunFaultError(ControlError):
    """A run could not go on as planned; the robot was stopped."""


def control_error(error: BaseException) -> ControlError:
    """Return an error as one of this package, for a run that it ends."""
    if isinstance(error, ControlError):
        return error
    return MotionRefusedError(f'the motion was ended by {error!r}')


#: Why a program is held up, and what to do; every message that says so ends with it.
HELD_UP_ADVICE = (
    'its machine was busy or suspended, or it was stopped by Ctrl+Z. End what keeps the machine '
    'busy, and drive again')


class PauseTimeoutError(RunFaultError):
    """A run was paused for too long; the robot was released."""


class InvalidMotionError(ControlError, ValueError):
    """
    A motion is invalid: a value is missing, wrong or beyond a limit; nothing moved.

    :param message: the value with its unit, the bound, what to do; without the path
    :param path: the key path in the motion, as in ``steps[2].turn.speed``; None if there is none
    """

    def __init__(self, message: str, path: str | None = None) -> None:
        super().__init__(message if path is None else f'{path}: {message}')
        self.message = message
        self.path = path
