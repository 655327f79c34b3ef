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

from kachaka_simple_control.control.timing import MAX_GUARDIAN_DELAY, MAX_TRANSIT_TIME

#: The largest number of messages that are kept: some seconds at the highest rate.
MAX_KEPT = 4096


class SentMessages:
    """
    The velocity messages that this program has sent, and has not received back yet.

    This program may subscribe to its own velocity topic, to detect messages of other programs.  It
    then receives its own messages as well, each at most once, and in the order in which they were
    sent.  So when one of them is received, all earlier messages that are still missing were lost.
    One thread may record messages while another thread calls ``consume``.
    """

    def __init__(self) -> None:
        self._sent: deque[tuple[float, bytes]] = deque(maxlen=MAX_KEPT)
        self._guardian_zeros: deque[float] = deque(maxlen=MAX_KEPT)

    def record(self, now: float, data: bytes) -> None:
        """
        Record a velocity message of this program; call this before the message is sent.

        :param now: the time [s]
        :param data: the serialized message
        """
        self._sent.append((now, data))

    def record_guardian_zero(self, now: float) -> None:
        """
        Record that this program asks its guardian to publish a zero velocity.

        The guardian is a separate process that can stop the robot.  When ``consume`` later gets
        the requested message, it does not treat it as a message of another program.

        :param now: the time of the request [s]
        """
        self._guardian_zeros.append(now)

    def discard_old(self, now: float) -> None:
        """
        Remove the messages that were sent more than MAX_TRANSIT_TIME ago.

        Call this when a subscription to the velocity topic begins.  The subscription cannot
        receive such old messages.

        :param now: the time [s]
        """
        while self._sent and now - self._sent[0][0] > MAX_TRANSIT_TIME:
            self._sent.popleft()

    def consume(self, data: bytes, is_zero: bool, now: float) -> bool:
        """
        Check whether a received message was sent by this program or by its guardian.

        The guardian is a separate process that publishes zero velocities.  If one of the two sent
        the message, it is removed from the recorded messages.  If this program itself sent it, all
        its earlier messages are also removed, because they were lost.

        :param data: the received message, serialized
        :param is_zero: whether the message is a zero velocity, which the guardian may have sent
        :param now: the time [s]
        :returns: whether this program or its guardian sent the message
        """
        # Work on a copy: the other thread continues to send.
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
