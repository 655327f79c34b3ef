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
"""The command ``kachaka_sim``, which runs a simulated Kachaka robot with a gRPC server."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
import contextlib
import os
import signal
import sys
import threading
import time

from kachaka_simple_control.kachaka.program import (
    add_floor_option,
    add_parent_option,
    add_simulation_options,
    ExitError,
    find_option_floor,
    listen_problem,
    PORT,
    run_until_shutdown,
    SDK_MISSING,
    simulation_parameters,
)
from kachaka_simple_control.kachaka.simulator.contact import Contact
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka, USUAL_LASER
from kachaka_simple_control.process.exit_codes import BAD_USAGE, FAULTED, OneLineParser
from kachaka_simple_control.process.signals import ShutdownEvent
from kachaka_simple_control.text import escaped, quoted

PROGRAM = 'kachaka_sim'
#: The signal that presses the simulated robot's power button: ``kill -USR1 PROCESS_ID``.
POWER_BUTTON_SIGNAL = signal.SIGUSR1


@contextlib.contextmanager
def power_button(press: Callable[[], None]) -> Iterator[None]:
    """
    Call a function at each SIGUSR1, the simulated robot's power button, during a ``with`` block.

    The caller must block the signal in all threads: one of its own waits for it.
    """
    is_over = threading.Event()

    def wait() -> None:
        while signal.sigwait({POWER_BUTTON_SIGNAL}) and not is_over.is_set():
            press()

    thread = threading.Thread(target=wait, name='power-button')
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        # Wake the waiting thread: its sigwait() receives this signal.
        os.kill(os.getpid(), POWER_BUTTON_SIGNAL)
        thread.join()


def main(args: Sequence[str] | None = None) -> int:
    """Run a simulated robot with a gRPC server until a signal ends the program."""
    # Block the signal before the first thread starts, so that all threads block it.  Do not set a
    # handler for it, because ShutdownEvent ends the program at each handled signal.
    signal.pthread_sigmask(signal.SIG_BLOCK, {POWER_BUTTON_SIGNAL})
    return run_until_shutdown(
        PROGRAM, lambda shutdown: _run(sys.argv[1:] if args is None else args, shutdown))


def _run(args: Sequence[str], shutdown: ShutdownEvent) -> None:
    parser = OneLineParser(
        prog=PROGRAM, allow_abbrev=False,
        description='Simulate a Kachaka that speaks gRPC as the real one does.  Needs no ROS.',
        epilog='Signal USR1 presses its power button: a pause, or its end.')
    add = parser.add_argument
    add('--grpc-port', type=_port, default=PORT, metavar='PORT',
        help='where to listen; 0: any port that is free (default: %(default)s)')
    add('--host', default='127.0.0.1',
        help='the address to listen at; 0.0.0.0: all of this machine (default: %(default)s)')
    add_simulation_options(parser, 'the robot')
    add_floor_option(parser, 'the robot')
    add_parent_option(parser)
    options = parser.parse_args(args)
    parameters = simulation_parameters(parser, options)
    file = find_option_floor(options)
    try:
        from kachaka_simple_control.kachaka.simulator.grpc_server import serving
    except (ImportError, RuntimeError) as error:
        raise ExitError(FAULTED, SDK_MISSING.format(error=error)) from None
    robot = SimulatedKachaka(
        time.monotonic(), parameters, bool(options.docked), options.seed or 0,
        None if file is None else file.floor, file.laser if file else USUAL_LASER)

    def on_contact(contact: Contact) -> None:
        print(f'{PROGRAM}: {contact}', file=sys.stderr, flush=True)

    try:
        with serving(
                robot, options.grpc_port, options.host, on_contact=on_contact,
                ) as server, power_button(
                    lambda: server.call(SimulatedKachaka.press_power_button)):
            print(f'ready: simulated Kachaka at {server.address}', flush=True)
            shutdown.wait(options.with_parent)
    except (OSError, UnicodeError) as error:
        reason = listen_problem(error, '--grpc-port')
        where = f'{escaped(options.host, 60)}:{options.grpc_port}'
        raise ExitError(BAD_USAGE, f'cannot listen at {where}: {reason}') from None


def _port(text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 10 and int(text) <= 65535):
        raise argparse.ArgumentTypeError(
            f'{quoted(text, 60)} is no port; it must be a whole number from 0 to 65535')
    return int(text)


if __name__ == '__main__':
    sys.exit(main())
