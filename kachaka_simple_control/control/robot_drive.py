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
"""Drive one robot: send velocities when they are due, check for faults, report the progress."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
import math
import threading

from kachaka_simple_control.control.drive_monitor import DriveMonitor
from kachaka_simple_control.control.events import (
    DriveState,
    MotionEnded,
    MotionStarted,
    ProgressMade,
    SpeedFactorChanged,
    StateChanged,
    VelocityKind,
    WatchChanged,
)
from kachaka_simple_control.control.speed_factor import is_hold, product, SpeedFactor
from kachaka_simple_control.control.tick import Tick
from kachaka_simple_control.control.tick_scheduler import VelocitySource
from kachaka_simple_control.control.timing import CHECK_PERIOD, max_gap
from kachaka_simple_control.control.velocity_gate import Permit, VelocityGate
from kachaka_simple_control.errors import ControlError
from kachaka_simple_control.motion.geometry import compose, integrate, ORIGIN, Pose, ZERO
from kachaka_simple_control.motion.plan import Plan

#: In these states a drive was requested, and its stop has not begun.
UNDER_WAY = frozenset({
    DriveState.WAITING, DriveState.CONNECTING, DriveState.DRIVING, DriveState.PAUSED})


@dataclass(frozen=True)
class DriveProgress:
    """
    The progress of the newest drive at one moment.

    :param title: the name of the motion; empty before the first drive
    :param plan: None without a plan
    :param began: t = 0 [s]; nan before the drive began
    :param plan_time: the point in the plan of the newest velocity [s]; None without a plan
    :param start: the pose at t = 0 by odometry; None if unknown
    :param way: the planned pose relative to ``start``
    :param factors: the speed factors below 1, by the name of their source
    :param skipped: how many velocities in all drives were too late to be sent
    :param ended_by: why the drive ended early; None if it did not
    :param watch: the newest of the obstacle watch; None without one
    """

    title: str = ''
    plan: Plan | None = None
    began: float = math.nan
    plan_time: float | None = None
    start: Pose | None = None
    way: Pose = ORIGIN
    factors: Mapping[str, float] = field(default_factory=dict)
    late: int = 0
    skipped: int = 0
    is_over: bool = False
    ended_by: str | None = None
    state: DriveState = DriveState.READY
    watch: WatchChanged | None = None

    @property
    def planned_pose(self) -> Pose | None:
        """Return where the robot should be now, in the odometry frame; None if that is unknown."""
        return None if self.start is None else compose(self.start, self.way)

    @property
    def step(self) -> tuple[int, int]:
        """
        Return the number of the current step and of all steps.

        The first step is 1; the current one is 0 before the first velocity; both are 0 without a
        plan.
        """
        if self.plan is None or not self.plan.steps:
            return 0, 0
        number = 0 if self.plan_time is None else self.plan.step_index(self.plan_time) + 1
        return number, len(self.plan.steps)


#: A velocity is late if it is sent this fraction of a period or more after its due time.
LATE = 0.25
#: How often ``ProgressMade`` is published, for readers of many robots [s].
PROGRESS_PERIOD = 0.25


class RobotDrive:
    """
    What one robot does in a drive, from the first velocity to the zero velocity at the end.

    It has no thread and reads no clock: ``step`` is told the time and says when it must be called
    again. Any thread may use ``end``, ``progress`` and ``on_stop``. Here alone the state of the
    robot's drive changes, and each change is published as an event.

    :param monitor: corrects velocities, and raises the faults that end the drive
    """

    def __init__(
            self, gate: VelocityGate, monitor: DriveMonitor, speed_factor: SpeedFactor,
            command_timeout: float) -> None:
        self.gate = gate
        self.monitor = monitor
        monitor.wait_for_dds = gate.wait_for_dds
        self.speed_factor = speed_factor
        self._command_timeout = command_timeout
        self._progress = DriveProgress()
        self._permit = Permit()
        self._source: VelocitySource | None = None
        self._period: float | None = None
        self._tick: Tick | None = None
        #: the planned pose relative to the start, at the first tick with the current velocity, and
        #: when this tick was due [s after t = 0]
        self._way = ORIGIN, 0.0
        #: when the next velocity is due [s after t = 0]
        self._due = 0.0
        #: when the monitor last checked for faults [s on the steady clock]
        self._checked = -math.inf
        #: when ``ProgressMade`` was published last [s on the steady clock], and the largest
        #: lateness of a velocity since [s]
        self._shown, self._lateness = -math.inf, 0.0
        #: whether the source has changed since its last ``due`` call
        self._has_source_changed = False
        self._state = self._state_before = DriveState.READY
        self._is_held = speed_factor.is_hold
        #: the drive that only zeros follow any more, and the one whose stop has ended
        self._ending: Permit | None = None
        self._stopped: Permit | None = None
        # Reentrant: a reader of events may set a speed factor when it is asked what it wants.
        self._changing = threading.RLock()
        speed_factor.on_change = self._on_factors

    def request(self, now: float, title: str, plan: Plan | None = None) -> None:
        """
        Show in ``progress`` which motion is driven next; the robot need not be connected yet.

        :param plan: None if velocities are commanded directly
        """
        before = self._progress
        self._tick, self._way = None, (ORIGIN, 0.0)
        self._state_before = DriveState.WAITING
        self._progress = DriveProgress(title, plan, late=before.late, skipped=before.skipped)
        self._update(now)

    def connect(self, now: float) -> None:
        """Record that the zeros before the first velocity are sent from now on."""
        self._state_before = DriveState.CONNECTING
        self._update(now)

    def begin(
            self, source: VelocitySource, t0: float, period: float | None = None,
            permit: Permit | None = None, start: Pose | None = None) -> Permit:
        """
        Begin a drive; from now on the caller has to call ``step``.

        :param t0: when the first velocity is due [s]
        :param period: the normal time between two velocities [s]; None if unknown
        :param permit: one that the gate's ``prepare`` has returned; None for a new one
        :param start: the pose by odometry; None if unknown
        :raises ControlError: if the drive was cancelled, or no velocity may be sent to the robot
        """
        self._permit = self.gate.begin(
            max_gap(period, self._command_timeout), permit, self._command_timeout, t0)
        self._source, self._period = source, period
        self._tick, self._due, self._way = None, 0.0, (ORIGIN, 0.0)
        self._checked, self._has_source_changed = -math.inf, False
        self._progress = replace(self._progress, start=start)
        return self._permit

    def step(self, now: float, woken: float | None = None) -> float | None:
        """
        Send the velocity that is due; without one check for faults.

        So the velocities of many robots that are due together are not apart by their checks.

        :param woken: when the thread has woken up [s]: from then on the time to the next check is
            measured, so that the next checks of all its robots need one wake-up; None: now
        :returns: when this must be called again at the latest [s]; None at the end of the drive:
            one zero velocity was sent, and the caller sends more until the command timeout has
            passed
        :raises ControlError: if another thread ended the drive, or if the drive cannot continue
        """
        permit, source, gate = self._permit, self._source, self.gate
        assert source is not None
        gate.check(permit)
        woken = now if woken is None else woken
        is_due = now >= permit.began + self._due or self._has_source_changed
        # A thread that has too much to do checks before the velocity, not never.
        if not is_due or woken - self._checked > 2.0 * CHECK_PERIOD:
            self._checked = woken
            self.monitor.check(now)
        if not is_due:
            return min(permit.began + self._due, self._checked + CHECK_PERIOD)
        # Clear the flag before the call of the source: a change during the call then counts for
        # the next step.
        is_early, self._has_source_changed = self._has_source_changed, False
        # The deadline has passed, even if the rounded time difference is slightly below it.
        elapsed = now - permit.began if is_early else max(now - permit.began, self._due)
        tick = source.due(elapsed, self.monitor.speed_factor)
        if tick is None:
            self._count(gate.send(
                permit, ZERO, source.kind, self._due, source.plan_duration, source.skipped))
            self._ending = permit  # its stop follows, unless another drive begins before
            self._update(now)
            return None
        velocity = self.monitor.correct(tick, now)
        kind = source.kind if velocity is tick.velocity else VelocityKind.CORRECTION
        if self._tick is None:
            gate.publish(MotionStarted(permit.began, tick.plan_time is not None))
            self._progress = replace(self._progress, began=permit.began)
            self._update(now)
        elif tick.velocity is not self._tick.velocity:
            way, since = self._way
            self._way = integrate(way, self._tick.velocity, tick.start - since), tick.start
        self._tick, self._due = tick, tick.start
        sent = gate.send(permit, velocity, kind, tick.start, tick.plan_time, source.skipped)
        self._count(sent)
        self._show(sent, tick)
        self.monitor.on_sent(sent, tick.rest if velocity.is_zero else 0.0, tick.plan_time)
        self._due = tick.deadline
        # Above 80 Hz not each velocity needs a check: it takes as long as a third of a velocity.
        return min(permit.began + tick.deadline, self._checked + (
            CHECK_PERIOD if woken - self._checked < CHECK_PERIOD / 2.0 else 0.0))

    def on_source_changed(self) -> None:
        """Make ``step`` ask the source for its new velocity at once; for any thread."""
        self._has_source_changed = True
        self.gate.wake()

    def end(self, reason: ControlError) -> bool:
        """
        End the drive early, and send one zero velocity at once; any thread may call this.

        The thread that drives then raises ``reason``, and sends more zero velocities.

        :returns: False if there was no drive, or another call ended it before
        """
        before = self.gate.permit
        was_over = before is not None and before.ended_by is not None
        permit = self.gate.cancel(reason)
        is_ended = permit is not None and permit.ended_by is reason and not was_over
        if is_ended:
            self.gate.send_zero(after=permit)
        return is_ended

    def on_stop(self, now: float, permit: Permit | None, has_ended: bool) -> None:
        """Record that the zeros of a drive's stop begin, or have ended; for any thread."""
        if permit is self._permit:
            self._ending, self._stopped = permit, permit if has_ended else None
            self._update(now)

    def finish(self, now: float, reason: str | None = None, is_fault: bool = True) -> None:
        """
        Record that the newest drive is over, unless that was done.

        :param reason: why it ended early; None if it was complete
        :param is_fault: whether an error ended it early; false if somebody requested the end
        """
        if self._progress.is_over:
            return
        self._progress = replace(self.progress, is_over=True, ended_by=reason)
        self.gate.publish(MotionEnded(now, reason, is_fault))
        self._update(now)

    @property
    def is_at_rest(self) -> bool:
        """Whether the newest velocity is zero and a speed factor holds the robot at rest."""
        tick = self._tick
        return tick is None or tick.rest == math.inf

    @property
    def progress(self) -> DriveProgress:
        """Return the progress of the newest drive, such as its plan and its planned pose."""
        tick = self._tick
        watch = self.monitor.watch
        progress = replace(
            self._progress, factors=self.speed_factor.factors, state=self._state,
            watch=None if watch is None else watch.told)
        if progress.is_over or tick is None:
            return progress
        way, since = self._way
        return replace(
            progress, plan_time=tick.plan_time,
            way=integrate(way, tick.velocity, tick.start - since))

    def _on_factors(self, now: float, factors: Mapping[str, float]) -> None:
        self.gate.publish(SpeedFactorChanged(now, dict(factors)))
        self._is_held = is_hold(product(factors))
        self._update(now)

    def _update(self, now: float) -> None:
        """Change the state, and publish it, if what it follows from has changed."""
        with self._changing:
            state = self._due_state()
            if state is not self._state:
                self._state = state
                self.gate.publish(StateChanged(now, state))

    def _due_state(self) -> DriveState:
        progress, permit = self._progress, self._permit
        if math.isnan(progress.began) and not progress.is_over:
            return self._state_before  # even if the stop of the drive before is still sent
        if self._ending is permit and not (progress.is_over and self._stopped is permit):
            return DriveState.STOPPING
        if progress.is_over:
            return DriveState.STOPPED if progress.ended_by is None else DriveState.CUT_SHORT
        return DriveState.PAUSED if self._is_held else DriveState.DRIVING

    def _show(self, sent: float, tick: Tick) -> None:
        self._lateness = max(self._lateness, sent - self._permit.began - tick.start)
        if sent - self._shown >= PROGRESS_PERIOD and self.gate.has_readers(ProgressMade):
            self.gate.publish(ProgressMade(sent, tick.plan_time, tick.velocity, self._lateness))
            self._shown, self._lateness = sent, 0.0

    def _count(self, sent: float) -> None:
        """Count late and skipped velocities."""
        source, late = self._source, sent - self._permit.began - self._due
        is_late = self._period is not None and late >= LATE * self._period
        if source is not None and (is_late or source.skipped):
            self._progress = replace(
                self._progress, late=self._progress.late + is_late,
                skipped=self._progress.skipped + source.skipped)
