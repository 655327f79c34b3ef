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
The command ``kachaka_simple_control``, which drives a motion or shows it without driving.

Tested by test/commands/test_confirmation.py.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import contextlib
import dataclasses
from pathlib import Path
import select
import shlex
import sys
import termios
from typing import TYPE_CHECKING

from kachaka_simple_control.commands.cli import Options, parse
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.files.library import LESSON_FUNCTION
from kachaka_simple_control.process.interrupts import exit_on_interrupt, raise_on_interrupt
from kachaka_simple_control.process.run_command import run_command
from kachaka_simple_control.process.signals import signal_dispatcher
from kachaka_simple_control.ros.environment import require_middleware

if TYPE_CHECKING:
    from kachaka_simple_control.analysis.drive_log import DriveLog

#: The answers that allow a drive.  The answer is empty if the user only presses Enter.
CONSENT = ('', 'y', 'yes')
#: How often the wait for an answer looks for Ctrl+C [s].
ANSWER_INTERVAL = 0.2


def confirm(floor_size: str, before: str = '') -> None:
    """
    Ask the user whether a robot may drive, and raise an error if it may not.

    :param before: an instruction that is printed before the question; empty for none
    :raises UsageError: if the answer is not Enter, y or yes, or there is no terminal to ask at
    """
    if not sys.stdin.isatty():
        raise UsageError('a robot will move, and there is no terminal to ask at: pass --yes')
    print(f'\nThe robot needs {floor_size} of free floor.  {before}', end='', flush=True)
    # Before the rest of the question: what is typed once it can be read is the answer.
    with contextlib.suppress(OSError, termios.error):
        termios.tcflush(sys.stdin.fileno(), termios.TCIFLUSH)
    print('Enter drives, n or Ctrl+C ends.', flush=True)
    answer = read_answer()
    if not answer or answer.strip().lower() not in CONSENT:
        raise UsageError('not confirmed: nothing was driven')


def read_answer() -> str:
    """
    Read a line that the user types, with its end; empty at the end of the input.

    Ctrl+C always ends the wait, at most ANSWER_INTERVAL late.
    """
    # A signal interrupts no read that begins just after it, or that another thread handles.
    while not select.select([sys.stdin], [], [], ANSWER_INTERVAL)[0]:
        pass
    return sys.stdin.readline()


def drive(options: Options) -> DriveLog:
    """
    Drive a robot as the options request, and return the record of the drive.

    :returns: empty if it is not recorded.  It is for a calibration, or with ``--sim``,
        ``--address``, ``--report`` or the ROS parameter ``summary``.
    :raises UsageError: if ROS 2 is not installed, or its setup file was not sourced
    :raises ControlError: if the drive could not be completed; the robot was stopped
    """
    with with_ros():
        from kachaka_simple_control.commands.drive import drive as drive_by_ros
    return drive_by_ros(options)


@contextlib.contextmanager
def with_ros() -> Iterator[None]:
    """
    Return a context manager in which modules that need ROS are imported: previews need none.

    :raises UsageError: if ROS 2 is not installed, or its setup file was not sourced
    """
    try:
        require_middleware()
        exit_on_interrupt()
        yield
        raise_on_interrupt()
    except ModuleNotFoundError as error:
        raise UsageError(
            f'to drive a robot needs ROS 2, and its {error.name} is not here: source it first, '
            'as in `source /opt/ros/jazzy/setup.bash`, or use the environment that `make setup` '
            'makes') from None


def _run(options: Options) -> None:
    if options.is_preview:
        from kachaka_simple_control.commands.preview import preview
        preview(options)
        return
    if options.repeat == 1:
        _drive_confirmed(options)
        return
    from kachaka_simple_control.report.output_file import prepare_report_dir
    with contextlib.ExitStack() as stack:
        if options.report is not None:
            stack.enter_context(prepare_report_dir(options.report))
        for number in range(1, options.repeat + 1):
            print(f'drive {number} of {options.repeat}', file=sys.stderr)
            _drive_confirmed(dataclasses.replace(
                options, report=options.report and str(Path(options.report, str(number)))))
            if signal_dispatcher.signum is not None:
                return
    if options.report is not None:
        print(f'kachaka_compare {shlex.quote(options.report)}/* compares them', file=sys.stderr)


def _drive_confirmed(options: Options) -> None:
    if options.address is not None and not options.yes:
        if options.pipe:
            raise UsageError('a robot will move: pass --yes, for --pipe asks nobody')
        from kachaka_simple_control.commands.preview import plan_view
        view = plan_view(options.motions[0] if options.motions else 'lesson', options)
        confirm(view.floor_size)
    drive(options)


def main(args: Sequence[str] | None = None) -> int:
    """Run the command ``kachaka_simple_control``."""
    options = parse(args)
    return run_command(
        lambda: _run(options), moves_robot=not options.is_preview,
        motion_function=LESSON_FUNCTION)
