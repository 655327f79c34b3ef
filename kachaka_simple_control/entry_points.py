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
The functions that start the commands of this package, such as ``kachaka_calibrate``.

The import of a command's modules takes some time.  Ctrl+C during the import ends the command at
once, without a traceback.
"""

from __future__ import annotations

from kachaka_simple_control.process.interrupts import exit_on_interrupt


def run(module: str) -> int:
    """
    Import a module of this package, and run its function ``main``.

    :param module: the name of the module within the package, as in ``commands.calibrate``
    :returns: the exit code that the function returns
    """
    exit_on_interrupt()
    # Imported only here, because before ``exit_on_interrupt`` Ctrl+C prints a traceback.
    from importlib import import_module

    from kachaka_simple_control.process.output import escape_unencodable, open_closed_streams
    open_closed_streams()
    escape_unencodable()
    code: int = import_module(f'kachaka_simple_control.{module}').main()
    return code


def calibrate() -> int:
    """Run the command ``kachaka_calibrate``, which calibrates a robot; return its exit code."""
    return run('commands.calibrate')


def compare() -> int:
    """
    Run the command ``kachaka_compare``, and return its exit code.

    The command compares several drives of the same motion.
    """
    return run('commands.compare')


def console() -> int:
    """
    Run the command ``kachaka_console``, and return its exit code.

    The command serves a page for a browser, on which a person drives a robot.
    """
    return run('console.console_command')


def fleet() -> int:
    """Run the command ``kachaka_fleet``, which drives robots in step; return its exit code."""
    return run('commands.fleet')


def bridge() -> int:
    """
    Run the command ``kachaka_bridge``, and return its exit code.

    The command connects a Kachaka, a mobile robot, to ROS 2.
    """
    return run('kachaka.bridge_command')


def simulate() -> int:
    """
    Run the command ``kachaka_sim``, and return its exit code.

    The command simulates a Kachaka, a mobile robot, with its gRPC server.
    """
    return run('kachaka.sim_command')
