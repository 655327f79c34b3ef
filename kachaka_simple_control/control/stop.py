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
"""The stop sequence, who may start it, and whether odometry confirms it."""

from __future__ import annotations

from collections.abc import Callable
import threading
import time
from typing import Protocol

from kachaka_simple_control.control.timing import (
    ODOMETRY_MAX_AGE,
    STANDSTILL_ANGULAR,
    STANDSTILL_LINEAR,
    STOP_BURST_COUNT,
    STOP_CONFIRM_TIMEOUT,
    STOP_MARGIN,
    STOP_REPEAT_PERIOD,
)
from kachaka_simple_control.control.velocity_gate import Run, VelocityGate
from kachaka_simple_control.errors import ControlError
from kachaka_simple_control.motion.geometry import Velocity


class StandstillDetector:
    """What odometry last said of the robot's velocity."""

    def __init__(self) -> None:
        """Have heard nothing yet."""
        self._heard: float | None = None
        self._still_since: float | None = None

    def on_odometry(self, now: float, velocity: Velocity) -> None:
        """
        Take note of a velocity.

        :param now: when it arrived [s]
        :param velocity: the velocity that odometry tells
        """
        self._heard = now
        if abs(velocity.linear_x) > STANDSTILL_LINEAR or abs(
                velocity.angular_z) > STANDSTILL_ANGULAR:
            self._still_since = None
        elif self._still_since is None:
            self._still_since = now

    def age(self, now: float) -> float | None:
        """
        Return for how long odometry has said nothing.

        :param now: the time [s]
        :returns: the time since it was last heard [s]; None if it never was
        """
        return None if self._heard is None else now - self._heard

    def is_moving(self, now: float) -> bool:
        """
        Tell whether the robot is seen to move.

        :param now: the time [s]
        :returns: true only if odometry is fresh and says so
        """
        silence = self.age(now)
        return silence is not None and silence <= ODOMETRY_MAX_AGE and self._still_since is None

    def still_since(self, now: float) -> float | None:
        """
        Return since when the robot is seen to stand still.

        :param now: the time [s]
        :returns: when the first sample said so that no moving one followed [s]; None if it moves
            or nobody can tell
        """
        silence = self.age(now)
        return self._still_since if silence is not None and silence <= ODOMETRY_MAX_AGE else None


class GuardianClient(Protocol):
    """Who stops the robot if this process cannot."""

    def report_stopping(self) -> None:
        """Hear that the robot is being sent to rest: with each zero, until the whole stop was."""

    def report_stopped(self) -> None:
        """Hear that the whole stop was sent: silence means nothing from here."""


def send_stop(
        zero: Callable[[], bool],
        hold: float,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep) -> bool:
    """
    Send a whole stop.

    Front-loaded: a reader that was slow or asleep plays its queue, so the first zeros push out
    whatever velocities are in it.

    :param zero: publishes one zero; returns whether it may go on
    :param hold: how long the robot keeps a velocity without a new one [s]
    :param clock: the steady clock [s]
    :param sleep: sleeps for a time [s]
    :returns: whether the stop was sent whole
    """
    end = clock() + hold + STOP_MARGIN
    for _ in range(STOP_BURST_COUNT):
        if not zero():
            return False
    while clock() < end:
        sleep(STOP_REPEAT_PERIOD)
        if not zero():
            return False
    return True


class StopController:
    """Stops a run once, whoever asks and how often; a run that begins ends the stop early."""

    def __init__(
            self,
            edge: VelocityGate,
            hold: float,
            guard: GuardianClient,
            still_moves: Callable[[], bool] = lambda: False,
            clock: Callable[[], float] = time.monotonic,
            sleep: Callable[[float], None] = time.sleep) -> None:
        """
        Make a stopper; nothing needs stopping yet.

        :param edge: where the zeros go
        :param hold: how long the robot keeps a velocity without a new one [s]
        :param guard: who is told
        :param still_moves: whether the robot is seen to move on although it should not, and
            nobody else drives it
        :param clock: the steady clock [s]
        :param sleep: sleeps for a time [s]
        """
        self._edge = edge
        self._hold = hold
        self._guard = guard
        self._still_moves = still_moves
        self._clock = clock
        self._sleep = sleep
        self._lock = threading.Lock()
        self._stopped: Run | None = None
        self._later: threading.Timer | None = None
        #: when the newest stop began [s on the clock]; None if there was none
        self.stop_started: float | None = None

    def stop(self, reason: ControlError) -> None:
        """
        Stop the newest run, and return when the stop has been sent whole.

        :param reason: what the run's own thread hears
        """
        self._send_stop(self._edge.cancel(reason))

    def stop_after_idle(self, run: Run, within: float) -> None:
        """
        Stop in the background unless another run begins soon; at once if nothing can wait there.

        :param run: the run that has just ended
        :param within: how long to wait for the next [s]
        """
        self._later = threading.Timer(within, self._stop_if_newest, (run,))
        self._later.daemon = True
        try:
            self._later.start()
        except RuntimeError:  # no thread can start, as at Python's end from 3.12 on
            self._stop_if_newest(run)

    def cancel_pending(self) -> None:
        """Forget a stop that waits for its time: another run begins at once."""
        if self._later is not None:
            self._later.cancel()

    def _stop_if_newest(self, run: Run) -> None:
        # Not by stop(): a run that begins right now is not the one to be ended.
        if self._edge.run is run:
            self._send_stop(run)

    def _send_stop(self, run: Run | None) -> None:
        with self._lock:
            if self._stopped is run:
                return
            self.stop_started = self._clock()
            if send_stop(lambda: self._send_zero(run), self._hold, self._clock, self._sleep):
                self._repeat_until_still(run)
                self._stopped = run
                self._guard.report_stopped()

    def _send_zero(self, run: Run | None) -> bool:
        # Told first: whoever is held up before its last zero is not to be taken for done.
        self._guard.report_stopping()
        return self._edge.send_zero(run)

    def _repeat_until_still(self, run: Run | None) -> None:
        """Send more zeros while the robot does not obey: a lossy link may have lost them all."""
        end = self._clock() + STOP_CONFIRM_TIMEOUT
        while self._still_moves() and self._clock() < end and self._send_zero(run):
            self._sleep(STOP_REPEAT_PERIOD)
