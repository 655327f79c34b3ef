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
Write files safely, check the path of a plot, and create the directory of a report.

Tested by test/report/test_plan_plot.py.
"""

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
    Write a file so that a reader sees either its old or its new content, and never a part of it.

    :raises OSError: if the file cannot be written; an old file of this name is unchanged
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
    An MCAP file that stays readable if the program is killed.

    The class has the methods that an MCAP writer calls on its file.  Each flush writes the new
    data, and after them an end record, which makes the file complete.  The next flush writes its
    data over this end record.  So after a crash the file can be read up to the last flush.

    :param path: the path of the file; the file must not exist
    :param end: the content of the end record
    :raises OSError: if the file cannot be created
    """

    def __init__(self, path: Path, end: bytes) -> None:
        self._descriptor = os.open(
            path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
        self._end = end
        self._pending = bytearray()
        self._size = 0

    def write(self, data: bytes) -> int:
        """
        Keep data in memory; the next ``flush`` writes them to the file.

        :returns: the size of the data [bytes]
        """
        self._pending += data
        return len(data)

    def tell(self) -> int:
        """Return the position in the file at which the next ``write`` stores its data [bytes]."""
        return self._size + len(self._pending)

    def flush(self) -> None:
        """
        Write the data from memory to the file, and an end record after them.

        The end record makes the file complete and readable.

        :raises OSError: if writing fails; the file then has the same content as before
        """
        self._store(self._end)

    def close(self) -> None:
        """
        Write the data from memory to the file, and close the file.

        This method adds no end record.  The caller must add it with ``write`` before ``close``.

        :raises OSError: if writing fails; the file is closed, and has the same content as before
        """
        try:
            self._store(b'')
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Close the file, and discard the data in memory."""
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
    Check the path of an image file, so that an error is found before the plot is drawn.

    The function does not import matplotlib.

    :returns: the same path as an object of the class ``Path``
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
    Save a matplotlib figure as an image file.

    :param path: the path of the file, as checked by ``check_plot_file``; the suffix of the file
        selects the image format
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
    """
    Return a sentence for each file of a report that needs a library which is not installed.

    The file ``report.html`` needs Jinja2, and ``run.mcap`` needs mcap.  Without its library, a
    file is left out of the report.

    :returns: the sentences, which also say how to install the library; empty if nothing is missing
    """
    needs = {'jinja2': f'report.html is left out: {NEEDS_JINJA2}',
             'mcap': f'run.mcap is left out: {NEEDS_MCAP}'}
    return [text for name, text in needs.items() if importlib.util.find_spec(name) is None]


@contextlib.contextmanager
def prepare_report_dir(name: str) -> Iterator[None]:
    """
    Create the directory of a report, and run the ``with`` block.

    If the block raises ``UsageError`` or ``InvalidMotionError``, the directories that this
    function has created are removed if they are empty.  A directory that existed before is not
    removed.

    :param name: the path of the directory; an existing directory must be empty
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
    """
    Create a directory and its missing parents, and check that the directory is empty and writable.

    :returns: the directories that were created: the directory itself first, then its parents; the
        list is empty if the directory existed before
    :raises UsageError: if the directory cannot be created or written to, or is not empty
    """
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
