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
Decide which gRPC call to the robot to make next.

A stop is sent before any other velocity.  If several velocities wait, only the newest one is sent.
"""

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
    A velocity for the robot, as fractions of its largest forward and turning velocities.

    :param linear: forward velocity, -1 to 1, negative backwards
    :param angular: turning velocity, -1 to 1, counter-clockwise positive
    :param time: the time at which the velocity was received [s, steady clock]
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

    :param velocity: the velocity [m/s, rad/s]
    :param limits: the largest velocities of the robot
    :param now: the time at which the velocity was received [s, steady clock]
    :returns: the command, with each velocity as a fraction of its limit, -1 to 1
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
    A timeout that detects when a publisher no longer sends velocities.

    The timeout expires 0.25 s after the last velocity, but only if the publisher sends regularly.
    This means that at least two velocities were received since the last zero velocity, with at
    most 0.15 s from one velocity to the next.
    """

    def __init__(self) -> None:
        self._last: float | None = None
        self._longest: float | None = None

    def on_command(self, is_stop: bool, now: float) -> None:
        """
        Restart the timeout, or switch it off if the received command is a zero velocity.

        If it was switched off, it starts again at the second velocity that is not zero.

        :param is_stop: whether the command is a zero velocity
        :param now: the time at which the command was received [s, steady clock]
        """
        if is_stop:
            self._last = self._longest = None
            return
        if self._last is not None:
            self._longest = max(self._longest or 0.0, now - self._last)
        self._last = now

    @property
    def end(self) -> float | None:
        """
        Return the time at which the timeout expires [s, steady clock], or None.

        None means that the publisher does not send regularly.  Since the last zero velocity, fewer
        than two velocities were received, or more than 0.15 s passed from one to the next.
        """
        if self._last is None or self._longest is None or self._longest > MAX_STREAM_PERIOD:
            return None
        return self._last + STREAM_TIMEOUT

    def has_expired(self, now: float) -> bool:
        """
        Return whether the timeout has expired.

        If the timeout has expired, it is switched off until two more velocities have been
        received.

        :param now: the current time [s, steady clock]
        """
        if self.end is None or now < self.end:
            return False
        self._last = self._longest = None
        return True


class LatestCommand:
    """
    Stores what to send to the robot next: at most one stop and one motion.

    A motion is a command with a velocity that is not zero.  A newer motion replaces the stored
    motion, so motions do not queue up if the robot is slow.  A stop removes the stored motion.  A
    motion that comes after a stop is stored, but can be taken only after the stop was taken.

    :param max_age: the largest age of a motion that may still be sent [s]; older motions are
        dropped
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
        """
        Store a new velocity command for the robot.

        A velocity that is not zero replaces the stored command.  A zero velocity removes the
        stored command, and ``take_stop()`` then returns true.

        :param command: the new command
        """
        if command.is_stop:
            self.request_stop()
            return
        self.clear()
        self._newest = self._motion = command

    def requeue(self, command: VelocityCommand) -> None:
        """
        Store a refused velocity command again, so that it is sent once more.

        The command is not stored if ``put()``, ``request_stop()`` or ``clear()`` was called after
        the command was first stored.

        :param command: the command, which the robot has refused
        """
        if command is self._newest:
            self._motion = command

    def request_stop(self) -> None:
        """Drop the stored velocity command, and require a stop before any new command."""
        self.clear()
        self.stop_pending = True

    def clear(self) -> None:
        """
        Drop the stored velocity command.

        After this, ``requeue()`` ignores all commands that were received before.
        """
        self.dropped += self._motion is not None
        self._newest = self._motion = None

    def take_stop(self) -> bool:
        """
        Return whether a stop, which is a zero velocity, must be sent now.

        The caller must then send the stop.  Further calls return false until the next stop is
        requested.
        """
        was_pending, self.stop_pending = self.stop_pending, False
        return was_pending

    def has_motion(self, now: float) -> bool:
        """
        Return whether there is a stored velocity command, and it can be sent now.

        If a stop is requested, the stop must be sent first.  A stored command that is too old is
        dropped.

        :param now: the current time [s, steady clock]
        """
        if self._motion is not None and now - self._motion.time > self._max_age:
            self.clear()
        return self._motion is not None and not self.stop_pending

    def take_motion(self, now: float) -> VelocityCommand | None:
        """
        Remove and return the stored velocity command, if it can be sent now.

        None is returned if no command is stored, if the command is too old, or if a requested stop
        must be sent first.

        :param now: the current time [s, steady clock]
        """
        if not self.has_motion(now):
            return None
        motion, self._motion = self._motion, None
        return motion


class RpcKind(Enum):
    """
    The kind of a gRPC call: a motion, a stop, or a call that enables manual control.

    A motion is a velocity that is not zero, and a stop is a zero velocity.  Manual control is the
    mode in which the robot follows velocities.
    """

    MOTION = 'motion'
    STOP = 'stop'
    #: enable manual control, because the robot refused a motion without it
    ENABLE = 'enable'


@dataclass(frozen=True, eq=False)
class RpcRequest:
    """
    A gRPC call to the robot that must be made now.

    :param kind: what the call does: it sends a velocity that is not zero, sends a zero velocity,
        or enables manual control, the mode in which the robot follows velocities
    :param command: the velocity to send; None for a call that enables manual control
    :param deadline: the longest time to wait for the robot's response [s]
    """

    kind: RpcKind
    command: VelocityCommand | None
    deadline: float


class CommandArbiter:
    """
    Decides which gRPC calls to make for the velocities that are received.

    The class makes no calls itself.  ``next_request()`` returns the next call to make, and the
    caller passes the result of the call to ``on_response()``.  In this class, a stop is a zero
    velocity, and a motion is any other velocity.

    A motion is sent only when no other call is in progress.  A stop is sent at once.  If a motion
    call is in progress at that time, the robot can receive the stop before the motion.  Therefore,
    the stop is sent again after the motion call, unless a newer motion waits.  A stop that fails
    is also sent again, until the robot has executed it or a newer motion is sent.

    If the robot refuses a motion because its manual control is off, manual control is enabled and
    the motion is sent again.  After one of the following faults, motions are ignored until the
    publisher of the velocities sends a zero velocity, or sends nothing for 1 s:

    - The connection is lost.
    - The robot refuses a motion for another reason, or refuses to enable manual control.
    - Three motion calls in a row get no response in time.
    - This process was suspended.

    :param command_timeout: how long the robot follows a velocity if it receives no new one [s]
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
        """
        Return the number of velocity commands that were dropped before they were sent.

        A command is dropped if a newer command replaces it, if a stop removes it, or if it is too
        old.
        """
        return self._latest.dropped

    @property
    def next_check(self) -> float | None:
        """
        Return the time at which to call ``next_request()`` again [s, steady clock], or None.

        A stop is due at this time, unless a velocity is received earlier.  None means that
        ``next_request()`` must be called again only after a command or a response is received.
        """
        times = [time for time in (self._stream.end, self._retry_stop_at) if time is not None]
        return min(times, default=None)

    def on_command(self, command: VelocityCommand) -> None:
        """
        Store a velocity command that was received, so that ``next_request()`` can return it.

        After a fault, such as a refused call, commands are ignored until a zero velocity is
        received, or until a command is received after a pause of 1 s.

        :param command: the command
        """
        is_rest = command.is_stop or command.time - self._last_command > REARM_IDLE_TIME
        self._last_command = command.time
        if self._is_connected and is_rest:
            self.is_blocked = False
        if command.is_stop or not self.is_blocked:
            self._stream.on_command(command.is_stop, command.time)
            self._latest.put(command)

    def next_request(self, now: float) -> RpcRequest | None:
        """
        Return the next gRPC call to make now, or None if no call is due.

        Several calls may be due, so call this method again until it returns None.  A returned gRPC
        call counts as in progress until ``on_response()`` gets its result.

        :param now: the current time [s, steady clock]
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
        """
        Use the result of a gRPC call to decide which calls to make next.

        :param request: the gRPC call, which ``next_request()`` has returned earlier
        :param result: the result of the call
        :param now: the current time [s, steady clock]
        """
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
        Allow no gRPC calls until ``on_connected()`` is called, and drop all waiting velocities.

        If the robot may be moving, the first gRPC call after ``on_connected()`` is a stop.  New
        velocities are ignored until their publisher sends a zero velocity, or sends nothing for
        1 s.
        """
        self._is_connected = False
        self.block_motion()

    def block_motion(self) -> None:
        """
        Drop all waiting velocities, stop the robot if it may be moving, and ignore new velocities.

        New velocities are ignored until their publisher sends a zero velocity, or sends nothing
        for 1 s.
        """
        self.is_blocked = True
        self.cancel_motion()

    def on_stall(self, now: float) -> None:
        """
        Stop the robot after this process was suspended, because received velocities may be old.

        All waiting velocities are dropped, and a stop is sent if the robot may be moving.  New
        velocities are ignored until their publisher sends a zero velocity, or sends nothing for
        1 s.

        :param now: the current time [s, steady clock]
        """
        self._last_command = now
        self.block_motion()

    def cancel_motion(self) -> None:
        """
        Drop all velocities received so far, and stop the robot if it may be moving.

        Velocities that are received later are not affected.
        """
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
