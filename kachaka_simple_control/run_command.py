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
"""Run the program of a command, and turn its error into one line and an exit code."""

from __future__ import annotations

from collections.abc import Callable
import contextlib
import sys
import traceback

from kachaka_simple_control.control.interrupts import raise_on_interrupt
from kachaka_simple_control.control.signals import signal_dispatcher
from kachaka_simple_control.errors import ControlError, InvalidMotionError
from kachaka_simple_control.exit_codes import code_of, DONE, SIGNALLED
from kachaka_simple_control.files.document import FileError, location
from kachaka_simple_control.files.library import LESSON_FUNCTION
from kachaka_simple_control.text import escaped, escaped_lines, MAX_LINE_LENGTH

#: The default name of the command.
NAME = 'kachaka_simple_control'


def run_command(body: Callable[[], None], name: str = NAME) -> int:
    """
    Run a program, and turn the error that ends it into one line and an exit code.

    :param body: the program
    :param name: the name of the program
    :returns: the exit code; after a signal, always the exit code of the signal
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
            # An error of the stop must not hide the reason for the stop.
            with contextlib.suppress(OSError):  # a full disk
                if isinstance(first, ControlError) and not error.__suppress_context__:
                    print(_message(first, name), file=sys.stderr)
                print(_message(error, name), file=sys.stderr)
    return code if signal_dispatcher.signum is None else SIGNALLED + signal_dispatcher.signum


def _message(error: Exception, name: str) -> str:
    if isinstance(error, FileError) and error.problems[0].line is not None:
        # File and line come first, because editors make a link of them.
        return escaped_lines(error)
    if isinstance(error, InvalidMotionError) and (line := _line_of_lesson(error)):
        return f'{line}: {escaped(error, MAX_LINE_LENGTH)}'
    if isinstance(error, ControlError):
        return f'{name}: {escaped(error, MAX_LINE_LENGTH)}'
    frame = traceback.extract_tb(error.__traceback__)[-1]
    text = escaped(error, MAX_LINE_LENGTH)
    return (f'{name}: unexpected {type(error).__name__}: {text} '
            f'({frame.filename}:{frame.lineno}); a robot that moved was stopped')


def _line_of_lesson(error: Exception) -> str:
    """Return the file and line of the lesson's movement that failed; empty if there is none."""
    frames = traceback.extract_tb(error.__traceback__)
    return next((escaped(location(frame.filename, frame.lineno), MAX_LINE_LENGTH)
                 for frame in reversed(frames) if frame.name == LESSON_FUNCTION), '')
