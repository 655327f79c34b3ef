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
"""Pass the events of a drive to its readers in a thread, so that none delays the drive."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from queue import SimpleQueue
import threading
import time

from kachaka_simple_control.control.events import Event, EventHandler

#: How many events may wait in the queue.  If more wait, the slowest reader is detached.  The value
#: is chosen: it corresponds to 10 s at the highest rate of velocities.
MAX_WAITING = 10_000
#: How long the thread collects events before it passes them on [s].  So one wake-up of the thread
#: serves several events.
BATCH_PERIOD = 0.02
#: How long ``close`` waits until all events are passed on [s].
CLOSE_TIMEOUT = 0.5


@dataclass(eq=False)
class _Reader:
    """
    A function that is called with each event, for example to record it.

    :param busy: its total run time since the queue of events was last empty [s]
    """

    handle: EventHandler
    on_detached: Callable[[str], None]
    wants: Callable[[Event], bool]
    robot: str = ''
    busy: float = 0.0


@dataclass(eq=False)
class _Call:
    """An event that is being passed to readers, with those that have not got it yet."""

    event: Event
    readers: list[_Reader]
    #: the reader that handles the event now, and the start of this call [s on the steady clock]
    current: _Reader | None = None
    since: float = 0.0
    #: whether another thread passes the event on now, because the current reader takes too long
    is_abandoned: bool = False
    #: a lock, so that two threads never call the same reader with this event
    lock: threading.Lock = field(default_factory=threading.Lock)

    def next_reader(self) -> _Reader | None:
        """
        Take the next reader of the event; None if this thread has none left.

        If one takes too long, another thread calls the remaining ones.
        """
        with self.lock:
            if self.is_abandoned or not self.readers:
                return None
            self.current, self.since = self.readers.pop(0), time.monotonic()
            return self.current


class EventBus:
    """
    Passes events to readers, functions that are called with each event in a separate thread.

    ``publish`` only puts an event into a queue.  A reader that raises an error is detached, and
    the slowest one if more than MAX_WAITING events wait: the drive and the others continue.
    ``bool(bus)`` is True if the bus has readers.

    :param on_detached: called with a text that names the reader and the reason
    """

    def __init__(self, on_detached: Callable[[str], None] = lambda _: None) -> None:
        self._on_detached = on_detached
        self._readers: tuple[_Reader, ...] = ()
        #: the waiting events with their robots, functions that the thread calls, and None, which
        #: ends the thread
        self._queue: SimpleQueue[tuple[Event, str] | Callable[[], None] | None] = SimpleQueue()
        self._hurry = threading.Event()
        self._call: _Call | None = None
        self._thread: threading.Thread | None = None
        self._lock = threading.Lock()
        #: how many events may wait; raised when a reader is detached, reset when none waits
        self._limit = MAX_WAITING
        #: the errors because of which readers were detached
        self.failures: list[Exception] = []

    def __bool__(self) -> bool:
        """Return whether the bus has readers."""
        return bool(self._readers)

    def subscribe(
            self, handler: EventHandler,
            on_detached: Callable[[str], None] = lambda _: None,
            wants: Callable[[Event], bool] = lambda _: True, robot: str = '') -> None:
        """
        Add a reader.

        :param on_detached: called with the reason if the reader gets no more events, for it has
            raised an error or is too slow; its output is then incomplete
        :param wants: a quick function, called in the thread that publishes, that returns whether
            the reader needs an event; one that nobody needs wakes no second thread
        :param robot: the name of the robot whose events it gets; empty for the only one of a node
        """
        with self._lock:
            self._readers = (*self._readers, _Reader(handler, on_detached, wants, robot))

    def publish(self, event: Event, robot: str = '') -> None:
        """Put an event of a robot into a queue, and return at once; any thread may call this."""
        for reader in self._readers:
            if reader.robot == robot and reader.wants(event):
                break
        else:
            return
        self._queue.put((event, robot))
        if self._thread is None:
            with self._lock:
                if self._thread is None:
                    self._start()
        elif self._queue.qsize() > self._limit:
            self._limit += MAX_WAITING
            self._detach_slowest_reader()

    def flush(self, timeout: float = CLOSE_TIMEOUT) -> bool:
        """Wait until the readers have got all events so far; return whether they have."""
        if self._thread is None:
            return True
        passed_on = threading.Event()

        def mark() -> None:
            self._hurry.clear()
            passed_on.set()

        self._queue.put(mark)
        self._hurry.set()
        return passed_on.wait(timeout)

    def close(self) -> None:
        """
        Wait until the readers have got all events, then remove all readers.

        This method waits at most CLOSE_TIMEOUT.  Events that are then still in the queue are lost.
        """
        self.flush()
        with self._lock:
            self._readers = ()
            self._thread = None
        self._queue.put(None)
        self._hurry.set()

    def _start(self, unfinished: _Call | None = None) -> None:
        thread = threading.Thread(target=self._run, args=(unfinished,), name='events', daemon=True)
        try:
            thread.start()
        except RuntimeError:  # from Python 3.12 on, no thread can start when the program ends
            return
        self._thread = thread

    def _run(self, unfinished: _Call | None) -> None:
        if unfinished is not None and not self._pass_on(unfinished):
            return
        while (item := self._queue.get()) is not None:
            if callable(item):
                item()
            elif not self._pass_on(_Call(item[0], [
                    reader for reader in self._readers if reader.robot == item[1]])):
                return
            if self._queue.empty():
                self._limit = MAX_WAITING
                for reader in self._readers:
                    reader.busy = 0.0
                self._hurry.wait(BATCH_PERIOD)

    def _pass_on(self, call: _Call) -> bool:
        """
        Call each reader with an event.

        :returns: True if this thread has called all readers; False if one reader took too long, so
            that another thread calls the remaining readers
        """
        self._call = call
        while (reader := call.next_reader()) is not None:
            try:
                reader.handle(call.event)
            except Exception as error:
                self._detach(reader, error)
            reader.busy += time.monotonic() - call.since
        return not call.is_abandoned

    def _detach_slowest_reader(self) -> None:
        """
        Detach the slowest reader, so that it gets no more events.

        If this reader still handles an event, the thread of the bus is blocked, and a new thread
        takes its place at once.  The new thread passes this event to the readers that have not got
        it yet, and then passes all later events to all readers that are not detached.
        """
        call, now = self._call, time.monotonic()
        if call is None:
            return
        with call.lock:
            slowest = max(self._readers, default=None, key=lambda reader: (
                reader.busy + (now - call.since) * (reader is call.current)))
            if slowest is None:
                return
            rest = None
            if slowest is call.current and not call.is_abandoned:
                call.is_abandoned = True
                rest = _Call(call.event, [*call.readers])
        self._detach(slowest, RuntimeError('it did not keep up'))
        if rest is not None:
            self._start(rest)

    def _detach(self, reader: _Reader, error: Exception) -> None:
        with self._lock:
            if reader not in self._readers:
                return
            self._readers = tuple(one for one in self._readers if one is not reader)
            self.failures.append(error)
        # The thread of the bus reports this, because a publisher must not be delayed.
        self._queue.put(partial(self._report, reader, str(error)))

    def _report(self, reader: _Reader, reason: str) -> None:
        """Report that a reader was detached, which means that it gets no more events."""
        name = getattr(reader.handle, '__qualname__', type(reader.handle).__name__)
        reader.on_detached(reason)
        self._on_detached(f'the reader of events {name} was detached, and is incomplete: {reason}')
