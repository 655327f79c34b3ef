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
The gRPC calls to a real Kachaka robot; the only module here that imports its SDK.

Tested by test/kachaka/grpc_client/test_grpc_bridge.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import socket
from typing import Any

import grpc
from kachaka_api.generated import kachaka_api_pb2 as pb2
from kachaka_api.generated.kachaka_api_pb2_grpc import KachakaApiStub
from kachaka_simple_control.errors import RobotNotFoundError
from kachaka_simple_control.kachaka.program import Address
from kachaka_simple_control.kachaka.robot_status import ErrorTexts, RpcFailure, RpcResult
from kachaka_simple_control.text import escaped

#: Advice for the user, from docs/GENERAL.md in pf-robotics/kachaka-api.
SWITCH_ON = 'switch the Kachaka API on in the phone app (Settings, the robot, Kachaka API)'
#: The longest time for a robot to accept a connection, and to respond to each of the three calls
#: of ``connect()`` [s].
CONNECT_TIMEOUT = 3.0
IDENTIFY_TIMEOUT = 2.0
CHANNEL_OPTIONS = (
    # gRPC must not send a lost velocity again.
    ('grpc.enable_retries', 0),
    # Do not use a proxy: the robot is in the local network.
    ('grpc.enable_http_proxy', 0),
    # The period is so long that no keep-alive is sent.  But keep-alive must be on, because only
    # then the operating system closes a connection if data is not acknowledged within the timeout
    # [ms].  This drops the velocities that wait to be sent.
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


class RobotClient:
    """
    One gRPC connection to a robot, opened by the first call; for several threads.

    A method with a ``deadline`` [s] makes a call, and waits for the response that long at most.
    If it fails, no error is raised: the ``RpcResult`` has the reason.
    """

    def __init__(self, address: Address) -> None:
        self._channel = grpc.insecure_channel(str(address), options=CHANNEL_OPTIONS)
        self._stub = KachakaApiStub(self._channel)

    def close(self) -> None:
        """Close the connection, and cancel all gRPC calls that are in progress."""
        self._channel.close()

    def set_velocity(self, linear: float, angular: float, deadline: float) -> RpcResult:
        """
        Send a velocity to the robot, and wait for its response.

        :param linear: a fraction of the robot's largest forward velocity, -1 to 1
        :param angular: of its largest turning velocity, -1 to 1, counter-clockwise positive
        """
        request = pb2.SetRobotVelocityRequest(linear=linear, angular=angular)
        return _call(self._stub.SetRobotVelocity, request, deadline)[0]

    def set_manual_control(self, enabled: bool, deadline: float) -> RpcResult:
        """Switch manual control on or off."""
        request = pb2.SetManualControlEnabledRequest(enable=enabled)
        return _call(self._stub.SetManualControlEnabled, request, deadline)[0]

    def errors(self, deadline: float) -> tuple[RpcResult, list[int]]:
        """Ask the robot for the codes of its current errors."""
        result, response = _call(self._stub.GetError, pb2.GetRequest(), deadline)
        return result, [] if response is None else list(response.error_codes)

    def battery(self, deadline: float) -> tuple[RpcResult, float | None]:
        """Ask the robot for the charge of its battery, from 0 to 1; None if the call failed."""
        result, response = _call(self._stub.GetBatteryInfo, pb2.GetRequest(), deadline)
        return result, None if response is None else response.remaining_percentage / 100.0

    def error_texts(self, deadline: float) -> tuple[RpcResult, str]:
        """Ask the robot for its texts of error codes, normally JSON; empty at failure."""
        result, response = _call(self._stub.GetRobotErrorCodeJson, pb2.EmptyRequest(), deadline)
        return result, '' if response is None else str(response.json)

    def identity(self, deadline: float) -> tuple[RpcResult, str]:
        """Ask for serial number and software release, with two calls; return them as one text."""
        result, serial = _call(self._stub.GetRobotSerialNumber, pb2.GetRequest(), deadline)
        if serial is None:
            return result, ''
        result, version = _call(self._stub.GetRobotVersion, pb2.GetRequest(), deadline)
        if version is None:
            return result, ''
        return result, (
            f'{escaped(serial.serial_number, 60)}, software {escaped(version.version, 60)}')

    def odometry(self, cursor: int, deadline: float) -> tuple[RpcResult, Any]:
        """
        Wait until the robot has odometry that is newer than a message with a cursor.

        :param cursor: that of the last message that the caller has received; 0 for the newest at
            once
        :returns: the result, and a GetRosOdometryResponse; None if the call failed
        """
        return _call(self._stub.GetRosOdometry, _newer_than(cursor), deadline)

    def wheel_odometry(self, cursor: int, deadline: float) -> tuple[RpcResult, Any]:
        """
        Wait until the robot has wheel odometry that is newer than a message with a cursor.

        :param cursor: that of the last message that the caller has received; 0 for the newest at
            once
        :returns: the result, and a GetRosWheelOdometryResponse; None if the call failed
        """
        return _call(self._stub.GetRosWheelOdometry, _newer_than(cursor), deadline)

    def laser_scan(self, cursor: int, deadline: float) -> tuple[RpcResult, Any]:
        """
        Wait until the robot has a laser scan that is newer than one with a cursor.

        The laser runs while the robot moves, and after ``activate_laser``.

        :param cursor: that of the last scan that the caller has received; 0 for the newest at once
        :returns: the result, and a GetRosLaserScanResponse; None if the call failed
        """
        return _call(self._stub.GetRosLaserScan, _newer_than(cursor), deadline)

    def activate_laser(self, duration: float, deadline: float) -> RpcResult:
        """Let the laser run for a time [s], even if the robot stands."""
        request = pb2.ActivateLaserScanRequest(duration_sec=duration)
        return _call(self._stub.ActivateLaserScan, request, deadline)[0]


def _newer_than(cursor: int) -> pb2.GetRequest:
    return pb2.GetRequest(metadata=pb2.Metadata(cursor=cursor))


def _call(method: Callable[..., Any], request: Any, deadline: float) -> tuple[RpcResult, Any]:
    """Make a gRPC call; return the result and the response, None if it failed."""
    try:
        response = method(request, timeout=deadline)
    except grpc.RpcError as error:
        return _failure(error, deadline), None
    except ValueError as error:  # the channel was closed
        return RpcResult(failure=RpcFailure.GONE, text=escaped(error)), None
    result = getattr(response, 'result', None)
    # Some robots report an error with code 0; this is not a success.
    code = 0 if result is None or result.success else result.error_code or -1
    return RpcResult(code=code), response


def _failure(error: Any, deadline: float) -> RpcResult:
    failure = FAILURES.get(error.code(), RpcFailure.FAILED)
    if failure is RpcFailure.LATE:
        return RpcResult(failure=failure, text=f'no answer within {deadline:.2g} s')
    text = ' '.join(str(error.details() or error.code()).split())
    if text.startswith('failed to connect'):
        # The operating system's reason is the last part of the text.
        text = text.rpartition(': ')[2]
    return RpcResult(failure=failure, text=escaped(text))


@dataclass(frozen=True)
class ConnectedRobot:
    """
    A robot that has responded to the first gRPC calls.

    :param texts: names and explanations of the robot's error codes; may be empty
    """

    address: Address
    client: RobotClient
    identity: str
    texts: ErrorTexts


def connect(address: Address) -> ConnectedRobot:
    """
    Connect to a robot, and read its serial number, software release and error texts.

    :raises RobotNotFoundError: if no robot responds; the error message has advice for the user
    """
    _check_reachable(address, CONNECT_TIMEOUT)
    client = RobotClient(address)
    result, identity = client.identity(IDENTIFY_TIMEOUT)
    if not result.is_success:
        client.close()
        raise RobotNotFoundError(_advice(address, result))
    _, text = client.error_texts(IDENTIFY_TIMEOUT)
    return ConnectedRobot(address, client, identity, ErrorTexts(text))


def _check_reachable(address: Address, timeout: float) -> None:
    """
    Check that a TCP connection to an address can be opened.

    :raises RobotNotFoundError: if not; the error message has advice for the user
    """
    try:
        with socket.create_connection((address.host, address.port), timeout):
            return
    except socket.gaierror:
        text = (f'there is no host {address.host!r}: look the IP address of the robot up in the '
                'phone app (Settings, App information)')
    except ConnectionRefusedError:
        text = f'{address} is there, but refuses connections: {SWITCH_ON}'
    except TimeoutError:
        text = (f'{address} does not answer within {timeout:g} s: is the robot on, is its address '
                'right, and is this machine in the same network?')
    except (OSError, UnicodeError) as error:
        reason = getattr(error, 'strerror', None) or error
        text = f'{address} cannot be reached ({reason}): is this machine in its network?'
    raise RobotNotFoundError(text)


def _advice(address: Address, result: RpcResult) -> str:
    if result.failure is RpcFailure.LATE:
        return (f'{address} accepts connections, but does not answer within {IDENTIFY_TIMEOUT:g} '
                's: is this the address of the robot? If it is, restart the robot')
    if result.failure is RpcFailure.GONE:
        return (f'{address} accepts connections, but does not answer ({result.text}): if this is '
                f'the address of the robot, {SWITCH_ON}')
    return f'{address} answers, but not as a Kachaka does ({result.text})'
