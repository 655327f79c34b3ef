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
"""What a report needs before a drive begins: a directory to write to, and libraries."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import importlib.util
from pathlib import Path
import tempfile

from kachaka_simple_control.errors import InvalidMotionError, UsageError

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
    Have a folder for a report; where a block is refused, it leaves no empty folder behind.

    :param name: the folder; it may be there, but be empty
    :returns: a context manager
    :raises UsageError: if it cannot be made or written to, or holds something
    """
    made = _make(Path(name))
    try:
        yield
    except (UsageError, InvalidMotionError):
        for folder in made:
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise


def _make(folder: Path) -> list[Path]:
    """Make a folder and those it is in; return what was made, the innermost first."""
    try:
        missing = [place for place in (folder, *folder.parents) if not place.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        held = next(folder.iterdir(), None)
        if held is None:
            # What may be looked into may still not be written to.
            with tempfile.NamedTemporaryFile(dir=folder):
                pass
    except FileExistsError:
        raise UsageError(
            f'--report {folder} is a file: name a folder that is new or empty') from None
    except OSError as error:
        raise UsageError(
            f'--report {folder} cannot be written to ({error.strerror}): name another '
            'folder') from None
    if held is not None:
        raise UsageError(
            f'--report {folder} is not empty, it holds {held.name}: name a folder that is new or '
            'empty')
    return missing
