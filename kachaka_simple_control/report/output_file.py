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
"""Files that are written for a user: whole or not at all, plots in a format by their suffix."""

from __future__ import annotations

import contextlib
import io
import os
from pathlib import Path
from typing import TYPE_CHECKING
import warnings

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.report.plot_style import default_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Metadata that are left out of each kind of file: two runs give the same bytes.
METADATA: dict[str, dict[str, None]] = {
    '.png': {'Software': None},
    '.svg': {'Date': None, 'Creator': None},
    '.pdf': {'CreationDate': None, 'Creator': None, 'Producer': None},
}


def write_atomically(path: Path, data: bytes) -> None:
    """
    Write a file such that a reader sees the old one or the new one, never a part.

    :param path: the file
    :param data: its content
    :raises OSError: if it cannot be written; the old one stays as it was
    """
    new = path.with_name(f'.{path.name}.new')
    try:
        new.write_bytes(data)
        new.replace(path)
    except OSError:
        with contextlib.suppress(OSError):
            new.unlink()
        raise


def check_plot_file(file: str | os.PathLike[str]) -> Path:
    """
    Return the path of a file if a plot can be saved to it; nothing is drawn or imported.

    :raises UsageError: if its suffix is no format of ours, or it cannot be written
    """
    path = Path(file)
    if path.suffix.lower() not in METADATA:
        raise UsageError(f'{path}: a plot is .png, .svg or .pdf; take one of these as its ending')
    if not path.parent.is_dir():
        raise UsageError(f'{path}: there is no folder {path.parent}; make it first')
    if path.is_dir():
        raise UsageError(f'{path}: this is a folder; name a file in it')
    # It is written beside the old one, and renamed.
    if not os.access(path.resolve().parent, os.W_OK):
        raise UsageError(f'{path}: you are not allowed to write there')
    return path


def save_figure(figure: Figure, path: Path) -> None:
    """
    Save a figure; its suffix selects the format.

    :param path: what ``check_plot_file`` returned
    :raises UsageError: if it cannot be written
    """
    data = io.BytesIO()
    suffix = path.suffix.lower()
    with default_style(), warnings.catch_warnings():
        # A letter that the font lacks becomes a box; the name is still in the table.
        warnings.filterwarnings('ignore', message='Glyph')
        figure.savefig(data, format=suffix[1:], metadata=METADATA[suffix])
    try:
        write_atomically(path.resolve(), data.getvalue())
    except OSError as error:
        raise UsageError(f'{path}: it cannot be written: {error.strerror}') from None
