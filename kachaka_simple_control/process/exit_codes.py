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
"""
The exit codes of the commands, and an argument parser that uses them.

Tested by test/process/test_run_command.py.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from difflib import get_close_matches
import re
from typing import Any, NoReturn

from kachaka_simple_control.errors import InvalidMotionError, RobotNotFoundError, UsageError
from kachaka_simple_control.text import escaped

DONE = 0
#: The run could not continue, or an unexpected error occurred; the robot was stopped.
FAULTED = 1
#: An option, parameter, file or motion is invalid; the robot has not moved.
BAD_USAGE = 2
#: No robot is ready, or another program drives the robot; this program has not moved it.
NO_ROBOT = 3
#: A signal stopped the program: the exit code is this number plus the number of the signal.
SIGNALLED = 128

HELP = """
exit codes: 0 done; 1 faulted; 2 bad usage or motion; 3 no robot listens, or another
program drives it; 128 + N stopped by signal N (130 after Ctrl+C)
"""


def code_of(error: BaseException) -> int:
    """
    Return the exit code of a command that ended with an error.

    The code is 2 for an invalid motion or option, 3 if no robot is ready or another program drives
    the robot, and 1 for any other error.
    """
    if isinstance(error, (InvalidMotionError, UsageError)):
        return BAD_USAGE
    return NO_ROBOT if isinstance(error, RobotNotFoundError) else FAULTED


#: Options of ROS, which must follow after ``--ros-args``.
ROS_OPTIONS = ('-p', '--param', '-r', '--remap', '--params-file')


class OneLineParser(argparse.ArgumentParser):
    """
    An argument parser whose error messages are always one line.

    A word such as ``-5cm`` is a value, not an option.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        #: what to write instead of an option that this parser does not have, by the option
        self.advice: dict[str, str] = {}
        #: the option that takes words such as ``side=1m``; empty without one
        self.value_option = ''
        #: whether the program takes ROS arguments after ``--ros-args``
        self.takes_ros_arguments = False
        # argparse itself takes a negative number for a value only if nothing follows the number.
        self._negative_number_matcher = re.compile(r'-\.?[0-9]')

    def set_completers(self, completers: Mapping[str, Callable[..., list[str]]]) -> None:
        """Set the functions with which argcomplete completes the arguments in a shell."""
        for action in self._actions:
            if action.dest in completers:
                action.completer = completers[action.dest]  # type: ignore[attr-defined]

    def error(self, message: str) -> NoReturn:
        """
        Print an error message in one line, and exit with code 2.

        If the message is about an unknown option, it says what to write instead: a similar option,
        the advice of this parser, or ``--ros-args`` before an argument for ROS.
        """
        word = message.removeprefix('unrecognized arguments: ').partition('=')[0].partition(' ')[0]
        if word != message.partition('=')[0].partition(' ')[0]:
            if self.takes_ros_arguments and (word in ROS_OPTIONS or ':=' in message):
                message += '; write ROS arguments after --ros-args'
            elif word in self.advice:
                message += f'; {self.advice[word]}'
            elif self.value_option and '=' in message and not word.startswith('-'):
                message += f'; write {self.value_option} before each NAME=VALUE'
            else:
                message += self._suggestion(word)
        self.exit(BAD_USAGE, f'{self.prog}: {escaped(message, 300)}\n')

    def _suggestion(self, word: str) -> str:
        options = [option for action in self._actions for option in action.option_strings]
        near = get_close_matches(word, options, 1)
        return f'; did you mean {near[0]}?' if near else ''
