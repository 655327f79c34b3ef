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
"""The independent observer: the robot of the tests, in a process that none of the loops is in."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import itertools
from pathlib import Path
import sys
import time

from benchmarks.wire import Row

TESTS = Path(__file__).resolve().parent.parent / 'test'
sys.path.append(str(TESTS))  # where the listener is

from listener import Heard, Listener  # noqa: E402

#: How long a robot has been there before a program is started [s].
AT_HOME = 2.0
_NUMBERS = itertools.count(1)


class Robot(Listener):
    """
    Subscribes as the official bridge does: best effort, a queue of five.

    Times are those that DDS stamps on a message when it is sent, so that how fast this process
    reads does not matter.  Each robot has a namespace of its own: a program that was killed is
    still seen on the graph for a while, and counts as somebody else who drives.
    """

    def __init__(self, namespace: str | None = None) -> None:
        """
        Be there, and listen from entering the ``with`` block on.

        :param namespace: where; None for a new one
        """
        self.namespace = namespace or new_namespace()
        super().__init__(self.namespace)

    def rows(self, mark: int = 0) -> list[Row]:
        """
        Return what was heard.

        :param mark: how many messages to leave out
        :returns: time and forward velocity of each message
        """
        return [Row(heard.time, heard.linear_x) for heard in self.heard[mark:]]

    def first(
            self, condition: Callable[[Heard], bool], mark: int, timeout: float) -> Heard | None:
        """
        Return the first message that fits, as soon as it is there.

        :param condition: what fits
        :param mark: how many messages to leave out
        :param timeout: how long to wait for one [s]
        :returns: the message; None if none came in time
        """
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            heard = self.heard[mark:]
            mark += len(heard)
            fitting = [message for message in heard if condition(message)]
            if fitting:
                return fitting[0]
            time.sleep(0.005)
        return None

    @property
    def publishers(self) -> int:
        """Return how many publishers of velocities this robot knows of."""
        return self._node.count_publishers(self._subscription.topic_name)


def new_namespace() -> str:
    """
    Return a namespace that no robot has had.

    :returns: the namespace
    """
    return f'bench_{next(_NUMBERS)}'


def robots(count: int, lasting: bool) -> Iterator[Robot]:
    """
    Have a robot for each of several programs; each has been there for a while when it is met.

    :param count: how many programs
    :param lasting: whether one robot serves all of them; a program that was killed is still seen
        for a while, so that the next one needs a robot of its own
    :returns: the robots; each ends when the next is asked for
    """
    for _ in range(1 if lasting else count):
        with Robot() as robot:
            time.sleep(AT_HOME)
            yield from itertools.repeat(robot, count if lasting else 1)


def moves(heard: Heard) -> bool:
    """
    Tell whether a message asks for motion.

    :param heard: the message
    :returns: whether it does
    """
    return heard.moves


def rests(heard: Heard) -> bool:
    """
    Tell whether a message asks for rest.

    :param heard: the message
    :returns: whether it does
    """
    return not heard.moves
