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
"""Leave a report of a drive: a page, a picture and a file for programs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import gc
from pathlib import Path

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.report.page.page import page
from kachaka_simple_control.report.pictures.drive_pictures import draw_pictures, Pictures
from kachaka_simple_control.report.record import Record
from kachaka_simple_control.report.run_json import run_json
from kachaka_simple_control.report.summary import Summary

PAGE, PICTURE, FIGURES = 'report.html', 'path.png', 'run.json'


def write_report(record: Record, folder: Path, recording: str | None) -> None:
    """
    Write ``report.html``, ``path.png`` and ``run.json``, each whole or not at all.

    Without matplotlib, or if nothing was planned, there is no picture, and the page says so.

    :param record: what happened
    :param folder: where to; it is there
    :param recording: why ``run.mcap`` beside them is missing or not whole, in a sentence; None if
        it is whole
    :raises OSError: if the folder cannot be written to
    """
    with _nothing_to_collect():
        _write_all(Summary(record), folder, recording)


def _write_all(summary: Summary, folder: Path, recording: str | None) -> None:
    _write(folder / FIGURES, run_json(summary, recording).encode())
    pictures, why_not = _pictures(summary)
    if pictures.png:
        _write(folder / PICTURE, pictures.png)
    else:
        (folder / PICTURE).unlink(missing_ok=True)
    text = page(summary, pictures.svg, why_not, recording)
    _write(folder / PAGE, text.encode(errors='replace'))


@contextmanager
def _nothing_to_collect() -> Iterator[None]:
    # An hour is half a million objects, all of them in use: to look for garbage among them takes
    # a fifth of the time.
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def _pictures(summary: Summary) -> tuple[Pictures, str | None]:
    nothing = Pictures({}, b'')
    try:
        return draw_pictures(summary), None
    except UsageError as error:
        return nothing, f'There are no pictures: {error}.'
    except Exception as error:  # the figures are worth having without the pictures
        return nothing, f'There are no pictures: drawing them failed ({error!r}).'


def _write(path: Path, data: bytes) -> None:
    # Whoever looks into the folder sees the old file or the new one, never a part of it.
    new = path.with_name(f'.{path.name}.new')
    new.write_bytes(data)
    new.replace(path)
