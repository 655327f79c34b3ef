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
"""Tell messages that this program sent from those of others; pure."""

from __future__ import annotations

from collections import deque

from kachaka_simple_control.control.timing import MAX_GUARDIAN_DELAY, MAX_TRANSIT_TIME

#: How many messages are kept that were sent and not heard yet: the highest rate, for seconds.
MAX_KEPT = 4096


class SentMessages:
    """
    What was sent and has not been heard yet.

    Each message that was sent accounts for one that is heard.  Those of one publisher are heard in
    the order in which they were sent, so what was sent before one that is heard is not to come any
    more.  One thread sends, another one asks.
    """

    def __init__(self) -> None:
        """Have sent nothing."""
        self._sent: deque[tuple[float, bytes]] = deque(maxlen=MAX_KEPT)
        self._by_guardian: deque[float] = deque(maxlen=MAX_KEPT)

    def record(self, now: float, data: bytes) -> None:
        """
        Take note of a message, before it is sent.

        :param now: the time [s]
        :param data: the message as it goes on the wire
        """
        self._sent.append((now, data))

    def record_guardian_zero(self, now: float) -> None:
        """
        Take note that the guardian is asked to send a zero.

        :param now: the time [s]
        """
        self._by_guardian.append(now)

    def discard_old(self, now: float) -> None:
        """
        Forget what cannot be heard any more by whoever listens from now on.

        :param now: the time [s]
        """
        while self._sent and now - self._sent[0][0] > MAX_TRANSIT_TIME:
            self._sent.popleft()

    def consume(self, data: bytes, is_zero: bool, now: float) -> bool:
        """
        Tell whether a message that was heard is one of those sent; each is so once.

        :param data: the message as it came
        :param is_zero: whether it is a zero, which the guardian may have sent
        :param now: the time [s]
        :returns: whether it is; if not, somebody else sent it
        """
        # A copy: the sending thread goes on.
        for index, (_, sent) in enumerate([*self._sent]):
            if sent == data:
                for _ in range(index + 1):
                    self._sent.popleft()
                return True
        while self._by_guardian and now - self._by_guardian[0] > MAX_GUARDIAN_DELAY:
            self._by_guardian.popleft()
        if is_zero and self._by_guardian:
            self._by_guardian.popleft()
            return True
        return False
