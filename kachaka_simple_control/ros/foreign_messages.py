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
Detect velocities that other programs send to the robot which this program drives.

Tested by test/ros/test_faults.py.
"""

from __future__ import annotations

from collections.abc import Callable
import time

from kachaka_simple_control.control.preparation import Moment, Steps, until
from kachaka_simple_control.control.sent_messages import MAX_QUEUED
from kachaka_simple_control.control.timing import FOREIGN_CHECK_TIME, FOREIGN_MESSAGE_MAX_AGE
from kachaka_simple_control.errors import RobotTakenError
from kachaka_simple_control.ros.velocity_publisher import is_zero, VelocityPublisher
from kachaka_simple_control.text import escaped
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

#: Best effort matches every publisher.  The executor's thread may be delayed for a moment.
SUBSCRIPTION_QOS = QoSProfile(depth=MAX_QUEUED, reliability=ReliabilityPolicy.BEST_EFFORT)
#: The node name in the graph if the name was not received, e.g. between ROS distributions.
UNKNOWN_NODE = '_NODE_NAME_UNKNOWN_'


class ForeignMessages:
    """
    Detects velocities that other programs send to the robot.

    It subscribes to the topic only while another program has a publisher there, to save CPU time.
    Only a received velocity proves that it drives: a publisher may never send.

    :param is_latched: whether the guardian has stopped the robot; zeros are then its own
    :param on_message: called in the executor's thread with a text about the sender of each
        velocity, but not during ``detect``
    """

    def __init__(
            self, node: Node, publisher: VelocityPublisher,
            other_publishers: Callable[[], list[str]], is_latched: Callable[[], bool],
            on_message: Callable[[str], None]) -> None:
        self._node = node
        self._publisher = publisher
        self._other_publishers = other_publishers
        self._is_latched = is_latched
        self._on_message = on_message
        self._subscription: Subscription | None = None
        self._names: list[str] = []
        self._newest = float('-inf')
        self._is_detecting = False
        # A separate callback group, so that no other callback delays this one.
        self._group = MutuallyExclusiveCallbackGroup()

    def update(self) -> bool:
        """Find velocity publishers of other programs; subscribe while there are any."""
        self._names = self._other_publishers()
        if self._names and self._subscription is None:
            self._publisher.sent.discard_old(time.monotonic())
            self._subscription = self._node.create_subscription(
                self._publisher.msg_type, self._publisher.topic_name, self._on_data,
                SUBSCRIPTION_QOS, callback_group=self._group, raw=True)
        elif not self._names and self._subscription is not None:
            subscription, self._subscription = self._subscription, None
            self._node.destroy_subscription(subscription)
        return bool(self._names)

    def has_recent(self, now: float) -> bool:
        """Return whether another program has sent a velocity to the robot recently."""
        return now - self._newest <= FOREIGN_MESSAGE_MAX_AGE

    def detect(self, moment: Moment) -> Steps[bool]:
        """
        Wait up to FOREIGN_CHECK_TIME (0.4 s) for a velocity of another program, if any publishes.

        :returns: whether one has arrived during the wait, or up to 1 s before it
        """
        if not self.update():
            return False
        self._is_detecting = True
        try:
            return (yield from until(
                moment, lambda: self.has_recent(moment.now), 'velocities of other programs',
                FOREIGN_CHECK_TIME))
        finally:
            self._is_detecting = False

    def require_none(self, moment: Moment) -> Steps[None]:
        """
        Check before a drive that no other program sends velocities to the robot.

        :raises RobotTakenError: if one does
        """
        if (yield from self.detect(moment)):
            # Discovery delivers node names last.  The wait is safe: the robot does not move yet.
            yield from until(
                moment, lambda: UNKNOWN_NODE not in self._other_publishers(), 'names of nodes',
                FOREIGN_CHECK_TIME)
            raise self.taken(self.describe_sender())

    def taken(self, sender: str) -> RobotTakenError:
        """Return an error which says that another program sends velocities already."""
        return RobotTakenError(
            f'{sender} sends velocities on {self._publisher.topic_name}; nothing was sent. Stop '
            'that program, or set the parameter allow_other_publishers to true')

    def describe_sender(self) -> str:
        """Return the names of the nodes of other programs that publish on the velocity topic."""
        if UNKNOWN_NODE in self._names:
            self._names = self._other_publishers() or self._names  # discovery delivers names last
        names = sorted({
            'whose name is not known' if name == UNKNOWN_NODE else escaped(name, 60)
            for name in self._names})
        return f'another program (node {" or ".join(names)})'

    def _on_data(self, data: bytes) -> None:
        now, zero = time.monotonic(), is_zero(data)
        if self._publisher.sent.consume(data, zero, now) or (zero and self._is_latched()):
            return
        self._newest = now
        if not self._is_detecting:
            self._on_message(self.describe_sender())
