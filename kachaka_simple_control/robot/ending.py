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
"""What ends a program that serves: a signal, its parent's end, or itself."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import sys
from types import TracebackType

#: What asks a program to end.
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Ending:
    """
    Something to wait for; enter it in the main thread, before anything that takes its time.

    Signals are noted in a pipe and otherwise left without effect, so that none of them interrupts
    a start or leaves a traceback.  One that was ignored (nohup) stays ignored.
    """

    def __init__(self) -> None:
        """Wait for nothing yet."""
        self._reader, self._writer = os.pipe()
        # Python writes to it from within the signal, where waiting is no choice.
        os.set_blocking(self._writer, False)

    def __enter__(self) -> Ending:
        """Listen to signals from now on, for the rest of the process."""
        signal.set_wakeup_fd(self._writer, warn_on_full_buffer=False)
        for signum in SIGNALS:
            if signal.getsignal(signum) != signal.SIG_IGN:
                signal.signal(signum, lambda *_: None)
        return self

    def __exit__(
            self,
            kind: type[BaseException] | None,
            error: BaseException | None,
            traceback: TracebackType | None) -> None:
        """Keep the handlers, so that a second signal does not cut the ending short."""

    def end(self) -> None:
        """End; from any thread."""
        with contextlib.suppress(BlockingIOError):
            os.write(self._writer, b'\0')

    def wait(self, with_parent: bool) -> None:
        """
        Return when it is time to end.

        :param with_parent: whether to end, too, when standard input does: a parent that holds
            its other end can be killed without leaving this process behind
        """
        sources = [self._reader] + with_parent * [sys.stdin.fileno()]
        while True:
            readable = select.select(sources, [], [])[0]
            if self._reader in readable or not os.read(readable[0], 4096):
                return
