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
"""The address of a robot, and a check that it is reachable."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
import socket

from kachaka_simple_control.text import quoted

#: The port of the robot's gRPC service (docs/GRPC.md in pf-robotics/kachaka-api).
PORT = 26400
#: The longest address: a host name of 253 characters, brackets and a port.
MAX_ADDRESS_LENGTH = 261


@dataclass(frozen=True)
class Address:
    """
    The address of a robot's gRPC service.

    :param host: the host name or IP address
    :param port: the TCP port
    """

    host: str
    port: int = PORT

    @classmethod
    def parse(cls, text: str) -> Address:
        """
        Return the address from a text.

        :param text: ``HOST`` or ``HOST:PORT``; an IPv6 address with a port needs brackets
        :raises ValueError: if the text is not an address; the message has one line
        """
        host, port = _split(text.strip())
        if len(text) > MAX_ADDRESS_LENGTH or not text.isprintable():
            raise ValueError(
                f'{quoted(text, 60)} is no address of a robot; it has at most '
                f'{MAX_ADDRESS_LENGTH} characters, all of them visible')
        if not host or any(c.isspace() or c == '/' for c in text.strip()) or set('[]') & set(host):
            raise ValueError(
                f'{text!r} is no address of a robot; write HOST or HOST:{PORT}, for example '
                f'192.168.1.20 or 192.168.1.20:{PORT}')
        if not (port.isascii() and port.isdigit() and 1 <= int(port) <= 65535):
            raise ValueError(f'the port in {text!r} must be a number from 1 to 65535')
        return cls(host, int(port))

    def __str__(self) -> str:
        """Return the address as text in the form that gRPC expects."""
        host = f'[{self.host}]' if ':' in self.host else self.host
        return f'{host}:{self.port}'


def _split(text: str) -> tuple[str, str]:
    if text.startswith('['):
        host, bracket, rest = text[1:].partition(']')
        has_port = rest.startswith(':')
        return (host if bracket and (has_port or not rest) else ''), rest[1:] or str(PORT)
    if text.count(':') == 1:
        host, _, port = text.partition(':')
        return host, port
    return text, str(PORT)


def address_argument(text: str) -> Address:
    """Return the address from a command line argument; raise argparse's error if invalid."""
    try:
        return Address.parse(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


#: See docs/GENERAL.md in pf-robotics/kachaka-api.
SWITCH_ON = 'switch the Kachaka API on in the phone app (Settings, the robot, Kachaka API)'


class UnreachableError(RuntimeError):
    """No robot responds at an address; the message has advice for the user."""


def check_reachable(address: Address, timeout: float) -> None:
    """
    Open a TCP connection to an address and close it.

    :param address: the address
    :param timeout: the longest time to try [s]
    :raises UnreachableError: if the connection fails
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
