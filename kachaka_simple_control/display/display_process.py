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
The process that shows a drive, as the program that drives keeps it.

The program that drives imports this module: it must load quickly, and without rich.
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
#: How long the display may take to clear the terminal at the end [s].
DISPLAY_EXIT_TIMEOUT = 1.0


class DisplayProcess(SubscriberProcess):
    """
    The process that shows a drive; this side restores the terminal.

    A display that was killed cannot do that: it is done here, at once, so that what it drew last
    is not taken for news.  One that hangs in the end is killed; but one that waits for a terminal
    which takes nothing, after Ctrl+S, clears it when it does.
    """

    def __init__(self) -> None:
        super().__init__(processes.python_command(DISPLAY_MODULE))
        self._restoring = threading.Thread(target=self._restore, name='display', daemon=True)
        self._restoring.start()

    def close(self, timeout: float) -> int | None:
        """
        Close the pipe and wait for the process to exit.

        :param timeout: how long to wait at most [s]
        :returns: its exit code; None if it waits for the terminal
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
