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
"""The robot's calls over gRPC, each with a deadline; the one module that knows its SDK."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import grpc
from kachaka_api.generated import kachaka_api_pb2 as pb2
from kachaka_api.generated.kachaka_api_pb2_grpc import KachakaApiStub
from kachaka_simple_control.escaping import escaped
from kachaka_simple_control.kachaka.grpc_client.address import Address
from kachaka_simple_control.kachaka.grpc_client.connection_state import RpcFailure, RpcResult

OPTIONS = (
    # A velocity that went astray must not be sent again by itself.
    ('grpc.enable_retries', 0),
    # A robot in this network is not behind the proxy that leads out of it.
    ('grpc.enable_http_proxy', 0),
    # No keep-alive is ever sent; but with it the system gives up a connection on which nothing
    # was acknowledged for this time, and with it the velocities that still wait there [ms].
    ('grpc.keepalive_time_ms', 3_600_000),
    ('grpc.keepalive_timeout_ms', 500),
    ('grpc.initial_reconnect_backoff_ms', 100),
    ('grpc.min_reconnect_backoff_ms', 1000),
    ('grpc.max_reconnect_backoff_ms', 1000),
)
FAILURES = {
    grpc.StatusCode.DEADLINE_EXCEEDED: RpcFailure.LATE,
    grpc.StatusCode.UNAVAILABLE: RpcFailure.GONE,
    grpc.StatusCode.CANCELLED: RpcFailure.GONE,
}
LATE = 'no answer within {deadline:.2g} s'


class RobotClient:
    """One connection to a robot; for many threads at once."""

    def __init__(self, address: Address) -> None:
        """
        Connect when the first call is made.

        :param address: where the robot is
        """
        self._channel = grpc.insecure_channel(str(address), options=OPTIONS)
        self._stub = KachakaApiStub(self._channel)

    def close(self) -> None:
        """End the connection, and every call under way."""
        self._channel.close()

    def set_velocity(self, linear: float, angular: float, deadline: float) -> RpcResult:
        """
        Let the robot drive.

        :param linear: forward velocity, from -1 to 1
        :param angular: turning velocity, from -1 to 1
        :param deadline: how long it may take to answer [s]
        :returns: how that ended
        """
        request = pb2.SetRobotVelocityRequest(linear=linear, angular=angular)
        return _outcome(self._stub.SetRobotVelocity, request, deadline)[0]

    def set_manual_control(self, enabled: bool, deadline: float) -> RpcResult:
        """
        Let the robot take velocities, or none.

        :param enabled: whether it takes them
        :param deadline: how long it may take to answer [s]
        :returns: how that ended
        """
        request = pb2.SetManualControlEnabledRequest(enable=enabled)
        return _outcome(self._stub.SetManualControlEnabled, request, deadline)[0]

    def errors(self, deadline: float) -> tuple[RpcResult, list[int]]:
        """
        Ask what is wrong with the robot now.

        :param deadline: how long it may take to answer [s]
        :returns: how that ended, and the codes of errors
        """
        outcome, answer = _outcome(self._stub.GetError, pb2.GetRequest(), deadline)
        return outcome, [] if answer is None else list(answer.error_codes)

    def error_texts(self, deadline: float) -> tuple[RpcResult, str]:
        """
        Ask what the codes mean.

        :param deadline: how long it may take to answer [s]
        :returns: how that ended, and what should be JSON
        """
        outcome, answer = _outcome(
            self._stub.GetRobotErrorCodeJson, pb2.EmptyRequest(), deadline)
        return outcome, '' if answer is None else str(answer.json)

    def identity(self, deadline: float) -> tuple[RpcResult, str]:
        """
        Ask who the robot is.

        :param deadline: how long each of two calls may take [s]
        :returns: how that ended, and its serial number and the release of its software
        """
        outcome, serial = _outcome(self._stub.GetRobotSerialNumber, pb2.GetRequest(), deadline)
        if serial is None:
            return outcome, ''
        outcome, version = _outcome(self._stub.GetRobotVersion, pb2.GetRequest(), deadline)
        if version is None:
            return outcome, ''
        return outcome, (
            f'{escaped(serial.serial_number, 60)}, software {escaped(version.version, 60)}')

    def odometry(self, cursor: int, deadline: float) -> tuple[RpcResult, Any]:
        """
        Ask where the robot thinks it is, once that is newer than what is known.

        :param cursor: of what is known; 0 for nothing
        :param deadline: how long that may take [s]
        :returns: how that ended, and GetRosOdometryResponse or None
        """
        return _newer(self._stub.GetRosOdometry, cursor, deadline)

    def wheel_odometry(self, cursor: int, deadline: float) -> tuple[RpcResult, Any]:
        """
        Ask for the same as the wheels have it.

        :param cursor: of what is known; 0 for nothing
        :param deadline: how long that may take [s]
        :returns: how that ended, and GetRosWheelOdometryResponse or None
        """
        return _newer(self._stub.GetRosWheelOdometry, cursor, deadline)


def _newer(method: Callable[..., Any], cursor: int, deadline: float) -> tuple[RpcResult, Any]:
    request = pb2.GetRequest(metadata=pb2.Metadata(cursor=cursor))
    return _outcome(method, request, deadline)


def _outcome(
        method: Callable[..., Any], request: Any, deadline: float) -> tuple[RpcResult, Any]:
    try:
        answer = method(request, timeout=deadline)
    except grpc.RpcError as error:
        return _failure(error, deadline), None
    except ValueError as error:  # the channel was closed
        return RpcResult(failure=RpcFailure.GONE, text=escaped(error)), None
    result = getattr(answer, 'result', None)
    # Some robots leave the code of an error at 0: what was no success is not taken for one.
    code = 0 if result is None or result.success else result.error_code or -1
    return RpcResult(code=code), answer


def _failure(error: Any, deadline: float) -> RpcResult:
    trouble = FAILURES.get(error.code(), RpcFailure.FAILED)
    if trouble is RpcFailure.LATE:
        return RpcResult(failure=trouble, text=LATE.format(deadline=deadline))
    text = ' '.join(str(error.details() or error.code()).split())
    if text.startswith('failed to connect'):
        # What the system said comes last, after names of layers and the address.
        text = text.rpartition(': ')[2]
    return RpcResult(failure=trouble, text=escaped(text))
