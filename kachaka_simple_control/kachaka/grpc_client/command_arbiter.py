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
"""Decide which gRPC call to the robot to make next: a stop first, then the newest velocity."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
import math

from kachaka_simple_control.control.timing import (
    MAX_CONSECUTIVE_TIMEOUTS,
    MAX_STREAM_PERIOD,
    REARM_IDLE_TIME,
    STOP_REPEAT_PERIOD,
    STOP_RPC_TIMEOUT,
    STREAM_TIMEOUT,
)
from kachaka_simple_control.kachaka.robot_status import (
    ERROR_NO_MANUAL_CONTROL,
    RpcFailure,
    RpcResult,
)
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.motion.limits import Limits


@dataclass(frozen=True)
class VelocityCommand:
    """
    A velocity as fractions of the robot's largest ones: -1 to 1, backwards and right negative.

    :param time: when it was received [s, steady clock]
    """

    linear: float
    angular: float
    time: float

    @property
    def is_stop(self) -> bool:
        """Return whether the command stops the robot, because both velocities are zero."""
        return self.linear == 0.0 and self.angular == 0.0


def velocity_command(velocity: Velocity, limits: Limits, now: float) -> VelocityCommand:
    """
    Convert a velocity to a command for the robot, and clip it to the robot's limits.

    :raises ValueError: if the velocity is infinite or NaN; the error message has one line
    """
    if not (math.isfinite(velocity.linear_x) and math.isfinite(velocity.angular_z)):
        raise ValueError(
            f'linear.x {velocity.linear_x} m/s and angular.z {velocity.angular_z} rad/s must be '
            'finite numbers')
    return VelocityCommand(
        max(-1.0, min(velocity.linear_x / limits.max_linear_velocity, 1.0)),
        max(-1.0, min(velocity.angular_z / limits.max_angular_velocity, 1.0)), now)


class StreamTimeout:
    """
    Detects when a publisher that sends regularly no longer sends velocities.

    It expires 0.25 s after the last velocity, if at least two were received since the last zero,
    with at most 0.15 s between them.
    """

    def __init__(self) -> None:
        self._last: float | None = None
        self._longest: float | None = None

    def on_command(self, is_stop: bool, now: float) -> None:
        """Restart the timeout at the second velocity in a row; switch it off at a zero."""
        if is_stop:
            self._last = self._longest = None
            return
        if self._last is not None:
            self._longest = max(self._longest or 0.0, now - self._last)
        self._last = now

    @property
    def end(self) -> float | None:
        """Return when the timeout expires [s]; None if the publisher is not regular."""
        if self._last is None or self._longest is None or self._longest > MAX_STREAM_PERIOD:
            return None
        return self._last + STREAM_TIMEOUT

    def has_expired(self, now: float) -> bool:
        """Return whether the timeout has expired; it is then off until two more have come."""
        if self.end is None or now < self.end:
            return False
        self._last = self._longest = None
        return True


class LatestCommand:
    """
    Stores what to send to the robot next: at most one stop and one motion, which is not zero.

    A newer motion replaces the stored one, so motions do not queue up if the robot is slow.  A
    stop removes it.  A motion that comes after a stop can be taken only after the stop was.

    :param max_age: the largest age of a motion that may still be sent [s]
    """

    def __init__(self, max_age: float) -> None:
        self._max_age = max_age
        self._newest: VelocityCommand | None = None
        self._motion: VelocityCommand | None = None
        #: whether a stop must be sent before any motion
        self.stop_pending = False
        #: the number of motions that were dropped: replaced, removed by a stop, or too old
        self.dropped = 0

    def put(self, command: VelocityCommand) -> None:
        """Store a new velocity command; a zero removes the stored one and requests a stop."""
        if command.is_stop:
            self.request_stop()
            return
        self.clear()
        self._newest = self._motion = command

    def requeue(self, command: VelocityCommand) -> None:
        """Store a refused command again, unless anything else was requested since."""
        if command is self._newest:
            self._motion = command

    def request_stop(self) -> None:
        """Drop the stored velocity command, and require a stop before any new command."""
        self.clear()
        self.stop_pending = True

    def clear(self) -> None:
        """Drop the stored command; ``requeue()`` ignores all that were received before."""
        self.dropped += self._motion is not None
        self._newest = self._motion = None

    def take_stop(self) -> bool:
        """Return, once, whether a stop was requested; the caller must then send it."""
        was_pending, self.stop_pending = self.stop_pending, False
        return was_pending

    def has_motion(self, now: float) -> bool:
        """Return whether there is a command that is not too old, and no stop comes first."""
        if self._motion is not None and now - self._motion.time > self._max_age:
            self.clear()
        return self._motion is not None and not self.stop_pending

    def take_motion(self, now: float) -> VelocityCommand | None:
        """Remove and return the stored command; None without one, if too old, or before a stop."""
        if not self.has_motion(now):
            return None
        motion, self._motion = self._motion, None
        return motion


class RpcKind(Enum):
    """The kind of a gRPC call: a motion, a stop (a zero), or to enable manual control."""

    MOTION = 'motion'
    STOP = 'stop'
    #: enable manual control, because the robot refused a motion without it
    ENABLE = 'enable'


@dataclass(frozen=True, eq=False)
class RpcRequest:
    """
    A gRPC call to the robot that must be made now.

    :param command: the velocity to send; None for a call that enables manual control
    :param deadline: the longest time to wait for the robot's response [s]
    """

    kind: RpcKind
    command: VelocityCommand | None
    deadline: float


class CommandArbiter:
    """
    Decides which gRPC calls to make for the velocities that are received.

    ``next_request()`` returns the next call, and the caller passes its result to
    ``on_response()``.  A stop is a zero velocity, a motion any other.

    A motion is sent only when no other call is in progress, a stop at once.  The robot may receive
    it before a motion that is in progress, so it is sent again after that, unless a newer motion
    waits.  A stop that fails is also sent again, until the robot has executed it or a newer motion
    is sent.

    If the robot refuses a motion because manual control is off, that is enabled and the motion is
    sent again.  After a fault, motions are ignored until their publisher sends a zero, or nothing
    for 1 s: the connection is lost, the robot refuses for another reason, three motions in a row
    get no response in time, or this process was suspended.
    """

    def __init__(self, command_timeout: float) -> None:
        self._command_timeout = command_timeout
        self._latest = LatestCommand(command_timeout)
        self._stream = StreamTimeout()
        self._in_flight: list[RpcRequest] = []
        self._overtaken: RpcRequest | None = None
        #: when to send a stop again that the robot could not execute [s, steady clock]; None if
        #: there is no such stop
        self._retry_stop_at: float | None = None
        self._must_enable = False
        self._is_connected = False
        self._timeouts = 0
        self._last_command = -math.inf
        #: whether motions are blocked after a fault
        self.is_blocked = False
        #: whether a motion was sent and no stop has been confirmed since then
        self.may_move = False

    @property
    def dropped(self) -> int:
        """Return how many commands were dropped: replaced, removed by a stop, or too old."""
        return self._latest.dropped

    @property
    def next_check(self) -> float | None:
        """
        Return when to call ``next_request()`` again [s, steady clock], for a stop that may be due.

        None: only after a command or a response.
        """
        times = [time for time in (self._stream.end, self._retry_stop_at) if time is not None]
        return min(times, default=None)

    def on_command(self, command: VelocityCommand) -> None:
        """Store a velocity command that was received; after a fault, it may be ignored."""
        is_rest = command.is_stop or command.time - self._last_command > REARM_IDLE_TIME
        self._last_command = command.time
        if self._is_connected and is_rest:
            self.is_blocked = False
        if command.is_stop or not self.is_blocked:
            self._stream.on_command(command.is_stop, command.time)
            self._latest.put(command)

    def next_request(self, now: float) -> RpcRequest | None:
        """
        Return the next gRPC call, in progress until ``on_response()``; None if none is due.

        Several may be due: call this until it returns None.
        """
        if self._stream.has_expired(now) or (
                self._retry_stop_at is not None and now >= self._retry_stop_at):
            self._retry_stop_at = None
            self._latest.request_stop()
        if not self._is_connected:
            return None
        request = self._next_stop(now) or self._next_enable(now) or self._next_motion(now)
        if request is not None:
            self._in_flight.append(request)
        return request

    def on_response(self, request: RpcRequest, result: RpcResult, now: float) -> None:
        """Use the result of a gRPC call that ``next_request()`` has returned."""
        self._in_flight.remove(request)
        if request.kind is RpcKind.STOP:
            self._on_stop_response(result, now)
        elif request.kind is RpcKind.ENABLE:
            self._on_enable_response(result)
        else:
            self._on_motion_response(request, result, now)

    def on_connected(self) -> None:
        """Allow gRPC calls from now on, because the robot has responded."""
        self._is_connected = True

    def on_connection_lost(self) -> None:
        """
        Make no calls until ``on_connected()``; drop all velocities; then stop if need be.

        New velocities are ignored as after any fault.
        """
        self._is_connected = False
        self.block_motion()

    def block_motion(self) -> None:
        """Drop all velocities, stop the robot if need be, ignore new ones as after a fault."""
        self.is_blocked = True
        self.cancel_motion()

    def on_stall(self, now: float) -> None:
        """Do as ``block_motion``: the process was suspended, what was received may be old."""
        self._last_command = now
        self.block_motion()

    def cancel_motion(self) -> None:
        """Drop all velocities received so far, and stop the robot if it may be moving."""
        self._must_enable = False
        self._stream = StreamTimeout()
        self._latest.clear()
        if self.may_move:
            self._latest.request_stop()

    def _next_stop(self, now: float) -> RpcRequest | None:
        if any(request.kind is RpcKind.STOP for request in self._in_flight):
            return None
        if not self._latest.take_stop():
            return None
        self._overtaken = next(
            (request for request in self._in_flight if request.kind is RpcKind.MOTION), None)
        return RpcRequest(RpcKind.STOP, VelocityCommand(0.0, 0.0, now), STOP_RPC_TIMEOUT)

    def _next_enable(self, now: float) -> RpcRequest | None:
        if self._in_flight or not self._must_enable:
            return None
        self._must_enable = False
        return RpcRequest(RpcKind.ENABLE, None, STOP_RPC_TIMEOUT) if self._latest.has_motion(
            now) else None

    def _next_motion(self, now: float) -> RpcRequest | None:
        command = None if self._in_flight else self._latest.take_motion(now)
        if command is None:
            return None
        self.may_move, self._retry_stop_at = True, None
        return RpcRequest(RpcKind.MOTION, command, self._command_timeout)

    def _on_stop_response(self, result: RpcResult, now: float) -> None:
        if result.failure is RpcFailure.FAILED:
            # Not at once: the call may have failed without reaching the robot, and fail so again.
            self._retry_stop_at = now + STOP_REPEAT_PERIOD if self.may_move else None
        elif not result.got_response:
            self._latest.request_stop()
        elif not self._in_flight and not self._latest.stop_pending:
            self.may_move, self._retry_stop_at = False, None

    def _on_enable_response(self, result: RpcResult) -> None:
        if result.got_response and not result.is_success:
            self.block_motion()

    def _on_motion_response(self, request: RpcRequest, result: RpcResult, now: float) -> None:
        assert request.command is not None
        was_overtaken, self._overtaken = request is self._overtaken, None
        is_late = result.failure is RpcFailure.LATE
        self._timeouts = self._timeouts + 1 if is_late else 0
        # The robot may have received stop and motion in any order.  A newer motion replaces both.
        if is_late or (was_overtaken and not self._latest.has_motion(now)):
            self._latest.request_stop()
        if result.code == ERROR_NO_MANUAL_CONTROL:
            self._must_enable = True
            self._latest.requeue(request.command)
        elif self._timeouts >= MAX_CONSECUTIVE_TIMEOUTS or (
                result.got_response and not result.is_success):
            self._timeouts = 0
            self.block_motion()
