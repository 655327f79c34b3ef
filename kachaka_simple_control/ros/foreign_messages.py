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
"""Velocities that others send to our robot."""

from __future__ import annotations

from collections.abc import Callable
import time

from kachaka_simple_control.control.timing import FOREIGN_MESSAGE_MAX_AGE, LISTEN_TIME
from kachaka_simple_control.control.waiting import wait_until
from kachaka_simple_control.errors import RobotTakenError
from kachaka_simple_control.escaping import escaped
from kachaka_simple_control.ros.velocity_publisher import is_zero, VelocityPublisher
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

#: Best effort hears everybody; the depth is for a thread that is held up for a moment.
LISTENER_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
#: What stands in place of a node's name that discovery does not tell, as between distros.
UNKNOWN = '_NODE_NAME_UNKNOWN_'


class ForeignMessages:
    """
    Listens to the velocities of a robot, while somebody else has a publisher of them.

    A publisher alone says nothing: it may never send.  While none of others is listed, nobody
    listens, and it costs nothing.
    """

    def __init__(
            self, node: Node, publisher: VelocityPublisher, others: Callable[[], list[str]],
            is_latched: Callable[[], bool], on_message: Callable[[str], None]) -> None:
        """
        Listen to nobody yet.

        :param node: the node that publishes
        :param publisher: its publisher of velocities
        :param others: returns the names of the nodes of others that have a publisher
        :param is_latched: tells whether the guardian stops the robot: then zeros are its own
        :param on_message: called with who may have sent it, for each message of others, in the
            thread that serves callbacks
        """
        self._node = node
        self._publisher = publisher
        self._others = others
        self._is_latched = is_latched
        self._on_message = on_message
        self._subscription: Subscription | None = None
        self._names: list[str] = []
        self._heard = float('-inf')
        #: whether somebody waits for the answer, who need not be told as well
        self._is_asked = False
        # In a group of its own, so that no other callback holds it up.
        self._group = MutuallyExclusiveCallbackGroup()

    def update(self) -> bool:
        """
        Look who else has a publisher, and listen as long as somebody has.

        :returns: whether somebody has
        """
        self._names = self._others()
        if self._names and self._subscription is None:
            self._publisher.sent.discard_old(time.monotonic())
            self._subscription = self._node.create_subscription(
                self._publisher.msg_type, self._publisher.topic_name, self._hear, LISTENER_QOS,
                callback_group=self._group, raw=True)
        elif not self._names and self._subscription is not None:
            subscription, self._subscription = self._subscription, None
            self._node.destroy_subscription(subscription)
        return bool(self._names)

    def has_recent(self, now: float) -> bool:
        """
        Tell whether somebody else drives the robot.

        :param now: the time [s on the steady clock]
        :returns: whether a message of others came a short time ago
        """
        return now - self._heard <= FOREIGN_MESSAGE_MAX_AGE

    def detect(self, check: Callable[[], None] = lambda: None) -> bool:
        """
        Listen for a while whether somebody else drives the robot; at once if nobody could.

        :param check: called while waiting; what it raises ends the wait
        :returns: whether somebody does
        """
        if not self.update():
            return False
        self._is_asked = True
        try:
            return wait_until(lambda: self.has_recent(time.monotonic()), LISTEN_TIME, check)
        finally:
            self._is_asked = False

    def require_none(self, check: Callable[[], None]) -> None:
        """
        Make sure that nobody else drives the robot; for use before it is taken.

        :param check: called while waiting; what it raises ends the wait
        :raises RobotTakenError: if somebody does
        """
        if self.detect(check):
            # Discovery tells the names of nodes last, and nothing moves yet.
            wait_until(lambda: UNKNOWN not in self._others(), LISTEN_TIME, check)
            raise RobotTakenError(
                f'{self.describe_sender()} sends velocities on {self._publisher.topic_name}; '
                'nothing was '
                'sent. Stop that program, or set the parameter allow_other_publishers to true')

    def describe_sender(self) -> str:
        """Return who may have sent what was heard, as far as that can be known."""
        if UNKNOWN in self._names:
            self._names = self._others() or self._names  # discovery tells names last
        names = sorted({
            'with a name that is not told here' if name == UNKNOWN else escaped(name, 60)
            for name in self._names})
        return f'somebody else (node {" or ".join(names)})'

    def _hear(self, data: bytes) -> None:
        now, zero = time.monotonic(), is_zero(data)
        if self._publisher.sent.consume(data, zero, now) or (zero and self._is_latched()):
            return
        self._heard = now
        if not self._is_asked:
            self._on_message(self.describe_sender())
