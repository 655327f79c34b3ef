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
"""Events of a drive, and the bus that passes them on within a process."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from kachaka_simple_control.motion.geometry import Footprint, Pose, Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.steps import Motion


@dataclass(frozen=True)
class SessionStarted:
    """
    A program began; the first event of all.

    :param title: what people call what it drives
    :param robot: what people call the robot
    :param limits: what the robot can do
    :param hold: how long the robot keeps a velocity without a new one [s]
    :param epoch: what to add to a time of the steady clock for the time since 1970 [s]
    :param velocity_topic: the resolved name of the topic that velocities go to
    :param odometry_topic: the resolved name of the topic that poses come from; None if there is
        none
    :param message_type: what velocities are sent as: Twist or TwistStamped
    :param frame: the frame in the header of a TwistStamped
    :param footprint: the outline of the robot; None if nobody knows it
    :param settings: the parameters of the node
    :param versions: of the program and what it stands on, by name
    """

    title: str
    robot: str
    limits: Limits
    hold: float
    epoch: float
    velocity_topic: str
    odometry_topic: str | None
    message_type: str = 'Twist'
    frame: str = 'base_link'
    footprint: Footprint | None = None
    settings: Mapping[str, object] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class MotionPlanned:
    """
    A motion was planned; the robot is met next, if it has not been met yet.

    The plan itself is made anew by whoever wants it: the same three things give the same plan.

    :param motion: what to do
    :param limits: what it was planned with
    :param rate: how often a velocity is sent [Hz]
    """

    motion: Motion
    limits: Limits
    rate: float


@dataclass(frozen=True)
class MotionStarted:
    """
    The first velocity of the motion planned last was sent: t = 0.

    :param time: when [s on the steady clock]
    """

    time: float


@dataclass(frozen=True, slots=True)
class VelocitySent:
    """
    A velocity was published.

    :param time: when [s on the steady clock]
    :param velocity: what
    """

    time: float
    velocity: Velocity


@dataclass(frozen=True, slots=True)
class OdometryReceived:
    """
    Odometry told a pose.

    :param time: when it arrived [s on the steady clock]
    :param pose: where the robot was, in ``odom``
    :param velocity: how fast it was
    """

    time: float
    pose: Pose
    velocity: Velocity = ZERO


@dataclass(frozen=True)
class MotionEnded:
    """
    The motion planned last is over.

    :param time: when that was known [s on the steady clock]; if it was driven to its end, its
        last zero was sent just before
    :param reason: why it is over before its end; None if it was driven to its end
    :param is_fault: whether something went wrong; False where its end was asked for
    """

    time: float
    reason: str | None = None
    is_fault: bool = True


@dataclass(frozen=True)
class SessionEnded:
    """
    The program stopped the robot and gave it back; the last event of all, unless it was killed.

    :param time: when [s on the steady clock]
    :param still_after: how long after the stop began odometry saw the robot still [s]; None if
        it did not
    :param signal: the signal that ended the program; None if none did
    :param error: why the program failed, in one line; None if it did not
    """

    time: float
    still_after: float | None = None
    signal: int | None = None
    error: str | None = None


Event = (SessionStarted | MotionPlanned | MotionStarted | VelocitySent | OdometryReceived
         | MotionEnded | SessionEnded)


EventHandler = Callable[[Event], None]


class EventBus:
    """
    Tells events to whoever wants to hear them, in the thread in which they happen.

    A hearer must return at once, for the thread may be the one that moves the robot.  One that
    fails is told nothing more; the drive goes on.
    """

    def __init__(self) -> None:
        """Have nobody to tell."""
        self._hearers: tuple[EventHandler, ...] = ()
        #: why hearers were dropped
        self.failures: list[Exception] = []

    def __bool__(self) -> bool:
        """Return whether anybody wants to hear."""
        return bool(self._hearers)

    def subscribe(self, hearer: EventHandler) -> None:
        """
        Add a hearer.

        :param hearer: called with each event from now on
        """
        self._hearers = (*self._hearers, hearer)

    def publish(self, event: Event) -> None:
        """
        Tell everybody.

        :param event: what happened
        """
        for hearer in self._hearers:
            try:
                hearer(event)
            except Exception as error:  # noqa: PERF203 (the robot comes first)
                self.failures.append(error)
                self._hearers = tuple(one for one in self._hearers if one is not hearer)
