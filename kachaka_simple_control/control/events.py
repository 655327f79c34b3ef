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
"""The events of a drive, which subscribers such as logs and displays receive in order of time."""

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
    A program has started to use a robot; this is the first event.

    :param title: name of the motion
    :param robot: name of the robot
    :param limits: the limits of velocity and acceleration of the robot
    :param command_timeout: how long the robot keeps a velocity if no new message arrives [s]
    :param epoch: the time since 1970 minus the time on the steady clock [s]
    :param velocity_topic: the resolved name of the topic of velocities
    :param odometry_topic: the resolved name of the topic of odometry; None without odometry
    :param message_type: the type of velocity messages: Twist or TwistStamped
    :param frame: the frame in the header of a TwistStamped
    :param footprint: the outline of the robot; None if it is unknown
    :param settings: the parameters of the node
    :param versions: the versions of the program and its dependencies, by name
    :param command: the command line; empty if there was none
    :param motion_source: the file of the motion; empty if the motion is not from a file
    :param motion_text: the text of that file; None if the motion is not from a file
    :param movement_count: the number of motions that follow: in the lesson, each call of
        ``move_robot`` is one motion; None if unknown
    :param has_keys: whether keys at the terminal can pause, slow down and stop the robot
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
    A motion was planned; if the robot is not connected yet, the program connects to it next.

    The event does not contain the plan.  A subscriber that needs the plan computes it again: the
    same motion, limits and rate always give the same plan.

    :param motion: the motion
    :param limits: the limits for the plan
    :param rate: how often a velocity is sent [Hz]
    :param time: when it was planned [s on the steady clock]; None if unknown
    """

    motion: Motion
    limits: Limits
    rate: float
    time: float | None = None


@dataclass(frozen=True)
class MotionStarted:
    """
    A run begins; the first velocity of the run follows this event.

    :param time: t = 0 of the run [s on the steady clock]
    :param has_plan: True if the run drives the motion of the newest ``MotionPlanned`` event; False
        if the run has no plan
    """

    time: float
    has_plan: bool = True


class VelocityKind(Enum):
    """The purpose of a sent velocity."""

    #: a velocity of a plan, as planned or under a speed factor
    PLAN = 'plan'
    #: a velocity of a plan, corrected with odometry
    CORRECTION = 'correction'
    #: a velocity that a caller commands directly, without a plan
    HAND = 'hand'
    #: a zero velocity before a run, so that the publisher and the robot's reader are matched
    PRIME = 'prime'
    #: a zero velocity of a stop
    STOP = 'stop'
    #: the first zero velocity of a stop by the guardian, a separate process
    GUARDIAN = 'guardian'


#: The kinds of velocity that a run sends.
RUN_KINDS = frozenset({VelocityKind.PLAN, VelocityKind.CORRECTION, VelocityKind.HAND})


@dataclass(frozen=True, slots=True)
class VelocitySent:
    """
    A velocity was published.

    :param time: when it was published [s on the steady clock]
    :param velocity: the velocity in the message
    :param kind: the purpose of the velocity
    :param due: when the velocity was due [s after t = 0 of the run]; None if no run sent it
    :param plan_time: the time in the plan to which the velocity belongs [s]; None without a plan
    :param skipped: how many velocities directly before this one were left out, because they were
        too late
    :param expected: the velocity at which the robot really moves after this message, according to
        its calibration; None if this is ``velocity``
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
        """Return whether ``plan_time`` differs from ``due``, because of a speed factor below 1."""
        return self.plan_time != self.due

    @property
    def is_of_run(self) -> bool:
        """
        Return whether a run sent the velocity.

        The value is False for the zero velocities of a stop and before a run.
        """
        return self.kind in RUN_KINDS


@dataclass(frozen=True)
class StopBegan:
    """
    A stop begins; the zero velocities of the stop follow this event.

    :param time: when the stop begins [s on the steady clock]
    """

    time: float


@dataclass(frozen=True)
class StopConfirmed:
    """
    A stop was sent completely, and odometry, if the robot has it, shows no motion.

    :param time: when both conditions were true [s on the steady clock]
    """

    time: float


@dataclass(frozen=True)
class SpeedFactorChanged:
    """
    The speed factor was changed.

    :param time: when it was changed [s on the steady clock]
    :param factors: the factors below 1, by the name of the source that set them; the speed factor
        is their product
    """

    time: float
    factors: Mapping[str, float]

    @property
    def product(self) -> float:
        """Return the product of the factors, from 0 to 1."""
        return product(self.factors)


@dataclass(frozen=True, slots=True)
class OdometryReceived:
    """
    An odometry message arrived.

    :param time: when it arrived [s on the steady clock]
    :param pose: the pose of the robot in the frame ``odom``
    :param velocity: the velocity of the robot
    """

    time: float
    pose: Pose
    velocity: Velocity = ZERO


@dataclass(frozen=True)
class MotionEnded:
    """
    The motion of the newest ``MotionPlanned`` event has ended.

    :param time: when the program detected this [s on the steady clock]; a complete motion ends
        with a zero velocity, which was sent just before this time
    :param reason: why the motion ended early; None if it was complete
    :param is_fault: True if an error ended the motion; False if somebody requested its end
    """

    time: float
    reason: str | None = None
    is_fault: bool = True


@dataclass(frozen=True)
class SessionEnded:
    """
    The program has stopped and released the robot.

    This is the last event.  It is missing if the program was killed.

    :param time: when the robot was released [s on the steady clock]
    :param stop_confirmed_after: time from the start of the stop until odometry showed standstill
        [s]; None if odometry did not show standstill
    :param signal: the signal that ended the program; None if no signal ended it
    :param error: why the program failed, in one line; None if it did not fail
    """

    time: float
    stop_confirmed_after: float | None = None
    signal: int | None = None
    error: str | None = None


Event = (SessionStarted | MotionPlanned | MotionStarted | VelocitySent | SpeedFactorChanged
         | OdometryReceived | StopBegan | StopConfirmed | MotionEnded | SessionEnded)
EventHandler = Callable[[Event], None]
