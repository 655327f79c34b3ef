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
"""Run the function of a command, print an error in one line, and return the exit code."""

from __future__ import annotations

from collections.abc import Callable
import contextlib
import sys
import traceback

from kachaka_simple_control.errors import ControlError, InvalidMotionError
from kachaka_simple_control.process.exit_codes import code_of, DONE, SIGNALLED
from kachaka_simple_control.process.interrupts import raise_on_interrupt
from kachaka_simple_control.process.signals import signal_dispatcher
from kachaka_simple_control.text import escaped, escaped_lines, location, MAX_LINE_LENGTH

#: The default name of the command.
NAME = 'kachaka_simple_control'


def run_command(
        body: Callable[[], None], name: str = NAME, moves_robot: bool = True,
        motion_function: str | None = None) -> int:
    """
    Run the function of a command, print an error in one line, and return the exit code.

    An error about a file may have several lines.  If the function fails, and then the stop of the
    robot fails too, both errors are printed.

    :param motion_function: the name of a function; an invalid motion is reported with the line of
        this function that has it
    :returns: the exit code; after a signal, always 128 plus the number of the signal
    """
    code = DONE
    try:
        raise_on_interrupt()
        body()
    except KeyboardInterrupt:
        code = SIGNALLED + 2
    except Exception as error:
        code = code_of(error)
        # After a signal, an expected error only says that the signal stopped the motion.
        if signal_dispatcher.signum is None or not isinstance(error, ControlError):
            first = error.__context__
            # An error during a stop must not hide the error that caused the stop.
            with contextlib.suppress(OSError):  # such as a full disk
                if isinstance(first, ControlError) and not error.__suppress_context__:
                    print(_message(first, name, moves_robot, motion_function), file=sys.stderr)
                print(_message(error, name, moves_robot, motion_function), file=sys.stderr)
    return code if signal_dispatcher.signum is None else SIGNALLED + signal_dispatcher.signum


def _message(
        error: Exception, name: str, moves_robot: bool, motion_function: str | None) -> str:
    if isinstance(error, ControlError) and error.begins_with_line:
        return escaped_lines(error)
    if isinstance(error, InvalidMotionError) and (line := _line_in(motion_function, error)):
        return f'{line}: {escaped(error, MAX_LINE_LENGTH)}'
    if isinstance(error, ControlError):
        return f'{name}: {escaped(error, MAX_LINE_LENGTH)}'
    if isinstance(error, SyntaxError) and error.filename:
        # The code of the lesson, which its reader edits; nothing in the file was run.
        place = escaped(location(error.filename, error.lineno), MAX_LINE_LENGTH)
        return f'{place}: {escaped(error.msg, MAX_LINE_LENGTH)}'
    frame = traceback.extract_tb(error.__traceback__)[-1]
    text = escaped(error, MAX_LINE_LENGTH)
    end = '; a robot that moved was stopped' if moves_robot else ''
    return (f'{name}: unexpected {type(error).__name__}: {text} '
            f'({frame.filename}:{frame.lineno}){end}')


def _line_in(function: str | None, error: Exception) -> str:
    """Return the line of a function in which an error was raised, as ``file:line``, or nothing."""
    frames = traceback.extract_tb(error.__traceback__)
    return next((escaped(location(frame.filename, frame.lineno), MAX_LINE_LENGTH)
                 for frame in reversed(frames) if frame.name == function), '')
