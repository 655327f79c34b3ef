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
The program that records a drive and writes its report.

The program runs in its own process.  The driving program sends it the events of the drive over a
pipe.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
import contextlib
import gc
import os
from pathlib import Path
import pickle
from queue import Empty, SimpleQueue
import signal
import sys
import tempfile
import threading
import time
from typing import BinaryIO, cast, IO

from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.analysis.fleet_summary import FleetLog, FleetSummary
from kachaka_simple_control.analysis.summary import Summary
from kachaka_simple_control.control.events import (
    Event,
    FleetStarted,
    MotionPlanned,
    RobotEvent,
    ScanReceived,
    SessionEnded,
    VelocityKind,
    VelocitySent,
    WatchChanged,
    WatchState,
)
from kachaka_simple_control.control.guardian_memory import GuardianMemory
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.motion.geometry import ZERO
from kachaka_simple_control.process.output import make_nonblocking, STDERR
from kachaka_simple_control.process.processes import lower_priority
from kachaka_simple_control.process.waiting import wait_until
from kachaka_simple_control.report.drive_plots import draw_drive_plots, DrivePlots
from kachaka_simple_control.report.fleet_drive_plot import draw_fleet_plots
from kachaka_simple_control.report.fleet_page import render_fleet_page
from kachaka_simple_control.report.html_page import render_page
from kachaka_simple_control.report.json_export import fleet_json, run_json
from kachaka_simple_control.report.mcap_recorder import McapRecorder
from kachaka_simple_control.report.output_file import NEEDS_JINJA2, NEEDS_MCAP, write_atomically
from kachaka_simple_control.telemetry.subscriber_process import decode
from kachaka_simple_control.text import escaped, MAX_LINE_LENGTH

PAGE, PLOT, FIGURES = 'report.html', 'path.png', 'run.json'
#: The period at which events are written to the recording [s].
FLUSH_PERIOD = 0.5
#: The longest time until an event arrives at this program [s].
MAX_EVENT_DELAY = 0.1
#: The longest wait for the guardian to stop the robot after the driving program has ended [s].
#: The guardian is a process that stops the robot if the driving program fails.
GUARDIAN_STOP_TIMEOUT = 1.0


def write_report(log: DriveLog | FleetLog, directory: Path, recording: str | None) -> None:
    """
    Write the files ``report.html``, ``path.png`` and ``run.json`` of a report.

    A reader sees either the old or the new content of a file, and never a part of it.  Without
    matplotlib, or without a planned motion, there are no plots, and ``report.html`` gives the
    reason.

    :param recording: the reason why the recording ``run.mcap`` is missing or incomplete, as a
        sentence; None if it is complete
    :raises OSError: if the directory cannot be written to
    :raises UsageError: if Jinja2 is missing; only ``report.html`` is then not written
    """
    # An hour of driving makes half a million objects, all in use.  Collecting garbage among them
    # would take a fifth of the time.
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        figures, draw, render = _contents(log, recording)
        write_atomically(directory / FIGURES, figures.encode())
        plots, reason = _plots(draw)
        if plots.png:
            write_atomically(directory / PLOT, plots.png)
        else:
            (directory / PLOT).unlink(missing_ok=True)
        write_atomically(directory / PAGE, render(plots.svg, reason).encode(errors='replace'))
    finally:
        if was_enabled:
            gc.enable()


def _contents(log: DriveLog | FleetLog, recording: str | None) -> tuple[
        str, Callable[[], DrivePlots], Callable[[Mapping[str, str], str | None], str]]:
    """Return the figures as JSON, and functions that return the plots and the page with them."""
    if isinstance(log, FleetLog):
        fleet = FleetSummary(log)
        return (fleet_json(fleet, recording), lambda: draw_fleet_plots(fleet.robots),
                lambda plots, reason: render_fleet_page(fleet, plots, reason, recording))
    summary = Summary(log)
    return (run_json(summary, recording), lambda: draw_drive_plots(summary),
            lambda plots, reason: render_page(summary, plots, reason, recording))


def _plots(draw: Callable[[], DrivePlots]) -> tuple[DrivePlots, str | None]:
    """
    Draw the plots of a drive, and catch all errors.

    :returns: the plots and None; after an error, no plots and a sentence with the reason
    """
    try:
        return draw(), None
    except UsageError as error:
        reason = f'There are no plots: {error}.'
    except Exception as error:  # the report is useful without plots
        reason = f'There are no plots: drawing them failed ({error!r}).'
    return DrivePlots({}, b''), reason


def read_events(stream: BinaryIO) -> Iterator[Event | RobotEvent | None]:
    """
    Yield the events that the driving program writes to a pipe, until the pipe is closed.

    After each FLUSH_PERIOD without an event, yield None, so that the caller can do regular work.
    A background thread always reads the pipe, even while the caller is busy.  Otherwise the pipe
    might become full, and then the driving program would send no more events.

    :param stream: the reading end of the pipe
    """
    queue: SimpleQueue[Event | RobotEvent | None] = SimpleQueue()

    def read() -> None:
        try:
            for event in decode(stream):
                queue.put(event)
        finally:
            queue.put(None)

    threading.Thread(target=read, daemon=True).start()
    while True:
        try:
            event = queue.get(timeout=FLUSH_PERIOD)
        except Empty:
            yield None
            continue
        if event is None:
            return
        yield event


class EventHandlers:
    """
    Passes each event to several functions, called handlers.

    A handler that raises an error receives no more events.  The other handlers still receive them.
    """

    def __init__(self, *handlers: Callable[[Event | RobotEvent], None]) -> None:
        self._handlers = [*handlers]
        #: the errors of the handlers that failed
        self.failures: list[Exception] = []

    def on_event(self, event: Event | RobotEvent) -> None:
        """Call each handler with an event, and remove a handler that raises an error."""
        for handler in [*self._handlers]:
            try:
                handler(event)
            except Exception as error:  # noqa: PERF203 (the rest of the report is useful)
                self.failures.append(error)
                self._handlers.remove(handler)


class EventStore:
    """
    Keeps the events of a drive in a file, until its report is written.

    Of the scans of the laser only those are kept that a report needs: one of an hour would be
    hundreds of megabytes.
    """

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        #: the newest scan of each robot, if it was not kept
        self._scans: dict[str, Event | RobotEvent] = {}
        #: what the obstacle watch of each robot said last
        self._states: dict[str, WatchState] = {}

    def on_event(self, event: Event | RobotEvent) -> None:
        """Keep an event."""
        robot, inner = event if isinstance(event, RobotEvent) else ('', event)
        if isinstance(inner, ScanReceived):
            self._scans[robot] = event
            return
        if isinstance(inner, MotionPlanned):
            self._states.pop(robot, None)  # the watch begins anew
        if isinstance(inner, WatchChanged):
            is_new = self._states.get(robot) is not inner.state
            self._states[robot] = inner.state
            if is_new and robot in self._scans:
                self._keep(self._scans.pop(robot))
        self._keep(event)

    def _keep(self, event: Event | RobotEvent) -> None:
        pickle.dump(event, self._file, pickle.HIGHEST_PROTOCOL)


def record_events(stream: BinaryIO, handlers: EventHandlers, recorder: McapRecorder) -> None:
    """
    Pass all events of a drive to handlers, and regularly write the recording to its file.

    :param stream: the reading end of the pipe from which the events are read
    """
    due = time.monotonic() + FLUSH_PERIOD
    for event in read_events(stream):
        if event is not None:
            handlers.on_event(event)
        now = time.monotonic()
        if now >= due:
            recorder.flush(now - MAX_EVENT_DELAY)
            due = now + FLUSH_PERIOD


def try_write_report(
        log: DriveLog | FleetLog, directory: Path, recording: str | None) -> str | None:
    """
    Write the report of a drive; after an error, return the reason instead of raising the error.

    :param recording: the reason why the recording ``run.mcap`` is missing or incomplete; None if
        it is complete
    :returns: the reason why the report, or only its HTML page, is missing; None if the report with
        its page was written
    """
    if isinstance(log, DriveLog) and log.session_started is None:
        return 'there is none: the program ended before anything began'
    try:
        write_report(log, directory, recording)
    except UsageError as error:
        return f'{PAGE} is left out: {error}'
    except Exception as error:  # the recording is written; only a message remains to print
        reason = error.strerror if isinstance(error, OSError) else repr(error)
        return f'there is none: {reason}'
    return None


def guardian_stops(file: int, slots: Sequence[int]) -> list[VelocitySent | None]:
    """
    Wait until the guardian has stopped the robots; return the first zero velocity of each.

    When it does so, it stores the time in memory that it shares with the driving program.

    :param slots: those of the robots in this memory
    :returns: None for a robot that it did not stop within GUARDIAN_STOP_TIMEOUT
    """
    memory = GuardianMemory(file)
    latches = [memory.slot(slot).latch for slot in slots]
    wait_until(lambda: all(latch.is_set for latch in latches), GUARDIAN_STOP_TIMEOUT)
    times = [latch.guardian_stop_time for latch in latches]
    return [None if time_ is None else VelocitySent(time_, ZERO, VelocityKind.GUARDIAN)
            for time_ in times]


def print_line(text: str) -> None:
    """Print a line to standard error; do nothing if standard error is closed."""
    with contextlib.suppress(OSError):
        print(f'report: {escaped(text, MAX_LINE_LENGTH)}', file=sys.stderr, flush=True)


def main() -> int:
    """
    Record the events from standard input until its end, and then write the report of the drive.

    The first command line argument is the directory of the report.  More arguments are optional:
    the file descriptor of the memory that is shared with the guardian, and the index in this
    memory of each robot, in the order of the fleet.

    :returns: the exit code: 0 if all files were written, otherwise 1; it is also 0 if a file is
        missing only because an optional library is not installed
    """
    make_nonblocking(STDERR)
    lower_priority()
    # These signals are for the driving program.  When it ends, the event pipe closes, and then the
    # report program ends too.
    for signum in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(signum, signal.SIG_IGN)
    # After this, files are written into the checked folder even if the folder is renamed.
    name, directory = sys.argv[1], Path()
    os.chdir(name)
    recorder = McapRecorder(directory)
    # The events for the report are stored in a file, because they would fill the memory.
    with tempfile.TemporaryFile() as events:
        ended = threading.Event()
        #: the names of the robots of a fleet
        robots: list[str] = []

        def look(event: Event | RobotEvent) -> None:
            if isinstance(event, SessionEnded):
                ended.set()
            elif isinstance(event, FleetStarted):
                robots.extend(member.name for member in event.robots)

        handlers = EventHandlers(recorder.on_event, EventStore(events).on_event, look)
        record_events(sys.stdin.buffer, handlers, recorder)
        if sys.argv[2:] and not ended.is_set():
            file, *slots = map(int, sys.argv[2:])
            for robot, stop in zip(robots or [''], guardian_stops(file, slots)):
                if stop is not None:
                    handlers.on_event(RobotEvent(robot, stop) if robot else stop)
        recording = recorder.finish()
        for text in filter(None, (recording, *map(repr, handlers.failures))):
            print_line(text)
        events.seek(0)
        log = FleetLog()
        for event in decode(cast('BinaryIO', events)):
            log.on_event(event)
        failure = try_write_report(
            log.robots.get('', DriveLog()) if log.started is None else log, directory, recording)
    print_line(failure or str(Path(name) / PAGE))
    texts = [text for text in (recording, failure)
             if text is not None and not text.endswith((NEEDS_JINJA2, NEEDS_MCAP))]
    return int(bool(texts or handlers.failures))
