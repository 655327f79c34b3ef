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
The thread that drives: it sleeps until the next deadline, or until something wakes it.

Meanwhile Python does not search old objects for garbage.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
import contextlib
import gc
import heapq
import os
import select
import threading
import time

from kachaka_simple_control.control.robot_drive import RobotDrive
from kachaka_simple_control.errors import control_error

#: The largest descriptor that ``select`` takes, plus one.
FD_SETSIZE = 1024


class Sleeper:
    """
    Sleeps; another thread can cut a sleep short.

    By ``select``, and no lock of Python's: that follows the wall clock before Python 3.11.
    """

    def __init__(self) -> None:
        self._reader, self._writer = os.pipe()
        os.set_blocking(self._reader, False)
        os.set_blocking(self._writer, False)
        self._sources = [self._reader]

    def sleep(self, duration: float) -> None:
        """
        Sleep.

        :param duration: how long [s]; less if another thread wakes it
        """
        if self._reader >= FD_SETSIZE:
            time.sleep(min(duration, 0.01))  # select takes no descriptor above 1023
        elif select.select(self._sources, (), (), duration)[0]:
            os.read(self._reader, 4096)

    def wake(self) -> None:
        """End the sleep under way, or the next one; from any thread."""
        # The pipe may be full, then the sleep ends anyway; and no error here may keep a stop back.
        with contextlib.suppress(OSError):
            os.write(self._writer, b'\0')

    def __del__(self) -> None:
        """Free its descriptors."""
        # Not by a call: another thread may still sleep.
        os.close(self._reader)
        os.close(self._writer)


class DriveLoop:
    """
    Drives one robot or many in the thread that calls ``run``.

    Nothing is polled: each drive says when it has to be called again, at the latest, and ``wake``
    ends a sleep.  No stop waits for this thread: whoever asks for one sends its first zero.

    :param clock: the steady clock [s]
    :param sleep: sleeps for a time [s]; None for a sleep that ``wake`` ends
    """

    def __init__(
            self, clock: Callable[[], float] = time.monotonic,
            sleep: Callable[[float], None] | None = None) -> None:
        self._clock = clock
        self._sleeper = Sleeper()
        self._sleep = sleep or self._sleeper.sleep
        self._woken: deque[RobotDrive] = deque()

    def wake(self, drive: RobotDrive) -> None:
        """Let a drive look for what has changed; from any thread."""
        self._woken.append(drive)
        self._sleeper.wake()

    def run(
            self, drives: Sequence[RobotDrive],
            on_failure: Callable[[RobotDrive, Exception], None] | None = None) -> None:
        """
        Drive robots whose runs have begun, until the last of them has ended.

        Whatever ends the loop or one of several drives, each robot concerned gets one zero at
        once; the whole stop is the caller's.

        :param drives: the drives
        :param on_failure: called with a drive and the error that ended it, in this thread, which
            drives the others on; None: the error ends all
        :raises ControlError: if a run could not go on, unless ``on_failure`` takes that
        """
        following = dict.fromkeys(range(len(drives)), 0.0)
        heap = [(0.0, number) for number in following]
        self._woken.clear()
        try:
            while heap:
                while (left := heap[0][0] - self._clock()) > 0.0:
                    self._sleep(left)
                    self._call_woken(drives, following, heap)
                at, number = heapq.heappop(heap)
                if following.get(number) != at:
                    continue  # it was woken since
                then = None
                try:
                    then = drives[number].step(self._clock())
                except Exception as error:
                    if on_failure is None:
                        raise
                    drives[number].end(control_error(error))
                    on_failure(drives[number], error)
                if then is None:
                    del following[number]
                else:
                    following[number] = then
                    heapq.heappush(heap, (then, number))
        except BaseException as error:
            # KeyboardInterrupt as well.  The only drive of a loop is stopped by the caller now.
            for number in following if len(drives) > 1 else ():
                drives[number].end(control_error(error))
            raise

    def _call_woken(
            self, drives: Sequence[RobotDrive], following: dict[int, float],
            heap: list[tuple[float, int]]) -> None:
        """Have the drives called next that were woken."""
        while self._woken:
            drive = self._woken.popleft()
            for number in following:
                if drives[number] is drive:
                    following[number] = 0.0
                    heapq.heappush(heap, (0.0, number))


#: So many collections of young objects never come before one of all: Python's largest threshold.
NEVER = 2 ** 31 - 1

_lock = threading.Lock()
_runs = 0
#: undoes what the first of the runs under way did
_restore = contextlib.ExitStack()


@contextlib.contextmanager
def old_objects_frozen() -> Iterator[None]:
    """
    Leave all objects that exist now out of collections for the length of a block.

    Searching a million objects takes 150 ms, in which no other code of the process runs
    (measured).  Afterwards the collector is as it was found: it belongs to the user's program.
    Blocks may overlap, in one thread or several.
    """
    global _runs  # noqa: PLW0603 (as the collector itself)
    with _lock:
        _runs += 1
        if _runs == 1:
            _freeze()
    try:
        yield
    finally:
        with _lock:
            _runs -= 1
            if not _runs:
                _restore.close()


def _freeze() -> None:
    if gc.get_freeze_count():
        # Unfreezing would also release the objects that the user has frozen.
        thresholds = gc.get_threshold()
        gc.set_threshold(*thresholds[:2], NEVER)
        _restore.callback(gc.set_threshold, *thresholds)
    else:
        gc.freeze()
        _restore.callback(gc.unfreeze)
