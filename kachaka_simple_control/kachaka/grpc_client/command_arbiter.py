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
"""Decide which call to make next: command timeout, newest command, stop first."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
import math

from kachaka_simple_control.control.timing import (
    MAX_CONSECUTIVE_TIMEOUTS,
    MAX_STREAM_PERIOD,
    REARM_IDLE_TIME,
    STOP_RPC_TIMEOUT,
    STREAM_TIMEOUT,
)
from kachaka_simple_control.kachaka.error_codes import ERROR_NO_MANUAL_CONTROL
from kachaka_simple_control.kachaka.grpc_client.connection_state import RpcFailure, RpcResult
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.motion.limits import Limits


@dataclass(frozen=True)
class VelocityCommand:
    """
    A velocity as parts of the robot's largest, and when it came.

    :param linear: forward, from -1 to 1
    :param angular: turning to the left, from -1 to 1
    :param time: when it came [s, steady clock]
    """

    linear: float
    angular: float
    time: float

    @property
    def is_stop(self) -> bool:
        """Whether it asks the robot to stand still."""
        return self.linear == 0.0 and self.angular == 0.0


def velocity_command(velocity: Velocity, limits: Limits, now: float) -> VelocityCommand:
    """
    Return a velocity as the robot takes it, cut off at its largest.

    :param velocity: the velocity
    :param limits: the largest velocities of the robot
    :param now: the time [s, steady clock]
    :returns: the command
    :raises ValueError: if the velocity is no finite number, in one line
    """
    if not (math.isfinite(velocity.linear_x) and math.isfinite(velocity.angular_z)):
        raise ValueError(
            f'linear.x {velocity.linear_x} m/s and angular.z {velocity.angular_z} rad/s must be '
            'finite numbers')
    return VelocityCommand(
        _part(velocity.linear_x, limits.max_linear_velocity),
        _part(velocity.angular_z, limits.max_angular_velocity),
        now)


def _part(value: float, largest: float) -> float:
    return max(-1.0, min(value / largest, 1.0))


class CommandTimeout:
    """
    Hears the commands that come, and says when to stop waiting for the next.

    Knows of a motion only what it heard in this motion: before its second velocity, nothing.
    """

    def __init__(self) -> None:
        """Wait for nothing."""
        self._last: float | None = None
        self._longest: float | None = None

    def on_command(self, is_stop: bool, now: float) -> None:
        """
        Take note of a command.

        :param is_stop: whether it asks the robot to stand still; then nothing more need come
        :param now: the time [s, steady clock]
        """
        if is_stop:
            self._last = self._longest = None
            return
        if self._last is not None:
            self._longest = max(self._longest or 0.0, now - self._last)
        self._last = now

    @property
    def end(self) -> float | None:
        """Return when to stop the robot unless a command comes before [s]; None for never."""
        if self._last is None or self._longest is None or self._longest > MAX_STREAM_PERIOD:
            return None
        return self._last + STREAM_TIMEOUT

    def has_expired(self, now: float) -> bool:
        """
        Tell once whether velocities have ceased.

        :param now: the time [s, steady clock]
        :returns: whether they have; then nothing is waited for until the next
        """
        if self.end is None or now < self.end:
            return False
        self._last = self._longest = None
        return True


class LatestCommand:
    """
    Holds one motion that waits for the robot to be free, or the knowledge that a stop is owed.

    A newer command takes the place of an older one, so nothing queues up before a slow robot.  A
    stop takes the place of any motion, and is never lost to one: it stays owed until it is taken.
    """

    def __init__(self, patience: float) -> None:
        """
        Hold nothing.

        :param patience: how old a motion may be when it is taken [s]; older ones are dropped
        """
        self._patience = patience
        self._newest: VelocityCommand | None = None
        self._motion: VelocityCommand | None = None
        #: whether a stop has to be sent before any motion
        self.stop_pending = False
        #: how many motions were replaced, or dropped for their age or for a stop
        self.dropped = 0

    def put(self, command: VelocityCommand) -> None:
        """
        Take a command in, in place of what waits.

        :param command: the newest command
        """
        if command.is_stop:
            self.request_stop()
            return
        self.clear()
        self._newest = self._motion = command

    def requeue(self, command: VelocityCommand) -> None:
        """
        Take in again a motion that the robot did not take, if it is still what is wanted.

        :param command: the motion, which was taken from here
        """
        if command is self._newest:
            self._motion = command

    def request_stop(self) -> None:
        """Drop what waits; a stop is owed."""
        self.clear()
        self.stop_pending = True

    def clear(self) -> None:
        """Forget the motion that waits, if one does, and all before it."""
        self.dropped += self._motion is not None
        self._newest = self._motion = None

    def take_stop(self) -> bool:
        """
        Take the stop that is owed.

        :returns: whether one was
        """
        was_owed, self.stop_pending = self.stop_pending, False
        return was_owed

    def has_motion(self, now: float) -> bool:
        """
        Tell whether a motion waits that may be sent; one that has grown too old is dropped.

        :param now: the time [s, steady clock]
        :returns: whether there is one, and no stop comes before it
        """
        if self._motion is not None and now - self._motion.time > self._patience:
            self.clear()
        return self._motion is not None and not self.stop_pending

    def take_motion(self, now: float) -> VelocityCommand | None:
        """
        Take the motion that waits, if it may be sent.

        :param now: the time [s, steady clock]
        :returns: the motion; None if there is none
        """
        if not self.has_motion(now):
            return None
        motion, self._motion = self._motion, None
        return motion


class RpcKind(Enum):
    """What the robot is asked for."""

    MOTION = 'motion'
    STOP = 'stop'
    #: manual control, for a motion that was refused without it
    ENABLE = 'take'


@dataclass(frozen=True, eq=False)
class RpcRequest:
    """
    One call to make now.

    :param kind: what it asks for
    :param command: the velocity of a motion or a stop; None for ``TAKE``
    :param deadline: how long the robot may take to answer [s]
    """

    kind: RpcKind
    command: VelocityCommand | None
    deadline: float


class CommandArbiter:
    """
    Turns commands that come into orders that go, one motion at a time.

    A motion is sent when nothing else is under way.  A stop is sent at once, beside a motion that
    is under way; and once more after that motion has ended, for the two may have arrived in
    either order.  After what went wrong (a lost link, a refusal, a robot that is too slow) no
    motion is sent until the commander has come to rest: a zero, or nothing for a while.
    """

    def __init__(self, hold: float) -> None:
        """
        Know of no robot, and send nothing.

        :param hold: how long the robot keeps a velocity [s]
        """
        self._hold = hold
        self._mailbox = LatestCommand(hold)
        self._silence = CommandTimeout()
        self._under_way: list[RpcRequest] = []
        self._overtaken: RpcRequest | None = None
        self._wants_control = False
        self._is_linked = False
        self._late = 0
        self._heard_last = float('-inf')
        #: whether motions wait for the commander to come to rest
        self.is_blocked = False
        #: whether the robot was given a motion, and has not confirmed a stop since
        self.may_move = False
        #: whether manual control was switched on for a motion
        self.has_taken = False

    @property
    def dropped(self) -> int:
        """Return how many motions were never sent, because of something newer or their age."""
        return self._mailbox.dropped

    @property
    def next_check(self) -> float | None:
        """Return when to ask again what is due, if nothing happens before [s]."""
        return self._silence.end

    def on_command(self, command: VelocityCommand) -> None:
        """
        Take a command in.

        :param command: the newest command
        """
        is_rest = command.is_stop or command.time - self._heard_last > REARM_IDLE_TIME
        self._heard_last = command.time
        if self._is_linked and is_rest:
            self.is_blocked = False
        if command.is_stop or not self.is_blocked:
            self._silence.on_command(command.is_stop, command.time)
            self._mailbox.put(command)

    def next_request(self, now: float) -> RpcRequest | None:
        """
        Return what to send now; ask again until it is nothing.

        :param now: the time [s, steady clock]
        :returns: the order, which is under way from now on
        """
        if self._silence.has_expired(now):
            self._mailbox.request_stop()
        if not self._is_linked:
            return None
        order = self._stop(now) or self._take(now) or self._motion(now)
        if order is not None:
            self._under_way.append(order)
        return order

    def on_response(self, order: RpcRequest, outcome: RpcResult, now: float) -> None:
        """
        Take in how an order ended.

        :param order: the order
        :param outcome: how it ended
        :param now: the time [s, steady clock]
        """
        self._under_way.remove(order)
        if order.kind is RpcKind.STOP:
            self._stop_ended(outcome)
        elif order.kind is RpcKind.ENABLE:
            self._take_ended(outcome)
        else:
            self._motion_ended(order, outcome, now)

    def on_connected(self) -> None:
        """Take in that the robot answers."""
        self._is_linked = True

    def on_connection_lost(self) -> None:
        """Take in that the robot is out of reach; it is stopped when it is back."""
        self._is_linked = False
        self.block_motion()

    def block_motion(self) -> None:
        """Send no motion until the commander has come to rest, and stop the robot if it moves."""
        self.is_blocked = True
        self.cancel_motion()

    def on_stall(self, now: float) -> None:
        """
        Take in that this program was frozen: what comes in now was waiting, and may be old.

        :param now: the time [s, steady clock]
        """
        self._heard_last = now
        self.block_motion()

    def cancel_motion(self) -> None:
        """Forget every motion that came, and stop the robot if it moves."""
        self._wants_control = False
        self._silence = CommandTimeout()
        self._mailbox.clear()
        if self.may_move:
            self._mailbox.request_stop()

    def _stop(self, now: float) -> RpcRequest | None:
        if any(order.kind is RpcKind.STOP for order in self._under_way):
            return None
        if not self._mailbox.take_stop():
            return None
        self._overtaken = next(
            (order for order in self._under_way if order.kind is RpcKind.MOTION), None)
        return RpcRequest(RpcKind.STOP, VelocityCommand(0.0, 0.0, now), STOP_RPC_TIMEOUT)

    def _take(self, now: float) -> RpcRequest | None:
        if self._under_way or not self._wants_control:
            return None
        self._wants_control = False
        return RpcRequest(RpcKind.ENABLE, None, STOP_RPC_TIMEOUT) if self._mailbox.has_motion(
            now) else None

    def _motion(self, now: float) -> RpcRequest | None:
        command = None if self._under_way else self._mailbox.take_motion(now)
        if command is None:
            return None
        self.may_move = True
        return RpcRequest(RpcKind.MOTION, command, self._hold)

    def _stop_ended(self, outcome: RpcResult) -> None:
        if not outcome.got_response:
            self._mailbox.request_stop()
        elif not self._under_way and not self._mailbox.stop_pending:
            self.may_move = False

    def _take_ended(self, outcome: RpcResult) -> None:
        if outcome.is_success:
            self.has_taken = True
        elif outcome.got_response:
            self.block_motion()

    def _motion_ended(self, order: RpcRequest, outcome: RpcResult, now: float) -> None:
        assert order.command is not None
        was_overtaken, self._overtaken = order is self._overtaken, None
        is_late = outcome.failure is RpcFailure.LATE
        self._late = self._late + 1 if is_late else 0
        # Which of the two came last is not known; a newer motion would make up for it.
        if is_late or (was_overtaken and not self._mailbox.has_motion(now)):
            self._mailbox.request_stop()
        if outcome.code == ERROR_NO_MANUAL_CONTROL:
            self._wants_control = True
            self._mailbox.requeue(order.command)
        elif self._late >= MAX_CONSECUTIVE_TIMEOUTS or (
            outcome.got_response and not outcome.is_success):
            self._late = 0
            self.block_motion()
