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
"""Meet a robot: find it, and learn who it is."""

from __future__ import annotations

from dataclasses import dataclass

from kachaka_simple_control.kachaka.error_codes import ErrorTexts
from kachaka_simple_control.kachaka.grpc_client.address import (
    Address,
    require_listener,
    SWITCH_ON,
    UnreachableError,
)
from kachaka_simple_control.kachaka.grpc_client.client import RobotClient
from kachaka_simple_control.kachaka.grpc_client.connection_state import Outcome, Trouble

#: How long a robot may take to accept a connection, then to answer each of three questions [s].
CONNECTING = 3.0
ANSWERING = 2.0


@dataclass(frozen=True)
class Meeting:
    """
    A robot that has answered.

    :param address: where it is
    :param client: its calls
    :param identity: its serial number and the release of its software
    :param texts: what its errors mean, as far as it says
    """

    address: Address
    client: RobotClient
    identity: str
    texts: ErrorTexts


def meet(address: Address) -> Meeting:
    """
    Find a robot, and learn who it is.

    :param address: where it should be
    :returns: what was learnt
    :raises UnreachableError: if no robot answers there, with what to do
    """
    require_listener(address, CONNECTING)
    client = RobotClient(address)
    outcome, identity = client.identity(ANSWERING)
    if not outcome.is_success:
        client.close()
        raise UnreachableError(_silent(address, outcome))
    outcome, text = client.error_texts(ANSWERING)
    return Meeting(address, client, identity, ErrorTexts(text))


def _silent(address: Address, outcome: Outcome) -> str:
    if outcome.trouble is Trouble.LATE:
        return (f'{address} accepts connections, but does not answer within {ANSWERING:g} s: is '
                'this the address of the robot? If it is, restart the robot')
    if outcome.trouble is Trouble.GONE:
        return (f'{address} accepts connections, but does not answer ({outcome.text}): if this is '
                f'the address of the robot, {SWITCH_ON}')
    return f'{address} answers, but not as a Kachaka does ({outcome.text})'
