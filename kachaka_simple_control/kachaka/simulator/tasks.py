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
"""Tasks of the simulated robot: actions, their controller, the queue."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
import math

from kachaka_simple_control.kachaka.error_codes import ERROR_STUCK, SUCCESS
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.motion.geometry import advance, Pose, Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits

#: How often the robot looks where it is while it drives by itself [s]; chosen.
CONTROL_PERIOD = 0.02
#: It has arrived when it is as near as this [m, rad]; chosen.  A lag makes the last bit slow.
TOLERANCE, TOLERANCE_WITH_LAG = 1e-6, 1e-4
#: And as slow as this [m/s, rad/s], unless it can stop at once; chosen.
SLOW = 1e-3
#: It has not arrived if it is farther away than this [m, rad] when it gives up; chosen.
FAILED_TOLERANCE = 1e-3
#: It gives up after so many times what the way takes at its speed, and so much more [s]; chosen.
TIMES, MORE = 3.0, 10.0


class ActionController:
    """A leg under way; it ends where it should, whatever gains and noise do."""

    def __init__(
            self, leg: Action, start: Pose, now: float, limits: Limits,
            fidelity: SimulationParameters) -> None:
        """
        Begin a leg.

        :param leg: what to do
        :param start: where the robot is
        :param now: the time [s]
        :param limits: its largest velocities
        :param fidelity: how its drive is
        """
        self._start = start
        self._lag = fidelity.lag
        self._near, self._slow = (TOLERANCE, math.inf) if fidelity.is_ideal else (
            TOLERANCE_WITH_LAG, SLOW)
        self._is_turn = isinstance(leg, (TurnInPlace, FacePoint, TurnToHeading))
        asked = abs(leg.speed) if isinstance(leg, DriveStraight) else 0.0
        if self._is_turn:
            self._speed = limits.max_angular_velocity
            self._acceleration = fidelity.angular_acceleration
        else:
            self._speed = min(asked or math.inf, limits.max_linear_velocity)
            self._acceleration = fidelity.linear_acceleration
        self._stays = isinstance(leg, StandStill)
        self._length = 0.0 if isinstance(leg, StandStill) else leg.length(start)
        #: When to give up, or to go on [s].
        self.end = now + (
            leg.duration if isinstance(leg, StandStill)
            else TIMES * abs(self._length) / self._speed + MORE)

    def step(
            self, pose: Pose, velocity: Velocity, now: float) -> tuple[Velocity, float] | bool:
        """
        Look where the robot is.

        :param pose: where it is
        :param velocity: how fast it is
        :param now: the time [s]
        :returns: the velocity, and when to look again [s]; or, at the end, whether it is there
        """
        if self._stays:
            return now >= self.end or (ZERO, self.end)
        rest = self._rest(pose)
        speed = velocity.angular_z if self._is_turn else velocity.linear_x
        # Whoever drives past the place is not there.
        if abs(rest) <= self._near and abs(speed) <= self._slow:
            return True
        if now >= self.end:
            return abs(rest) <= FAILED_TOLERANCE
        wanted = self._speed_for(rest)
        return (
            Velocity(angular_z=wanted) if self._is_turn else Velocity(linear_x=wanted),
            now + CONTROL_PERIOD)

    def _rest(self, pose: Pose) -> float:
        if self._is_turn:
            return self._length - (pose.theta - self._start.theta)
        heading = self._start.theta
        return self._length - (
            (pose.x - self._start.x) * math.cos(heading)
            + (pose.y - self._start.y) * math.sin(heading))

    def _speed_for(self, rest: float) -> float:
        # Without a lag: the rest within one look.  With one, a loop of gain 1 / (4 lag) is
        # critically damped: as fast as it can be without going too far.
        duration = CONTROL_PERIOD + 4.0 * self._lag
        most = self._speed
        if math.isfinite(self._acceleration):
            duration += 3.0 * CONTROL_PERIOD
            # Braking with half of what it can leaves room for its gains and its lag.
            most = min(most, math.sqrt(self._acceleration * abs(rest)))
        return max(-most, min(rest / duration, most))


#: A point that is nearer than this [m] is where the robot stands.
HERE = 1e-4


@dataclass(frozen=True)
class DriveStraight:
    """
    Drive straight on.

    :param distance: how far [m], negative backwards
    :param speed: how fast at most [m/s]; 0 for as fast as the robot can
    """

    distance: float
    speed: float = 0.0

    def length(self, start: Pose) -> float:
        """
        Return how far this is.

        :param start: where the robot is at its beginning
        :returns: the signed way [m]
        """
        return self.distance


@dataclass(frozen=True)
class TurnInPlace:
    """
    Turn on the spot.

    :param angle: how far [rad], counter-clockwise positive; more than a turn is more than a turn
    """

    angle: float

    def length(self, start: Pose) -> float:
        """
        Return how far this is.

        :param start: where the robot is at its beginning
        :returns: the signed angle [rad]
        """
        return self.angle


@dataclass(frozen=True)
class FacePoint:
    """
    Turn towards a point, the shorter way.

    :param x: where it is in odometry [m]
    :param y: likewise [m]
    """

    x: float
    y: float

    def length(self, start: Pose) -> float:
        """
        Return how far this is.

        :param start: where the robot is at its beginning
        :returns: the signed angle [rad]; 0 where the robot stands on the point
        """
        # A point that the robot stands on is in no direction.
        if math.hypot(self.x - start.x, self.y - start.y) <= HERE:
            return 0.0
        direction = math.atan2(self.y - start.y, self.x - start.x)
        return math.remainder(direction - start.theta, math.tau)


@dataclass(frozen=True)
class DriveToPoint:
    """
    Drive straight on as far as a point is away.

    :param x: where it is in odometry [m]
    :param y: likewise [m]
    """

    x: float
    y: float

    def length(self, start: Pose) -> float:
        """
        Return how far this is.

        :param start: where the robot is at its beginning
        :returns: the way [m]
        """
        return math.hypot(self.x - start.x, self.y - start.y)


@dataclass(frozen=True)
class TurnToHeading:
    """
    Turn to a heading, the shorter way.

    :param theta: the heading in odometry [rad]
    """

    theta: float

    def length(self, start: Pose) -> float:
        """
        Return how far this is.

        :param start: where the robot is at its beginning
        :returns: the signed angle [rad]
        """
        return math.remainder(self.theta - start.theta, math.tau)


@dataclass(frozen=True)
class StandStill:
    """
    Stay for a time.

    :param duration: how long [s]
    :param can_be_ended: whether somebody may tell the robot to go on before
    """

    duration: float
    can_be_ended: bool = False


Action = DriveStraight | TurnInPlace | FacePoint | DriveToPoint | TurnToHeading | StandStill


def plan_to_pose(pose: Pose) -> tuple[Action, ...]:
    """
    Return how the robot drives to a pose, with nothing in its way.

    :param pose: the pose in odometry
    :returns: a turn, a straight line and a turn
    """
    return FacePoint(pose.x, pose.y), DriveToPoint(pose.x, pose.y), TurnToHeading(pose.theta)


def plan_docking(dock: Pose, distance: float, speed: float) -> tuple[Action, ...]:
    """
    Return how the robot drives onto its dock: to the place before it, then backwards.

    :param dock: where it stands then, in odometry
    :param distance: how far before the dock it turns its back to it [m]
    :param speed: how fast it drives backwards [m/s]
    :returns: the legs
    """
    before = advance(dock, distance, 0.0)
    return (*plan_to_pose(before), DriveStraight(-distance, speed))


#: How many outcomes are kept; chosen.
MAX_RESULTS = 100


@dataclass(frozen=True)
class Task:
    """
    Something to do.

    :param identity: its name, which no other has
    :param legs: its parts, in order
    :param ends_docked: whether the robot stands on its dock once all is done
    :param note: whatever its sender wants to have beside it
    """

    identity: str
    legs: tuple[Action, ...]
    ends_docked: bool = False
    note: object = None

    @property
    def moves(self) -> bool:
        """Whether the robot moves for it."""
        return not all(isinstance(leg, StandStill) for leg in self.legs)


@dataclass(frozen=True)
class TaskResult:
    """
    How an errand ended.

    :param task: the errand
    :param code: 0, or the code of the error
    """

    task: Task
    code: int

    @property
    def is_success(self) -> bool:
        """Whether all of it was done."""
        return self.code == SUCCESS


class TaskQueue:
    """The errands of one robot, which does them one by one; told the time."""

    def __init__(self, limits: Limits, fidelity: SimulationParameters) -> None:
        """
        Have nothing to do.

        :param limits: the robot's largest velocities
        :param fidelity: how its drive is
        """
        self._limits = limits
        self._fidelity = fidelity
        self._waiting: deque[Task] = deque()
        self._legs: deque[Action] = deque()
        self._way: ActionController | None = None
        self.current: Task | None = None
        #: Newest last.
        self.results: deque[TaskResult] = deque(maxlen=MAX_RESULTS)

    def add(self, errand: Task) -> None:
        """
        Take an errand on, behind all others.

        :param errand: the errand
        """
        self._waiting.append(errand)
        if self.current is None:
            self._begin_next()

    def drop_all(self, code: int) -> None:
        """
        End all errands undone.

        :param code: why
        """
        dropped = [] if self.current is None else [self.current]
        self.results.extend(TaskResult(errand, code) for errand in (*dropped, *self._waiting))
        self._waiting.clear()
        self._begin_next()

    def prepend(self, leg: Action) -> None:
        """
        Do something before the next leg.

        :param leg: what to do
        """
        self._legs.appendleft(leg)

    def end_stay(self, now: float) -> bool:
        """
        Go on, if the robot stays where it may be told to go on.

        :param now: the time [s]
        :returns: whether it did
        """
        if self._way is None or not isinstance(
                leg := self._legs[0], StandStill) or not leg.can_be_ended:
            return False
        self._way.end = now
        return True

    def proceed(
            self, pose: Pose, velocity: Velocity, now: float) -> tuple[Velocity,
            float] | TaskResult:
        """
        Do what is to be done for the current errand.

        :param pose: where the robot is
        :param velocity: how fast it is
        :param now: the time [s]
        :returns: the velocity, and when to ask again [s]; at the end of the errand its outcome,
            and the next errand is the current one
        """
        while self._legs:
            if self._way is None:
                self._way = ActionController(
                    self._legs[0], pose, now, self._limits, self._fidelity)
            answer = self._way.step(pose, velocity, now)
            if not isinstance(answer, bool):
                return answer
            if not answer:
                return self._finish(ERROR_STUCK)
            self._legs.popleft()
            self._way = None
        return self._finish(SUCCESS)

    def _finish(self, code: int) -> TaskResult:
        assert self.current is not None, 'somebody proceeds with nothing'
        outcome = TaskResult(self.current, code)
        self.results.append(outcome)
        self._begin_next()
        return outcome

    def _begin_next(self) -> None:
        self.current = self._waiting.popleft() if self._waiting else None
        self._legs = deque(self.current.legs if self.current else ())
        self._way = None
