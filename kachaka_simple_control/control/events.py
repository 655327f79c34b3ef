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
The events of a drive: objects that tell logs, displays and other subscribers what happened.

Subscribers receive the events in order of time.
"""

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
    A program has started to use a robot; this is always the first event.

    :param title: name of the motion
    :param robot: name of the robot
    :param limits: the limits of velocity and acceleration of the robot
    :param command_timeout: how long the robot keeps a velocity if no new message arrives [s]
    :param epoch: the time since 1970 minus the time on the steady clock, at the same moment [s]
    :param velocity_topic: the name of the velocity topic, after namespace and remapping were
        applied
    :param odometry_topic: the name of the odometry topic, after namespace and remapping were
        applied; None without odometry
    :param message_type: the type of velocity messages: Twist or TwistStamped
    :param frame: the frame in the header of a TwistStamped
    :param footprint: the outline of the robot; None if it is unknown
    :param settings: the values of the node's ROS parameters, by name
    :param versions: the versions of the program and its dependencies, by name
    :param command: the command line; empty if there was none
    :param motion_source: the path of the motion file; empty if the motion is not from a file
    :param motion_text: the text of the motion file; None if the motion is not from a file
    :param movement_count: how many motions the program will drive, one for each call of the
        function ``move_robot``; None if unknown
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
    A motion was planned, which means that all its velocities were computed.

    If the program has no control of the robot yet, it gets control after this event.  The event
    does not contain the plan.  A subscriber that needs the plan computes it again: the same
    motion, limits and rate always give the same plan.

    :param motion: the motion, which is a list of steps such as moves and turns
    :param limits: the limits of velocity and acceleration that the plan keeps
    :param rate: how often a velocity is sent [Hz]
    :param time: when the motion was planned [s on the steady clock]; None if unknown
    """

    motion: Motion
    limits: Limits
    rate: float
    time: float | None = None


@dataclass(frozen=True)
class MotionStarted:
    """
    A run, which is one drive of a robot, begins; its first velocity follows this event.

    :param time: when the first velocity of the run is due, called t = 0 [s on the steady clock]
    :param has_plan: True if the velocities of the run come from the plan of the newest
        ``MotionPlanned`` event; False if a caller commands them directly, without a plan
    """

    time: float
    has_plan: bool = True


class VelocityKind(Enum):
    """The purpose of a velocity message, for example to drive a plan or to stop the robot."""

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
    A velocity message was published.

    Many of these messages belong to a run, which is one drive of a robot.  t = 0 is the time when
    the first velocity of the run was due.

    :param time: when the message was published [s on the steady clock]
    :param velocity: the velocity in the message
    :param kind: the purpose of the message, for example to drive a plan or to stop the robot
    :param due: when the velocity was due [s after t = 0]; None if the message belongs to no run
    :param plan_time: the point in the plan to which the velocity belongs [s after the start of the
        plan]; None without a plan
    :param skipped: how many velocities directly before this one were not sent, because they were
        too late
    :param expected: the velocity with which the robot is expected to move after this message.  It
        is computed from the calibration of the robot, and not measured.  None if it is equal to
        ``velocity``
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
        """
        Return whether a speed factor below 1 has delayed the plan.

        In this case ``plan_time`` (the point in the plan) differs from ``due`` (the time since the
        start of the drive).  Without a plan the value has no meaning.
        """
        return self.plan_time != self.due

    @property
    def is_of_run(self) -> bool:
        """
        Return whether the velocity belongs to a run, which is one drive of a robot.

        The value is False for a zero velocity of a stop, and for a zero velocity that is sent
        before a run.
        """
        return self.kind in RUN_KINDS


@dataclass(frozen=True)
class StopBegan:
    """
    The program begins to stop the robot; the zero velocities of the stop follow this event.

    :param time: when the stop begins [s on the steady clock]
    """

    time: float


@dataclass(frozen=True)
class StopConfirmed:
    """
    All zero velocities of a stop were sent, and odometry shows that the robot does not move.

    If the robot has no odometry, the event only says that all zero velocities were sent.

    :param time: when the program noticed this [s on the steady clock]
    """

    time: float


@dataclass(frozen=True)
class SpeedFactorChanged:
    """
    The speed factor, which is the speed of the robot relative to its plan, was changed.

    :param time: when the speed factor was changed [s on the steady clock]
    :param factors: the factors below 1, by the name of the source that set them, such as a pause
        or an obstacle sensor; the speed factor is the product of these factors
    """

    time: float
    factors: Mapping[str, float]

    @property
    def product(self) -> float:
        """Return the speed factor, from 0 to 1: the product of all factors in this event."""
        return product(self.factors)


@dataclass(frozen=True, slots=True)
class OdometryReceived:
    """
    The program has received an odometry message.

    :param time: when the message arrived [s on the steady clock]
    :param pose: the pose of the robot in the frame ``odom``
    :param velocity: the velocity of the robot in the message
    """

    time: float
    pose: Pose
    velocity: Velocity = ZERO


@dataclass(frozen=True)
class MotionEnded:
    """
    The motion of the newest ``MotionPlanned`` event has ended.

    :param time: when the program noticed the end [s on the steady clock].  If the motion was
        complete, a zero velocity was sent just before this time
    :param reason: why the motion ended early; None if it was complete
    :param is_fault: True if an error ended the motion early; False if somebody requested the end.
        The value has no meaning if the motion was complete
    """

    time: float
    reason: str | None = None
    is_fault: bool = True


@dataclass(frozen=True)
class SessionEnded:
    """
    The program has stopped and released the robot; this is the last event.

    The event is missing if the program was killed.

    :param time: when the robot was released [s on the steady clock]
    :param stop_confirmed_after: the time from the start of the last stop until odometry showed
        that the robot stood still [s]; None if odometry did not show this
    :param signal: the number of the signal that ended the program; None if no signal ended it
    :param error: why the program failed, in one line; None if it did not fail
    """

    time: float
    stop_confirmed_after: float | None = None
    signal: int | None = None
    error: str | None = None


Event = (SessionStarted | MotionPlanned | MotionStarted | VelocitySent | SpeedFactorChanged
         | OdometryReceived | StopBegan | StopConfirmed | MotionEnded | SessionEnded)
EventHandler = Callable[[Event], None]
