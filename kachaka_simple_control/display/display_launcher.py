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
"""The side of the program that drives of the one that shows it."""

from __future__ import annotations

import contextlib
import os
import threading

from kachaka_simple_control.control import processes
from kachaka_simple_control.control.output import has_room, STDERR
from kachaka_simple_control.display import terminal
from kachaka_simple_control.display.renderers import has_terminal
from kachaka_simple_control.telemetry.subscriber_process import SubscriberProcess

DISPLAY_MODULE = 'kachaka_simple_control.display.display_process'
#: How long it may take to clear the terminal [s]; there is nothing worth waiting for.
DISPLAY_EXIT_TIMEOUT = 1.0


class DisplayProcess(SubscriberProcess):
    """
    Tells a display what happens, and sees to it that the terminal is left as it was found.

    A display that was killed cannot do that: it is done in its place, at once, so that nobody
    takes for news what it drew last.  One that hangs in the end is killed; but one that waits for
    a terminal which takes nothing, after Ctrl+S, clears it when it does.
    """

    def __init__(self) -> None:
        """Start it."""
        super().__init__(processes.python_command(DISPLAY_MODULE))
        self._clearing = threading.Thread(target=self._clear, name='display', daemon=True)
        self._clearing.start()

    def close(self, timeout: float) -> int | None:
        """
        Tell it that nothing follows, and wait for its end.

        :param timeout: how long to wait at most [s]
        :returns: its exit code; None if it waits for the terminal
        """
        if super().close(min(timeout, DISPLAY_EXIT_TIMEOUT)) is None:
            if not has_room(STDERR):
                return None
            self._process.kill()
        code = self._process.wait()
        self._clearing.join(DISPLAY_EXIT_TIMEOUT)
        return code

    def _clear(self) -> None:
        if self._process.wait() != 0 and has_terminal(STDERR):
            with contextlib.suppress(OSError):
                os.write(STDERR, terminal.RELEASE_ROWS.encode())


def should_display(is_lesson: bool) -> bool:
    """
    Tell whether a display has anything to show.

    :param is_lesson: whether the movements are told one by one by the node's log lines anyway
    :returns: whether it does: always on a terminal
    """
    return not is_lesson or has_terminal(STDERR)
