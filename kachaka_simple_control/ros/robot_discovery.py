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
"""Find the robot on the ROS graph: it listens, is the only one, and stays the same."""

from __future__ import annotations

from collections.abc import Callable

from kachaka_simple_control.control.guardian import Guardian, NullGuardian
from kachaka_simple_control.control.waiting import wait_until
from kachaka_simple_control.errors import RobotNotFoundError, RunFaultError
from kachaka_simple_control.escaping import escaped
from kachaka_simple_control.ros.endpoints import (
    incompatibility,
    own_participant,
    participants,
)
from kachaka_simple_control.ros.manual_control_client import ManualControlClient
from kachaka_simple_control.ros.names import RobotNames
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from rclpy.node import Node

HINT = ('. Is its bridge running, in the same ROS_DOMAIN_ID? Compare the name with `ros2 topic '
        'list`. Without a robot, try `kachaka_simple_control --sim`')


class RobotDiscovery:
    """Whether the robot listens, and to whom."""

    def __init__(
            self, node: Node, names: RobotNames, publisher: VelocityPublisher,
            manual_control: ManualControlClient, guardian: Guardian | NullGuardian) -> None:
        """
        Look at nothing yet.

        :param node: whose view of the graph is used
        :param names: the robot's names, as they were before remapping
        :param publisher: the publisher of velocities
        :param manual_control: what the robot may need beside a subscription
        :param guardian: who publishes zeros for us
        """
        self._node = node
        self._publisher = publisher
        self._manual_control = manual_control
        self._guardian = guardian
        self._service = names.manual_control
        self._odometry = node.resolve_topic_name(names.odometry) if names.odometry else None
        self._participant = own_participant(node)
        self._brought: Callable[[], bytes | None] | None = None
        #: whose subscription is the robot's
        self._robot: set[bytes] = set()
        self._counts: list[int] = []

    @property
    def is_subscribed(self) -> bool:
        """Whether anybody takes our velocities."""
        return self.subscriber_count > 0

    @property
    def subscriber_count(self) -> int:
        """Return how many take our velocities."""
        return int(self._publisher.get_subscription_count())

    def require_participant(self, brought: Callable[[], bytes | None]) -> None:
        """
        Meet no other robot than one that was brought along.

        :param brought: returns its participant, or None as long as it has none
        """
        self._brought = brought

    def wait_for_robot(self, timeout: float, check: Callable[[], None]) -> None:
        """
        Wait until the robot listens to us.

        :param timeout: how long [s]
        :param check: called while waiting; what it raises ends the wait
        :raises RobotNotFoundError: if it does not, with what is missing and what to try
        """
        if not wait_until(lambda: not self._missing(), timeout, check):
            raise RobotNotFoundError(self._not_found(timeout))

    def wait_for_guardian(self, timeout: float, check: Callable[[], None]) -> None:
        """
        Wait until the robot listens to our guardian, too.

        :param timeout: how long [s]
        :param check: called while waiting; what it raises ends the wait
        :raises RobotNotFoundError: if it does not
        """
        if not wait_until(
                lambda: self._guardian.is_matched and not self._missing(), timeout, check):
            # What discovery found meanwhile tells more.
            raise RobotNotFoundError(self._not_found(timeout) if self._missing() else (
                f'the guardian has not met the robot within {timeout:g} s, so nothing moved; the '
                'parameter guardian:=false drives without one'))

    def check_subscribed(self) -> None:
        """
        Make sure that the robot still listens.

        :raises RunFaultError: if it has left
        """
        if not self.is_subscribed:
            raise self._has_left()

    def has_changed(self) -> bool:
        """
        Tell whether anybody came or left since this was last asked.

        :returns: whether numbers have changed; a robot in another's place within that time is not
            seen here
        """
        before, self._counts = self._counts, self._count()
        return self._counts != before

    def check_identity(self) -> None:
        """
        Make sure that the robot is the one that was met, and not one that came in its place.

        :raises RunFaultError: if it is another; it has to be met first
        """
        listeners = self._listeners()
        if not listeners:
            raise self._has_left()
        if not self._robot & listeners:
            raise RunFaultError(
                f'the robot left: who subscribes to {self._publisher.topic_name} now came later')

    def check_exclusive(self) -> None:
        """
        Make sure that it is one robot that obeys.

        :raises RunFaultError: if there are more; a newcomer is seen when discovery has found it
        """
        if (robots := len(self._robots())) > 1:
            raise RunFaultError(self._not_one(robots))

    def other_publishers(self) -> list[str]:
        """
        Return who else has a publisher of velocities, which may never send any.

        :returns: the names of their nodes, where the graph tells them
        """
        infos = self._node.get_publishers_info_by_topic(self._publisher.topic_name)
        return [escaped(info.node_name, 60)
                for info, participant in zip(infos, participants(infos))
                if not self._is_ours(participant)]

    def _is_ours(self, participant: bytes) -> bool:
        # All that the guardian ever was: one that left may be listed for a while.
        return participant == self._participant or participant in self._guardian.participants

    def remember_robot(self) -> None:
        """Remember who the robot is: who takes velocities and, if anybody does, tells odometry."""
        listeners = self._listeners()
        self._robot = listeners & set(self._robots()) or listeners

    def _has_left(self) -> RunFaultError:
        return RunFaultError(
            f'the robot left: nobody subscribes to {self._publisher.topic_name} any more')

    def _count(self) -> list[int]:
        topics = [self._publisher.topic_name, *([self._odometry] if self._odometry else [])]
        return [self.subscriber_count, *map(self._node.count_publishers, topics)]

    def _listeners(self) -> set[bytes]:
        return set(participants(
            self._node.get_subscriptions_info_by_topic(self._publisher.topic_name)))

    def _robots(self) -> list[bytes]:
        return participants(
            self._node.get_publishers_info_by_topic(self._odometry) if self._odometry else [])

    def _missing(self) -> str:
        """Return what keeps the robot from being taken; nothing if it can be."""
        if not self.is_subscribed:
            return self._no_subscriber()
        return self._no_robot()

    def _no_robot(self) -> str:
        robots = self._robots()
        if len(robots) > 1:
            return self._not_one(len(robots))
        if self._brought is not None and self._brought() not in robots:
            return self._not_ours(len(robots))
        if not self._manual_control.is_available:
            return (f'a subscriber is there, but not the service {self._service}; for a robot '
                    'without it, set the parameter manual_control to false')
        if not self._manual_control.is_needed and self._odometry and not robots:
            return f'a subscriber is there, but nobody publishes {self._odometry}'
        return ''

    def _no_subscriber(self) -> str:
        wanted = self._publisher.msg_type.__name__
        topic = self._publisher.topic_name
        infos = self._node.get_subscriptions_info_by_topic(topic)
        types = {info.topic_type for info in infos}
        fitting = [info for info in infos if info.topic_type.endswith('/' + wanted)]
        if types and not fitting:
            return f'its subscriber takes {escaped(", ".join(sorted(types)))}, not {wanted}'
        # As the graph tells both: a publisher itself says 0 s for a deadline that is not set.
        own = self._node.get_publishers_info_by_topic(topic)
        offered = [info.qos_profile for info, participant in zip(own, participants(own))
                   if participant == self._participant]
        for info in fitting:
            if offered and (reason := incompatibility(offered[0], info.qos_profile)):
                return (f'a subscriber is there (node {escaped(info.node_name, 60)}), but its '
                        f'quality of service does not fit: {reason}; change that of the robot')
        return 'nobody subscribes to it'

    def _not_one(self, robots: int) -> str:
        return (f'{robots} robots publish {self._odometry}, and each of them would obey; stop all '
                'but one, or give each its own robot_namespace')

    def _not_ours(self, robots: int) -> str:
        if not robots:
            return f'the robot that was brought along does not publish {self._odometry}'
        return (f'another robot publishes {self._odometry}: stop its bridge, or name a '
                'robot_namespace for this one')

    def _not_found(self, timeout: float) -> str:
        where = (f'{self._publisher.topic_name} (ROS domain '
                 f'{self._node.context.get_domain_id()}) after {timeout:g} s')
        if not self.is_subscribed:
            return f'no robot listens on {where}: {self._missing()}{HINT}'
        return f'no robot can be driven by {where}: {self._missing()}'
