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
"""Compute the current status of a drive from the events of the drive, for the display."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from kachaka_simple_control.analysis.step_results import driven
from kachaka_simple_control.control import events
from kachaka_simple_control.control.events import DriveState, WatchChanged, WatchState
from kachaka_simple_control.control.hold_text import describe_hold, HELD
from kachaka_simple_control.control.robot_drive import LATE
from kachaka_simple_control.control.speed_factor import is_hold, OBSTACLE, product
from kachaka_simple_control.control.timing import ODOMETRY_MAX_AGE
from kachaka_simple_control.motion.geometry import Displacement, Velocity
from kachaka_simple_control.motion.plan import Plan, plan

#: The rate of the plan that the display computes for a long motion without corners [Hz].  A low
#: rate is enough, because the times of its steps do not depend on it.
PLAN_RATE = 0.001
#: Odometry that is older than this is not used to show the progress of a step [s].
DISPLAY_ODOMETRY_MAX_AGE = 0.5
#: A driving program that sends no velocity for this time is shown as blocked [s].
EVENT_TIMEOUT = 1.0
#: The words for the two things that are counted: the steps of a motion, or movements.  A movement
#: is one call of a method that drives, such as ``move_robot``.
STEP, MOVEMENT = 'step', 'movement'


@dataclass(frozen=True)
class Remaining:
    """
    The distance and the angle that remain until the end of a step.

    :param distance: along the path [m], at least 0; None if the step has no length
    :param angle: [rad], at least 0; None if the step does not turn
    :param by_odometry: whether they are from odometry, or else from the sent velocities
    """

    distance: float | None
    angle: float | None
    by_odometry: bool


@dataclass(frozen=True)
class StepStatus:
    """
    The status of the current step of a motion, or of a movement.

    :param number: from 1
    :param count: the total number; None if unknown
    :param time_left: until its end according to the plan [s]
    """

    number: int
    count: int | None
    noun: str
    description: str
    duration: float
    time_left: float
    remaining: Remaining

    @property
    def label(self) -> str:
        """Return the number of the step or movement as text, for example ``step 2 of 9``."""
        total = '' if self.count is None else f' of {self.count}'
        return f'{self.noun} {self.number}{total}'


@dataclass(frozen=True)
class DriveStatus:
    """
    The status of a drive at one time.

    :param robot: the name of the robot; empty if not yet known
    :param reason: why the motion ended early; None if it did not
    :param topic: the topic of velocities; empty if not yet known
    :param wait_left: how long the program still waits for the robot [s]; None if over or unknown
    :param step: None if there is none
    :param duration: the planned duration of the motion [s]; None without a plan
    :param time_left: until the end of the motion by the plan [s]; 0 without a plan
    :param commanded: the last sent velocity; None if nothing was sent
    :param odometry: the velocity by odometry; None without it
    :param odometry_age: the age of the last sample [s]; 0 without odometry
    :param factors: the speed factors below 1, by the name of their source
    :param silent_for: since the last velocity [s]; None up to EVENT_TIMEOUT (1 s), or at rest
    :param lateness: the largest of the newest velocities [s], by ``ProgressMade``
    :param is_late: whether this counts as late
    :param watch: what the obstacle watch says; None without one
    """

    state: DriveState
    title: str
    robot: str
    reason: str | None
    topic: str
    wait_left: float | None
    step: StepStatus | None
    duration: float | None
    time_left: float
    commanded: Velocity | None
    odometry: Velocity | None
    odometry_age: float
    factors: Mapping[str, float]
    silent_for: float | None
    lateness: float = 0.0
    is_late: bool = False
    watch: WatchChanged | None = None

    @property
    def held_by(self) -> str:
        """Return why only the obstacle watch holds the robot; empty if it does not."""
        return describe_hold(self.state, self.factors, self.watch)

    @property
    def has_own_hold(self) -> bool:
        """Return whether its own watch holds the robot, and not only that of another robot."""
        return bool(self.held_by) and is_hold(self.factors.get(OBSTACLE, 1.0))

    @property
    def word(self) -> str:
        """Return the word for the state: that of the ``DriveState``, or ``held``."""
        return HELD if self.held_by else self.state.value

    @property
    def waits_for_resume(self) -> bool:
        """Return whether the robot is held until somebody resumes, or could go on so."""
        is_silent = self.watch is not None and self.watch.state is WatchState.NO_SCAN
        return is_hold(self.speed) and (not self.held_by or is_silent)

    @property
    def speed(self) -> float:
        """Return the speed relative to the plan: 1 is full speed, and 0 is a pause."""
        return product(self.factors)

    def stretched(self, duration: float) -> float:
        """
        Return how long a part of the plan takes at the current speed [s].

        In a hold, how long it takes after that, at the speed from the other factors.
        """
        speed = product({name: factor for name, factor in self.factors.items()
                         if not is_hold(factor)})
        return duration if is_hold(speed) else duration / speed

    @property
    def fraction(self) -> float:
        """Return how much of the planned duration is completed, from 0 to 1; without a plan, 1."""
        return 1.0 - self.time_left / self.duration if self.duration else 1.0


NO_DISPLACEMENT = Displacement(0.0, 0.0)


class StepOdometer:
    """
    Adds up how far the robot has moved since the start of the current step.

    :param plan: None: nothing is added up
    """

    def __init__(self, plan: Plan | None) -> None:
        self._plan = plan
        self._step, self._sum = 0, NO_DISPLACEMENT

    def update(self, duration: float, plan_time: float, displacement: Displacement) -> None:
        """
        Add a movement; if a step began in it, only the share since then, to a sum of 0.

        :param plan_time: that at the end of the movement [s]
        """
        if self._plan is None or not self._plan.steps:
            return
        step, share = self._plan.step_index(plan_time), 1.0
        if step != self._step:
            inside = plan_time - self._plan.steps[step].start
            share = min(1.0, max(0.0, inside / max(duration, 1e-9)))
            self._step, self._sum = step, NO_DISPLACEMENT
        self._sum = Displacement(self._sum.distance + share * displacement.distance,
                                 self._sum.angle + share * displacement.angle)

    def displacement(self, step: int) -> Displacement:
        """Return the movement since the start of a step, by its index; 0 for any but the last."""
        return self._sum if step == self._step else NO_DISPLACEMENT


class DriveTracker:
    """Follows the status of one driving program from its events, which must arrive in order."""

    #: the words for what is driven, and by which program
    what, program = 'the robot', 'kachaka_simple_control'

    def __init__(self) -> None:
        self._session: events.SessionStarted | None = None
        self._planned: events.MotionPlanned | None = None
        self._plan: Plan | None = None
        self._started: float | None = None
        #: the newest velocity message of the current drive
        self._own: events.VelocitySent | events.ProgressMade | None = None
        self._factors: Mapping[str, float] = {}
        self._watch: events.WatchChanged | None = None
        self._ended: events.MotionEnded | None = None
        self._motion_count = 0
        self._sent: events.VelocitySent | events.ProgressMade | None = None
        self._lateness = 0.0
        self._stop_time: float | None = None
        self._odometry: events.OdometryReceived | None = None
        self._commanded_odometer = self._driven_odometer = StepOdometer(None)
        self._state = DriveState.READY
        #: the last event of the program; None if the program still runs or was killed
        self.session_ended: events.SessionEnded | None = None

    def on_event(self, event: events.Event) -> None:  # noqa: C901 (one case a kind)
        """Update the status of the drive from an event, such as a sent velocity."""
        match event:
            case events.VelocitySent() | events.ProgressMade():
                self._on_velocity(event)
            case events.OdometryReceived():
                self._on_odometry(event)
            case events.MotionPlanned():
                self._on_plan(event)
            case events.MotionStarted():
                self._on_start(event)
            case events.StateChanged():
                self._on_state(event)
            case events.SpeedFactorChanged():
                self._factors = event.factors
            case events.WatchChanged():
                self._watch = event
            case events.MotionEnded():
                self._ended = event
            case events.SessionStarted():
                self._session = event
            case events.SessionEnded():
                self.session_ended = event

    def status_at(self, now: float) -> DriveStatus:
        """Return the status of the drive at a time, according to all events so far."""
        elapsed = self._elapsed(now)
        duration = self._plan.duration if self._plan is not None else None
        odometry = self._odometry
        return DriveStatus(
            state=self._state_at(now),
            title=self._title(),
            robot='' if self._session is None else self._session.robot,
            reason=None if self._ended is None else self._ended.reason,
            topic='' if self._session is None else self._session.velocity_topic,
            wait_left=self._wait_left(now),
            step=self._step(now, elapsed),
            duration=duration,
            time_left=(duration or 0.0) - elapsed,
            commanded=None if self._sent is None else self._sent.velocity,
            odometry=None if odometry is None else odometry.velocity,
            odometry_age=0.0 if odometry is None else max(0.0, now - odometry.time),
            factors=self._factors,
            silent_for=self._silence(now),
            lateness=self._lateness,
            is_late=self._planned is not None and self._lateness >= LATE / self._planned.rate,
            watch=self._watch)

    @property
    def motion_count(self) -> int:
        """How many motions were planned so far."""
        return self._motion_count

    @property
    def is_under_way(self) -> bool:
        """Whether a motion has begun and has not ended."""
        return self._started is not None and self._ended is None

    @property
    def has_keys(self) -> bool:
        """Whether the driving program reads keys from the terminal."""
        return self._session is not None and self._session.has_keys

    @property
    def is_guarded(self) -> bool:
        """Whether a separate process, the guardian, stops the robot if the program is killed."""
        return self._session is not None and bool(self._session.settings.get('guardian'))

    def _on_plan(self, event: events.MotionPlanned) -> None:
        self._planned, self._started, self._ended = event, None, None
        self._watch = None  # it begins anew
        self._stop_time = None
        # Corners are made of messages, so their times depend on the rate.
        self._plan = event.plan if event.carried or event.motion.corners else plan(
            event.motion, event.limits, PLAN_RATE)
        self._reset_odometers()
        self._motion_count += 1

    def _on_start(self, event: events.MotionStarted) -> None:
        if not event.has_plan:
            self._planned = self._plan = self._ended = None
        self._started, self._stop_time, self._own = event.time, None, None
        self._lateness = 0.0
        self._reset_odometers()

    def _on_state(self, event: events.StateChanged) -> None:
        self._state = event.state
        if event.state is DriveState.STOPPING:
            # If a motion ends early, MotionEnded follows when the stop is sent, 0.4 s later.
            self._stop_time = event.time

    def _reset_odometers(self) -> None:
        self._commanded_odometer = StepOdometer(self._plan)
        self._driven_odometer = StepOdometer(self._plan)

    def _on_velocity(self, event: events.VelocitySent | events.ProgressMade) -> None:
        before, self._sent = self._sent, event
        if isinstance(event, events.ProgressMade):
            self._own, self._lateness = event, event.lateness
            return
        if not self.is_under_way:
            return
        if event.is_of_run:
            self._own = event
        if isinstance(before, events.VelocitySent):
            held, velocity = event.time - before.time, before.expected or before.velocity
            self._commanded_odometer.update(held, self._plan_time(event.time), Displacement(
                velocity.linear_x * held, velocity.angular_z * held))

    def _plan_time(self, now: float) -> float:
        """Return the plan time; below full speed it may be a period of the messages off."""
        own = self._own
        if own is None or own.plan_time is None:
            return 0.0
        # Between two events of progress, more than between two velocities, a hold would be seen.
        slope = product(self._factors) if isinstance(own, events.ProgressMade) else 1.0
        return own.plan_time + slope * (now - own.time)

    def _on_odometry(self, event: events.OdometryReceived) -> None:
        before, self._odometry = self._odometry, event
        if before is not None and self.is_under_way and before.time < event.time:
            self._driven_odometer.update(
                event.time - before.time, self._plan_time(event.time),
                driven((before, event), before.time, event.time) or NO_DISPLACEMENT)

    def _state_at(self, now: float) -> DriveState:
        seen, is_over = self._odometry, self._state in (DriveState.STOPPED, DriveState.CUT_SHORT)
        # No robot that is seen to move is called stopped, even when all zeros were sent.
        is_moving = (
            seen is not None and not seen.is_still and now - seen.time <= ODOMETRY_MAX_AGE)
        return DriveState.STOPPING if is_over and is_moving else self._state

    def _wait_left(self, now: float) -> float | None:
        if self._session is None or self._planned is None or self._planned.time is None:
            return None
        timeout = self._session.settings.get('robot_timeout')
        left = self._planned.time + timeout - now if isinstance(timeout, float) else 0.0
        return left if left > 0.0 else None

    def _silence(self, now: float) -> float | None:
        if not self.is_under_way or self._sent is None:
            return None
        silence = now - self._sent.time
        return silence if silence > EVENT_TIMEOUT else None

    def _elapsed(self, now: float) -> float:
        if self._plan is None or self._started is None:
            return 0.0
        if self._ended is not None:
            if self._ended.reason is None:
                return self._plan.duration
            now = min(now, self._ended.time)
        if self._stop_time is not None:
            now = min(now, self._stop_time)
        return min(max(0.0, self._plan_time(now)), self._plan.duration)

    def _title(self) -> str:
        if self._session is not None:
            return self._session.title
        return '' if self._planned is None else self._planned.motion.name

    def _step(self, now: float, elapsed: float) -> StepStatus | None:
        if self._plan is None or self._planned is None or not self._plan.steps:
            return None
        index = self._plan.step_index(elapsed)
        step = self._plan.steps[index]
        is_call = self._planned.motion.name != self._title()
        return StepStatus(
            self._motion_count if is_call else index + 1,
            self._movement_count() if is_call else len(self._plan.steps),
            MOVEMENT if is_call else STEP,
            step.named(step.step.describe()), step.duration,
            max(0.0, step.end - max(elapsed, step.start)),
            self._remaining(index, step.displacement, now))

    def _movement_count(self) -> int | None:
        count = None if self._session is None else self._session.movement_count
        return None if count is None or count < self._motion_count else count

    def _remaining(self, index: int, total: Displacement, now: float) -> Remaining:
        by_odometry = (
            self._odometry is not None and now - self._odometry.time <= DISPLAY_ODOMETRY_MAX_AGE)
        odometer = self._driven_odometer if by_odometry else self._commanded_odometer
        done = odometer.displacement(index)
        return Remaining(
            _remaining_amount(total.distance, done.distance),
            _remaining_amount(total.angle, done.angle), by_odometry)


def _remaining_amount(total: float, done: float) -> float | None:
    """Return how much of a distance or an angle remains, at least 0; None if the total is 0."""
    if total == 0.0:
        return None
    return max(0.0, total - done if total > 0.0 else done - total)
