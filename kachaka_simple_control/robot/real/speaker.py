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
"""Say things without waiting until they are said: a terminal may be held."""

from __future__ import annotations

from collections.abc import Callable
import queue
import threading
import time

from kachaka_simple_control.robot.real.error_texts import Level

#: The same text is said again only after so many seconds without it.
QUIET = 1.0
#: How long to wait at the end until everything is said [s].
PATIENCE = 0.5


class Speaker:
    """Says what it is told in a thread of its own."""

    def __init__(self, say: Callable[[Level, str], None]) -> None:
        """
        Say nothing yet.

        :param say: says a text; may take its time
        """
        self._say = say
        self._texts: queue.SimpleQueue[tuple[Level, str] | None] = queue.SimpleQueue()
        self._heard: dict[str, float] = {}
        self._thread = threading.Thread(target=self._run, name='speaker', daemon=True)
        self._thread.start()

    def tell(self, level: Level, text: str) -> None:
        """
        Have something said; returns at once.

        :param level: how bad it is
        :param text: the text; not said while the same one is repeated
        """
        now = time.monotonic()
        # Texts have figures in them: what was not heard lately is forgotten.
        self._heard = {known: at for known, at in self._heard.items() if now - at < QUIET}
        if text not in self._heard:
            self._texts.put((level, text))
        self._heard[text] = now

    def close(self) -> None:
        """Say what is left."""
        self._texts.put(None)
        self._thread.join(PATIENCE)

    def _run(self) -> None:
        while (one := self._texts.get()) is not None:
            self._say(*one)
