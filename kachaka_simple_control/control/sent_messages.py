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
"""Distinguish the velocity messages of this program from the messages of other programs."""

from __future__ import annotations

from collections import deque
import threading

from kachaka_simple_control.control.timing import MAX_GUARDIAN_DELAY, MAX_TRANSIT_TIME

#: How many messages wait for a program that looks for others: it may be delayed for a moment.
MAX_QUEUED = 100


class SentMessages:
    """
    The velocity messages that this program has sent, and has not received back yet.

    A program that looks for messages of others receives its own, too, each at most once and in
    order: those before a received one that are missing were lost.  Kept are those of the last
    MAX_TRANSIT_TIME, and the MAX_QUEUED before them: no older one is received any more.  One
    thread may record while another consumes.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._sent: deque[tuple[float, bytes]] = deque()
        self._guardian_zeros: deque[float] = deque(maxlen=MAX_QUEUED)

    def record(self, now: float, data: bytes) -> None:
        """Record a velocity message, before it is sent."""
        with self._lock:
            sent = self._sent
            sent.append((now, data))
            while len(sent) > MAX_QUEUED and now - sent[MAX_QUEUED][0] > MAX_TRANSIT_TIME:
                sent.popleft()

    def record_guardian_zero(self, now: float) -> None:
        """Record that the guardian was asked for a zero, which is then of no other program."""
        self._guardian_zeros.append(now)

    def discard_old(self, now: float) -> None:
        """Remove what is older than MAX_TRANSIT_TIME: a new subscription cannot receive it."""
        with self._lock:
            while self._sent and now - self._sent[0][0] > MAX_TRANSIT_TIME:
                self._sent.popleft()

    def consume(self, data: bytes, is_zero: bool, now: float) -> bool:
        """
        Return whether this program or its guardian has sent a received message, and forget it.

        :param is_zero: whether it is a zero velocity, which the guardian may have sent
        """
        with self._lock:
            # One of this program is mostly the first; those before it are removed with it.
            for index, (_, sent) in enumerate(self._sent):
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
