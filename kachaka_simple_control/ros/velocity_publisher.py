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
"""What a node shows of its publisher of velocities."""

from __future__ import annotations

from typing import Any

from kachaka_simple_control.errors import MotionRefusedError
from kachaka_simple_control.motion.kinematics import Velocity, ZERO
from kachaka_simple_control.ros.messages import twist
from rclpy.publisher import Publisher


class VelocityPublisher:
    """
    A publisher that can be looked at, but publishes nothing on its own.

    Velocities leave through one place, where latch, gap and limits are checked; everything else
    a publisher offers (``topic_name``, ``get_subscription_count()``, ...) is handed through.
    """

    def __init__(self, publisher: Publisher) -> None:
        """
        Show a publisher.

        :param publisher: the one that the edge uses
        """
        self._publisher = publisher
        self._velocity, self._message = ZERO, twist(ZERO)

    def transmit(self, velocity: Velocity) -> None:
        """
        Put a velocity on the wire; for the edge alone.

        :param velocity: what to publish
        """
        # The same one comes again and again, and a message takes longer to make than to send.
        if velocity is not self._velocity:
            self._velocity, self._message = velocity, twist(velocity)
        self._publisher.publish(self._message)

    def publish(self, msg: Any) -> None:  # noqa: ARG002
        """
        Refuse to publish beside the edge.

        :param msg: not sent
        :raises MotionRefusedError: always, with the way to go
        """
        raise MotionRefusedError(
            'nothing was published: velocities are timed, limited and stopped by move_robot() '
            'and stop_robot(); use those')

    def __getattr__(self, name: str) -> Any:
        """
        Hand everything else through.

        :param name: the attribute
        :returns: the publisher's own
        """
        return getattr(self._publisher, name)
