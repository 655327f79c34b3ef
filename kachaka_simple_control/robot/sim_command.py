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
"""The command ``kachaka_sim``: a simulated Kachaka that speaks gRPC, as the real one does."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import sys
import time

from kachaka_simple_control.escaping import escaped, quoted
from kachaka_simple_control.one_line_parser import OneLineParser
from kachaka_simple_control.robot.ending import Ending
from kachaka_simple_control.robot.fidelity import Fidelity
from kachaka_simple_control.robot.fidelity_options import add_figures, fidelity
from kachaka_simple_control.robot.power_button import hold_back, power_button
from kachaka_simple_control.robot.simulated import SimulatedKachaka

PROGRAM = 'kachaka_sim'
#: What the package of the maker is installed with: its own pins would hold everything else back.
MISSING = (
    'the SDK of the robot is missing here ({error}); install it with: '
    "pip install 'kachaka_simple_control[kachaka]' && pip install --no-deps kachaka-api")


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the robot until a signal comes.

    :param args: the arguments without the program's name; those of the command line by default
    :returns: the exit code
    """
    hold_back()
    with Ending() as ending:
        return _main(sys.argv[1:] if args is None else args, ending)


def _main(args: Sequence[str], ending: Ending) -> int:
    options, how = _parse(args)
    try:
        from kachaka_simple_control.robot.grpc_server.server_thread import serving
    except (ImportError, RuntimeError) as error:
        return _failure(MISSING.format(error=error), 1)
    robot = SimulatedKachaka(time.monotonic(), how, options.docked, options.seed)
    try:
        with serving(robot, options.grpc_port, options.host) as server, power_button(
                lambda: server.call(SimulatedKachaka.press_power_button)):
            print(f'ready: simulated Kachaka at {server.address}', flush=True)
            ending.wait(options.with_parent)
    except (OSError, UnicodeError) as error:
        reason = getattr(error, 'strerror', None) or error
        where = f'{escaped(options.host, 60)}:{options.grpc_port}'
        return _failure(f'cannot listen at {where}: {reason}', 2)
    return 0


def _failure(message: str, code: int) -> int:
    print(f"{PROGRAM}: {escaped(' '.join(message.split()), 400)}", file=sys.stderr)
    return code


def _parse(args: Sequence[str]) -> tuple[argparse.Namespace, Fidelity]:
    parser = _parser()
    options = parser.parse_args(args)
    try:
        return options, fidelity(options)
    except ValueError as error:
        parser.error(str(error))


def _port(text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 10 and int(text) <= 65535):
        raise argparse.ArgumentTypeError(
            f'{quoted(text, 60)} is no port; it must be a whole number from 0 to 65535')
    return int(text)


def _parser() -> OneLineParser:
    parser = OneLineParser(
        prog=PROGRAM, allow_abbrev=False,
        description='Simulate a Kachaka that speaks gRPC as the real one does.  Needs no ROS.',
        epilog='Signal USR1 presses its power button: a pause, or its end.')
    add = parser.add_argument
    add('--grpc-port', type=_port, default=26400, metavar='PORT',
        help='where to listen; 0: any port that is free (default: %(default)s)')
    add('--host', default='127.0.0.1',
        help='the address to listen at; 0.0.0.0: all of this machine (default: %(default)s)')
    add('--docked', action='store_true', help='the robot starts on its charging dock')
    add('--seed', type=int, default=0, help='of all noise (default: %(default)s)')
    add_figures(parser)
    add('--with-parent', action='store_true', help='end when standard input does')
    return parser


if __name__ == '__main__':
    sys.exit(main())
