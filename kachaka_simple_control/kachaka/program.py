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
Addresses, options of a simulated robot and exit codes for the commands of a Kachaka.

Tested by test/kachaka/grpc_client/test_addresses_and_errors.py.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
import errno
import sys
from typing import TYPE_CHECKING

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.document import FileError
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.motion.units import parse_number, UnitError
from kachaka_simple_control.process.exit_codes import BAD_USAGE, DONE
from kachaka_simple_control.process.signals import ShutdownEvent
from kachaka_simple_control.text import escaped, escaped_lines, quoted

if TYPE_CHECKING:
    from kachaka_simple_control.files.floor_file import FloorFile

#: The port of the robot's gRPC service (docs/GRPC.md in pf-robotics/kachaka-api).
PORT = 26400
#: The largest number of characters in an address: 253 for the host name, 2 for the brackets of an
#: IPv6 address, 6 for the port with its colon.
MAX_ADDRESS_LENGTH = 261
#: The error message has the option --no-deps, because the version pins of the manufacturer's
#: package would downgrade other packages.
SDK_MISSING = (
    'the SDK of the robot is missing here ({error}); install it with: '
    "pip install 'kachaka_simple_control[kachaka]' && pip install --no-deps kachaka-api")
#: The name of the value of the option ``--floor``.
FLOOR = 'floor_file'
#: The names of all command line options of a simulated robot, but for its floor.
SIMULATION_NAMES = ('docked', 'seed', *(figure.name for figure in fields(SimulationParameters)))


@dataclass(frozen=True)
class Address:
    """The network address of a robot's gRPC service."""

    host: str
    port: int = PORT

    @classmethod
    def parse(cls, text: str) -> Address:
        """
        Convert a text to the network address of a robot.

        :param text: ``HOST`` or ``HOST:PORT``; an IPv6 address in brackets if a port follows
        :raises ValueError: if the text is not a valid address; the error message has one line
        """
        host, port = _split_address(text.strip())
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
        """Return the address as ``HOST:PORT`` for gRPC, with brackets around an IPv6 address."""
        host = f'[{self.host}]' if ':' in self.host else self.host
        return f'{host}:{self.port}'


def _split_address(text: str) -> tuple[str, str]:
    if text.startswith('['):
        host, bracket, rest = text[1:].partition(']')
        has_port = rest.startswith(':')
        return (host if bracket and (has_port or not rest) else ''), rest[1:] or str(PORT)
    if text.count(':') == 1:
        host, _, port = text.partition(':')
        return host, port
    return text, str(PORT)


def address_argument(text: str) -> Address:
    """
    Convert an argument to the address of a robot, as argparse wants a type.

    :raises argparse.ArgumentTypeError: if the argument is not a valid address
    """
    try:
        return Address.parse(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def number_argument(unit: str = '') -> Callable[[str], float]:
    """
    Return a function that converts an argument to a number, as argparse wants a type.

    :param unit: the unit that the user may write after the number; empty for a ratio
    """
    def convert(text: str) -> float:
        try:
            return parse_number(text, unit)
        except UnitError as error:
            raise argparse.ArgumentTypeError(str(error)) from None
    return convert


def option_of(name: str) -> str:
    """Return the command line option of a value, as in ``--dead-time`` for ``dead_time``."""
    return f"--{name.replace('_', '-')}"


def add_simulation_options(parser: argparse._ActionsContainer, robot: str) -> None:
    """Add the options of a simulated robot to a parser; None where the user gives none."""
    add = parser.add_argument
    add('--docked', action='store_true', default=None,
        help=f'{robot} starts on its charging dock')
    add('--seed', type=int, help='of all noise (default: 0)')
    for figure in fields(SimulationParameters):
        unit = figure.metadata['unit']
        add(option_of(figure.name), type=number_argument(unit),
            metavar=unit.upper().replace('^', '') or 'F',
            help=f"{figure.metadata['help']} (default: {figure.default})")


def add_floor_option(parser: argparse._ActionsContainer, robot: str) -> None:
    """Add the option ``--floor`` of a simulated robot; its value has the name ``FLOOR``."""
    parser.add_argument(
        '--floor', dest=FLOOR, metavar='FILE',
        help=f'what {robot} can touch and its laser sees: the path of a floor file, or the name '
             'of a floor that comes with the package (default: an empty floor)')


def add_parent_option(parser: argparse.ArgumentParser) -> None:
    """Add the option ``--with-parent``: end with standard input, so with the parent."""
    parser.add_argument(
        '--with-parent', action='store_true', help='end when standard input does')


def simulation_words(options: Mapping[str, object]) -> tuple[str, ...]:
    """Convert the parsed options of a simulated robot back to arguments; None is left out."""
    return tuple(
        option_of(name) + ('' if options[name] is True else f'={options[name]}')
        for name in SIMULATION_NAMES if options[name] is not None)


def floor_words(options: Mapping[str, object]) -> tuple[str, ...]:
    """Convert the parsed option ``--floor`` back to arguments: none if it was not given."""
    file = options.get(FLOOR)
    return () if file is None else (f'--floor={file}',)


def find_option_floor(options: argparse.Namespace) -> FloorFile | None:
    """
    Read the floor of the option ``--floor``; None if it was not given.

    :raises FloorFileError: if there is no such floor, or its file is invalid
    """
    if (file := getattr(options, FLOOR)) is None:
        return None
    from kachaka_simple_control.files.floor_file import find_floor
    return find_floor(file)


def simulation_parameters(
        parser: argparse.ArgumentParser, options: argparse.Namespace) -> SimulationParameters:
    """
    Return the parameters of the simulated robot from the parsed options.

    The parser ends the program, with a message, if one is invalid.
    """
    try:
        return SimulationParameters(
            **{figure.name: value for figure in fields(SimulationParameters)
               if (value := getattr(options, figure.name)) is not None})
    except InvalidMotionError as error:
        parser.error(f'{option_of(str(error.name))} is {error.message}')


def listen_problem(error: OSError | UnicodeError, option: str) -> str:
    """Return why a program cannot listen at a port, and what to do if the port is the reason."""
    reason = getattr(error, 'strerror', None) or str(error)
    is_port = getattr(error, 'errno', None) in (errno.EADDRINUSE, errno.EACCES)
    return f'{reason}; choose another {option}' if is_port else reason


class ExitError(Exception):
    """An exception that ends the program with an exit code and an error message."""

    def __init__(self, code: int, text: object) -> None:
        super().__init__(str(text))
        self.code = code


def run_until_shutdown(program: str, body: Callable[[ShutdownEvent], None]) -> int:
    """
    Run the main function of a program, and return the exit code, also of an ``ExitError``.

    An error about a file has a line for each problem.

    Signals only set the event that the main function gets and must wait for.
    """
    with ShutdownEvent() as shutdown:
        try:
            body(shutdown)
        except FileError as error:
            print(escaped_lines(error), file=sys.stderr)
            return BAD_USAGE
        except ExitError as error:
            print(f"{program}: {escaped(' '.join(str(error).split()), 400)}", file=sys.stderr)
            return error.code
    return DONE
