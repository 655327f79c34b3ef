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
Hold a robot before obstacles, and let it go on: what the obstacle watch says is done here.

Tested by test/control/test_scan_watch.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
import threading

from kachaka_simple_control.control.events import Event, WatchChanged, WatchState
from kachaka_simple_control.control.hold_text import describe_watch
from kachaka_simple_control.control.obstacle_watch import ObstacleWatch, Verdict
from kachaka_simple_control.control.preparation import Moment, Steps, until
from kachaka_simple_control.control.speed_factor import OBSTACLE, SpeedFactor
from kachaka_simple_control.control.tick_scheduler import VelocitySource
from kachaka_simple_control.control.timing import (
    LASER_PERIOD,
    LONG_HOLD,
    SCAN_START_TIMEOUT,
    SCAN_TIMEOUT,
)
from kachaka_simple_control.errors import RobotNotFoundError
from kachaka_simple_control.motion.geometry import Point, Pose, Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import Plan

#: An obstacle at another distance is told if it has changed by more [m], [rad].
TOLD_LENGTH, TOLD_ANGLE = 0.025, 0.05


def do_nothing() -> None:
    """Do nothing."""


class ScanWatch:
    """
    Sets the speed factor of a robot by its scans, and publishes why.

    A thread that drives no robot calls ``on_scan``, the one that drives ``prepare``, ``poll``
    and ``end``; any thread may call the others.

    :param name: of the robot; empty for the only one of a node
    :ivar others: the speed factors of the other robots of a drive, which are held as well
    :ivar activate: lets the laser run for some seconds, also while the robot rests
    :ivar told: what was published last, or that all is free at the start; None outside a drive
    """

    def __init__(
            self, watch: ObstacleWatch, speed_factor: SpeedFactor, name: str,
            publish: Callable[[Event], None], log: Callable[[str], object]) -> None:
        self._watch = watch
        self._speed_factor, self._name = speed_factor, name
        self._publish, self._log = publish, log
        self.others: Sequence[SpeedFactor] = ()
        self.activate: Callable[[], None] = lambda: None
        self.told: WatchChanged | None = None
        self._lock = threading.RLock()
        self._is_driving = False
        #: ``on_scan`` of the source of the drive
        self._on_scan = do_nothing
        self._held_since: float | None = None
        self._activated = -math.inf

    def on_scan(self, now: float, taken: float, points: Sequence[Point]) -> None:
        """Compare a scan, with points in the frame of the robot, with the planned path."""
        sight = self._watch.look(taken, points)
        with self._lock:
            verdict = self._watch.decide(sight)
            if self._is_driving:
                self._apply(verdict, now)
        self._on_scan()

    def on_sent(self, now: float, plan_time: float | None) -> None:
        """Note which plan time was sent; for the thread that drives."""
        self._watch.on_sent(now, plan_time)

    def on_odometry(self, now: float, pose: Pose) -> None:
        """Note a pose of odometry, which arrives in order of time."""
        self._watch.on_odometry(now, pose)

    def cut(self, wanted: Velocity, limits: Limits, now: float) -> Velocity:
        """Return the part of a velocity by hand that the watch allows."""
        return self._watch.cut(wanted, limits, now)

    def prepare(
            self, moment: Moment, topic: str, plan: Plan | None, start: Callable[[], Pose | None],
            source: VelocitySource) -> Steps[None]:
        """
        Wait for a scan, and begin to watch a drive.

        :param plan: None if velocities are commanded directly
        :param start: returns the pose by odometry; None if unknown
        :raises RobotNotFoundError: if no scan comes in time
        """
        def has_scan() -> bool:
            if moment.now - self._watch.taken <= SCAN_TIMEOUT:
                return True
            self._keep_running(moment.now)
            return False

        if not (yield from until(moment, has_scan, 'a scan', SCAN_START_TIMEOUT)):
            raise RobotNotFoundError(
                f'the obstacle watch needs scans of the laser, and within {SCAN_START_TIMEOUT:g} '
                f's none that says anything has come on {topic}: let the laser run (that of a '
                'Kachaka rests while the robot stands), or leave watch out and clear the floor')
        with self._lock:
            self._is_driving, self._on_scan = True, source.on_scan
            self._apply(self._watch.begin(plan, start(), source.watch()), moment.now)

    def end(self) -> None:
        """End to watch, after a drive."""
        with self._lock:
            if self._is_driving:
                self._is_driving, self._held_since, self.told = False, None, None
                self._on_scan = do_nothing
                self._set(1.0, None)
            self.others = ()

    def poll(self, now: float, is_at_rest: bool) -> None:
        """
        Notice that no scan comes any more, and let the laser of a robot at rest run on.

        :param is_at_rest: whether the drive has the robot at rest, and nobody has paused it
        """
        # Who has the lock sets the factor just now; the thread that drives does not wait for it.
        if self._lock.acquire(blocking=False):
            try:
                is_lost = self._poll(now)
            finally:
                self._lock.release()
            if is_lost:
                self._on_scan()
        if is_at_rest:
            self._keep_running(now)

    def go_blind(self, now: float) -> bool:
        """Go on slowly without a scan, as a person wants; return whether scans were missing."""
        with self._lock:
            verdict = self._watch.go_blind(now) if self._is_driving else None
            if verdict is not None:
                self._apply(verdict, now)
        return verdict is not None

    def _poll(self, now: float) -> bool:
        if not self._is_driving:
            return False
        verdict = self._watch.check(now)
        if verdict is not None:
            self._apply(verdict, now)
        if self._held_since is not None and now - self._held_since >= LONG_HOLD:
            self._held_since = math.inf
            self._log(
                f'Held for {LONG_HOLD:g} s: {describe_watch(self.told, {})}. Clear the way, or '
                'stop the robot')
        return verdict is not None

    def _apply(self, verdict: Verdict, now: float) -> None:
        valid_for = self._watch.valid_until - now
        factor = self._watch.factor if valid_for > 0.0 else 0.0
        self._set(factor, valid_for if factor else None)
        told = WatchChanged(now, *verdict)
        if not _is_told(self.told, told):
            is_new = self.told is None or self.told.state is not told.state
            self.told = told
            self._publish(told)
            if is_new:
                text = describe_watch(told, {OBSTACLE: factor})
                self._log(f'Held: {text}' if not factor else f'Goes on: {text or "it is free"}')
        elif self.told is None:
            self.told = told  # not published, but to whoever asks there is a watch
        if factor:
            self._held_since = None
        elif self._held_since is None:
            self._held_since = now

    def _set(self, factor: float, valid_for: float | None) -> None:
        self._speed_factor.set(OBSTACLE, factor, valid_for)
        for other in self.others:
            other.set(f'{OBSTACLE} of {self._name}', factor, valid_for)

    def _keep_running(self, now: float) -> None:
        if now - self._activated >= LASER_PERIOD:
            self._activated = now
            self.activate()


def _is_told(before: WatchChanged | None, told: WatchChanged) -> bool:
    """Return whether this was told already, nearly; that all is free needs not be said first."""
    if before is None:
        return told.state is WatchState.CLEAR
    if before.state is not told.state:
        return False
    if before.distance is None or told.distance is None:
        return True
    return (abs(before.distance - told.distance) <= TOLD_LENGTH
            and abs((before.angle or 0.0) - (told.angle or 0.0)) <= TOLD_ANGLE)
