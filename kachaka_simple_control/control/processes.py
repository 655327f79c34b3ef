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
"""Start child processes; read the state of processes, set priorities, read the boot time."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
import sys
import time

#: The first entry of the search path is the folder the program was started in, which may be any:
#: even that of this package, where ``kachaka_simple_control`` is a file.
MAIN_CODE = (
    'import sys; sys.path = [entry for entry in sys.path if entry]; '
    'from {module} import main; sys.exit(main())')
PACKAGE = Path(__file__).resolve().parent.parent
#: The states of a Linux process that a signal, or a debugger, has stopped.
STOPPED_STATES = ('T', 't')
#: How much is added to the nice value.
NICENESS = 10


def python_command(module: str) -> list[str]:
    """
    Return the command that runs a module's ``main`` in a fresh Python.

    :param module: its full name
    :returns: the command, to which arguments may be added
    """
    return [sys.executable, '-c', MAIN_CODE.format(module=module)]


def child_environment() -> dict[str, str]:
    """Return an environment in which a child finds all modules that this process finds."""
    # It works, too, where this package is not installed.
    entries = [Path(entry).resolve() for entry in sys.path]
    path = os.pathsep.join(str(entry) for entry in entries if entry != PACKAGE)
    return {**os.environ, 'PYTHONPATH': path}


def boottime() -> float:
    """
    Return the time since the machine was started, sleep included [s].

    The steady clock stands still while a machine is suspended; this one goes on.
    """
    return time.clock_gettime(time.CLOCK_BOOTTIME)


def is_stopped(pid: int) -> bool:
    """Return whether SIGSTOP or a debugger stopped a process; False if that is unknown."""
    fields = _stat_fields(pid)
    return fields is not None and fields[0] in STOPPED_STATES


def is_running(pid: int) -> bool:
    """Return whether a process exists and is no zombie; False if that is unknown."""
    fields = _stat_fields(pid)
    return fields is not None and fields[0] != 'Z'


def is_in_background(pid: int) -> bool:
    """Return whether Ctrl+C misses a process: it is in the background of its terminal."""
    fields = _stat_fields(pid)
    if fields is None:
        return False
    group, foreground = int(fields[2]), int(fields[5])
    return foreground not in (-1, group)


def _stat_fields(pid: int) -> list[str] | None:
    """
    Return the fields of a process in ``/proc`` after its name; None if they are unknown.

    They begin with its state, parent, process group, session, terminal, and the terminal's
    foreground process group (-1 without a terminal).
    """
    try:
        status = Path(f'/proc/{pid}/stat').read_text()
    except OSError:
        return None
    # The name comes before, in brackets, and may hold any character.
    return status.rpartition(')')[2].split()


def lower_priority() -> None:
    """Let other processes go first."""
    with contextlib.suppress(OSError):
        os.nice(NICENESS)


def set_idle_priority() -> None:
    """
    Run only when no other process wants to.

    With a mere low priority Linux still lets a process that wakes up wait for a moment.
    """
    lower_priority()
    with contextlib.suppress(AttributeError, OSError):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
