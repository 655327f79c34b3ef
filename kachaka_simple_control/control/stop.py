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
import math
import threading
import time

from kachaka_simple_control.control.events import Event, StopConfirmed
from kachaka_simple_control.control.guardian import Guardian, NullGuardian
from kachaka_simple_control.control.preparation import (
    complete,
    Moment,
    pause,
    Preparation,
    Steps,
    Wait,
)
from kachaka_simple_control.control.timing import (
    STOP_BURST_COUNT,
    STOP_MARGIN,
    STOP_REPEAT_PERIOD,
)
from kachaka_simple_control.control.velocity_gate import Permit, VelocityGate
from kachaka_simple_control.errors import ControlError


def stop_steps(
        moment: Moment, send_zero: Callable[[], bool], command_timeout: float) -> Steps[bool]:
    """
    Send zero velocities for the robot's command timeout plus STOP_MARGIN.

    The first STOP_BURST_COUNT are sent without a pause: they push older velocities out of the
    queue of a reader that was slow or frozen.

    :param send_zero: publishes one; False ends the stop early
    :returns: whether all were sent
    """
    end = moment.now + command_timeout + STOP_MARGIN
    for _ in range(STOP_BURST_COUNT):
        if not send_zero():
            return False
    while moment.now < end:
        yield from pause(moment, STOP_REPEAT_PERIOD, 'its command timeout')
        if not send_zero():
            return False
    return True


class StopController:
    """
    Sends one stop for each drive, even if several threads request it; a new drive ends it early.

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
        self._stopped: Permit | None = None
        #: when the newest stop began [s on the clock]; None before the first
        self.stop_started: float | None = None
        #: called with why a late stop has failed
        self.on_failure: Callable[[str], object] = lambda _: None
        #: called with the time, the drive's permit and False when the zeros of its stop begin, and
        #: with True when they have ended
        self.on_stop: Callable[[float, Permit | None, bool], object] = lambda *_: None
        #: called at the end of each complete stop
        self.on_stopped: Callable[[], None] = lambda: None

    @property
    def is_stopped(self) -> bool:
        """Whether the newest drive was stopped completely; also True if no drive has begun yet."""
        return self._stopped is self._gate.permit

    def stop(self, reason: ControlError | None, only: Permit | None = None) -> str | None:
        """Go through the ``steps`` in the calling thread."""
        return complete(
            [partial(self.steps, reason=reason, only=only)], lambda: None, self._clock,
            self._sleep)[0]

    def steps(
            self, moment: Moment, reason: ControlError | None,
            only: Permit | None = None) -> Steps[str | None]:
        """
        Stop the newest drive, and wait until all zero velocities of the stop were sent.

        :param reason: ends the drive, whose thread raises it; None if the drive to stop has ended
            already
        :param only: the drive to stop if ``reason`` is None; nothing is sent after a newer one has
            begun
        :returns: why the stop could not be sent; None if it was sent, or a newer drive has begun
        """
        permit = only
        if reason is not None:
            permit = self._gate.cancel(reason)
        elif self._gate.permit is not only:
            return None
        while not self._lock.acquire(blocking=False):
            yield Wait('the stop that another thread sends', math.inf)
        try:
            return None if self._stopped is permit else (yield from self._send_all(moment, permit))
        finally:
            self._lock.release()

    def _send_all(self, moment: Moment, permit: Permit | None) -> Steps[str | None]:
        self.stop_started = moment.now
        self.on_stop(moment.now, permit, False)
        try:
            try:
                if not (yield from stop_steps(
                        moment, partial(self._send_zero, permit), self._command_timeout)):
                    return None
                is_still = yield from self._repeat_until_still(moment, permit)
            except Exception as error:  # the context is gone: nothing can be published
                return f'the stop could not be sent: {error}'
            self._stopped = permit
            self._guardian.report_stopped()
            if is_still:
                self._publish(StopConfirmed(self._clock()))
            self.on_stopped()
        finally:
            self.on_stop(self._clock(), permit, True)
        return None

    def _send_zero(self, permit: Permit | None) -> bool:
        # Report before the zero: if this process hangs before its last zero, the guardian must not
        # treat the stop as complete.
        self._guardian.report_stopping()
        return self._gate.send_zero(permit)

    def _repeat_until_still(self, moment: Moment, permit: Permit | None) -> Steps[bool]:
        """
        Send more zeros until odometry shows no motion: the link may have lost the others.

        :returns: False if the time has passed, or if a newer drive has begun
        """
        began = moment.now
        while (more_time := self._more_time()) > 0.0:
            if moment.now >= began + more_time or not self._send_zero(permit):
                return False
            yield from pause(moment, STOP_REPEAT_PERIOD, 'its rest')
        return True


class LateStops:
    """
    Stops robots after drives that no other drive has followed, in one thread for all of them.

    :param clock: and the timeout of ``threading.Condition.wait`` are on the same clock [s]
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._due: dict[StopController, tuple[float, Permit]] = {}
        self._changed = threading.Condition()
        self._is_closed = False
        # Started here: from Python 3.12 on, no thread can start when the program ends.
        self._thread = threading.Thread(target=self._run, name='late stops', daemon=True)
        self._thread.start()

    def schedule(self, controller: StopController, permit: Permit, within: float) -> None:
        """Stop a robot after a time [s], unless ``cancel`` is called, or another drive begins."""
        with self._changed:
            self._due[controller] = self._clock() + within, permit
            self._changed.notify()

    def cancel(self, controller: StopController) -> None:
        """Do not send the stop that is scheduled for a robot, because another drive begins."""
        with self._changed:
            self._due.pop(controller, None)

    def close(self) -> None:
        """End the thread; wait for it, but not in the thread itself."""
        with self._changed:
            self._is_closed = True
            self._changed.notify()
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _run(self) -> None:
        under_way: list[tuple[StopController, Preparation[str | None]]] = []
        while True:
            with self._changed:
                now = self._clock()
                while not (self._is_closed or under_way) and now < (
                        first := min((at for at, _ in self._due.values()), default=math.inf)):
                    self._changed.wait(None if first == math.inf else first - now)
                    now = self._clock()
                if self._is_closed:
                    break
                for controller in [one for one, (at, _) in self._due.items() if at <= now]:
                    _, permit = self._due.pop(controller)
                    under_way.append((controller, Preparation(partial(
                        controller.steps, reason=None, only=permit))))
            waits = [(pair, wait) for pair in under_way
                     if (wait := pair[1].advance(self._clock())) is not None]
            for controller, stop in under_way:
                if stop.result is not None:
                    controller.on_failure(stop.result)
            under_way = [pair for pair, _ in waits]
            if waits:
                time.sleep(STOP_REPEAT_PERIOD / 2.0)
        for _, stop in under_way:
            stop.close()
