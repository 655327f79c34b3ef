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
"""The events of a drive: all that a reader needs, in the order in which it happened."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from kachaka_simple_control.control.speed_factor import product
from kachaka_simple_control.motion.geometry import Footprint, Pose, Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.steps import Motion


@dataclass(frozen=True)
class SessionStarted:
    """
    A program began; the first event of all.

    :param title: name of what it drives
    :param robot: name of the robot
    :param limits: what the robot can do
    :param command_timeout: how long the robot keeps a velocity without a new one [s]
    :param epoch: what to add to a time of the steady clock for the time since 1970 [s]
    :param velocity_topic: the resolved name of the topic of velocities
    :param odometry_topic: the resolved name of the topic of odometry; None without one
    :param message_type: the type of velocity messages: Twist or TwistStamped
    :param frame: the frame in the header of a TwistStamped
    :param footprint: the outline of the robot; None if it is unknown
    :param settings: the parameters of the node
    :param versions: of the program and its dependencies, by name
    :param command: the command line; empty if there was none
    :param motion_source: the file of the motion; empty if it comes from none
    :param motion_text: the text of that file; None if it comes from none
    :param movement_count: how many motions will follow, one for each call; None if that is unknown
    :param has_keys: whether keys at the terminal pause, slow down and stop
    """

    title: str
    robot: str
    limits: Limits
    command_timeout: float
    epoch: float
    velocity_topic: str
    odometry_topic: str | None
    message_type: str = 'Twist'
    frame: str = 'base_link'
    footprint: Footprint | None = None
    settings: Mapping[str, object] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    command: str = ''
    motion_source: str = ''
    motion_text: str | None = None
    movement_count: int | None = None
    has_keys: bool = False


@dataclass(frozen=True)
class MotionPlanned:
    """
    A motion was planned; a robot that is not connected yet is connected next.

    A subscriber that needs the plan makes it anew: the same motion, limits and rate give the same.

    :param rate: how often a velocity is sent [Hz]
    :param time: when [s on the steady clock]; None if that is not known
    """

    motion: Motion
    limits: Limits
    rate: float
    time: float | None = None


@dataclass(frozen=True)
class MotionStarted:
    """
    A run begins: its first velocity follows.

    :param time: t = 0 of the run [s on the steady clock]
    :param has_plan: whether it drives the motion planned last; False: it has no plan
    """

    time: float
    has_plan: bool = True


class VelocityKind(Enum):
    """What a velocity was sent for."""

    #: a velocity of a plan, as it is there or under a speed factor
    PLAN = 'plan'
    #: a velocity of a plan, corrected by odometry
    CORRECTION = 'correction'
    #: a velocity that somebody wants now
    HAND = 'hand'
    #: a zero before a run, so that the robot's reader is matched
    PRIME = 'prime'
    #: a zero of a stop
    STOP = 'stop'
    #: the first zero of the guardian's stop
    GUARDIAN = 'guardian'


#: The kinds that a run sends.
RUN_KINDS = frozenset({VelocityKind.PLAN, VelocityKind.CORRECTION, VelocityKind.HAND})


@dataclass(frozen=True, slots=True)
class VelocitySent:
    """
    A velocity was published.

    :param time: when [s on the steady clock]
    :param kind: what it was sent for
    :param due: when it was due [s after t = 0 of its run]; None if it is no velocity of a run
    :param plan_time: where on the plan that is [s of the plan]; None if it is none of a plan
    :param skipped: how many velocities before it were not sent: this one was due already
    :param expected: what the robot makes of it by its calibration; None: the velocity itself
    """

    time: float
    velocity: Velocity
    kind: VelocityKind
    due: float | None = None
    plan_time: float | None = None
    skipped: int = 0
    expected: Velocity | None = None

    @property
    def is_delayed(self) -> bool:
        """Return whether a speed factor has made it later than planned, or another velocity."""
        return self.plan_time != self.due

    @property
    def is_of_run(self) -> bool:
        """Return whether a run sent it, and not a stop or a robot being taken."""
        return self.kind in RUN_KINDS


@dataclass(frozen=True)
class StopBegan:
    """
    A stop begins: its zeros follow.

    :param time: when [s on the steady clock]
    """

    time: float


@dataclass(frozen=True)
class StopConfirmed:
    """
    A stop was sent whole, and odometry, where there is any, no longer showed motion.

    :param time: when [s on the steady clock]
    """

    time: float


@dataclass(frozen=True)
class SpeedFactorChanged:
    """
    The speed factor was changed.

    :param time: when [s on the steady clock]
    :param factors: the factors below 1, by the name of who asks for less speed; their product
        counts
    """

    time: float
    factors: Mapping[str, float]

    @property
    def product(self) -> float:
        """Return the factor that results, from 0 to 1."""
        return product(self.factors)


@dataclass(frozen=True, slots=True)
class OdometryReceived:
    """
    An odometry message arrived.

    :param time: when [s on the steady clock]
    :param pose: of the robot, in ``odom``
    :param velocity: of the robot
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
    The program stopped the robot and released it; the last event of all, unless it was killed.

    :param time: when [s on the steady clock]
    :param stop_confirmed_after: how long after the stop began odometry showed standstill [s]; None
        if it did not
    :param signal: the signal that ended the program; None without one
    :param error: why the program failed, in one line; None if it did not
    """

    time: float
    stop_confirmed_after: float | None = None
    signal: int | None = None
    error: str | None = None


Event = (SessionStarted | MotionPlanned | MotionStarted | VelocitySent | SpeedFactorChanged
         | OdometryReceived | StopBegan | StopConfirmed | MotionEnded | SessionEnded)
EventHandler = Callable[[Event], None]
