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

from collections.abc import Callable, Iterable

from kachaka_simple_control.control.guardian import Guardian, NullGuardian
from kachaka_simple_control.control.preparation import Moment, Steps, until
from kachaka_simple_control.control.timing import DISCOVERY_TIMEOUT, PUBLISHER_SEARCH_TIMEOUT
from kachaka_simple_control.errors import RobotNotFoundError, RunFaultError
from kachaka_simple_control.files.robot_profile import RobotProfile
from kachaka_simple_control.ros import robot_problems as problems
from kachaka_simple_control.ros.graph import Endpoint, Graph
from kachaka_simple_control.ros.manual_control_client import ManualControlClient
from kachaka_simple_control.ros.names import RobotNames
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from kachaka_simple_control.text import escaped


class RobotDiscovery:
    """
    Finds the robot in the ROS graph: the DDS participant that takes velocities and has odometry.

    :param manual_control: its service must be available if the robot needs it
    :param guardian: its publisher counts as one of this program, and must discover the robot
    """

    def __init__(
            self, graph: Graph, names: RobotNames, publisher: VelocityPublisher,
            manual_control: ManualControlClient, guardian: Guardian | NullGuardian,
            profile: RobotProfile) -> None:
        self._graph = graph
        self._profile = profile
        self._publisher, self._topic = publisher, publisher.topic_name
        self._manual_control = manual_control
        self._guardian = guardian
        self._service = names.manual_control
        self._odometry_topic = graph.node.resolve_topic_name(names.odometry) if (
            names.odometry) else None
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
        return len(self._graph.subscriptions(self._topic)) if (
            self._publisher.get_subscription_count()) else 0

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
                problems.GUARDIAN_UNMATCHED.format(timeout=timeout)))
        yield from until(
            moment, lambda: not self._guardian.unmatched(self._find_robot()), 'the guardian',
            DISCOVERY_TIMEOUT)

    @property
    def is_alone(self) -> bool:
        """Whether the guardian's search has found the publisher of this node, and no other's."""
        found = self._guardian.found_publishers(self._topic)
        # That it has found this one shows that it works, and that it began after this node.
        return (self._guardian.has_searched and self._graph.participant in found
                and not self._found_others())

    def wait_for_publishers(self, moment: Moment) -> Steps[None]:
        """
        Wait until this node has discovered the publishers that the guardian's search has found.

        Up to 3 s later than the search; before, this node cannot receive the velocities of another
        program.  If a publisher has left meanwhile, the wait ends after DISCOVERY_TIMEOUT (3.5 s).
        """
        def has_discovered_all() -> bool:
            return self._found_others() <= _participants(self._graph.publishers(self._topic))

        yield from until(
            moment, lambda: self._guardian.has_searched, 'the search for other programs',
            PUBLISHER_SEARCH_TIMEOUT)
        yield from until(
            moment, has_discovered_all, 'the publishers of other programs', DISCOVERY_TIMEOUT)

    def _found_others(self) -> set[bytes]:
        """Return the participants of other programs' publishers that the search has found."""
        own = {self._graph.participant, *self._guardian.participants}
        return self._guardian.found_publishers(self._topic) - own

    def has_changed(self) -> bool:
        """
        Return whether a count of publishers or subscribers has changed since the last call.

        Another robot may have replaced the robot without a change: see ``check_identity``.
        """
        graph = self._graph
        counts = [self._publisher.get_subscription_count(), graph.count_subscriptions(self._topic),
                  graph.count_publishers(self._topic), self._count_odometry_publishers()]
        before, self._counts = self._counts, counts
        return counts != before

    def remember_robot(self) -> None:
        """Store the participants of the robot for ``check_identity``."""
        self._robot = self._find_robot()

    def check_identity(self) -> None:
        """
        Check that the robot is still the one that ``remember_robot`` has stored.

        :raises RunFaultError: if it was replaced by another one, or no longer subscribes
        """
        subscribers = self._subscribers() if self._publisher.get_subscription_count() else set()
        if not self._robot & subscribers:
            text = problems.ROBOT_REPLACED if subscribers else problems.ROBOT_LEFT
            raise RunFaultError(text.format(topic=self._topic))

    def check_exclusive(self) -> None:
        """
        Check that not more than one robot publishes odometry on the odometry topic.

        :raises RunFaultError: if more do
        """
        if (count := self._count_odometry_publishers()) > 1:
            raise RunFaultError(problems.SEVERAL_ROBOTS.format(
                count=count, topic=self._odometry_topic))

    def other_publishers(self) -> list[str]:
        """Return the names of the nodes of other programs that have a publisher of velocities."""
        # An earlier participant of the guardian may stay in the graph for a while.
        own = {self._graph.participant, *self._guardian.participants}
        return [escaped(info.node_name, 60)
                for participant, info in self._graph.publishers(self._topic)
                if participant not in own]

    def _find_robot(self) -> set[bytes]:
        """Return the subscribers of velocities that publish odometry; if none does, all."""
        subscribers = self._subscribers()
        return subscribers & self._odometry_publishers() or subscribers

    def _subscribers(self) -> set[bytes]:
        return _participants(self._graph.subscriptions(self._topic))

    def _odometry_publishers(self) -> set[bytes]:
        topic = self._odometry_topic
        return _participants(self._graph.publishers(topic)) if topic else set()

    def _count_odometry_publishers(self) -> int:
        return self._graph.count_publishers(self._odometry_topic) if self._odometry_topic else 0

    def _problem(self) -> str:
        """Return a text that says why no robot can be driven; empty if a robot can be driven."""
        if not self.is_subscribed:
            return problems.no_match(self._publisher, self._graph)
        topic, count = self._odometry_topic, self._count_odometry_publishers()
        if count > 1:
            return problems.SEVERAL_ROBOTS.format(count=count, topic=topic)
        if self._required_participant is not None and (
                self._required_participant() not in self._odometry_publishers()):
            text = problems.ANOTHER_ROBOT if count else problems.OWN_ROBOT_SILENT
            return text.format(topic=topic)
        if not self._manual_control.is_available:
            return problems.NO_SERVICE.format(service=self._service)
        if (not self._manual_control.is_needed and topic and not count
                and self._profile.odometry_required):
            return problems.NO_ODOMETRY.format(topic=topic)
        return ''

    def _not_found(self, timeout: float) -> str:
        domain = self._graph.node.context.get_domain_id()
        where = f'{self._topic} (ROS domain {domain}) after {timeout:g} s: {self._problem()}'
        if self.is_subscribed:
            return f'no robot can be driven by {where}'
        return f'no robot listens on {where}' + (
            '' if self._required_participant is not None else problems.hint())


def _participants(endpoints: Iterable[Endpoint]) -> set[bytes]:
    return {participant for participant, _ in endpoints}
