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
The program that leaves a report: it lives beside the one that drives, and on after it.

Its arguments are the folder; what happens comes from its standard input.
"""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
from pathlib import Path
from queue import Empty, SimpleQueue
import signal
import sys
import threading
import time
from typing import BinaryIO

from kachaka_simple_control.audience.audience import Audience
from kachaka_simple_control.audience.background import step_back
from kachaka_simple_control.audience.stream import events
from kachaka_simple_control.execution.output import never_wait, STDERR
from kachaka_simple_control.report.bag.bag import Bag
from kachaka_simple_control.report.events import Event
from kachaka_simple_control.report.record import Record
from kachaka_simple_control.report.report import write_report

#: How often what happened is handed to the disk [s].
PERIOD = 0.5
#: Who tells something may be this late [s].
LATENESS = 0.1


def outlive() -> None:
    """
    End only after the program that drives.

    Whoever ends all programs of a terminal or a service means that one; this one hears of it.
    """
    for signum in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(signum, signal.SIG_IGN)


def heard(stream: BinaryIO) -> Iterator[Event | None]:
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
            for event in events(stream):
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


def listen(stream: BinaryIO, audience: Audience, bag: Bag) -> None:
    """
    Hear all, and hand it to the disk as it comes.

    :param stream: where events come from
    :param audience: hears them
    :param bag: the recording
    """
    due = time.monotonic() + PERIOD
    for event in heard(stream):
        if event is not None:
            audience.tell(event)
        now = time.monotonic()
        if now >= due:
            bag.flush(now - LATENESS)
            due = now + PERIOD


def report(record: Record, folder: Path, recording: str | None) -> str | None:
    """
    Write the report.

    :param record: what happened
    :param folder: where it goes
    :param recording: why there is no recording or it ended early; None if it is whole
    :returns: why there is no report; None if there is
    """
    if record.opened is None:
        return 'there is none: the program ended before anything began'
    try:
        write_report(record, folder, recording)
    except Exception as error:  # the recording is there, and there is nobody else to tell
        reason = error.strerror if isinstance(error, OSError) else repr(error)
        return f'there is none: {reason}'
    return None


def say(text: str) -> None:
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
    never_wait(STDERR)
    step_back()
    outlive()
    folder = Path(sys.argv[1])
    record, audience = Record(), Audience()
    bag = Bag(folder, record)
    audience.join(record.hear)
    audience.join(bag.hear)
    listen(sys.stdin.buffer, audience, bag)
    recording = bag.finish()
    for text in filter(None, (recording, *map(repr, audience.failures))):
        say(text)
    failure = report(record, folder, recording)
    say(failure or str(folder / 'report.html'))
    return int(any((recording, failure, audience.failures)))
