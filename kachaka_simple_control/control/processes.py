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
"""Start child processes, and tell their state, priority and the time since boot."""

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


def python_command(module: str) -> list[str]:
    """
    Return what runs a module's ``main`` in a fresh Python.

    :param module: its full name
    :returns: the command, to which arguments may be added
    """
    return [sys.executable, '-c', MAIN_CODE.format(module=module)]


def child_environment() -> dict[str, str]:
    """
    Return an environment in which a child finds all that this process finds.

    :returns: the environment; it works, too, where this package is not installed
    """
    entries = [Path(entry).resolve() for entry in sys.path]
    path = os.pathsep.join(str(entry) for entry in entries if entry != PACKAGE)
    return {**os.environ, 'PYTHONPATH': path}


def boottime() -> float:
    """
    Return the time since the machine was started, sleep included [s].

    The steady clock stands still while a machine is suspended; this one tells that it was.
    """
    return time.clock_gettime(time.CLOCK_BOOTTIME)


#: What Linux calls a process that a signal, or a debugger, has stopped.
STOPPED_STATES = ('T', 't')


def is_stopped(pid: int) -> bool:
    """
    Tell whether a process was stopped by SIGSTOP or by a debugger.

    :param pid: the number of the process
    :returns: whether it was; false where nobody can tell
    """
    return _state(pid) in STOPPED_STATES


def is_running(pid: int) -> bool:
    """
    Tell whether a process is there and no zombie, which its parent has yet to collect.

    :param pid: the number of the process
    :returns: whether it is; false where nobody can tell
    """
    return _state(pid) not in (None, 'Z')


def _state(pid: int) -> str | None:
    """Return what Linux calls the state of a process; None if nobody can tell."""
    try:
        status = Path(f'/proc/{pid}/stat').read_text()
    except OSError:
        return None
    # Its name comes before, in brackets, and may hold any character.
    return status.rpartition(')')[2].split()[0]


#: How much lower than others the priority is.
NICENESS = 10


def lower_priority() -> None:
    """Let others go first."""
    with contextlib.suppress(OSError):
        os.nice(NICENESS)


def set_idle_priority() -> None:
    """
    Run only when nobody else wants to.

    With a mere low priority Linux still lets somebody who wakes up wait for a moment.
    """
    lower_priority()
    with contextlib.suppress(AttributeError, OSError):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
