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
"""Find the robot in the ROS graph; check that there is only one, and that it is not replaced."""

from __future__ import annotations

from collections.abc import Callable
import os

from kachaka_simple_control.control.guardian import Guardian, NullGuardian
from kachaka_simple_control.control.preparation import Moment, Steps, until
from kachaka_simple_control.control.timing import DISCOVERY_TIMEOUT, PUBLISHER_SEARCH_TIMEOUT
from kachaka_simple_control.errors import RobotNotFoundError, RunFaultError
from kachaka_simple_control.files.robot_profile import RobotProfile
from kachaka_simple_control.ros.dds_transport import is_localhost_only
from kachaka_simple_control.ros.endpoints import incompatibility, own_participant, participants
from kachaka_simple_control.ros.environment import DISCOVERY_SERVER
from kachaka_simple_control.ros.manual_control_client import ManualControlClient
from kachaka_simple_control.ros.names import RobotNames
from kachaka_simple_control.ros.velocity_publisher import TYPES, VelocityPublisher
from kachaka_simple_control.text import escaped, quoted
from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

#: How to drive a robot without odometry.
WITHOUT_ODOMETRY = (
    'for a robot without odometry write `odometry_topic: null`, and for one that may have none '
    '`odometry_required: false`, in its profile (--robot FILE)')
#: What to look at if no robot is found; not for one that this program has started.
HINT = ('. Is its bridge running, in the same ROS_DOMAIN_ID? Compare the name with `ros2 topic '
        'list`. Without a robot, try `kachaka_simple_control --sim`')


class RobotDiscovery:
    """
    Finds the robot in the ROS graph: the DDS participant that takes velocities and has odometry.

    :param manual_control: its service must be available if the robot needs it
    :param guardian: its publisher counts as one of this program, and must discover the robot
    """

    def __init__(
            self, node: Node, names: RobotNames, publisher: VelocityPublisher,
            manual_control: ManualControlClient, guardian: Guardian | NullGuardian,
            profile: RobotProfile) -> None:
        self._node = node
        self._profile = profile
        self._publisher = publisher
        self._manual_control = manual_control
        self._guardian = guardian
        self._service = names.manual_control
        self._odometry_topic = node.resolve_topic_name(names.odometry) if names.odometry else None
        self._participant = own_participant(node)
        self._required_participant: Callable[[], bytes | None] | None = None
        #: the participants of the robot, set by ``remember_robot``
        self._robot: set[bytes] = set()
        self._counts: list[int] = []

    @property
    def is_subscribed(self) -> bool:
        """Whether a subscription of another node matches the velocity publisher of this node."""
        return self.subscriber_count > 0

    @property
    def subscriber_count(self) -> int:
        """Return how many subscriptions other nodes have; 0 if none matches the publisher."""
        return len(self._subscriptions()) if self._publisher.get_subscription_count() else 0

    def require_participant(self, participant: Callable[[], bytes | None]) -> None:
        """
        Accept only a robot that has a given DDS participant.

        :param participant: None while it is not known: no robot is accepted then
        """
        self._required_participant = participant

    def wait_for_robot(self, moment: Moment, timeout: float) -> Steps[None]:
        """
        Wait until a robot is found in the ROS graph and can be driven.

        :raises RobotNotFoundError: at the timeout; the message says what is missing
        """
        if not (yield from until(moment, lambda: not self._problem(), 'a robot', timeout)):
            raise RobotNotFoundError(self._not_found(timeout))

    def wait_for_guardian(self, moment: Moment, timeout: float) -> Steps[None]:
        """
        Wait until the robot can be driven, and the guardian's publisher has discovered the robot.

        Without odometry, each subscriber may be the robot: then it waits for the others, too, but
        for DISCOVERY_TIMEOUT (3.5 s) at most, because one that was killed stays in the graph.

        :raises RobotNotFoundError: if this takes longer than the timeout
        """
        def is_found() -> bool:
            robot = self._find_robot()
            return self._guardian.unmatched(robot) != robot and not self._problem()

        if not (yield from until(moment, is_found, 'the guardian', timeout)):
            # If discovery has found a problem meanwhile, report this problem: it explains more.
            raise RobotNotFoundError(self._not_found(timeout) if self._problem() else (
                f'the guardian has not discovered the robot within {timeout:g} s, so nothing '
                'moved; the parameter guardian:=false drives without one'))
        yield from until(
            moment, lambda: not self._guardian.unmatched(self._find_robot()), 'the guardian',
            DISCOVERY_TIMEOUT)

    def wait_for_publishers(self, moment: Moment) -> Steps[None]:
        """
        Wait until this node has discovered the publishers that the guardian's search has found.

        Up to 3 s later than the search; before, this node cannot receive the velocities of another
        program.  If a publisher has left meanwhile, the wait ends after DISCOVERY_TIMEOUT (3.5 s).
        """
        topic = self._publisher.topic_name

        def has_discovered_all() -> bool:
            own = {self._participant, *self._guardian.participants}
            return self._guardian.found_publishers(topic) - own <= set(participants(
                self._node.get_publishers_info_by_topic(topic)))

        yield from until(
            moment, lambda: self._guardian.has_searched, 'the search for other programs',
            PUBLISHER_SEARCH_TIMEOUT)
        yield from until(
            moment, has_discovered_all, 'the publishers of other programs', DISCOVERY_TIMEOUT)

    def check_subscribed(self) -> None:
        """
        Check that the robot still subscribes to the velocities of this node.

        :raises RunFaultError: if it does not
        """
        if not self.is_subscribed:
            raise self._subscriber_left()

    def has_changed(self) -> bool:
        """
        Return whether a count of publishers or subscribers has changed since the last call.

        Another robot may have replaced the robot without a change: see ``check_identity``.
        """
        before, self._counts = self._counts, self._endpoint_counts()
        return self._counts != before

    def remember_robot(self) -> None:
        """Store the participants of the robot for ``check_identity``."""
        self._robot = self._find_robot()

    def check_identity(self) -> None:
        """
        Check that the robot is still the one that ``remember_robot`` has stored.

        :raises RunFaultError: if it was replaced by another one, or has left the ROS graph
        """
        subscribers = self._subscribers()
        if not subscribers:
            raise self._subscriber_left()
        if not self._robot & subscribers:
            raise RunFaultError(
                f'the robot left: who subscribes to {self._publisher.topic_name} now came later')

    def check_exclusive(self) -> None:
        """
        Check that not more than one robot publishes odometry on the odometry topic.

        :raises RunFaultError: if more do
        """
        if (count := len(self._odometry_publishers())) > 1:
            raise RunFaultError(self._several_robots(count))

    def other_publishers(self) -> list[str]:
        """Return the names of the nodes of other programs that have a publisher of velocities."""
        infos = self._node.get_publishers_info_by_topic(self._publisher.topic_name)
        return [escaped(info.node_name, 60)
                for info, participant in zip(infos, participants(infos))
                if not self._is_own(participant)]

    def _is_own(self, participant: bytes) -> bool:
        # An earlier participant of the guardian may stay in the graph for a while.
        return participant == self._participant or participant in self._guardian.participants

    def _endpoint_counts(self) -> list[int]:
        topics = [self._publisher.topic_name]
        if self._odometry_topic:
            topics.append(self._odometry_topic)
        return [self.subscriber_count, *map(self._node.count_publishers, topics)]

    def _find_robot(self) -> set[bytes]:
        """Return the subscribers of velocities that publish odometry; if none does, all."""
        subscribers = self._subscribers()
        return subscribers & set(self._odometry_publishers()) or subscribers

    def _subscribers(self) -> set[bytes]:
        return set(participants(self._subscriptions()))

    def _subscriptions(self) -> list[TopicEndpointInfo]:
        """Return the subscriptions to the velocities; that of ``ForeignMessages`` is left out."""
        infos = self._node.get_subscriptions_info_by_topic(self._publisher.topic_name)
        own = self._participant, self._node.get_name(), self._node.get_namespace()
        return [info for info, participant in zip(infos, participants(infos))
                if (participant, info.node_name, info.node_namespace) != own]

    def _odometry_publishers(self) -> list[bytes]:
        return participants(
            self._node.get_publishers_info_by_topic(self._odometry_topic)
            if self._odometry_topic else [])

    def _problem(self) -> str:
        """Return a text that says why no robot can be driven; empty if a robot can be driven."""
        return self._robot_problem() if self.is_subscribed else self._subscriber_problem()

    def _robot_problem(self) -> str:
        robots = self._odometry_publishers()
        if len(robots) > 1:
            return self._several_robots(len(robots))
        if self._required_participant is not None and self._required_participant() not in robots:
            if not robots:
                return ('the robot that this program started does not publish '
                        f'{self._odometry_topic}')
            return (f'another robot publishes {self._odometry_topic}: stop its bridge, or name a '
                    'robot_namespace for this one')
        if not self._manual_control.is_available:
            return (f'a subscriber is there, but not the service {self._service}; for a robot '
                    'without it, set the parameter manual_control to false')
        if (not self._manual_control.is_needed and self._odometry_topic and not robots
                and self._profile.odometry_required):
            return (f'a subscriber is there, but nobody publishes {self._odometry_topic}; '
                    f'{WITHOUT_ODOMETRY}')
        return ''

    def _subscriber_problem(self) -> str:
        """Return a text that says why no subscription matches this node's velocity publisher."""
        own_type = self._publisher.msg_type.__name__
        topic = self._publisher.topic_name
        infos = self._subscriptions()
        types = {info.topic_type for info in infos}
        same_type = [info for info in infos if info.topic_type.endswith('/' + own_type)]
        if types and not same_type:
            taken = ', '.join(sorted(types))
            remedy = next((f': write `message_type: {name}` in the profile of the robot (--robot '
                           'FILE)' for name in TYPES if taken.endswith(f'/{name}')), '')
            return f'its subscriber takes {escaped(taken)}, not {own_type}{remedy}'
        # Read both QoS profiles from the graph: a publisher returns 0 s for an unset deadline.
        publishers = self._node.get_publishers_info_by_topic(topic)
        offered = [info.qos_profile
                   for info, participant in zip(publishers, participants(publishers))
                   if participant == self._participant]
        for info in same_type:
            if offered and (reason := incompatibility(offered[0], info.qos_profile)):
                return (f'a subscriber is there (node {escaped(info.node_name, 60)}), but its '
                        f'quality of service does not fit: {reason}; change that of the robot')
        return 'nobody subscribes to it'

    def _several_robots(self, count: int) -> str:
        return (f'{count} robots publish {self._odometry_topic}, and each of them would obey; '
                'stop all but one, or give each its own robot_namespace')

    def _subscriber_left(self) -> RunFaultError:
        return RunFaultError(
            f'the robot left: nobody subscribes to {self._publisher.topic_name} any more')

    def _not_found(self, timeout: float) -> str:
        topic = (f'{self._publisher.topic_name} (ROS domain '
                 f'{self._node.context.get_domain_id()}) after {timeout:g} s')
        if not self.is_subscribed:
            hint = '' if self._required_participant is not None else f'{HINT}{_narrow_search()}'
            return f'no robot listens on {topic}: {self._problem()}{hint}'
        return f'no robot can be driven by {topic}: {self._problem()}'


def _narrow_search() -> str:
    """Return sentences about the environment variables by which a robot may stay unseen."""
    text = '. Only this machine is searched, as environment variables say' if (
        is_localhost_only()) else ''
    if server := os.environ.get(DISCOVERY_SERVER):
        text += f'. {DISCOVERY_SERVER} is {quoted(server, 100)}: does this server run?'
    return text
