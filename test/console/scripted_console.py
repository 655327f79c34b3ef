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
"""Run the real console with the scripted drive process; ``--drive=WORD`` passes a word to it."""

from __future__ import annotations

from functools import partial
from pathlib import Path
import sys

from kachaka_simple_control.console.console_command import parse, PROGRAM, run
from kachaka_simple_control.console.drive_process import DriveProcess
from kachaka_simple_control.console.reports import Reports
from kachaka_simple_control.kachaka.program import ExitError

ONE_ROBOT, FLEET = (
    Path(__file__).with_name(name) for name in ('scripted_drive.py', 'scripted_fleet.py'))
DRIVE_OPTION = '--drive='


def drive_command(*words: str, script: Path = ONE_ROBOT) -> list[str]:
    """Return the command line of the scripted drive process."""
    return [sys.executable, str(script), *words]


def main(arguments: list[str]) -> int:
    """Run the console until a signal ends it."""
    words = [word.removeprefix(DRIVE_OPTION) for word in arguments
             if word.startswith(DRIVE_OPTION)]
    own = [word for word in arguments if not word.startswith(DRIVE_OPTION)]
    try:
        options = parse([*own, '--no-browser'])
        reports = Reports(options.reports)
        command = partial(drive_command, *words) if options.fleet is None else partial(
            drive_command, options.fleet, *words, script=FLEET)
        return run(
            options, partial(DriveProcess, lambda: command(*reports.options())), reports)
    except ExitError as error:
        print(f'{PROGRAM}: {error}', file=sys.stderr)
        return error.code


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
