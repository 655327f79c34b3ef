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
"""Tell the messages that this program sent from those of other programs; pure."""

from __future__ import annotations

from collections import deque

from kachaka_simple_control.control.timing import MAX_GUARDIAN_DELAY, MAX_TRANSIT_TIME

#: Most messages that are kept: some seconds at the highest rate.
MAX_KEPT = 4096


class SentMessages:
    """
    Messages that were sent and not received yet.

    Each message that was sent accounts for one that is received.  Those of one publisher arrive in
    order, so what was sent before a received one has been lost.  One thread records,
    another one consumes.
    """

    def __init__(self) -> None:
        self._sent: deque[tuple[float, bytes]] = deque(maxlen=MAX_KEPT)
        self._guardian_zeros: deque[float] = deque(maxlen=MAX_KEPT)

    def record(self, now: float, data: bytes) -> None:
        """Record a message, as serialized, before it is sent."""
        self._sent.append((now, data))

    def record_guardian_zero(self, now: float) -> None:
        """Record that the guardian is asked to send a zero."""
        self._guardian_zeros.append(now)

    def discard_old(self, now: float) -> None:
        """Discard what was sent too long ago to reach a subscription that begins now."""
        while self._sent and now - self._sent[0][0] > MAX_TRANSIT_TIME:
            self._sent.popleft()

    def consume(self, data: bytes, is_zero: bool, now: float) -> bool:
        """
        Remove a received message, and all that were sent before it.

        :param data: the message as received
        :param is_zero: whether it is a zero, which the guardian may have sent
        :param now: the time [s]
        :returns: whether it was sent by this program or its guardian
        """
        # A copy: the other thread goes on sending.
        for index, (_, sent) in enumerate([*self._sent]):
            if sent == data:
                for _ in range(index + 1):
                    self._sent.popleft()
                return True
        while self._guardian_zeros and now - self._guardian_zeros[0] > MAX_GUARDIAN_DELAY:
            self._guardian_zeros.popleft()
        if is_zero and self._guardian_zeros:
            self._guardian_zeros.popleft()
            return True
        return False
