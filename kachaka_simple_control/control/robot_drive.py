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
"""One robot's drive: what is due, sent, checked and known of it; told the time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import partial
import math

from kachaka_simple_control.control.events import MotionStarted, VelocityKind
from kachaka_simple_control.control.run_monitor import RunMonitor
from kachaka_simple_control.control.speed_factor import is_hold, product, SpeedFactor
from kachaka_simple_control.control.tick_scheduler import Tick, VelocitySource
from kachaka_simple_control.control.timing import CHECK_PERIOD, max_gap
from kachaka_simple_control.control.velocity_gate import Run, VelocityGate
from kachaka_simple_control.errors import ControlError
from kachaka_simple_control.motion.geometry import compose, integrate, ORIGIN, Pose, ZERO
from kachaka_simple_control.motion.plan import Plan


class RunState(Enum):
    """The state of the newest run, in words."""

    NONE = 'nothing started yet'
    CONNECTING = 'connecting to the robot'
    DRIVING = 'driving'
    HELD = 'paused'
    ENDED = 'at rest'
    ENDED_EARLY = 'stopped early'


@dataclass(frozen=True)
class RunProgress:
    """
    The newest run at one time; it never changes.

    :param title: the name of what is driven; empty before the first run
    :param plan: its plan; None without one
    :param began: t = 0 [s on the steady clock]; nan before it began
    :param plan_time: where on the plan its newest velocity is [s of the plan]; None without a plan
    :param start: where odometry showed the robot at t = 0; None if that is unknown
    :param way: where the velocities since then should have brought it, from its start
    :param factors: the speed factors below 1, by the name of who asks for less speed
    :param late: how many velocities of all runs left a quarter of a period or more after their
        time
    :param skipped: how many velocities of all runs never left: the next was due by then
    :param is_over: whether it has ended
    :param ended_by: why it ended early; None if it did not
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

    @property
    def state(self) -> RunState:
        """Return its state."""
        if not self.title:
            return RunState.NONE
        if self.is_over:
            return RunState.ENDED if self.ended_by is None else RunState.ENDED_EARLY
        if math.isnan(self.began):
            return RunState.CONNECTING
        return RunState.HELD if is_hold(product(self.factors)) else RunState.DRIVING

    @property
    def planned_pose(self) -> Pose | None:
        """Return where the robot should be, as odometry would show it; None if unknown."""
        return None if self.start is None else compose(self.start, self.way)

    @property
    def step(self) -> tuple[int, int]:
        """Return the number of the step under way, and of all; 0 before the first."""
        if self.plan is None or not self.plan.steps:
            return 0, 0
        number = 0 if self.plan_time is None else self.plan.step_index(self.plan_time) + 1
        return number, len(self.plan.steps)


#: A velocity is late if it leaves this part of a period after its time, or more.
LATE = 0.25


class RobotDrive:
    """
    The run of one robot, from its first velocity to the zero after its last.

    It has no thread and no clock: whoever drives it calls ``step`` with the time, and again at the
    time that it returns.  ``end`` and ``progress`` may be called from any thread.

    :param gate: sends the velocities
    :param monitor: sends heartbeats, corrects velocities, and raises the faults that end a run
    :param speed_factor: the speed relative to the plan, and who wants it slower
    :param command_timeout: how long the robot keeps a velocity [s]
    """

    def __init__(
            self, gate: VelocityGate, monitor: RunMonitor, speed_factor: SpeedFactor,
            command_timeout: float) -> None:
        self.gate = gate
        self.monitor = monitor
        self.speed_factor = speed_factor
        self._command_timeout = command_timeout
        self._progress = RunProgress()
        self._run = Run()
        self._source: VelocitySource | None = None
        self._period: float | None = None
        self._tick: Tick | None = None
        self._way = ORIGIN
        #: when the next velocity is due [s after t = 0]
        self._due = 0.0
        #: whether the source has changed since it was asked last
        self._has_source_changed = False

    def request(self, title: str, plan: Plan | None = None) -> None:
        """
        Show what is driven next; the robot may have to be taken before.

        :param title: its name
        :param plan: its plan; None without one
        """
        before = self._progress
        self._tick, self._way = None, ORIGIN
        self._progress = RunProgress(title, plan, late=before.late, skipped=before.skipped)

    def begin(
            self, source: VelocitySource, t0: float, period: float | None = None,
            run: Run | None = None, start: Pose | None = None) -> Run:
        """
        Begin a run; ``step`` drives it from now on.

        :param source: tells which velocity is due
        :param t0: when its first velocity is due: t = 0 [s on the steady clock]
        :param period: time between two velocities in good conditions [s]; None if that is unknown
        :param run: the run that the gate prepared for it; None for a new one
        :param start: where the robot is, by odometry; None if that is unknown
        :returns: the run
        :raises ControlError: if it may not begin
        """
        self._run = self.gate.begin(
            max_gap(period, self._command_timeout), run, self._command_timeout, t0)
        self._source, self._period = source, period
        self._tick, self._due, self._way = None, 0.0, ORIGIN
        self._has_source_changed = False
        self._progress = replace(self._progress, start=start)
        return self._run

    def step(self, now: float) -> float | None:
        """
        Look for faults, and send the velocity that is due, if one is.

        :param now: the time [s on the steady clock]
        :returns: when to call it again, at the latest [s on the steady clock]; None at the end of
            the run, which has sent one zero; the whole stop is the caller's
        :raises ControlError: if the run was ended or cannot go on
        """
        run, source, gate = self._run, self._source, self.gate
        assert source is not None
        gate.check(run)
        gate.wait_for_dds(self.monitor.check)
        if now < run.began + self._due and not self._has_source_changed:
            return min(run.began + self._due, now + CHECK_PERIOD)
        # Before the source is asked: a change that comes meanwhile is for the next call.
        is_early, self._has_source_changed = self._has_source_changed, False
        # A deadline has passed, even if the difference of two times rounds below it.
        elapsed = now - run.began if is_early else max(now - run.began, self._due)
        tick = source.due(elapsed, self.monitor.speed_factor)
        if tick is None:
            self._count(gate.send(
                run, ZERO, source.kind, self._due, source.plan_duration, source.skipped))
            return None
        velocity = self.monitor.correct(tick, now)
        kind = source.kind if velocity is tick.velocity else VelocityKind.CORRECTION
        if self._tick is None:
            gate.publish(MotionStarted(run.began, tick.plan_time is not None))
            self._progress = replace(self._progress, began=run.began)
        else:
            self._way = integrate(
                self._way, self._tick.velocity, tick.start - self._tick.start)
        self._tick, self._due = tick, tick.start
        self._count(gate.send(run, velocity, kind, tick.start, tick.plan_time, source.skipped))
        gate.wait_for_dds(partial(self.monitor.on_sent, tick.rest if velocity.is_zero else 0.0))
        self._due = tick.deadline
        return min(run.began + tick.deadline, now + CHECK_PERIOD)

    def on_source_changed(self) -> None:
        """Ask the source at once, and not at its next deadline; from any thread."""
        self._has_source_changed = True
        self.gate.wake()

    def end(self, reason: ControlError) -> bool:
        """
        End the run under way, with one zero at once; from any thread.

        The thread that drives it raises the reason, and sends the whole stop.

        :returns: whether there was one to end
        """
        run = self.gate.cancel(reason)
        is_ended = run is not None and run.ended_by is reason
        if is_ended:
            self.gate.send_zero(after=run)
        return is_ended

    def finish(self, reason: str | None = None) -> None:
        """
        Show that the run is over.

        :param reason: why it ended early; None if it was driven to its end
        """
        self._progress = replace(self.progress, is_over=True, ended_by=reason)

    @property
    def progress(self) -> RunProgress:
        """Return the newest run as it is now."""
        tick = self._tick
        if self._progress.is_over or tick is None:
            return replace(self._progress, factors=self.speed_factor.factors)
        return replace(
            self._progress, plan_time=tick.plan_time, way=self._way,
            factors=self.speed_factor.factors)

    def _count(self, sent: float) -> None:
        """Count what is late or was skipped; told when a velocity was sent."""
        source, late = self._source, sent - self._run.began - self._due
        is_late = self._period is not None and late >= LATE * self._period
        if source is not None and (is_late or source.skipped):
            self._progress = replace(
                self._progress, late=self._progress.late + is_late,
                skipped=self._progress.skipped + source.skipped)
