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
"""Output files: safe writes, checks of plot files, and the directory of a report."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import importlib.util
import os
from pathlib import Path
import tempfile
from typing import TYPE_CHECKING

from kachaka_simple_control.errors import InvalidMotionError, UsageError
from kachaka_simple_control.report.plot_style import file_of, METADATA

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_atomically(path: Path, data: bytes) -> None:
    """
    Write a file atomically: a reader sees the old or the new content, and never a part of it.

    :param path: the file
    :param data: the new content
    :raises OSError: if the file cannot be written; the old file stays unchanged
    """
    new = path.with_name(f'.{path.name}.new')
    try:
        new.write_bytes(data)
        new.replace(path)
    except OSError:
        with contextlib.suppress(OSError):
            new.unlink()
        raise


class CrashSafeFile:
    """
    A file for an MCAP writer that is complete after each flush.

    Each flush writes an end record after the data, and the next flush overwrites it.  If the
    program is killed, the file is readable up to the last flush.

    :param path: the file; it must not exist
    :param end: the end record, which completes the file after the data
    :raises OSError: if the file cannot be created
    """

    def __init__(self, path: Path, end: bytes) -> None:
        self._descriptor = os.open(
            path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
        self._end = end
        self._pending = bytearray()
        self._size = 0

    def write(self, data: bytes) -> int:
        """Keep data in memory until the next flush, and return the number of bytes."""
        self._pending += data
        return len(data)

    def tell(self) -> int:
        """Return the offset of the next data in the file."""
        return self._size + len(self._pending)

    def flush(self) -> None:
        """
        Write the data in memory and the end record to the file.

        :raises OSError: if the write fails; the file then keeps its old content
        """
        self._store(self._end)

    def close(self) -> None:
        """
        Write the data in memory, and close the file.

        No end record is added; the caller must have written it.

        :raises OSError: if the write fails; the file then keeps its old content
        """
        try:
            self._store(b'')
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Close the file without another write."""
        with contextlib.suppress(OSError):
            os.close(self._descriptor)

    def _store(self, end: bytes) -> None:
        try:
            self._pwrite(bytes(self._pending) + end, self._size)
        except OSError:
            # The disk has room for the old end record, because the file contained it before.
            with contextlib.suppress(OSError):
                if self._size:
                    self._pwrite(self._end, self._size)
                    os.ftruncate(self._descriptor, self._size + len(self._end))
            raise
        self._size += len(self._pending)
        self._pending.clear()

    def _pwrite(self, data: bytes, offset: int) -> None:
        view = memoryview(data)
        while view:
            count = os.pwrite(self._descriptor, view, offset)
            view, offset = view[count:], offset + count


def check_plot_file(file: str | os.PathLike[str]) -> Path:
    """
    Check that a plot can be saved to a file, without importing matplotlib.

    :returns: the path of the file
    :raises UsageError: if the suffix is not .png, .svg or .pdf, or the file cannot be written
    """
    path = Path(file)
    if path.suffix.lower() not in METADATA:
        raise UsageError(f'{path}: a plot is .png, .svg or .pdf; take one of these as its ending')
    if not path.parent.is_dir():
        raise UsageError(f'{path}: there is no folder {path.parent}; make it first')
    if path.is_dir():
        raise UsageError(f'{path}: this is a folder; name a file in it')
    # The new file is written in the same folder and renamed.
    if not os.access(path.resolve().parent, os.W_OK):
        raise UsageError(f'{path}: you are not allowed to write there')
    return path


def save_figure(figure: Figure, path: Path) -> None:
    """
    Save a figure; the suffix of the file selects the format.

    :param path: the path of the file, returned by ``check_plot_file``
    :raises UsageError: if the file cannot be written
    """
    data = file_of(figure, path.suffix.lower())
    try:
        write_atomically(path.resolve(), data)
    except OSError as error:
        raise UsageError(f'{path}: it cannot be written: {error.strerror}') from None


#: The module of the program that writes a report.
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
    Create a directory for a report, and remove it after certain errors in the ``with`` block.

    These errors are ``UsageError`` and ``InvalidMotionError``.  A directory that existed before is
    not removed.

    :param name: the directory; it may exist if it is empty
    :raises UsageError: if the directory cannot be created or written to, or is not empty
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
    """Create a directory and its parents; return the created ones, the directory itself first."""
    try:
        missing = [path for path in (directory, *directory.parents) if not path.exists()]
        directory.mkdir(parents=True, exist_ok=True)
        content = next(directory.iterdir(), None)
        if content is None:
            # A readable directory may not be writable.
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
