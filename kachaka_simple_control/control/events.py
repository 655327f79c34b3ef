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
The events of a drive, which tell logs, displays and other subscribers what happened.

Subscribers receive them in order of time.  All times are on the steady clock [s].

Tested by test/telemetry/test_event_bus.py.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import get_args, NamedTuple

from kachaka_simple_control.control.speed_factor import product
from kachaka_simple_control.motion.drive_order import MotionText
from kachaka_simple_control.motion.floor import Floor
from kachaka_simple_control.motion.geometry import Footprint, Point, Pose, Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import Plan, plan
from kachaka_simple_control.motion.steps import Motion

#: No other Python code of this process runs while the steps of a plan are made to bytes: 10 ms.
MAX_CARRIED_STEPS = 1000


class FleetMember(NamedTuple):
    """
    One robot of a fleet.

    :param start: where it stands at t = 0, in the frame of the floor
    :param motion: the name of what it drives
    """

    name: str
    start: Pose
    motion: str


@dataclass(frozen=True)
class FleetStarted:
    """
    A program has started to use a fleet: its first event, before ``SessionStarted`` of each robot.

    :param repeat: how many rounds they drive; each begins with a ``MotionPlanned`` of each robot
    :param goes_on: whether the others drive on after a fault of one
    :param source: the path of the fleet's file; empty without one
    :param text: the text of this file; None without one
    :param near_passes: where two come near each other by plan, a line each
    """

    name: str
    robots: tuple[FleetMember, ...]
    repeat: int = 1
    goes_on: bool = False
    source: str = ''
    text: str | None = None
    near_passes: tuple[str, ...] = ()


@dataclass(frozen=True)
class SessionStarted:
    """
    A program has started to use a robot; this is always the first event of the robot.

    :param epoch: the time since 1970 minus the steady clock, at the same moment [s]
    :param odometry_topic: after namespace and remapping; None without odometry
    :param footprint: the outline of the robot; None if it is unknown
    :param command: the command line; empty if there was none
    :param motion_file: that of the motion that the program was started with; None without one
    :param movement_count: how many motions the program will drive; None if unknown
    :param floor: what stands on the floor of a simulated robot, in the frame in which it starts;
        None if unknown
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
    motion_file: MotionText | None = None
    movement_count: int | None = None
    has_keys: bool = False
    floor: Floor | None = None


@dataclass(frozen=True)
class MotionPlanned:
    """
    A motion was planned; the program may have no control of the robot yet.

    :param carried: the plan; None in another process if it has more than MAX_CARRIED_STEPS steps
    :param motion_file: None if the motion is not from a file
    """

    motion: Motion
    limits: Limits
    rate: float
    time: float | None = None
    carried: Plan | None = field(default=None, repr=False, compare=False)
    motion_file: MotionText | None = field(default=None, repr=False)

    @cached_property
    def plan(self) -> Plan:
        """Return the plan, which depends on motion, limits and rate alone."""
        return self.carried or plan(self.motion, self.limits, self.rate)

    def __getstate__(self) -> dict[str, object]:
        """Return what another process gets."""
        is_long = self.carried is not None and len(self.carried.steps) > MAX_CARRIED_STEPS
        return {name: None if is_long and name == 'carried' else value
                for name, value in vars(self).items() if name != 'plan'}


@dataclass(frozen=True)
class MotionStarted:
    """
    A drive begins; its first velocity follows this event.

    :param time: t = 0, when the first velocity is due
    :param has_plan: whether the velocities are those of the newest ``MotionPlanned``; false if a
        caller commands them
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
    #: a zero velocity before a drive, so that the publisher and the robot's reader are matched
    PRIME = 'prime'
    #: a zero velocity of a stop
    STOP = 'stop'
    #: the first zero velocity of a stop by the guardian, a separate process
    GUARDIAN = 'guardian'


#: The kinds of velocity that a drive sends.
RUN_KINDS = frozenset({VelocityKind.PLAN, VelocityKind.CORRECTION, VelocityKind.HAND})


@dataclass(frozen=True, slots=True)
class VelocitySent:
    """
    A velocity message was published.

    :param due: when it was due [s after t = 0]; None if it belongs to no drive
    :param plan_time: the point in the plan to which it belongs [s]; None without a plan
    :param skipped: how many velocities directly before this one were not sent, being too late
    :param expected: with which the robot is expected to move, by its calibration; None if it is
        equal to ``velocity``
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
        """Return whether a speed factor has delayed the plan; no meaning without a plan."""
        return self.plan_time != self.due

    @property
    def is_of_run(self) -> bool:
        """Return whether it belongs to a drive; false for zeros of a stop or before a drive."""
        return self.kind in RUN_KINDS


@dataclass(frozen=True, slots=True)
class ProgressMade:
    """
    How far a drive has come: a few times a second, for readers without ``VelocitySent``.

    :param plan_time: the point in the plan of the newest velocity [s]; None without a plan
    :param lateness: the largest of the velocities since the ``ProgressMade`` before [s]
    """

    time: float
    plan_time: float | None
    velocity: Velocity
    lateness: float = 0.0


class DriveState(Enum):
    """
    The state of the newest drive of a robot; only ``RobotDrive`` changes it.

    The value is the word that the live display shows.
    """

    #: no drive was requested yet
    READY = 'ready'
    #: a drive was requested, and this program has no control of the robot yet
    WAITING = 'waiting'
    #: the zeros before the first velocity are sent
    CONNECTING = 'connecting'
    DRIVING = 'driving'
    #: a speed factor holds the robot, which may still brake
    PAUSED = 'paused'
    #: only zeros are sent any more, and the stop is not complete
    STOPPING = 'stopping'
    #: the drive was complete, and the zeros of its stop were sent
    STOPPED = 'stopped'
    #: the drive ended early; the same then
    CUT_SHORT = 'cut short'


@dataclass(frozen=True)
class StateChanged:
    """The state of the newest drive has changed."""

    time: float
    state: DriveState


@dataclass(frozen=True)
class StopConfirmed:
    """All zero velocities of a stop were sent, and odometry, if there is any, shows standstill."""

    time: float


@dataclass(frozen=True)
class SpeedFactorChanged:
    """
    The speed factor was changed.

    :param factors: the factors below 1, by the name of their source
    """

    time: float
    factors: Mapping[str, float]

    @property
    def product(self) -> float:
        """Return the speed factor, from 0 to 1: the product of all factors in this event."""
        return product(self.factors)


class WatchState(Enum):
    """The state of the obstacle watch of a robot; displays show the values."""

    CLEAR = 'clear'
    #: held: something is on the planned path
    OBSTACLE = 'obstacle'
    #: held: no scan that counts has come for too long
    NO_SCAN = 'no scan'
    #: somebody has resumed without a scan: it goes on slowly until one comes
    BLIND = 'blind'


@dataclass(frozen=True, slots=True)
class WatchChanged:
    """
    The obstacle watch has changed its state, or an obstacle is at another distance now.

    :param distance: how far the robot can still drive on its planned path before it touches what
        was seen [m], never negative; None without an obstacle
    :param angle: how far it can still turn on this way [rad], never negative; None without one
    """

    time: float
    state: WatchState
    distance: float | None = None
    angle: float | None = None


@dataclass(frozen=True, slots=True)
class ScanReceived:
    """
    A scan of the laser has come; only for an obstacle watch.

    :param time: when it was taken
    :param points: what it has seen, in the frame of the robot: x ahead, y to the left [m]
    """

    time: float
    points: tuple[Point, ...]


@dataclass(frozen=True, slots=True)
class OdometryReceived:
    """
    The program has received an odometry message.

    :param pose: in the frame ``odom``
    :param is_still: whether it shows standstill, by the robot's ``StandstillDetector``
    """

    time: float
    pose: Pose
    velocity: Velocity = ZERO
    is_still: bool = False


@dataclass(frozen=True)
class MotionEnded:
    """
    The motion of the newest ``MotionPlanned`` event has ended.

    :param time: just after the zero velocity, if the motion was complete
    :param reason: why the motion ended early; None if it was complete
    :param is_fault: whether an error ended it early; false if somebody requested the end
    """

    time: float
    reason: str | None = None
    is_fault: bool = True


@dataclass(frozen=True)
class RobotsApart:
    """
    The robots of a fleet have waited for each other at a rest.

    :param at: the plan time of this rest [s]
    :param apart: by how much the first to arrive was before the last [s]
    :param robots: how many they were
    """

    time: float
    at: float
    apart: float
    robots: int


@dataclass(frozen=True)
class SessionEnded:
    """
    The program has stopped and released its robots; the last event, missing if it was killed.

    :param stop_confirmed_after: the time from the start of the last stop until odometry showed
        standstill [s]; None if it did not
    :param signal: the number of the signal that ended the program; None if no signal ended it
    :param error: why the program failed, in one line; None if it did not fail
    """

    time: float
    stop_confirmed_after: float | None = None
    signal: int | None = None
    error: str | None = None


Event = (SessionStarted | MotionPlanned | MotionStarted | VelocitySent | SpeedFactorChanged
         | OdometryReceived | StateChanged | StopConfirmed | MotionEnded | SessionEnded
         | ProgressMade | FleetStarted | RobotsApart | WatchChanged | ScanReceived)
EventHandler = Callable[[Event], None]
#: Everything that happened, as a record needs it.
DETAILED: frozenset[type] = frozenset(get_args(Event)) - {ProgressMade}
#: What happens a few times a second at most, as a display of many robots needs it.
OVERVIEW: frozenset[type] = frozenset(get_args(Event)) - {
    VelocitySent, OdometryReceived, ScanReceived}


class RobotEvent(NamedTuple):
    """An event of one of several robots, by its name, as readers of all robots get it."""

    robot: str
    event: Event
