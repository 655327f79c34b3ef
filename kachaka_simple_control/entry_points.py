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
The entry points of the commands.

During the slow import of modules, Ctrl+C ends a command at once, without a traceback.
"""

from __future__ import annotations

from kachaka_simple_control.control.interrupts import exit_on_interrupt


def run(module: str) -> int:
    """
    Run the function ``main`` of a module of this package.

    :param module: the name of the module within the package
    :returns: the exit code
    """
    exit_on_interrupt()
    # Imported only here, because before ``exit_on_interrupt`` Ctrl+C prints a traceback.
    from importlib import import_module

    from kachaka_simple_control.control.output import open_closed_streams
    open_closed_streams()
    code: int = import_module(f'kachaka_simple_control.{module}').main()
    return code


def calibrate() -> int:
    """Run the command ``kachaka_calibrate``; return its exit code."""
    return run('commands.calibrate')


def compare() -> int:
    """Run the command ``kachaka_compare``; return its exit code."""
    return run('commands.compare')


def bridge() -> int:
    """Run the command ``kachaka_bridge``; return its exit code."""
    return run('kachaka.bridge_command')


def simulate() -> int:
    """Run the command ``kachaka_sim``; return its exit code."""
    return run('kachaka.sim_command')
