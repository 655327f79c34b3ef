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
"""Whether another process is frozen, or gone."""

from __future__ import annotations

from pathlib import Path

#: What Linux calls a process that a signal, or a debugger, has stopped.
STOPPED = ('T', 't')


def is_frozen(pid: int) -> bool:
    """
    Tell whether a process was stopped by SIGSTOP or by a debugger.

    :param pid: the number of the process
    :returns: whether it was; false where nobody can tell
    """
    return _state(pid) in STOPPED


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
