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
Publish in a thread of its own, so that whoever has something to show never waits for DDS.

While somebody joins the graph, publishing may take long.  What is
only shown must not add to what the robot waits for.
"""

from __future__ import annotations

from collections.abc import Callable
from queue import SimpleQueue
import threading

from rclpy.publisher import Publisher

#: So many messages may wait for DDS; what comes then is left away.
MOST = 200
#: How long the thread may take to end [s].
PATIENCE = 1.0

#: Makes a message, in the thread that publishes it.
Make = Callable[[], bytes]


class Aside:
    """One thread for all that a node shows; it begins with the first message."""

    def __init__(self, is_open: Callable[[], bool]) -> None:
        """
        Publish nothing yet.

        :param is_open: whether anything may be published yet
        """
        self._is_open = is_open
        self._waiting: SimpleQueue[tuple[Publisher, Make] | None] = SimpleQueue()
        self._thread: threading.Thread | None = None
        self._starting = threading.Lock()
        #: what is told when something could not be made
        self.on_error: Callable[[Publisher, Exception], None] = _ignore

    def publish(self, publisher: Publisher, make: Make) -> None:
        """
        Publish something soon, in its turn; returns at once.

        :param publisher: where
        :param make: returns the message as bytes
        """
        if self._waiting.qsize() < MOST:
            self._waiting.put((publisher, make))
        if self._thread is None:
            self._start()

    def close(self) -> None:
        """Publish nothing more."""
        self._waiting.put(None)
        if self._thread is not None:
            self._thread.join(PATIENCE)

    def _start(self) -> None:
        with self._starting:
            if self._thread is None:
                self._thread = threading.Thread(target=self._serve, name='shown', daemon=True)
                self._thread.start()

    def _serve(self) -> None:
        while (waiting := self._waiting.get()) is not None:
            publisher, make = waiting
            try:
                if self._is_open():
                    self._publish(publisher, make)
            except Exception as error:  # whatever it is, the next message is another one
                self.on_error(publisher, error)

    def _publish(self, publisher: Publisher, make: Make) -> None:
        publisher.publish(make())


def _ignore(publisher: Publisher, error: Exception) -> None:
    """Tell nobody."""
