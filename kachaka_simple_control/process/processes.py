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
Start child processes, read the state of processes, set priorities, end a process that hangs.

Tested by test/kachaka/test_bridge_process.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
import faulthandler
from functools import partial
import os
from pathlib import Path
import sys
import time
from typing import Any
import weakref

from kachaka_simple_control.process.output import STDERR

#: The Python code of a child process.  It removes the empty entry of the search path, which means
#: the current folder.  The reason: the user may start the program in the folder of this package,
#: and there the name ``kachaka_simple_control`` means a file, not the package.
MAIN_CODE = (
    'import sys; sys.path = [entry for entry in sys.path if entry]; '
    'from {module} import main; sys.exit(main())')
PACKAGE = Path(__file__).resolve().parent.parent
#: The states of a Linux process that a signal or a debugger has stopped.
STOPPED_STATES = ('T', 't')
#: Returns the time since the machine was started [s], including the time in suspend.  The steady
#: clock does not count the time in suspend.
boottime = partial(time.clock_gettime, time.CLOCK_BOOTTIME)
#: The increment of the nice value for a low priority.
NICENESS = 10

_called_in_children: set[weakref.WeakMethod[Any]] = set()


def call_in_forked_children(method: Callable[[], object]) -> None:
    """
    Let each forked child call a method of an object, as long as this object is in use.

    ``os.register_at_fork`` alone would keep the object, with its descriptors, until the end.
    """
    _called_in_children.add(weakref.WeakMethod(method, _called_in_children.discard))


def _call_in_child() -> None:
    for reference in list(_called_in_children):
        if (method := reference()) is not None:
            method()


os.register_at_fork(after_in_child=_call_in_child)


def python_command(module: str) -> list[str]:
    """Return the command that runs the function ``main`` of a module in a new Python process."""
    return [sys.executable, '-c', MAIN_CODE.format(module=module)]


def child_environment() -> dict[str, str]:
    """Return environment variables with which a child process can import the same modules."""
    # This also works if the package is not installed.
    entries = [Path(entry).resolve() for entry in sys.path]
    path = os.pathsep.join(str(entry) for entry in entries if entry != PACKAGE)
    return {**os.environ, 'PYTHONPATH': path}


@contextlib.contextmanager
def ended_after(timeout: float) -> Iterator[None]:
    """
    End this process with exit code 1, and print all call stacks, if a block takes too long.

    Fast DDS may hang while a node is destroyed, and Python may then run no code at all.  So a
    thread that needs no Python does it.

    :param timeout: the longest time for the block [s]
    """
    faulthandler.dump_traceback_later(timeout, file=STDERR, exit=True)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()


def is_stopped(pid: int) -> bool:
    """Return whether SIGSTOP or a debugger has suspended a process; False if this is unknown."""
    fields = _stat_fields(pid)
    return fields is not None and fields[0] in STOPPED_STATES


def is_running(pid: int) -> bool:
    """Return whether a process exists and is no zombie; False if this is unknown."""
    fields = _stat_fields(pid)
    return fields is not None and fields[0] != 'Z'


def is_in_background(pid: int) -> bool:
    """
    Return whether a process is in the background of a terminal, where Ctrl+C does not reach it.

    False if it has no terminal, or if its state is unknown.
    """
    fields = _stat_fields(pid)
    if fields is None:
        return False
    group, foreground = int(fields[2]), int(fields[5])
    return foreground not in (-1, group)


def _stat_fields(pid: int) -> list[str] | None:
    """
    Return the fields after the process name in ``/proc/<pid>/stat``; None if unreadable.

    They are: state, parent, process group, session, terminal, and the foreground process group of
    the terminal (-1 without a terminal).
    """
    try:
        status = Path(f'/proc/{pid}/stat').read_text()
    except OSError:
        return None
    # The name stands before these fields, in brackets, and may contain any character.
    return status.rpartition(')')[2].split()


def lower_priority() -> None:
    """Lower the CPU priority of this process, if the system allows it."""
    with contextlib.suppress(OSError):
        os.nice(NICENESS)


def set_idle_priority() -> None:
    """
    Let this process run only if no other process needs the CPU (SCHED_IDLE).

    One with a low priority could still delay another that wakes up.
    """
    lower_priority()
    with contextlib.suppress(AttributeError, OSError):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
