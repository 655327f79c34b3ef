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
"""Define the errors that this package raises, with messages for the user."""

from __future__ import annotations

from typing import Any

#: The message if tornado, which serves the page of the console, is not installed.
TORNADO_MISSING = (
    'the page needs tornado, which is missing here; install it with: pip install '
    "'kachaka_simple_control[console]', or sudo apt install python3-tornado")


class ControlError(RuntimeError):
    """
    The base class of the errors that this package raises for the user.

    The message is one line.  Only the message of a ``FileError``, which is about a file, may have
    several lines: one for each problem in the file.
    """

    #: whether the message begins with file and line, which many editors show as a link
    begins_with_line = False

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what pickle needs, whatever arguments a class takes, for another process."""
        return _restored, (type(self), self.args, self.__dict__)


def _restored(
        kind: type[ControlError], args: tuple[object, ...], state: dict[str, Any]) -> ControlError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(state)
    return error


class UsageError(ControlError):
    """An option, a parameter or a name is invalid; the robot has not moved."""


class RobotNotFoundError(ControlError):
    """No robot was found, or the robot was not ready in time; the robot has not moved."""


class RobotTakenError(RobotNotFoundError):
    """
    Another program already drives the robot, or another bridge uses the same ROS names.

    This program has not moved the robot.
    """


class MotionRefusedError(ControlError):
    """
    A motion is not allowed to start now, or was ended early.

    For example, no motion is allowed to start after a signal, during another motion, or in a
    callback of the node.
    """


class MotionRunningError(MotionRefusedError):
    """
    A motion cannot start, because another thread of this program drives the robot.

    The motion of the other thread continues.
    """


class MotionStoppedError(MotionRefusedError):
    """A motion was ended on request, for example by a call of ``stop_robot()``."""


class RobotMovedError(MotionRefusedError):
    """
    A paused motion was not resumed, because the robot was moved during the pause.

    The motion stays paused.
    """


class RunFaultError(ControlError):
    """
    A motion could not continue as planned, a stop failed, or another fault occurred.

    If the fault ended a motion, this program has tried to stop the robot.
    """


def control_error(error: BaseException) -> ControlError:
    """
    Convert the error that ends a motion to a ``ControlError``, and return it.

    A ``ControlError`` is returned unchanged.
    """
    if isinstance(error, ControlError):
        return error
    return MotionRefusedError(f'the motion was ended by {error!r}')


#: The end of each message about a program that was blocked: the likely causes and the remedy.
HELD_UP_ADVICE = (
    'its machine was busy or suspended, or it was stopped by Ctrl+Z. If the machine is busy, end '
    'what keeps it so; then drive again')


#: The answer to a command that comes when nothing is driven any more.
ENDED = 'ended: nothing is driven any more'


class PauseTimeoutError(RunFaultError):
    """A motion was paused for too long and was ended; other programs can now drive the robot."""


class InvalidMotionError(ControlError, ValueError):
    """
    A motion is invalid, because a value is missing, wrong or beyond a limit.

    The robot has not moved.

    :param message: the text of the error without ``path`` and ``name``, for example the value with
        its unit, the limit, and advice for the user
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
        """Return the path and the name of the value, as far as known, followed by the message."""
        text = self.message if self.name is None else f'{self.name} is {self.message}'
        return text if self.path is None else f'{self.path}: {text}'

    def at(self, path: str) -> InvalidMotionError:
        """
        Return a copy of the error with a new path.

        :param path: the keys that lead to the wrong value, for example ``steps[2].turn.speed``
        """
        return InvalidMotionError(self.message, path, self.name)

    def by(self, whose: str) -> InvalidMotionError:  # noqa: ARG002 (LimitError uses it)
        """Return the error unchanged; only that of a ``LimitError`` says whose limit it is."""
        return self


class LimitError(InvalidMotionError):
    """
    A value is beyond a limit; the robot has not moved.

    :param lowest: the lowest allowed value; None if there is no lower limit
    :param whose: whose limit it is, as written in the message, for example ``the robot's`` in
        ``above the robot's limit``
    :param note: the end of the message, which says for which motion the limit is valid, for
        example ``backwards``; empty for any motion
    :param name: the name of the value; None if the name is part of a path, which the caller sets
        with ``at()``
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
        """
        Return a copy of the error with a new path.

        :param path: the keys that lead to the wrong value, for example ``steps[2].turn.speed``
        """
        return self._changed(path, self.whose)

    def by(self, whose: str) -> LimitError:
        """
        Return a copy of the error with a new value of ``whose``.

        :param whose: whose limit it is, as written in the message, for example ``the robot's`` in
            ``above the robot's limit``
        """
        return self._changed(self.path, whose)

    def _changed(self, path: str | None, whose: str) -> LimitError:
        changed = LimitError(
            self.value, self.unit, self.highest, self.lowest, whose=whose, note=self.note,
            name=self.name)
        changed.path = path
        return changed
