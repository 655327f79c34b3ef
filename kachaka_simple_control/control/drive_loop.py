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
The loop of the thread that drives one or more robots.

It sleeps until a velocity or a check for faults is due, or another thread wakes it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
import contextlib
import gc
import os
import select
import sys
import threading
import time

from kachaka_simple_control.control.robot_drive import RobotDrive
from kachaka_simple_control.errors import control_error

#: ``select`` accepts only file descriptors below this number.
FD_SETSIZE = 1024


class Sleeper:
    """
    Sleeps for a given time; another thread can end the sleep early.

    It waits with ``select``: before Python 3.11 the timeout of a lock depends on the wall clock.
    """

    def __init__(self) -> None:
        self._reader, self._writer = os.pipe()
        os.set_blocking(self._reader, False)
        os.set_blocking(self._writer, False)
        self._sources = [self._reader]

    def sleep(self, duration: float) -> None:
        """Sleep for a time [s], or until another thread calls ``wake``."""
        if self._reader >= FD_SETSIZE:
            time.sleep(min(duration, 0.01))  # select takes no descriptor above 1023
        elif select.select(self._sources, (), (), duration)[0]:
            os.read(self._reader, 4096)

    def wake(self) -> None:
        """End the sleep, or the next one if there is none; any thread may call this."""
        # If the pipe is full, the sleep ends anyway.  No error here may delay a stop.
        with contextlib.suppress(OSError):
            os.write(self._writer, b'\0')

    def __del__(self) -> None:
        """Close both ends of the pipe through which ``wake`` ends a sleep."""
        # There is no method to close them earlier: another thread may still sleep.
        os.close(self._reader)
        os.close(self._writer)


class DriveLoop:
    """
    Drives one or more robots in the thread that calls ``run``.

    The loop does not poll: each ``RobotDrive`` says when it must be called next.  A stop does not
    wait for this thread: the thread that requests it sends the first zero velocity itself.

    :param sleep: sleeps for a time [s]; None for a ``Sleeper``, the only one that ``wake`` can end
    :param beat: writes the heartbeat of this thread
    """

    def __init__(
            self, clock: Callable[[], float] = time.monotonic,
            sleep: Callable[[float], None] | None = None,
            beat: Callable[[], None] = lambda: None) -> None:
        self._clock = clock
        self._beat = beat
        self._sleeper: Sleeper | None = Sleeper()
        self._sleep = sleep or self._sleeper.sleep
        self._woken: deque[RobotDrive] = deque()
        #: the drive whose error ended all; None before
        self.failed: RobotDrive | None = None

    def wake(self, drive: RobotDrive) -> None:
        """Make ``run`` call a drive at once, ended or with a new velocity; for any thread."""
        self._woken.append(drive)
        # Another thread may call ``close``: this reference keeps the pipe open meanwhile.
        if (sleeper := self._sleeper) is not None:
            sleeper.wake()

    def close(self) -> None:
        """Let go of the pipe, which closes when no thread sleeps or wakes any more."""
        self._sleeper, self._sleep = None, time.sleep

    def run(
            self, drives: Sequence[RobotDrive],
            on_failure: Callable[[RobotDrive, Exception], None] | None = None,
            on_end: Callable[[RobotDrive], None] = lambda _: None) -> None:
        """
        Drive robots until all drives have ended.

        Each drive has begun already.  Afterwards, even after an error, the caller sends zero
        velocities to each robot until its command timeout has passed.  If an error ends one or all
        drives, their robots get one zero velocity at once.

        :param on_failure: called in this thread with a drive and the error that ended it; the
            others continue.  None: the error of one drive ends all
        :param on_end: called in this thread with a drive that has come to its end before others:
            its robot has got one zero velocity
        :raises ControlError: if a drive could not continue and ``on_failure`` is None
        """
        following = dict.fromkeys(range(len(drives)), 0.0)
        self._woken.clear()
        try:
            while following:
                while (left := min(following.values()) - (woken := self._clock())) > 0.0:
                    self._sleep(left)
                    self._call_woken(drives, following)
                # Only here: each drive that was due at the last heartbeat has been called since.
                self._beat()
                for number in [number for number, at in following.items() if at <= woken]:
                    try:
                        then = drives[number].step(self._clock(), woken)
                    except Exception as error:
                        if on_failure is None:
                            self.failed = drives[number]
                            raise
                        del following[number]
                        drives[number].end(control_error(error))
                        on_failure(drives[number], error)
                        continue
                    if then is not None:
                        following[number] = then
                        continue
                    del following[number]
                    if following:
                        on_end(drives[number])
        except BaseException as error:
            # This includes KeyboardInterrupt.  No robot waits for the stop of another.
            for number in following:
                with contextlib.suppress(Exception):  # the caller's stop says why none can be sent
                    drives[number].end(control_error(error))
            raise

    def _call_woken(self, drives: Sequence[RobotDrive], following: dict[int, float]) -> None:
        """
        Schedule each drive that was passed to ``wake``, so that the loop calls it next.

        :param following: the time of the next call of each drive, by its index; changed in place
        """
        while self._woken:
            drive = self._woken.popleft()
            for number in following:
                if drives[number] is drive:
                    following[number] = 0.0


#: Python's largest threshold for the garbage collector: with it no full collection ever starts.
NEVER = 2 ** 31 - 1
#: How long a busy thread may make the thread that drives wait for the interpreter's lock [s].
#: Python's 5 ms may pass in each call of DDS.  Chosen.
SWITCH_INTERVAL = 0.0002

_lock = threading.Lock()
_runs = 0
#: restores the settings of the interpreter when the last drive ends
_restore = contextlib.ExitStack()


@contextlib.contextmanager
def interpreter_prepared() -> Iterator[None]:
    """
    Set the interpreter so that no other thread holds up a drive for long in a ``with`` block.

    All objects that exist now are excluded from garbage collection: to search a million takes
    150 ms (measured), in which no other code of the process runs.  And a busy thread gives way
    soon.  Such blocks may overlap, in several threads: the first begins, the last one restores.
    """
    global _runs  # noqa: PLW0603 (as the interpreter itself)
    with _lock:
        _runs += 1
        if _runs == 1:
            _freeze()
            interval = sys.getswitchinterval()
            sys.setswitchinterval(min(interval, SWITCH_INTERVAL))
            _restore.callback(sys.setswitchinterval, interval)
    try:
        yield
    finally:
        with _lock:
            _runs -= 1
            if not _runs:
                _restore.close()


def _freeze() -> None:
    if gc.get_freeze_count():
        # gc.unfreeze() would also unfreeze the objects that the user's program has frozen.
        thresholds = gc.get_threshold()
        gc.set_threshold(*thresholds[:2], NEVER)
        _restore.callback(gc.set_threshold, *thresholds)
    else:
        gc.freeze()
        _restore.callback(gc.unfreeze)
