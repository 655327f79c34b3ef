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
"""The process that records a drive and writes its report."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
from contextlib import contextmanager
import gc
from pathlib import Path
from queue import Empty, SimpleQueue
import signal
import sys
import threading
import time
from typing import BinaryIO

from kachaka_simple_control.control.output import make_nonblocking, STDERR
from kachaka_simple_control.control.processes import lower_priority
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.report.drive_log import DriveLog
from kachaka_simple_control.report.drive_plots import draw_drive_plots, DrivePlots
from kachaka_simple_control.report.html_page import render_page
from kachaka_simple_control.report.json_export import run_json
from kachaka_simple_control.report.mcap_recorder import McapRecorder
from kachaka_simple_control.report.summary import Summary
from kachaka_simple_control.telemetry.events import Event, EventBus
from kachaka_simple_control.telemetry.subscriber_process import decode

PAGE, PICTURE, FIGURES = 'report.html', 'path.png', 'run.json'


def write_report(record: DriveLog, folder: Path, recording: str | None) -> None:
    """
    Write ``report.html``, ``path.png`` and ``run.json``, each whole or not at all.

    Without matplotlib, or if nothing was planned, there is no picture, and the page says so.
    Without Jinja2 there is no page.

    :param record: what happened
    :param folder: where to; it is there
    :param recording: why ``run.mcap`` beside them is missing or not whole, in a sentence; None if
        it is whole
    :raises OSError: if the folder cannot be written to
    :raises UsageError: if Jinja2 is missing, once the other files are written
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
    text = render_page(summary, pictures.svg, why_not, recording)
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


def _pictures(summary: Summary) -> tuple[DrivePlots, str | None]:
    nothing = DrivePlots({}, b'')
    try:
        return draw_drive_plots(summary), None
    except UsageError as error:
        return nothing, f'There are no pictures: {error}.'
    except Exception as error:  # the figures are worth having without the pictures
        return nothing, f'There are no pictures: drawing them failed ({error!r}).'


def _write(path: Path, data: bytes) -> None:
    # Whoever looks into the folder sees the old file or the new one, never a part of it.
    new = path.with_name(f'.{path.name}.new')
    new.write_bytes(data)
    new.replace(path)


#: How often what happened is handed to the disk [s].
PERIOD = 0.5
#: Who tells something may be this late [s].
LATENESS = 0.1


def ignore_signals() -> None:
    """
    End only after the program that drives.

    Whoever ends all programs of a terminal or a service means that one; this one hears of it.
    """
    for signum in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(signum, signal.SIG_IGN)


def read_events(stream: BinaryIO) -> Iterator[Event | None]:
    """
    Return what is told, as it comes, and nothing now and then.

    The pipe is emptied even while somebody is busy with what came: the program that drives tells
    nothing more to one who does not keep up.

    :param stream: where it comes from
    :returns: the events; None where none has come for a while
    """
    queue: SimpleQueue[Event | None] = SimpleQueue()

    def read() -> None:
        try:
            for event in decode(stream):
                queue.put(event)
        finally:
            queue.put(None)

    threading.Thread(target=read, daemon=True).start()
    while True:
        try:
            told = queue.get(timeout=PERIOD)
        except Empty:
            yield None
            continue
        if told is None:
            return
        yield told


def record_events(stream: BinaryIO, audience: EventBus, bag: McapRecorder) -> None:
    """
    Hear all, and hand it to the disk as it comes.

    :param stream: where events come from
    :param audience: hears them
    :param bag: the recording
    """
    due = time.monotonic() + PERIOD
    for event in read_events(stream):
        if event is not None:
            audience.publish(event)
        now = time.monotonic()
        if now >= due:
            bag.flush(now - LATENESS)
            due = now + PERIOD


def try_write_report(record: DriveLog, folder: Path, recording: str | None) -> str | None:
    """
    Write the report.

    :param record: what happened
    :param folder: where it goes
    :param recording: why there is no recording or it ended early; None if it is whole
    :returns: why there is no report; None if there is
    """
    if record.session_started is None:
        return 'there is none: the program ended before anything began'
    try:
        write_report(record, folder, recording)
    except UsageError as error:
        return f'{PAGE} is left out: {error}'
    except Exception as error:  # the recording is there, and there is nobody else to tell
        reason = error.strerror if isinstance(error, OSError) else repr(error)
        return f'there is none: {reason}'
    return None


def print_line(text: str) -> None:
    """
    Say something, if anybody is left to hear it.

    :param text: a line
    """
    with contextlib.suppress(OSError):
        print(f'report: {text}', file=sys.stderr, flush=True)


def main() -> int:
    """
    Hear what happens until its end, and leave a report.

    :returns: the exit code: 0 if all was written, else 1
    """
    make_nonblocking(STDERR)
    lower_priority()
    ignore_signals()
    folder = Path(sys.argv[1])
    record, audience = DriveLog(), EventBus()
    bag = McapRecorder(folder, record)
    audience.subscribe(record.on_event)
    audience.subscribe(bag.on_event)
    record_events(sys.stdin.buffer, audience, bag)
    recording = bag.finish()
    for text in filter(None, (recording, *map(repr, audience.failures))):
        print_line(text)
    failure = try_write_report(record, folder, recording)
    print_line(failure or str(folder / 'report.html'))
    return int(any((recording, failure, audience.failures)))
