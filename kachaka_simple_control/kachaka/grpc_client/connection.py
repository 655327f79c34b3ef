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
"""Connect to a robot and identify it."""

from __future__ import annotations

from dataclasses import dataclass

from kachaka_simple_control.kachaka.error_codes import ErrorTexts
from kachaka_simple_control.kachaka.grpc_client.address import (
    Address,
    check_reachable,
    SWITCH_ON,
    UnreachableError,
)
from kachaka_simple_control.kachaka.grpc_client.client import RobotClient
from kachaka_simple_control.kachaka.grpc_client.connection_state import RpcFailure, RpcResult

#: How long a robot may take to accept a connection, and to respond to each of three calls [s].
CONNECT_TIMEOUT = 3.0
IDENTIFY_TIMEOUT = 2.0


@dataclass(frozen=True)
class ConnectedRobot:
    """
    A robot that has responded.

    :param address: its address
    :param client: its calls
    :param identity: its serial number and software release
    :param texts: the texts of its errors, as far as it has them
    """

    address: Address
    client: RobotClient
    identity: str
    texts: ErrorTexts


def connect(address: Address) -> ConnectedRobot:
    """
    Connect to a robot and identify it.

    :param address: its address
    :raises UnreachableError: if no robot responds there, with advice for the user
    """
    check_reachable(address, CONNECT_TIMEOUT)
    client = RobotClient(address)
    result, identity = client.identity(IDENTIFY_TIMEOUT)
    if not result.is_success:
        client.close()
        raise UnreachableError(_advice(address, result))
    _, text = client.error_texts(IDENTIFY_TIMEOUT)
    return ConnectedRobot(address, client, identity, ErrorTexts(text))


def _advice(address: Address, result: RpcResult) -> str:
    if result.failure is RpcFailure.LATE:
        return (f'{address} accepts connections, but does not answer within {IDENTIFY_TIMEOUT:g} '
                's: is this the address of the robot? If it is, restart the robot')
    if result.failure is RpcFailure.GONE:
        return (f'{address} accepts connections, but does not answer ({result.text}): if this is '
                f'the address of the robot, {SWITCH_ON}')
    return f'{address} answers, but not as a Kachaka does ({result.text})'
