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
"""The command ``kachaka_sim``, and the options of the simulated robot."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
import contextlib
import os
import signal
import sys
import threading
import time

from kachaka_simple_control.control.signals import ShutdownEvent
from kachaka_simple_control.escaping import escaped, quoted
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
from kachaka_simple_control.one_line_parser import OneLineParser

#: Of each option that is a figure of ``SimulationParameters``: name, unit, help.
PARAMETER_OPTIONS = (
    ('lag', 'S', 'time constant of the drive'),
    ('linear_acceleration', 'M/S2', 'largest change of the forward velocity'),
    ('angular_acceleration', 'RAD/S2', 'largest change of the turning velocity'),
    ('linear_gain', 'F', 'true over demanded forward velocity'),
    ('angular_gain', 'F', 'true over demanded turning velocity'),
    ('velocity_noise', 'F', 'standard deviation of the velocity, as a part of it'),
    ('odometry_noise', 'M', 'standard deviation of the position in odometry'),
    ('heading_noise', 'RAD', 'standard deviation of the heading in odometry'),
    ('undock_distance', 'M', 'how far the robot drives off its dock'),
    ('undock_velocity', 'M/S', 'how fast it does that'),
)


def add_parameter_options(parser: argparse.ArgumentParser) -> None:
    """
    Let a program take the figures.

    :param parser: the parser of its command line
    """
    for name, unit, text in PARAMETER_OPTIONS:
        parser.add_argument(
            f"--{name.replace('_', '-')}", type=float, default=getattr(SimulationParameters, name),
            metavar=unit, help=f'{text} (default: %(default)s)')


def simulation_parameters(options: argparse.Namespace) -> SimulationParameters:
    """
    Return the figures that were given.

    :param options: what the parser made of the command line
    :returns: the figures
    :raises ValueError: if no robot has one of them
    """
    return SimulationParameters(
        **{name: getattr(options, name) for name, _, _ in PARAMETER_OPTIONS})


#: What presses it: ``kill -USR1`` and the number of the process.
SIGNAL = signal.SIGUSR1


def hold_back() -> None:
    """
    Keep the signal for whoever waits for it; call it before there are any other threads.

    It is not handled but waited for, since ``ShutdownEvent`` takes any handled signal for the end.
    """
    signal.pthread_sigmask(signal.SIG_BLOCK, {SIGNAL})


@contextlib.contextmanager
def power_button(press: Callable[[], None]) -> Iterator[None]:
    """
    Let the signal press a button for the length of a ``with`` block.

    :param press: what to do each time
    :returns: a context manager
    """
    is_over = threading.Event()

    def wait() -> None:
        while signal.sigwait({SIGNAL}) and not is_over.is_set():
            press()

    thread = threading.Thread(target=wait, name='power-button')
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        # To the process, like any other: whichever thread waits for it takes it.
        os.kill(os.getpid(), SIGNAL)
        thread.join()


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
    with ShutdownEvent() as ending:
        return _main(sys.argv[1:] if args is None else args, ending)


def _main(args: Sequence[str], ending: ShutdownEvent) -> int:
    options, how = _parse(args)
    try:
        from kachaka_simple_control.kachaka.simulator.grpc_server import serving
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


def _parse(args: Sequence[str]) -> tuple[argparse.Namespace, SimulationParameters]:
    parser = _parser()
    options = parser.parse_args(args)
    try:
        return options, simulation_parameters(options)
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
    add_parameter_options(parser)
    add('--with-parent', action='store_true', help='end when standard input does')
    return parser


if __name__ == '__main__':
    sys.exit(main())
