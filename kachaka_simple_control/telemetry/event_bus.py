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

from collections import deque
from collections.abc import Callable, Collection, Sequence
import contextlib
from dataclasses import dataclass, field
from functools import partial
from queue import Empty, SimpleQueue
import threading
import time
from typing import Any

from kachaka_simple_control.control.events import DETAILED, Event, EventHandler, RobotEvent

#: How many events of each robot may wait in the queue, and of all.  If more wait, the slowest
#: reader is detached.  The values are chosen: the first corresponds to 10 s at the highest rate of
#: velocities, and the second to 25 MB.
MAX_WAITING, MAX_WAITING_OF_ALL = 10_000, 100_000
#: How long the thread collects events before it passes them on [s].  So one wake-up of the thread
#: serves several events.
BATCH_PERIOD = 0.02
#: How many events the thread takes from the queue at once.
MAX_BATCH = 500
#: What waits: an event with its robot, a function that the thread calls, or None, which ends it.
_Item = tuple[Event, str] | Callable[[], None] | None
#: How long ``close`` waits until all events are passed on [s].
CLOSE_TIMEOUT = 0.5


@dataclass(eq=False)
class _Reader:
    """
    A function that is called with events, for example to record them.

    :param robot: whose events it gets; None for those of all, several in one call
    :param busy: its total run time since the queue of events was last empty [s]
    """

    handle: Callable[[Any], None]
    on_detached: Callable[[str], None]
    kinds: Collection[type]
    robot: str | None
    is_active: Callable[[], bool] | None = None
    busy: float = 0.0


@dataclass(eq=False)
class _Batch:
    """Events that are being passed to readers: for those that have not got them yet."""

    parts: list[tuple[_Reader, list[Any]]]
    #: the reader that handles events now, and the start of its first call [s on the steady clock]
    current: _Reader | None = None
    since: float = 0.0
    #: whether another thread passes the events on now, because the current reader takes too long
    is_abandoned: bool = False
    #: a lock, so that two threads never call the same reader with the same event
    lock: threading.Lock = field(default_factory=threading.Lock)

    def next_part(self) -> tuple[_Reader, list[Any]] | None:
        """
        Take the next reader, and what to call it with; None if this thread has none left.

        If one takes too long, another thread calls the remaining ones.
        """
        with self.lock:
            if self.is_abandoned or not self.parts:
                return None
            part = self.parts.pop(0)
            self.current, self.since = part[0], time.monotonic()
            return part


class EventBus:
    """
    Passes events to readers, functions that are called with them in a separate thread.

    ``publish`` only puts an event into a queue.  A reader that raises an error is detached, and
    the slowest one if too many events wait: the drive and the others continue.  ``bool(bus)`` is
    True if the bus has readers.

    :param on_detached: called with a text that names the reader and the reason
    """

    def __init__(self, on_detached: Callable[[str], None] = lambda _: None) -> None:
        self._on_detached = on_detached
        self._readers: tuple[_Reader, ...] = ()
        #: the readers of the events of a robot and of a type, once such an event was published;
        #: None: of all types
        self._index: dict[tuple[str, type | None], tuple[_Reader, ...]] = {}
        #: what waits for the thread
        self._queue: SimpleQueue[_Item] = SimpleQueue()
        #: those that the thread has taken out of it, and not handled yet
        self._taken: deque[_Item] = deque()
        self._hurry = threading.Event()
        self._batch: _Batch | None = None
        self._thread: threading.Thread | None = None
        self._lock = threading.Lock()
        self._robots: set[str] = set()
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
            kinds: Collection[type] = DETAILED, robot: str = '',
            is_active: Callable[[], bool] | None = None) -> None:
        """
        Add a reader of the events of one robot.

        :param on_detached: called with the reason if the reader gets no more events, for it has
            raised an error or is too slow; its output is then incomplete
        :param kinds: the types of the events that it gets
        :param robot: the name of the robot; empty for the only one of a node
        :param is_active: a quick function, called in the threads that publish, that returns
            whether the reader needs events now; None for always.  It may get more nevertheless
        """
        self._add(_Reader(handler, on_detached, kinds, robot, is_active))

    def subscribe_to_all(
            self, handler: Callable[[Sequence[Event | RobotEvent]], None],
            on_detached: Callable[[str], None] = lambda _: None,
            kinds: Collection[type] = DETAILED) -> None:
        """
        Add a reader of the events of all robots, which gets several in one call.

        An event of a robot with a name is a ``RobotEvent``.  The parameters are as above.
        """
        self._add(_Reader(handler, on_detached, kinds, None))

    def has_readers(self, kind: type, robot: str = '') -> bool:
        """
        Return whether somebody needs the events of a type of a robot now; any thread may ask.

        Who publishes often asks this before it makes an event.
        """
        for reader in self._find(robot, kind):
            if reader.is_active is None or reader.is_active():
                return True
        return False

    def publish(self, event: Event, robot: str = '') -> None:
        """Put an event of a robot into a queue, and return at once; any thread may call this."""
        if not self.has_readers(type(event), robot):
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
            self._set_readers(())
            self._thread = None
        self._queue.put(None)
        self._hurry.set()

    def _add(self, reader: _Reader) -> None:
        with self._lock:
            self._set_readers((*self._readers, reader))

    def _set_readers(self, readers: tuple[_Reader, ...]) -> None:
        # In this order: whoever gets the new index sees the new readers.
        self._readers = readers
        self._index = {}

    def _find(self, robot: str, kind: type) -> tuple[_Reader, ...]:
        index = self._index
        if (known := index.get((robot, kind))) is not None:
            return known
        # In two steps: to look at the readers of all robots for each type takes long.
        of_robot = index.get((robot, None))
        if of_robot is None:
            of_robot = index[robot, None] = tuple(
                reader for reader in self._readers if reader.robot in (None, robot))
        readers = index[robot, kind] = tuple(
            reader for reader in of_robot if kind in reader.kinds)
        if robot not in self._robots:
            self._robots.add(robot)
            self._reset_limit()
        return readers

    def _reset_limit(self) -> None:
        self._limit = min(MAX_WAITING * len(self._robots), MAX_WAITING_OF_ALL)

    def _start(self, unfinished: _Batch | None = None) -> None:
        thread = threading.Thread(target=self._run, args=(unfinished,), name='events', daemon=True)
        try:
            thread.start()
        except RuntimeError:  # from Python 3.12 on, no thread can start when the program ends
            return
        self._thread = thread

    def _run(self, unfinished: _Batch | None) -> None:
        if unfinished is not None and not self._pass_on(unfinished):
            return
        while True:
            self._take()
            if events := self._taken_events():
                if not self._pass_on(_Batch(self._parts(events))):
                    return
            elif (call := self._taken.popleft()) is None:
                return
            elif callable(call):
                call()
            if not self._taken and self._queue.empty():
                self._reset_limit()
                for reader in self._readers:
                    reader.busy = 0.0
                self._hurry.wait(BATCH_PERIOD)

    def _take(self) -> None:
        """Take what waits in the queue, at least one item, if nothing is left of the last time."""
        if not self._taken:
            self._taken.append(self._queue.get())
            with contextlib.suppress(Empty):
                while len(self._taken) < MAX_BATCH:
                    self._taken.append(self._queue.get_nowait())

    def _taken_events(self) -> list[tuple[Event, str]]:
        events = []
        while self._taken and isinstance(self._taken[0], tuple):
            events.append(self._taken[0])
            self._taken.popleft()
        return events

    def _parts(self, events: Sequence[tuple[Event, str]]) -> list[tuple[_Reader, list[Any]]]:
        parts: dict[_Reader, list[Any]] = {}
        for event, robot in events:
            for reader in self._find(robot, type(event)):
                parts.setdefault(reader, []).append(
                    RobotEvent(robot, event) if robot and reader.robot is None else event)
        return [(reader, [given] if reader.robot is None else given)
                for reader, given in parts.items()]

    def _pass_on(self, batch: _Batch) -> bool:
        """
        Call each reader with its events.

        :returns: True if this thread has called all readers; False if one reader took too long, so
            that another thread calls the remaining readers
        """
        self._batch = batch
        while (part := batch.next_part()) is not None:
            reader, arguments = part
            try:
                for argument in arguments:
                    if batch.is_abandoned:
                        break
                    reader.handle(argument)
            except Exception as error:
                self._detach(reader, error)
            reader.busy += time.monotonic() - batch.since
        return not batch.is_abandoned

    def _detach_slowest_reader(self) -> None:
        """
        Detach the slowest reader, so that it gets no more events.

        If this reader still handles an event, the thread of the bus is blocked, and a new thread
        takes its place at once.  The new thread passes the events to the readers that have not got
        them yet, and then passes all later events to all readers that are not detached.
        """
        batch, now = self._batch, time.monotonic()
        if batch is None:
            return
        with batch.lock:
            slowest = max(self._readers, default=None, key=lambda reader: (
                reader.busy + (now - batch.since) * (reader is batch.current)))
            if slowest is None:
                return
            rest = None
            if slowest is batch.current and not batch.is_abandoned:
                batch.is_abandoned = True
                rest = _Batch([*batch.parts])
        self._detach(slowest, RuntimeError('it did not keep up'))
        if rest is not None:
            self._start(rest)

    def _detach(self, reader: _Reader, error: Exception) -> None:
        with self._lock:
            if reader not in self._readers:
                return
            self._set_readers(tuple(one for one in self._readers if one is not reader))
            self.failures.append(error)
        # The thread of the bus reports this, because a publisher must not be delayed.
        self._queue.put(partial(self._report, reader, str(error)))

    def _report(self, reader: _Reader, reason: str) -> None:
        """Report that a reader was detached, which means that it gets no more events."""
        name = getattr(reader.handle, '__qualname__', type(reader.handle).__name__)
        reader.on_detached(reason)
        self._on_detached(f'the reader of events {name} was detached, and is incomplete: {reason}')
