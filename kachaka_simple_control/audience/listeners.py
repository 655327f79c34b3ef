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
"""The processes that a command starts to show and to report what happens."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import sys
import time

from kachaka_simple_control.audience.audience import Audience
from kachaka_simple_control.audience.teller import Teller
from kachaka_simple_control.execution import child
from kachaka_simple_control.execution.signals import WATCH
from kachaka_simple_control.report.events import Closed

#: How long a report may take [s].
PATIENCE = 60.0
#: How long it may hold up a program that was told to end by a signal [s]; it goes on by itself.
PATIENCE_WHEN_STOPPED = 1.0
REPORTER = 'kachaka_simple_control.audience.reporter'


class Listeners:
    """
    The listeners of one program, and what it tells them in the end.

    :param audience: tells them what happens
    """

    def __init__(self, audience: Audience) -> None:
        """Have none."""
        self._audience = audience
        self._tellers: list[Teller] = []
        #: how long after the stop began odometry saw the robot still [s]; None if it did not
        self.still_after: float | None = None

    def start(self, module: str, *arguments: str) -> None:
        """
        Start one.

        :param module: its program
        :param arguments: what that is told
        """
        self.join(Teller([*child.command(module), *arguments], child.environment()))

    def join(self, teller: Teller) -> None:
        """
        Add one that was started.

        :param teller: tells it; closed in the end, in the order of joining
        """
        self._tellers.append(teller)
        self._audience.join(teller.tell)

    def dismiss(self, error: BaseException | None) -> None:
        """
        Tell them how it ended, and wait until they are done.

        :param error: why the program failed; None if it did not
        """
        self._audience.tell(Closed(
            time.monotonic(), self.still_after, WATCH.signum,
            str(error) if isinstance(error, Exception) else None))
        patience = PATIENCE if WATCH.signum is None else PATIENCE_WHEN_STOPPED
        for teller in self._tellers:
            teller.close(patience)
            if teller.deaf_because is not None:
                _say(f'what was shown or reported ends early: {teller.deaf_because}')


def _say(text: str) -> None:
    # Somebody may have closed the terminal.
    with contextlib.suppress(OSError):
        print(f'kachaka_simple_control: {text}', file=sys.stderr, flush=True)


@contextlib.contextmanager
def listeners(audience: Audience) -> Iterator[Listeners]:
    """
    Have listeners as long as a block lasts.

    :param audience: tells them what happens
    :returns: a context manager for them
    """
    those = Listeners(audience)
    try:
        yield those
    except BaseException as error:
        those.dismiss(error)
        raise
    those.dismiss(None)
