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
from collections.abc import Callable, Sequence
import contextlib
import subprocess
import sys

from kachaka_simple_control.console.page_protocol import AskPreview, LineError, Plan, Preview
from kachaka_simple_control.errors import ControlError
from kachaka_simple_control.files.document import FileError, is_path
from kachaka_simple_control.files.messages import from_json, to_json
from kachaka_simple_control.files.motion_file import MotionFile
from kachaka_simple_control.files.motion_reader import loads
from kachaka_simple_control.files.robot_profile import find_robot, RobotProfile
from kachaka_simple_control.motion.paths import floor_area, sample_path
from kachaka_simple_control.process.processes import (
    child_environment,
    lower_priority,
    python_command,
)

#: A worker that takes longer is ended [s].
PATIENCE = 10.0
#: The largest number of points of a plan and of errors in an answer.
MAX_POINTS = 1000
MAX_ERRORS = 100
DEFAULT_ROBOT = 'kachaka'
DEFAULT_RATE = 10.0
#: The longest line of an answer [bytes]
LINE_LIMIT = 1_000_000


def preview(number: int, text: str, robot: str | None = None, name: str = 'motion') -> Preview:
    """
    Check the text of a motion, and plan it as an open loop.

    :param robot: the name or the path of the robot's profile; None for what the text says
    """
    try:
        file = loads(text, name)
        profile = _profile(file, robot)
        plan = file.order(
            profile, file.rate or DEFAULT_RATE, closed_loop=False, watch=bool(file.watch)).plan
    except FileError as error:
        problems = error.problems[:MAX_ERRORS]
        return Preview(number, tuple(LineError(part.line, str(part)) for part in problems), None)
    except ControlError as error:
        return Preview(number, (LineError(None, str(error)),), None)
    points = tuple(
        (round(pose.x, 4), round(pose.y, 4), round(pose.theta, 4))
        for pose in sample_path(plan, most=MAX_POINTS))
    (x0, y0), (x1, y1) = floor_area(plan, profile.footprint).corners
    return Preview(number, (), Plan(
        points, (x0, y0, x1, y1), plan.duration, len(plan.steps)))


def _profile(file: MotionFile, robot: str | None) -> RobotProfile:
    if robot is None and file.robot is not None:
        if is_path(file.robot):
            # A text of the page must not make the console read any path that it likes.
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
    :param command: the command line of the worker; None for that of this module
    """

    def __init__(self, robot: str | None = None, command: Sequence[str] | None = None) -> None:
        options = [] if robot is None else [robot]
        self._command = list(command or [*python_command(__name__), *options])
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
                env=child_environment())
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(to_json(ask).encode('ascii') + b'\n')
        await process.stdin.drain()
        line = await process.stdout.readline()
        return from_json(line.rstrip(), {Preview.TYPE: Preview}, LINE_LIMIT)


def main(answer: Callable[..., Preview] = preview) -> int:
    """
    Run the worker: read requests from standard input, write previews to standard output.

    :returns: the exit code, when standard input is closed
    """
    lower_priority()
    robot = sys.argv[1] if len(sys.argv) > 1 else None
    with contextlib.suppress(KeyboardInterrupt, BrokenPipeError):
        for line in sys.stdin.buffer:
            ask = from_json(line.rstrip(), {AskPreview.TYPE: AskPreview})
            sys.stdout.write(to_json(answer(ask.id, ask.text, robot), LINE_LIMIT) + '\n')
            sys.stdout.flush()
    return 0


if __name__ == '__main__':
    sys.exit(main())
