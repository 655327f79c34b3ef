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
Start, close and clean up the display process of a drive.

The driving program imports this module, so it must load quickly, and without rich.
"""

from __future__ import annotations

import contextlib
import os
import threading

from kachaka_simple_control.control import processes
from kachaka_simple_control.control.output import has_room, STDERR
from kachaka_simple_control.display.terminal import is_terminal, RELEASE_ROWS
from kachaka_simple_control.telemetry.subscriber_process import SubscriberProcess

DISPLAY_MODULE = 'kachaka_simple_control.display.display_program'
#: The time that the display has to clear the terminal at the end [s].
DISPLAY_EXIT_TIMEOUT = 1.0


class DisplayProcess(SubscriberProcess):
    """
    The display process of a drive, as the driving program controls it.

    If the display is killed, this class restores the terminal at once, so that no outdated panel
    remains.  If the display does not exit at the end, it is killed.  If the terminal is blocked
    by Ctrl+S, the display keeps running, and clears the terminal after Ctrl+Q.
    """

    def __init__(self) -> None:
        super().__init__(processes.python_command(DISPLAY_MODULE))
        self._restoring = threading.Thread(target=self._restore, name='display', daemon=True)
        self._restoring.start()

    def close(self, timeout: float) -> int | None:
        """
        Close the pipe and wait for the process to exit.

        :param timeout: the longest wait [s]
        :returns: the exit code; None if the process still waits for the terminal
        """
        if super().close(min(timeout, DISPLAY_EXIT_TIMEOUT)) is None:
            if not has_room(STDERR):
                return None
            self._process.kill()
        code = self._process.wait()
        self._restoring.join(DISPLAY_EXIT_TIMEOUT)
        return code

    def _restore(self) -> None:
        if self._process.wait() != 0 and is_terminal(STDERR):
            with contextlib.suppress(OSError):
                os.write(STDERR, RELEASE_ROWS.encode())
