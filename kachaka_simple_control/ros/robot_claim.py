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
"""The right to drive a robot, or to show one: one program holds it, and newcomers are refused."""

from __future__ import annotations

from collections.abc import Callable
import hashlib
import os
import socket
import threading
import time

from kachaka_simple_control.control.claims import (
    Claim,
    ClaimedError,
    Claims,
    HELD,
    MachineClaim,
    RELEASED,
    WANTED,
)
from kachaka_simple_control.control.timing import (
    CLAIM_CONFLICT_TIME,
    CLAIM_DISCOVERY_TIME,
    CLAIM_PERIOD,
    CLAIM_SETTLE_TIME,
)
from kachaka_simple_control.control.waiting import wait_until
from kachaka_simple_control.errors import RobotTakenError
from kachaka_simple_control.ros.dds_transport import is_localhost_only
from kachaka_simple_control.ros.endpoints import own_participant
from kachaka_simple_control.ros.names import MAX_NAME_LENGTH
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

#: What is told who comes second, by what is claimed.
TAKEN = {
    'driver': '{who} drives the robot on {topic}, so nothing was sent; wait until it ends, or '
              'stop it',
    'bridge': '{who} shows a robot on {topic}; stop it, or choose another --namespace',
}


class RobotClaim:
    """
    The claim of one program on one robot, on this machine and between machines.

    On one machine the kernel decides.  Between machines, programs tell each other of their claims
    on a topic beside that of the velocities.  Discovery takes its time there, so that two may hold
    the claim for a moment: when they find each other, both are told.
    """

    def __init__(
            self, node: Node, topic: str, role: str, on_rival: Callable[[str], None]) -> None:
        """
        Claim nothing yet.

        :param node: whose claim it is
        :param topic: where the robot takes velocities, resolved
        :param role: what is claimed: ``driver`` or ``bridge``
        :param on_rival: called, in the thread that serves callbacks, when somebody else turns out
            to hold the claim that this program holds
        """
        self._machine = MachineClaim()
        self._name = f'{role} {node.context.get_domain_id()} {topic}'
        self._node_name = node.get_fully_qualified_name()
        self._taken_text = TAKEN[role].format(topic=topic, who='{who}')
        self._told = None if is_localhost_only() else _ToldClaim(
            node, _topic(topic, role), on_rival)

    def fileno(self) -> int:
        """Return the descriptor that keeps the claim, for a child to inherit."""
        return self._machine.fileno()

    def take(self, check: Callable[[], None]) -> None:
        """
        Take the claim on this machine, and tell others that it is wanted.

        Nothing happens if it is held already.  Follow it with ``hold``, or with ``withdraw``.

        :param check: called while waiting; what it raises ends the wait
        :raises RobotTakenError: if another program holds the claim, with who that is
        """
        who = f'{self._node_name} (process {os.getpid()}'
        since = f'since {time.strftime("%H:%M:%S")})'
        try:
            self._machine.take(self._name, f'{who}, {since}')
        except ClaimedError as error:
            raise self._taken(str(error)) from None
        if self._told is not None:
            rival = self._told.take(f'{who} on {socket.gethostname()}, {since}', check)
            if rival is not None:
                raise self._taken(rival)

    def hold(self) -> None:
        """Tell other machines that the robot is ours from now on."""
        if self._told is not None:
            self._told.hold()

    def withdraw(self) -> None:
        """Tell other machines that the robot is not wanted any more."""
        if self._told is not None:
            self._told.withdraw()

    def require(self) -> None:
        """
        Make sure that nobody else holds the claim as well.

        :raises RobotTakenError: if somebody does
        """
        if self._told is not None and (rival := self._told.holder()) is not None:
            raise self._taken(rival)

    def release(self) -> None:
        """Give the claim back, for good."""
        if self._told is not None:
            self._told.release()
        self._machine.release()

    def _taken(self, who: str) -> RobotTakenError:
        return RobotTakenError(self._taken_text.replace('{who}', who))


def _topic(velocities: str, role: str) -> str:
    topic = f'{velocities}/_{role}'
    if len(topic) <= MAX_NAME_LENGTH:
        return topic
    return f'/_kachaka_simple_control/_{hashlib.sha256(velocities.encode()).hexdigest()}/_{role}'


class _ToldClaim:
    """A claim that other machines are told of, and what they tell."""

    def __init__(self, node: Node, topic: str, on_rival: Callable[[str], None]) -> None:
        self._joined = time.monotonic()
        self._who = ''
        self._on_rival = on_rival
        self._participant = own_participant(node).hex()
        self._claims = Claims(self._participant)
        self._state = RELEASED
        self._rival_seen: float | None = None
        quality = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._publisher = node.create_publisher(String, topic, quality)
        # Many may tell of theirs at the same moment.
        heard = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        # In a group of its own: what is told must be heard whatever became of other callbacks.
        node.create_subscription(
            String, topic, self._hear, heard, callback_group=MutuallyExclusiveCallbackGroup())
        self._node = node
        self._over = threading.Event()
        self._telling = threading.Thread(target=self._tell_on, name='claim', daemon=True)

    def take(self, who: str, check: Callable[[], None]) -> str | None:
        """Say that the claim is wanted, and return who keeps us from it."""
        if self._state == HELD:
            return self.holder()
        self._who = who
        self._tell(WANTED)
        if not self._telling.is_alive():
            self._telling.start()
        asked = time.monotonic()

        def is_decided() -> bool:
            alone = self._node.count_publishers(self._publisher.topic_name) < 2
            settled = asked if alone else asked + CLAIM_SETTLE_TIME
            return self._rival() is not None or time.monotonic() >= max(
                settled, self._joined + CLAIM_DISCOVERY_TIME)

        try:
            wait_until(is_decided, CLAIM_DISCOVERY_TIME + CLAIM_SETTLE_TIME, check)
        except BaseException:
            self.withdraw()
            raise
        if (rival := self._rival()) is not None:
            self.withdraw()
        return rival

    def hold(self) -> None:
        """Hold the claim from now on."""
        if self._state != HELD:
            self._tell(HELD)

    def withdraw(self) -> None:
        """Want it no more; one that is held is not given back before the end."""
        if self._state == WANTED:
            self._tell(RELEASED)

    def holder(self) -> str | None:
        """Return who else holds the claim."""
        claim = self._claims.holder(time.monotonic())
        return None if claim is None else claim.who

    def release(self) -> None:
        """Claim nothing any more; only after the other has heard of ours, if there is another."""
        if self._rival_seen is not None:
            time.sleep(max(0.0, self._rival_seen + CLAIM_CONFLICT_TIME - time.monotonic()))
        self._over.set()
        if self._state != RELEASED and self._node.context.ok():
            self._tell(RELEASED)

    def _rival(self) -> str | None:
        claim = self._claims.blocking_claim(time.monotonic())
        return None if claim is None else claim.who

    def _tell(self, state: str) -> None:
        self._state = state
        self._publish()

    def _publish(self) -> None:
        self._publisher.publish(
            String(data=Claim(self._participant, self._state, self._who).to_json()))

    def _tell_on(self) -> None:
        while not self._over.wait(CLAIM_PERIOD):
            if not self._node.context.ok():
                return
            if self._state != RELEASED:
                self._publish()

    def _hear(self, message: String) -> None:
        claim = Claim.from_json(message.data)
        if claim is None:
            return
        self._claims.on_claim(claim, time.monotonic())
        if self._state == HELD and (holder := self.holder()) is not None:
            if self._rival_seen is None:
                self._rival_seen = time.monotonic()
            self._on_rival(holder)
