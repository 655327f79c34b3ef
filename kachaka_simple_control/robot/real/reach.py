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
"""Find out why a robot cannot be reached, in words for whoever stands beside it."""

from __future__ import annotations

import socket

from kachaka_simple_control.robot.real.address import Address

#: Where the switch is: docs/GENERAL.md in pf-robotics/kachaka-api.
SWITCH_ON = 'switch the Kachaka API on in the phone app (Settings, the robot, Kachaka API)'


class UnreachableError(RuntimeError):
    """No robot answers; the text says what to do about it."""


def require_listener(address: Address, timeout: float) -> None:
    """
    Make sure that somebody listens at an address.

    :param address: the address
    :param timeout: how long to try [s]
    :raises UnreachableError: if nobody does
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
    raise UnreachableError(text)
