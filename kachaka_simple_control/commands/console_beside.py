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
"""Serve the page of the console beside a drive that begins in this program."""

from __future__ import annotations

import importlib.util
import os
import select
import subprocess

from kachaka_simple_control.commands.remote_commands import RemoteCommands
from kachaka_simple_control.commands.remote_reports import ReportWriter
from kachaka_simple_control.errors import TORNADO_MISSING, UsageError
from kachaka_simple_control.files import protocol
from kachaka_simple_control.files.motion_file import MotionFile
from kachaka_simple_control.kachaka_simple_control import KachakaSimpleControl
from kachaka_simple_control.motion.floor import Floor
from kachaka_simple_control.process.processes import child_environment, python_command

CONSOLE = 'kachaka_simple_control.console.console_command'
#: How long the console may take to listen, and to end [s].
START_TIMEOUT, END_TIMEOUT = 10.0, 3.0


class ConsoleBeside(RemoteCommands):
    """
    The page of the console for a drive that begins in this program; a context manager.

    The console is a child process: if it ends, the drive goes on, because it began in a terminal.

    :param robot: for the plans that the page shows; None for the default
    :param motion_file: the motion, whose plan the page draws; None without a file
    :param floor: what stands on the floor of a simulated robot; None if unknown
    :raises UsageError: if tornado is missing, or if the console does not start
    """

    def __init__(
            self, robot_control: KachakaSimpleControl, robot: str | None,
            motion_file: MotionFile | None, floor: Floor | None = None) -> None:
        if importlib.util.find_spec('tornado') is None:
            raise UsageError(TORNADO_MISSING)
        commands, for_console = os.pipe()
        from_drive, reports = os.pipe()
        robot_option = [] if robot is None else [f'--robot={robot}']
        self._process = subprocess.Popen(
            [*python_command(CONSOLE), '--no-browser', *robot_option,
             f'--beside={from_drive},{for_console},{os.getpid()}'],
            # Ctrl+C is for this program, which stops the robot, and then closes the pipes.
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, start_new_session=True,
            env=child_environment(), pass_fds=(from_drive, for_console))
        for file in (from_drive, for_console):
            os.close(file)
        self._motion_file = motion_file
        super().__init__(robot_control, commands, ReportWriter(reports))
        self._writer.floor = floor

    def __enter__(self) -> ConsoleBeside:
        """Wait for the address of the page, and log it."""
        link = self._read_link()
        if not link:
            self.__exit__()
            raise UsageError('the console has not started, so nothing was driven')
        self._robot_control.get_logger().info(f'Console: {link}')
        self.start()
        file = self._motion_file
        if file is not None and file.text is not None:
            self._writer.write(protocol.MotionText(
                file.text, file.source, file.values, file.included_texts))
        return self

    def __exit__(self, *error: object) -> None:
        """Tell the page that the program ends, and end the console."""
        self.finish()
        self._writer.close()
        try:
            self._process.wait(END_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()

    def _read_link(self) -> str:
        stdout = self._process.stdout
        assert stdout is not None
        if not select.select([stdout], [], [], START_TIMEOUT)[0]:
            return ''
        return stdout.readline().decode().removeprefix('ready: ').strip()

    def _on_closed(self) -> None:
        # The drive began in a terminal, so it goes on.
        if not self._is_over:
            self._robot_control.get_logger().warning('The console has ended; the drive goes on')
        os.close(self._source)
