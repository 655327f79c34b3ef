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
"""Release several robots at the same time, even while Python shuts down."""

from __future__ import annotations

from collections.abc import Callable
import contextlib
from queue import SimpleQueue
import threading

Close = Callable[[], None]


class Closers:
    """
    A list of functions that stop and release robots; ``close_all`` calls them in parallel.

    ``add`` starts a thread for each, which waits for ``close_all``: from Python 3.12 on, no thread
    can start while Python shuts down.
    """

    def __init__(self) -> None:
        self._closers: dict[Close, _Closer] = {}

    def add(self, close: Close, group: object) -> None:
        """
        Add a close function; do nothing if Python shuts down already.

        :param close: it may be called more than once, and from any thread
        :param group: any object, for example a ROS context, by which ``close_all`` can select
        """
        closer = _Closer(close, group)
        with contextlib.suppress(RuntimeError):  # the program ends already: no thread can start
            closer.start()
            self._closers[close] = closer

    def remove(self, close: Close) -> None:
        """Remove a close function without calling it, because its robot was already released."""
        closer = self._closers.pop(close, None)
        if closer is not None:
            closer.is_wanted.put(False)

    def close_all(self, group: object | None = None) -> None:
        """
        Call all close functions at the same time, wait until they have returned, and remove them.

        :param group: only those that were added with it; None for all
        """
        chosen = [closer for closer in [*self._closers.values()]
                  if group is None or closer.group is group]
        for closer in chosen:
            self._closers.pop(closer.close, None)
        last = chosen.pop() if chosen else None
        for closer in chosen:
            closer.is_wanted.put(True)
        if last is not None:
            last.is_wanted.put(False)
            last.close()
        for closer in chosen:
            closer.join()


class _Closer(threading.Thread):
    """A thread that waits, and then calls a close function or ends without the call."""

    def __init__(self, close: Close, group: object) -> None:
        super().__init__(name='closer', daemon=True)
        self.close, self.group = close, group
        #: receives one value: True to call the close function, False to end without the call
        self.is_wanted: SimpleQueue[bool] = SimpleQueue()

    def run(self) -> None:
        """Wait for the word whether the function is to be called."""
        if self.is_wanted.get():
            self.close()
