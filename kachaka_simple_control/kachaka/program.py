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
"""Common code of ``kachaka_bridge`` and ``kachaka_sim``: options and program end."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import fields
import sys

from kachaka_simple_control.control.signals import ShutdownEvent
from kachaka_simple_control.exit_codes import DONE
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.text import escaped

#: With --no-deps, because the version pins of the manufacturer's package downgrade other packages.
SDK_MISSING = (
    'the SDK of the robot is missing here ({error}); install it with: '
    "pip install 'kachaka_simple_control[kachaka]' && pip install --no-deps kachaka-api")
#: The names of all options of a simulated robot.
SIMULATION_NAMES = ('docked', 'seed', *(figure.name for figure in fields(SimulationParameters)))


def add_simulation_options(parser: argparse._ActionsContainer, robot: str) -> None:
    """
    Add the options of a simulated robot; an option that is not given has the value None.

    :param parser: the parser, or a group of its options
    :param robot: the name of the robot in the help text
    """
    add = parser.add_argument
    add('--docked', action='store_true', default=None,
        help=f'{robot} starts on its charging dock')
    add('--seed', type=int, help='of all noise (default: 0)')
    for figure in fields(SimulationParameters):
        add(f"--{figure.name.replace('_', '-')}", type=float, metavar=figure.metadata['unit'],
            help=f"{figure.metadata['help']} (default: {figure.default})")


def add_parent_option(parser: argparse.ArgumentParser) -> None:
    """Add the option ``--with-parent``: end the program when standard input closes."""
    parser.add_argument(
        '--with-parent', action='store_true', help='end when standard input does')


def simulation_words(options: Mapping[str, object]) -> tuple[str, ...]:
    """
    Return the given options of a simulated robot as command line arguments.

    :param options: the values of the parsed options, by name
    """
    return tuple(
        f"--{name.replace('_', '-')}" + ('' if options[name] is True else f'={options[name]}')
        for name in SIMULATION_NAMES if options[name] is not None)


def simulation_parameters(
        parser: argparse.ArgumentParser, options: argparse.Namespace) -> SimulationParameters:
    """
    Return the simulation parameters from the options; end the program if one is invalid.

    :param parser: the parser
    :param options: the parsed options
    """
    try:
        return SimulationParameters(
            **{figure.name: value for figure in fields(SimulationParameters)
               if (value := getattr(options, figure.name)) is not None})
    except ValueError as error:
        parser.error(str(error))


class ExitError(Exception):
    """
    An exception that ends the program with an exit code and a message.

    :param code: the exit code
    :param text: the reason, for the user
    """

    def __init__(self, code: int, text: object) -> None:
        super().__init__(str(text))
        self.code = code


def run_until_shutdown(program: str, body: Callable[[ShutdownEvent], None]) -> int:
    """
    Run the body of a program; print the text of an ``ExitError`` in one line.

    :param program: the name of the program
    :param body: the body, called with an event that a signal sets
    :returns: the exit code
    """
    with ShutdownEvent() as shutdown:
        try:
            body(shutdown)
        except ExitError as error:
            print(f"{program}: {escaped(' '.join(str(error).split()), 400)}", file=sys.stderr)
            return error.code
    return DONE
