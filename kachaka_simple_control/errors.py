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
"""The errors that refuse or end a motion, with messages for the user."""

from __future__ import annotations


class ControlError(RuntimeError):
    """
    The base class of all errors of this package.

    The message is one line.  The message of a file error has one line for each problem instead.
    """


class UsageError(ControlError):
    """An option, a parameter or a name is invalid; the robot has not moved."""


class RobotNotFoundError(ControlError):
    """No robot was found, or no robot was ready, within the timeout; the robot has not moved."""


class RobotTakenError(RobotNotFoundError):
    """
    Another program drives the robot, or runs a bridge with the same ROS names.

    This program has not moved the robot.
    """


class MotionRefusedError(ControlError):
    """
    A motion is refused, because no motion may start now.

    Examples are a start after a stop, during another motion, or in a callback.
    """


class MotionRunningError(MotionRefusedError):
    """
    A motion is refused, because another thread of this program drives the robot.

    The motion of the other thread continues.
    """


class MotionStoppedError(MotionRefusedError):
    """A stop request ended a motion, as intended."""


class RobotMovedError(MotionRefusedError):
    """A motion stays paused, because the robot was moved during the pause."""


class RunFaultError(ControlError):
    """A run could not continue as planned; the robot was stopped."""


def control_error(error: BaseException) -> ControlError:
    """Convert an error that ends a run to a ``ControlError``, unless it is one already."""
    if isinstance(error, ControlError):
        return error
    return MotionRefusedError(f'the motion was ended by {error!r}')


#: The end of each message about a program that was blocked: the likely causes and the remedy.
HELD_UP_ADVICE = (
    'its machine was busy or suspended, or it was stopped by Ctrl+Z. End what keeps the machine '
    'busy, and drive again')


class PauseTimeoutError(RunFaultError):
    """A run was paused for too long; it was ended, and other programs may drive the robot."""


class InvalidMotionError(ControlError, ValueError):
    """
    A motion is invalid, because a value is missing, wrong or beyond a limit.

    The robot has not moved.

    :param message: the value with its unit, the limit and the remedy, without path and name
    :param path: the keys that lead to the value in the motion, for example
        ``steps[2].turn.speed``; None if unknown
    :param name: the name of the wrong value; None if more than one value is wrong
    """

    def __init__(self, message: str, path: str | None = None, name: str | None = None) -> None:
        super().__init__(message, path, name)
        self.message = message
        self.path = path
        self.name = name

    def __str__(self) -> str:
        """Return the message, after the path and the name if they are known."""
        text = self.message if self.name is None else f'{self.name} is {self.message}'
        return text if self.path is None else f'{self.path}: {text}'

    def at(self, path: str) -> InvalidMotionError:
        """Return a copy of the error with another path."""
        return InvalidMotionError(self.message, path, self.name)

    def by(self, whose: str) -> InvalidMotionError:  # noqa: ARG002 (LimitError uses it)
        """Return the error unchanged; only a ``LimitError`` names the owner of a limit."""
        return self


class LimitError(InvalidMotionError):
    """
    A value is beyond a limit; the robot has not moved.

    :param value: the value
    :param unit: the unit of the value and of the limits
    :param highest: the highest allowed value
    :param lowest: the lowest allowed value; None if there is no lower limit
    :param whose: the owner of the limit, for example ``the robot's``
    :param note: a text about what else lowers the limit; empty for none
    :param name: the name of the value; None if the path contains it
    """

    def __init__(
            self, value: float, unit: str, highest: float, lowest: float | None = None, *,
            whose: str, note: str = '', name: str | None = None) -> None:
        if lowest is None:
            text = f'{value} {unit} is above {whose} limit of {highest:.10g} {unit}{note}'
        else:
            text = (f'{value} {unit}, outside {whose} limits of {lowest:.6g} to {highest:.6g} '
                    f'{unit}{note}')
        super().__init__(text, None, name)
        self.value, self.unit, self.highest, self.lowest = value, unit, highest, lowest
        self.whose, self.note = whose, note

    def at(self, path: str) -> LimitError:
        """Return a copy of the error with another path."""
        return self._changed(path, self.whose)

    def by(self, whose: str) -> LimitError:
        """Return a copy of the error with another owner of the limit, such as ``the robot's``."""
        return self._changed(self.path, whose)

    def _changed(self, path: str | None, whose: str) -> LimitError:
        changed = LimitError(
            self.value, self.unit, self.highest, self.lowest, whose=whose, note=self.note,
            name=self.name)
        changed.path = path
        return changed
