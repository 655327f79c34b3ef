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
"""Claim a robot: no second program drives it, and no second bridge serves it."""

from __future__ import annotations

from collections.abc import Callable
import hashlib
import os
import socket
import threading
import time
import weakref

from kachaka_simple_control.control.claims import (
    Claim,
    ClaimedError,
    Claims,
    HELD,
    MachineClaim,
    RELEASED,
    WANTED,
)
from kachaka_simple_control.control.preparation import Moment, pause, Steps, until
from kachaka_simple_control.control.timing import (
    CLAIM_CONFLICT_TIME,
    CLAIM_DISCOVERY_TIME,
    CLAIM_PERIOD,
    CLAIM_SETTLE_TIME,
)
from kachaka_simple_control.errors import RobotTakenError
from kachaka_simple_control.ros.dds_transport import is_localhost_only
from kachaka_simple_control.ros.graph import Graph
from kachaka_simple_control.ros.names import MAX_NAME_LENGTH
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

#: The error message for a refused program, by role.
TAKEN = {
    'driver': '{who} drives the robot on {topic}, so nothing was sent; wait until it ends, or '
              'stop it',
    'bridge': '{who} shows a robot on {topic}',
}


class RobotClaim:
    """
    Claims a robot for one program, so that no other program drives it.

    On one machine, the kernel decides.  Between machines, each program publishes its claim on a
    topic of the robot; discovery takes time, so two may have it for a moment, and each reports the
    conflict when it receives the other's claim.

    :param role: ``driver``, or ``bridge`` for the program that connects the robot with ROS
    :param on_conflict: called in the executor's thread, maybe many times, with a text about the
        other
    """

    def __init__(
            self, graph: Graph, topic: str, role: str,
            on_conflict: Callable[[str], None]) -> None:
        node = graph.node
        self._machine = MachineClaim()
        self._name = f'{role} {node.context.get_domain_id()} {topic}'
        self._node_name = node.get_fully_qualified_name()
        self._taken_text = TAKEN[role].format(topic=topic, who='{who}')
        self._own_text = (f'an earlier node of this program has the robot on {topic}: call its '
                          'destroy_node() first')
        self._network = None if is_localhost_only() else _NetworkClaim(
            graph, _claim_topic(topic, role), on_conflict)

    def fileno(self) -> int:
        """Return the descriptor of a socket; a process that inherits it keeps the claim."""
        return self._machine.fileno()

    def take(
            self, moment: Moment, is_alone: Callable[[], bool] = lambda: False) -> Steps[None]:
        """
        Claim the robot here and from other machines; wait until it is clear who has it.

        If this object has it already, only check the others.  Then call ``hold``, or ``withdraw``.

        :param is_alone: whether a search has found that no other program drives the robot: then
            there is nobody to wait for

        :raises RobotTakenError: if another program or node has it; the message says who
        """
        who = f'{self._node_name} (process {os.getpid()}'
        since = f'since {time.strftime("%H:%M:%S")})'
        try:
            yield from self._machine.take(moment, self._name, f'{who}, {since}')
        except ClaimedError as error:
            if error.is_own:
                raise RobotTakenError(self._own_text) from None
            raise self._taken(str(error)) from None
        if self._network is not None:
            blocker = yield from self._network.take(
                f'{who} on {socket.gethostname()}, {since}', moment, is_alone)
            if blocker is not None:
                raise self._taken(blocker)

    def hold(self) -> None:
        """Tell programs on other machines that this program now has the claim on the robot."""
        if self._network is not None:
            self._network.hold()

    def withdraw(self) -> None:
        """
        Take the request to other machines back, unless ``hold`` was called.

        On this machine the program keeps the claim until ``release``.
        """
        if self._network is not None:
            self._network.withdraw()

    def require(self) -> None:
        """
        Check that no other program has published that it has the claim on the robot.

        :raises RobotTakenError: if one has; the message says which
        """
        if self._network is not None and (holder := self._network.holder()) is not None:
            raise self._taken(holder)

    def release(self, moment: Moment) -> Steps[None]:
        """Give up the claim on the robot; this object cannot take the claim again."""
        if self._network is not None:
            yield from self._network.release(moment)
        self._machine.release()

    def _taken(self, who: str) -> RobotTakenError:
        return RobotTakenError(self._taken_text.replace('{who}', who))


def _claim_topic(velocity_topic: str, role: str) -> str:
    topic = f'{velocity_topic}/_{role}'
    if len(topic) <= MAX_NAME_LENGTH:
        return topic
    digest = hashlib.sha256(velocity_topic.encode()).hexdigest()
    return f'/_kachaka_simple_control/_{digest}/_{role}'


class _NetworkClaim:
    """Publishes the claim of this program on a robot, and receives those of others."""

    def __init__(self, graph: Graph, topic: str, on_conflict: Callable[[str], None]) -> None:
        node = graph.node
        self._joined = time.monotonic()
        self._who = ''
        self._on_conflict = on_conflict
        self._participant = graph.participant.hex()
        self._claims = Claims(self._participant)
        self._state = RELEASED
        self._conflict_found: float | None = None
        self._publisher = node.create_publisher(
            String, topic, QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        # The depth allows for several programs that publish at the same moment.  A separate
        # callback group: claims must be received even if another callback of the node blocks.
        node.create_subscription(
            String, topic, self._on_message,
            QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL),
            callback_group=MutuallyExclusiveCallbackGroup())
        self._node = node
        _repeater.add(self)

    def take(
            self, who: str, moment: Moment, is_alone: Callable[[], bool]) -> Steps[str | None]:
        """
        Request the claim, and wait until it is clear who gets it.

        :param is_alone: whether a search has found that no other program drives the robot
        :returns: None if this program gets it; otherwise a text about the one that does
        """
        if self._state == HELD:
            return self.holder()
        self._who = who
        self._set_state(WANTED)
        asked = moment.now

        def is_decided() -> bool:
            nobody_claims = self._node.count_publishers(self._publisher.topic_name) < 2
            if nobody_claims and is_alone():
                return True
            settled = asked if nobody_claims else asked + CLAIM_SETTLE_TIME
            return self._blocker() is not None or moment.now >= max(
                settled, self._joined + CLAIM_DISCOVERY_TIME)

        try:
            yield from until(
                moment, is_decided, 'the claims of other programs',
                CLAIM_DISCOVERY_TIME + CLAIM_SETTLE_TIME)
        except BaseException:
            self.withdraw()
            raise
        if (blocker := self._blocker()) is not None:
            self.withdraw()
        return blocker

    def hold(self) -> None:
        if self._state != HELD:
            self._set_state(HELD)

    def withdraw(self) -> None:
        if self._state == WANTED:
            self._set_state(RELEASED)

    def holder(self) -> str | None:
        """Return a text about another program that has the claim; None if none has."""
        claim = self._claims.holder(time.monotonic())
        return None if claim is None else claim.who

    def release(self, moment: Moment) -> Steps[None]:
        """
        Tell other programs that this one no longer has the claim.

        After a conflict wait first, until CLAIM_CONFLICT_TIME (3 s) has passed since: the other
        program finds it in this time as well.
        """
        if self._conflict_found is not None:
            yield from pause(
                moment, self._conflict_found + CLAIM_CONFLICT_TIME - moment.now, 'the other one')
        _repeater.remove(self)
        if self._state != RELEASED and self._node.context.ok():
            self._set_state(RELEASED)

    def _blocker(self) -> str | None:
        claim = self._claims.blocking_claim(time.monotonic())
        return None if claim is None else claim.who

    def _set_state(self, state: str) -> None:
        self._state = state
        self._publish()

    def _publish(self) -> None:
        self._publisher.publish(
            String(data=Claim(self._participant, self._state, self._who).to_json()))

    def repeat(self) -> None:
        """Publish the claim again, for programs that came later, unless it is released."""
        if self._state != RELEASED and self._node.context.ok():
            self._publish()

    def _on_message(self, message: String) -> None:
        claim = Claim.from_json(message.data)
        if claim is None:
            return
        self._claims.on_claim(claim, time.monotonic())
        if self._state == HELD and (holder := self.holder()) is not None:
            if self._conflict_found is None:
                self._conflict_found = time.monotonic()
            self._on_conflict(holder)


class _Repeater:
    """Publishes the claims of this program again and again, in one thread for all of them."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        # Weak references, so that a claim of a node that could not be made is let go of.
        self._claims: weakref.WeakSet[_NetworkClaim] = weakref.WeakSet()
        self._stopped = threading.Event()
        self._stopped.set()

    def add(self, claim: _NetworkClaim) -> None:
        with self._lock:
            self._claims.add(claim)
            if self._stopped.is_set():
                self._stopped = threading.Event()
                # Started here, because since Python 3.12 no thread can start after the main
                # thread has ended, and another thread may begin to drive then.
                threading.Thread(
                    target=self._run, args=(self._stopped,), name='claims', daemon=True).start()

    def remove(self, claim: _NetworkClaim) -> None:
        with self._lock:
            self._claims.discard(claim)
            if not self._claims:
                self._stopped.set()

    def _run(self, stopped: threading.Event) -> None:
        while not stopped.wait(CLAIM_PERIOD):
            with self._lock:
                if not self._claims:
                    stopped.set()
            self._repeat()

    def _repeat(self) -> None:
        for claim in [*self._claims]:
            claim.repeat()


_repeater = _Repeater()
