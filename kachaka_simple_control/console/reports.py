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
The reports of the drives of a console: a folder for each drive process.

Tested by test/console/test_server.py.
"""

from __future__ import annotations

from pathlib import Path
import tempfile

from kachaka_simple_control.errors import UsageError

#: The file of a report that a browser can show.
PAGE = 'report.html'


class Reports:
    """
    A folder with the reports of drives: ``1``, ``2`` and so on, a folder for each drive process.

    :param directory: the folder; None for no reports
    :ivar newest: the number of the newest report that is complete; None before the first
    """

    def __init__(self, directory: str | None) -> None:
        self.newest: int | None = None
        self._directory = None if directory is None else Path(directory).absolute()
        self._number = 0

    def require_writable(self) -> None:
        """
        Create the folder, unless it exists, and check that a report can be written to it.

        :raises UsageError: if it cannot be created or written to
        """
        if self._directory is None:
            return
        try:
            self._directory.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=self._directory):
                pass
        except OSError as error:
            raise UsageError(
                f'--reports {self._directory} cannot be written to ({error.strerror}): name '
                'another folder') from None

    def options(self) -> list[str]:
        """Return the options for the next drive process, with a folder that is not there yet."""
        if self._directory is None:
            return []
        self._number += 1
        while (self._directory / str(self._number)).exists():
            self._number += 1
        return [f'--report={self._directory / str(self._number)}']

    def note_end(self) -> None:
        """Look for the report of the drive process that has ended."""
        if self._directory is not None and self._page(self._number).is_file():
            self.newest = self._number

    def read(self, number: int) -> bytes | None:
        """Return the page of a report of this console; None if there is no such report."""
        if self.newest is None or not 1 <= number <= self.newest:
            return None
        try:
            return self._page(number).read_bytes()
        except OSError:
            return None

    def _page(self, number: int) -> Path:
        assert self._directory is not None
        return self._directory / str(number) / PAGE
