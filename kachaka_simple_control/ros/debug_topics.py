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
"""Publishers of debug topics, which show the state of a node; a separate thread publishes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from queue import SimpleQueue
import threading
import time
from typing import Any

from geometry_msgs.msg import TwistStamped
from kachaka_simple_control.control.events import Event, VelocitySent
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.ros import conversions
from kachaka_simple_control.ros.endpoints import with_qos_overrides
from kachaka_simple_control.ros.names import COMMANDED_VELOCITY, DIAGNOSTICS, SPEED_FACTOR
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from kachaka_simple_control.telemetry.diagnosis import Diagnosis
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from std_msgs.msg import Float64

#: How many messages may wait for the publisher thread; further messages are dropped.
MAX_QUEUE = 200
#: How long the publisher thread may take to end [s].
THREAD_EXIT_TIMEOUT = 1.0
#: Time between two counts of the subscribers [s]: a count takes longer than the rest of a call.
SUBSCRIBER_COUNT_PERIOD = 0.2


class NoEventCallbacks:
    """
    Event callbacks for a publisher that needs none: it creates no event handlers.

    By default each publisher has two event callbacks.  They take time in every cycle of the
    executor, and are not needed here: a subscriber with an incompatible QoS logs this itself.
    """

    def create_event_handlers(self, *_: object) -> list[Any]:
        """Return an empty list of event handlers."""
        return []


def create_debug_publisher(
        node: Node, velocities: VelocityPublisher, kind: type, topic: str,
        qos: QoSProfile) -> Publisher:
    """
    Create a publisher whose QoS can be changed with the ROS parameters ``qos_overrides``.

    :param velocities: the publisher of the velocities that move the robot
    :param kind: the type of the message
    :param topic: the name of the topic, before remapping
    :param qos: the default QoS
    :raises UsageError: if the topic is remapped to the velocity topic, or the QoS is refused
    """
    name = node.resolve_topic_name(topic)
    if name == velocities.topic_name:
        raise UsageError(
            f'{topic} is remapped to {name}, which moves the robot: what is shown needs a topic '
            'of its own')
    callbacks: Any = NoEventCallbacks()
    publisher: Publisher = with_qos_overrides(
        lambda options: node.create_publisher(
            kind, topic, qos, event_callbacks=callbacks, qos_overriding_options=options),
        _check_history)
    return publisher


def _check_history(qos: QoSProfile) -> SetParametersResult:
    # With a full history, publishing waits for readers, and then the drive waits as well.
    if qos.history == HistoryPolicy.KEEP_ALL:
        return SetParametersResult(
            successful=False, reason='history keep_all would let a slow reader hold up the drive')
    return SetParametersResult(successful=True)


#: Returns a serialised message; called in the thread that publishes it.
Serialize = Callable[[], bytes]


class PublisherThread:
    """
    One thread that publishes all debug topics of a node; the first message starts it.

    :param may_publish: returns whether messages may be published now
    :param on_error: called with the publisher and the error if a message could not be published
    """

    def __init__(
            self, may_publish: Callable[[], bool],
            on_error: Callable[[Publisher, Exception], None]) -> None:
        self._may_publish, self._on_error = may_publish, on_error
        self._queue: SimpleQueue[tuple[Publisher, Serialize] | None] = SimpleQueue()
        self._thread: threading.Thread | None = None
        self._starting = threading.Lock()

    def publish(self, publisher: Publisher, serialize: Serialize) -> None:
        """Put a message into the queue, and return at once."""
        if self._queue.qsize() < MAX_QUEUE:
            self._queue.put((publisher, serialize))
        if self._thread is None:
            self._start()

    def close(self) -> None:
        """Publish the messages in the queue, then end the thread."""
        self._queue.put(None)
        if self._thread is not None:
            self._thread.join(THREAD_EXIT_TIMEOUT)

    def _start(self) -> None:
        with self._starting:
            if self._thread is None:
                self._thread = threading.Thread(
                    target=self._run, name='debug topics', daemon=True)
                self._thread.start()

    def _run(self) -> None:
        while (item := self._queue.get()) is not None:
            publisher, serialize = item
            try:
                if self._may_publish():
                    self._publish(publisher, serialize)
            except Exception as error:  # any error: the next message may still be published
                self._on_error(publisher, error)

    def _publish(self, publisher: Publisher, serialize: Serialize) -> None:
        publisher.publish(serialize())


class SpeedFactorPublisher:
    """
    Publishes the speed factor when it changes; a late subscriber gets the newest value.

    :param velocities: the publisher of the velocities that move the robot
    :raises UsageError: if the topic is remapped to the velocity topic
    """

    def __init__(
            self, node: Node, velocities: VelocityPublisher, thread: PublisherThread) -> None:
        self._publisher = create_debug_publisher(
            node, velocities, Float64, SPEED_FACTOR,
            QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        self._thread = thread

    def publish(self, factor: float) -> None:
        """Publish the speed factor, from 0 to 1."""
        self._thread.publish(
            self._publisher, lambda: bytes(serialize_message(Float64(data=factor))))


class CommandedVelocityPublisher:
    """
    Publishes each velocity again on a debug topic after it was sent, while there are subscribers.

    The QoS is best effort: a plot needs the newest value only.  A reliable writer has more work
    with readers that are slow, gone or frozen.

    :param velocities: the publisher of the velocities that move the robot
    :param frame: the frame of the robot
    :raises UsageError: if the topic is remapped to the velocity topic
    """

    def __init__(
            self, node: Node, velocities: VelocityPublisher, thread: PublisherThread,
            frame: str) -> None:
        self._publisher = create_debug_publisher(
            node, velocities, TwistStamped, COMMANDED_VELOCITY,
            QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT))
        self._thread = thread
        self._clock = node.get_clock()
        # Created once: creating a message takes longer than sending it.
        self._message = TwistStamped()
        self._message.header.frame_id = frame
        self._has_subscribers = False
        self._check_time = float('-inf')

    def on_sent(self, event: Event) -> None:
        """Publish the velocity of a ``VelocitySent`` event, stamped with its send time."""
        if not isinstance(event, VelocitySent):
            return
        if event.time - self._check_time >= SUBSCRIBER_COUNT_PERIOD:
            self._check_time = event.time
            self._has_subscribers = self._publisher.get_subscription_count() > 0
        if self._has_subscribers:
            self._thread.publish(self._publisher, partial(
                self._serialize, event.velocity,
                self._clock.now().nanoseconds - round((time.monotonic() - event.time) * 1e9)))

    def _serialize(self, velocity: Velocity, time: int) -> bytes:
        message = self._message
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(time, 1_000_000_000)
        message.twist.linear.x = velocity.linear_x
        message.twist.angular.z = velocity.angular_z
        return bytes(serialize_message(message))


class DiagnosticsPublisher:
    """
    Publishes a diagnosis each time ``publish`` is called, if there are subscribers.

    :param velocities: the publisher of the velocities that move the robot
    :param robot: the name of the robot
    :param diagnose: returns the diagnosis; None if there is none
    :raises ImportError: if diagnostic_msgs is not installed
    :raises UsageError: if the topic is remapped to the velocity topic
    """

    def __init__(
            self, node: Node, velocities: VelocityPublisher, thread: PublisherThread, robot: str,
            diagnose: Callable[[], Diagnosis | None]) -> None:
        from diagnostic_msgs.msg import DiagnosticArray
        self._publisher = create_debug_publisher(
            node, velocities, DiagnosticArray, DIAGNOSTICS, QoSProfile(depth=10))
        self._thread = thread
        self._clock = node.get_clock()
        self._name = f'{node.get_fully_qualified_name().lstrip("/")}: drive'
        self._robot = f'{robot} on {velocities.topic_name}'
        self._diagnose = diagnose

    def publish(self) -> None:
        """Publish the current diagnosis."""
        if not self._publisher.get_subscription_count():
            return
        diagnosis = self._diagnose()
        if diagnosis is None:
            return
        message = conversions.diagnostics(
            {self._name: diagnosis}, self._clock.now().to_msg(), self._robot)
        self._thread.publish(self._publisher, lambda: bytes(serialize_message(message)))
