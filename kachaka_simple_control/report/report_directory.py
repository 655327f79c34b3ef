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
"""Prepare a report before a drive: its directory, its libraries, the program that writes it."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import importlib.util
from pathlib import Path
import tempfile

from kachaka_simple_control.errors import InvalidMotionError, UsageError

#: The program that writes a report.
REPORT_MODULE = 'kachaka_simple_control.report.report_program'
NEEDS_JINJA2 = 'it needs Jinja2: pip install jinja2, or sudo apt install python3-jinja2'
NEEDS_MCAP = "it needs mcap 1.5 or newer: pip install 'mcap>=1.5'"


def missing_libraries() -> list[str]:
    """Return a sentence for each file that is left out because its library is missing."""
    needs = {'jinja2': f'report.html is left out: {NEEDS_JINJA2}',
             'mcap': f'run.mcap is left out: {NEEDS_MCAP}'}
    return [text for name, text in needs.items() if importlib.util.find_spec(name) is None]


@contextlib.contextmanager
def prepare_report_dir(name: str) -> Iterator[None]:
    """
    Create a directory for a report; remove it if the block raises an error of usage or motion.

    :param name: the directory; it may exist if it is empty
    :raises UsageError: if it cannot be created or written to, or is not empty
    """
    created = _create(Path(name))
    try:
        yield
    except (UsageError, InvalidMotionError):
        for directory in created:
            with contextlib.suppress(OSError):
                directory.rmdir()
        raise


def _create(directory: Path) -> list[Path]:
    """Create a directory and its parents; return what was created, the innermost first."""
    try:
        missing = [path for path in (directory, *directory.parents) if not path.exists()]
        directory.mkdir(parents=True, exist_ok=True)
        content = next(directory.iterdir(), None)
        if content is None:
            # A directory that can be read may still not be writable.
            with tempfile.NamedTemporaryFile(dir=directory):
                pass
    except FileExistsError:
        raise UsageError(
            f'--report {directory} is a file: name a folder that is new or empty') from None
    except OSError as error:
        raise UsageError(
            f'--report {directory} cannot be written to ({error.strerror}): name another '
            'folder') from None
    if content is not None:
        raise UsageError(
            f'--report {directory} is not empty, it holds {content.name}: name a folder that is '
            'new or empty')
    return missing
