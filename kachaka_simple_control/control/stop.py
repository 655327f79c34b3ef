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
Stop the robot once for each drive, and check with odometry that it stands still.

A stop consists of zero velocities until the robot's command timeout has passed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
import threading
import time

from kachaka_simple_control.control.events import Event, StopBegan, StopConfirmed
from kachaka_simple_control.control.guardian import Guardian, NullGuardian
from kachaka_simple_control.control.timing import (
    STOP_BURST_COUNT,
    STOP_MARGIN,
    STOP_REPEAT_PERIOD,
)
from kachaka_simple_control.control.velocity_gate import Run, VelocityGate
from kachaka_simple_control.errors import ControlError, RunFaultError


def send_stop(
        send_zero: Callable[[], bool],
        command_timeout: float,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep) -> bool:
    """
    Send zero velocities for the robot's command timeout plus STOP_MARGIN.

    The first STOP_BURST_COUNT are sent without a pause: they push older velocities out of the
    queue of a reader that was slow or frozen.

    :param send_zero: publishes one; False ends the stop early
    :returns: whether all were sent
    """
    end = clock() + command_timeout + STOP_MARGIN
    for _ in range(STOP_BURST_COUNT):
        if not send_zero():
            return False
    while clock() < end:
        sleep(STOP_REPEAT_PERIOD)
        if not send_zero():
            return False
    return True


class StopController:
    """
    Sends one stop for each run, even if several threads request it; a new run ends a stop early.

    :param guardian: gets a report before each zero velocity, and at the end of the stop
    :param more_time: how much longer the stop must continue at most [s], because odometry shows
        motion or is lost; 0 if it need not
    :param publish: puts an event into a queue, and returns at once
    """

    def __init__(
            self,
            gate: VelocityGate,
            command_timeout: float,
            guardian: Guardian | NullGuardian,
            more_time: Callable[[], float] = lambda: 0.0,
            clock: Callable[[], float] = time.monotonic,
            sleep: Callable[[float], None] = time.sleep,
            publish: Callable[[Event], None] = lambda _: None) -> None:
        self._gate = gate
        self._publish = publish
        self._command_timeout = command_timeout
        self._guardian = guardian
        self._more_time = more_time
        self._clock = clock
        self._sleep = sleep
        self._lock = threading.Lock()
        self._stopped: Run | None = None
        self._later: threading.Timer | None = None
        #: when the newest stop began [s on the clock]; None before the first
        self.stop_started: float | None = None
        #: called at the end of each complete stop
        self.on_stopped: Callable[[], None] = lambda: None

    @property
    def is_stopped(self) -> bool:
        """Whether the newest drive was stopped completely; also True if no drive has begun yet."""
        return self._stopped is self._gate.run

    @property
    def is_stopping(self) -> bool:
        """Whether the zero velocities of a stop are being sent now."""
        return self._lock.locked()

    def stop(self, reason: ControlError | None, only: Run | None = None) -> str | None:
        """
        Stop the newest run, and wait until all zero velocities of the stop were sent.

        :param reason: ends the run, whose thread raises it; None if the run to stop has ended
            already
        :param only: the run to stop if ``reason`` is None; nothing is sent after a newer one has
            begun
        :returns: why the stop could not be sent; None if it was sent, or a newer run has begun
        """
        run = only
        if reason is not None:
            run = self._gate.cancel(reason)
        elif self._gate.run is not only:
            return None
        with self._lock:
            if self._stopped is run:
                return None
            self.stop_started = self._clock()
            self._publish(StopBegan(self.stop_started))
            send_zero = partial(self._send_zero, run)
            try:
                if not send_stop(send_zero, self._command_timeout, self._clock, self._sleep):
                    return None
                is_still = self._repeat_until_still(run)
            except Exception as error:  # the context is gone: nothing can be published
                return f'the stop could not be sent: {error}'
            self._stopped = run
            self._guardian.report_stopped()
            if is_still:
                self._publish(StopConfirmed(self._clock()))
            self.on_stopped()
        return None

    def stop_after_idle(self, run: Run, within: float) -> None:
        """
        Stop the robot in the background after a run, unless another begins in time.

        :param within: how long to wait for another run before the stop is sent [s]
        """
        self._later = threading.Timer(within, self._stop_ended, (run,))
        self._later.daemon = True
        try:
            self._later.start()
        except RuntimeError:  # from Python 3.12 on, no thread can start when the program ends
            self._stop_ended(run)

    def cancel_pending(self) -> None:
        """Cancel the stop that ``stop_after_idle`` has scheduled, because another drive begins."""
        if self._later is not None:
            self._later.cancel()

    def _stop_ended(self, run: Run) -> None:
        if (failure := self.stop(None, only=run)) is not None:
            raise RunFaultError(failure)

    def _send_zero(self, run: Run | None) -> bool:
        # Report before the zero: if this process hangs before its last zero, the guardian must not
        # treat the stop as complete.
        self._guardian.report_stopping()
        return self._gate.send_zero(run)

    def _repeat_until_still(self, run: Run | None) -> bool:
        """
        Send more zeros until odometry shows no motion: the link may have lost the others.

        :returns: False if the time has passed, or if a newer run has begun
        """
        began = self._clock()
        while (more_time := self._more_time()) > 0.0:
            if self._clock() >= began + more_time or not self._send_zero(run):
                return False
            self._sleep(STOP_REPEAT_PERIOD)
        return True
