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
"""The command ``kachaka_console``: watch, drive and stop robots with a page in a browser."""

from __future__ import annotations

import argparse
import asyncio
from collections.abc import Sequence
import contextlib
from functools import partial
import os
import signal
import sys
import threading
from typing import TYPE_CHECKING
import webbrowser

from kachaka_simple_control.console.base_console import BaseConsole, DriveFactory
from kachaka_simple_control.console.console import Console
from kachaka_simple_control.console.drive_process import (
    drive_command,
    DriveProcess,
    fleet_command,
)
from kachaka_simple_control.console.fleet_console import FleetConsole
from kachaka_simple_control.console.folder import Folder, FolderError
from kachaka_simple_control.console.preview import PreviewWorker
from kachaka_simple_control.console.reports import Reports
from kachaka_simple_control.console.running_drive import RunningDrive
from kachaka_simple_control.console.security import bracketed, is_loopback, Tokens
from kachaka_simple_control.errors import TORNADO_MISSING, UsageError
from kachaka_simple_control.files.document import FileError
from kachaka_simple_control.files.fleet_file import find_fleet
from kachaka_simple_control.files.robot_profile import find_robot
from kachaka_simple_control.kachaka.program import (
    add_floor_option,
    add_simulation_options,
    address_argument,
    ExitError,
    find_option_floor,
    floor_words,
    listen_problem,
    simulation_parameters,
    simulation_words,
)
from kachaka_simple_control.process.exit_codes import (
    BAD_USAGE,
    DONE,
    FAULTED,
    OneLineParser,
    SIGNALLED,
)
from kachaka_simple_control.text import escaped, quoted

if TYPE_CHECKING:
    from kachaka_simple_control.console.server import ConsoleServer

PROGRAM = 'kachaka_console'
PORT = 8400
ROS_ARGUMENTS = '--ros-args'
#: How long the server goes on after a drive beside it has ended, to send the end to all pages [s].
LAST_MESSAGES = 0.3
#: The options that only the console of one robot has, by name.
OF_ONE_ROBOT = ('robot', 'address', 'folder', 'beside')
EPILOG = """
exit codes: 0 done; 1 faulted; 2 bad usage; 128 + N ended by signal N
"""


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the console until a signal ends it.

    :param args: the command line arguments without the program's name; default: ``sys.argv[1:]``
    """
    options = parse(sys.argv[1:] if args is None else args)
    try:
        reports = Reports(options.reports)
        _require_usable(options, reports)
        return run(options, drive_factory(options, reports), reports)
    except ExitError as error:
        print(f'{PROGRAM}: {escaped(error, 400)}', file=sys.stderr)
        return error.code
    except KeyboardInterrupt:
        return SIGNALLED + signal.SIGINT


def parse(args: Sequence[str]) -> argparse.Namespace:
    """
    Parse the command line arguments.

    :param args: the arguments without the program's name
    :returns: the values of the options; ``ros_arguments`` are those from ``--ros-args`` on, for
        the drive process
    """
    own, ros = list(args), []
    if ROS_ARGUMENTS in own:
        start = own.index(ROS_ARGUMENTS)
        own, ros = own[:start], own[start:]
    parser = _parser()
    options = parser.parse_args(own)
    simulation = simulation_words(vars(options))
    if options.fleet is not None:
        _refuse_one_robot(parser, options, simulation)
    elif options.allow_near:
        parser.error('--allow-near is about the robots of --fleet')
    simulation = (*simulation, *floor_words(vars(options)))
    if simulation and not options.sim:
        parser.error(f'{simulation[0].partition("=")[0]} is about the simulated robot of --sim')
    simulation_parameters(parser, options)
    options.ros_arguments, options.simulation = ros, simulation
    return options


def _refuse_one_robot(
        parser: OneLineParser, options: argparse.Namespace, simulation: Sequence[str]) -> None:
    if simulation:
        parser.error(
            f'{simulation[0].partition("=")[0]} is about one robot: the file of a fleet gives the '
            'errors of each (simulation)')
    for name in OF_ONE_ROBOT:
        if getattr(options, name) is not None:
            parser.error(
                f'--{name} is for the console of one robot: leave out --{name}, or --fleet')


def drive_options(options: argparse.Namespace) -> list[str]:
    """Return the options for the drive process."""
    words = ['--sim'] if options.sim else []
    words += ['--allow-near'] if options.allow_near else []
    for name in ('robot', 'address'):
        value = getattr(options, name)
        words += [f'--{name}={value}'] if value is not None else []
    return [*words, *options.simulation, *options.ros_arguments]


def needs_token(options: argparse.Namespace) -> bool:
    """Return whether a page can be opened only by one of the links that are printed."""
    return options.token or not is_loopback(options.host)


def drive_factory(options: argparse.Namespace, reports: Reports) -> DriveFactory:
    """Return a function that makes the drive process of a console."""
    if options.fleet is not None:
        return partial(DriveProcess, partial(
            fleet_command, options.fleet, drive_options(options), reports.options))
    if options.beside is not None:
        return partial(RunningDrive, *options.beside)
    return partial(
        DriveProcess, partial(drive_command, drive_options(options), reports.options))


def run(
        options: argparse.Namespace, make_drive: DriveFactory,
        reports: Reports | None = None) -> int:
    """
    Run the console until a signal ends it, or until the drive beside which it runs has ended.

    :param reports: the reports of the drives; None for none
    :returns: the exit code
    :raises ExitError: if tornado is missing, or the console cannot listen or open its folder
    """
    try:
        import tornado  # noqa: F401
    except ImportError:
        raise ExitError(FAULTED, TORNADO_MISSING) from None
    return asyncio.run(_run(options, make_drive, reports or Reports(None)))


def _require_usable(options: argparse.Namespace, reports: Reports) -> None:
    """
    Refuse files and a folder of reports with which each drive process would fail.

    :raises ExitError: if there is none of this name, its file is invalid, or no report can be
        written
    """
    try:
        if options.robot is not None:
            find_robot(options.robot)
        if options.fleet is not None:
            find_fleet(options.fleet)
        find_option_floor(options)
        reports.require_writable()
    except FileError as error:
        # One line, also for a profile with several problems.
        raise ExitError(BAD_USAGE, str(error).splitlines()[0]) from None
    except UsageError as error:
        raise ExitError(BAD_USAGE, error) from None


def _parser() -> OneLineParser:
    parser = OneLineParser(
        prog=PROGRAM, allow_abbrev=False, epilog=EPILOG,
        description='Watch, drive and stop robots with a page in a browser.')
    parser.takes_ros_arguments = True
    parser.advice['--rate'] = f'write, for example, {ROS_ARGUMENTS} -p rate:=50.0'
    add = parser.add_argument
    add('--port', type=_port, default=PORT, metavar='PORT',
        help='where to listen; 0: any port that is free (default: %(default)s)')
    add('--host', default='127.0.0.1', metavar='HOST',
        help='the address of this machine at which to listen; another than the default can be '
             'reached by other machines, and only with one of the links that are printed')
    add('--allow-host', action='append', default=[], metavar='NAME',
        help='a further name of this machine in the links of browsers')
    add('--token', action='store_true',
        help='need a link with a token on this machine as well, because others use it too')
    add('--folder', metavar='DIR',
        help='offer the motion files of this folder, and save there (default: save nothing)')
    add('--reports', metavar='DIR',
        help='write a report of the drives between two releases of the robot to DIR/1, DIR/2, ...')
    add('--no-browser', action='store_true', help='do not open the page in a browser')
    robot = parser.add_mutually_exclusive_group().add_argument
    robot('--sim', action='store_true', help='start a simulated Kachaka')
    robot('--address', type=lambda text: str(address_argument(text)), metavar='HOST',
          help='connect to the real Kachaka at this address, HOST or HOST:PORT')
    add('--robot', metavar='NAME',
        help='kachaka, turtlebot3, generic, or the path of a profile (default: kachaka)')
    add('--fleet', metavar='FILE',
        help='watch, run and stop the robots of this fleet: the path of its file, or the name of '
             'one that comes with the package')
    add('--allow-near', action='store_true',
        help='with --fleet: drive also where two robots come closer than the margin')
    group = parser.add_argument_group('errors of the simulated robot, with --sim')
    add_simulation_options(group, 'the simulated robot')
    add_floor_option(group, 'a simulated robot')
    # For a drive with --console, which starts this program.
    add('--beside', type=_beside, help=argparse.SUPPRESS)
    add(ROS_ARGUMENTS, action='store_true', default=argparse.SUPPRESS,
        help='everything after it is for ROS: remaps, parameters (-p robot_timeout:=30), ...')
    return parser


def _beside(text: str) -> tuple[int, int, int]:
    reports, commands, pid = map(int, text.split(','))
    return reports, commands, pid


def _port(text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 10 and int(text) <= 65535):
        raise argparse.ArgumentTypeError(
            f'{quoted(text, 60)} is no port; it must be a whole number from 0 to 65535')
    return int(text)


async def _run(
        options: argparse.Namespace, make_drive: DriveFactory, reports: Reports) -> int:
    loop, ended = asyncio.get_running_loop(), asyncio.Event()
    signals: list[int] = []

    def end(signum: int) -> None:
        signals.append(signum)
        ended.set()

    for signum in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        loop.add_signal_handler(signum, end, signum)
    tokens = Tokens() if needs_token(options) else None
    console = _console(options, make_drive, reports)
    try:
        server = _server(console, options, tokens)
    except (OSError, UnicodeError) as error:
        reason = listen_problem(error, '--port')
        where = f'{escaped(options.host, 60)}:{options.port}'
        raise ExitError(BAD_USAGE, f'cannot listen at {where}: {reason}') from None
    console.start()
    try:
        link = _print_links(options, server.port, tokens)
        if not options.no_browser and _has_screen():
            # Some browsers return only when they are closed.
            threading.Thread(target=webbrowser.open, args=(link,), daemon=True).start()
        if isinstance(console.drive, RunningDrive):
            await _until_over(console.drive, ended)
        else:
            await ended.wait()
    finally:
        # The drive process first: without its console it must not go on.
        await console.close()
        await server.close()
    return SIGNALLED + signals[0] if signals else DONE


def _console(
        options: argparse.Namespace, make_drive: DriveFactory, reports: Reports) -> BaseConsole:
    if options.fleet is not None:
        return FleetConsole(make_drive, reports)
    try:
        folder = Folder(options.folder)
    except FolderError as error:
        raise ExitError(BAD_USAGE, error) from None
    return Console(make_drive, folder, PreviewWorker(options.robot, folder), reports)


def _server(
        console: BaseConsole, options: argparse.Namespace, tokens: Tokens | None) -> ConsoleServer:
    # It imports tornado, which may be missing.
    from kachaka_simple_control.console.server import ConsoleServer
    names = tuple(options.allow_host)
    with contextlib.ExitStack() as stack:
        if options.beside is not None:
            # Another drive may have its page there.
            stack.enter_context(contextlib.suppress(OSError))
        return ConsoleServer(console, options.host, options.port, tokens, names)
    return ConsoleServer(console, options.host, 0, tokens, names)


async def _until_over(drive: RunningDrive, ended: asyncio.Event) -> None:
    """Wait until a drive or the console has ended, and its end was shown."""
    waits = [asyncio.ensure_future(event.wait()) for event in (drive.has_ended, ended)]
    await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
    for wait in waits:
        wait.cancel()
    await asyncio.sleep(LAST_MESSAGES)


def _print_links(options: argparse.Namespace, port: int, tokens: Tokens | None) -> str:
    host = 'localhost' if options.host in ('0.0.0.0', '::') else options.host
    if options.allow_host:
        host = options.allow_host[0]
    page = f'http://{bracketed(host)}:{port}/'
    if tokens is None:
        print(f'ready: {page}', flush=True)
        return page
    link = f'{page}?token={tokens.driver}'
    print(f'ready: {link}', flush=True)
    print(f'to look and stop only: {page}?token={tokens.viewer}', flush=True)
    return link


def _has_screen() -> bool:
    """Return whether a browser can open a window; another would take over the terminal."""
    return sys.platform == 'darwin' or any(
        name in os.environ for name in ('DISPLAY', 'WAYLAND_DISPLAY'))


if __name__ == '__main__':
    sys.exit(main())
