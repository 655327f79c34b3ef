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
Check the text of a motion and plan it in a worker process.

A plan may take a second of computing.  In the process of the console, no message would be handled
meanwhile, not even a stop.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
import contextlib
import subprocess
import sys

from kachaka_simple_control.console.folder import file_name, Folder
from kachaka_simple_control.console.folder_includes import FolderIncludes
from kachaka_simple_control.console.page_protocol import (
    AskPreview,
    LineError,
    MotionParameter,
    Plan,
    Preview,
)
from kachaka_simple_control.errors import ControlError
from kachaka_simple_control.files.document import FileError, format_path, is_path, Problem
from kachaka_simple_control.files.included_texts import find_among
from kachaka_simple_control.files.messages import from_json, to_json
from kachaka_simple_control.files.motion_file import MotionFile
from kachaka_simple_control.files.motion_reader import loads, read_all_parameters
from kachaka_simple_control.files.parameters import assign, Parameter
from kachaka_simple_control.files.robot_profile import find_robot, RobotProfile
from kachaka_simple_control.motion.paths import floor_area, sample_path
from kachaka_simple_control.process.processes import (
    child_environment,
    lower_priority,
    python_command,
)

#: A worker that takes longer is ended [s].  It needs a second or two, but has a low priority.
PATIENCE = 30.0
#: The largest number of points of a plan and of errors in an answer.
MAX_POINTS = 1000
MAX_ERRORS = 100
DEFAULT_ROBOT = 'kachaka'
DEFAULT_RATE = 10.0
#: The longest line of an answer [bytes]
LINE_LIMIT = 1_000_000


def preview(ask: AskPreview, folder: Folder, robot: str | None = None) -> Preview:
    """
    Check the text of a motion, and plan it as an open loop.

    :param folder: has the files that it may include
    :param robot: the name or the path of the robot's profile; None for what the text says
    """
    # A text of a page must not make the console read any path that it likes.
    includes = FolderIncludes(folder, ask.text)
    name, find = (file_name(ask.name), includes.find) if ask.included is None else (
        ask.name, find_among(ask.included))
    parameters = {part.name: part for part in read_all_parameters(ask.text)}
    values = {key: value for key, value in ask.values.items() if key in parameters}
    shown = tuple(_shown(parameter) for parameter in parameters.values())
    try:
        file = loads(ask.text, name, values, find)
        profile = _profile(file, robot)
        plan = file.order(
            profile, file.rate or DEFAULT_RATE, closed_loop=False, watch=bool(file.watch)).plan
    except FileError as error:
        wrong = assign(parameters, values)[1]
        problems = error.problems[:MAX_ERRORS]
        return Preview(
            ask.id, tuple(_line_error(part, name, wrong) for part in problems), None, shown)
    except ControlError as error:
        return Preview(ask.id, (LineError(None, str(error)),), None, shown)
    points = tuple(
        (round(pose.x, 4), round(pose.y, 4), round(pose.theta, 4))
        for pose in sample_path(plan, most=MAX_POINTS))
    (x0, y0), (x1, y1) = floor_area(plan, profile.footprint).corners
    return Preview(
        ask.id, (), Plan(points, (x0, y0, x1, y1), plan.duration, len(plan.steps)), shown,
        includes.texts)


def _shown(parameter: Parameter) -> MotionParameter:
    default = parameter.default
    return MotionParameter(
        parameter.name, parameter.description, None if default is None else default.text,
        parameter.bounds)


def _line_error(problem: Problem, name: str, wrong: Mapping[str, str]) -> LineError:
    """
    Return a problem for the page.

    :param name: the name of the file
    :param wrong: what is wrong with the value of a parameter, by the name of the parameter
    """
    if problem.source is not None:
        return LineError(problem.line_read, problem.describe(name))
    parameter = next((key for key, text in wrong.items() if problem.text == text
                      and problem.path == format_path(['parameters', key])), None)
    text = str(problem) if parameter is None else problem.text
    return LineError(problem.line, text, parameter)


def _profile(file: MotionFile, robot: str | None) -> RobotProfile:
    if robot is None and file.robot is not None:
        if is_path(file.robot):
            raise file.error_at(
                'robot', 'is a path, which is not read here; start the console with --robot')
        try:
            return find_robot(file.robot)
        except FileError as error:
            raise file.error_at('robot', error.problems[0].text) from None
    return find_robot(robot or DEFAULT_ROBOT)


class PreviewWorker:
    """
    The worker process of the previews; it is started when it is needed.

    All methods must be called in the thread of the event loop.

    :param robot: the name or the path of the robot's profile; None for what each text says
    :param folder: has the files that a text may include
    :param command: the command line of the worker; None for that of this module
    """

    def __init__(
            self, robot: str | None, folder: Folder,
            command: Sequence[str] | None = None) -> None:
        # The worker gets the open folder itself, as the console has it.
        self._passed = () if folder.handle is None else (folder.handle,)
        place = f'/dev/fd/{folder.handle}' if self._passed else ''
        self._command = list(command or [*python_command(__name__), robot or '', place])
        self._process: asyncio.subprocess.Process | None = None
        self._lock = asyncio.Lock()

    async def preview(self, ask: AskPreview) -> Preview:
        """Return the preview of a text; it waits for those that were asked for before."""
        async with self._lock:
            try:
                return await asyncio.wait_for(self._exchange(ask), PATIENCE)
            except asyncio.TimeoutError:
                why = f'planning took longer than {PATIENCE:g} s'
            except (OSError, ValueError) as error:
                why = f'the worker that plans has failed: {error}'
            await self.close()
            return Preview(ask.id, (LineError(None, why),), None)

    async def close(self) -> None:
        """End the worker."""
        process, self._process = self._process, None
        if process is not None:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()

    async def _exchange(self, ask: AskPreview) -> Preview:
        if self._process is None or self._process.returncode is not None:
            self._process = await asyncio.create_subprocess_exec(
                *self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, limit=LINE_LIMIT,
                env=child_environment(), pass_fds=self._passed)
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(to_json(ask).encode('ascii') + b'\n')
        await process.stdin.drain()
        line = await process.stdout.readline()
        return from_json(line.rstrip(), {Preview.TYPE: Preview}, LINE_LIMIT)


def main() -> int:
    """
    Run the worker: read requests from standard input, write previews to standard output.

    :returns: the exit code, when standard input is closed
    """
    lower_priority()
    robot, place = sys.argv[1:]
    folder = Folder(place or None)
    with contextlib.suppress(KeyboardInterrupt, BrokenPipeError):
        for line in sys.stdin.buffer:
            ask = from_json(line.rstrip(), {AskPreview.TYPE: AskPreview})
            sys.stdout.write(to_json(preview(ask, folder, robot or None), LINE_LIMIT) + '\n')
            sys.stdout.flush()
    return 0


if __name__ == '__main__':
    sys.exit(main())
