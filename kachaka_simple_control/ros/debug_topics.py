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
Publishers of debug topics: planned and driven path, sent velocities, speed, and diagnostics.

A separate thread sends the messages, so that the thread that drives is not delayed.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from functools import partial
from queue import SimpleQueue
import threading
import time
from typing import Any

from geometry_msgs.msg import TwistStamped
from kachaka_simple_control.control.diagnosis import Diagnosis
from kachaka_simple_control.control.events import (
    Event,
    MotionStarted,
    OdometryReceived,
    VelocitySent,
)
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.files.cdr import PathSerializer
from kachaka_simple_control.motion.geometry import ORIGIN, Pose, Velocity
from kachaka_simple_control.motion.paths import MAX_POSES, PoseHistory, sample_path
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.ros import conversions
from kachaka_simple_control.ros.endpoints import with_qos_overrides
from kachaka_simple_control.ros.names import DIAGNOSTICS
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
#: Time between two counts of the subscribers [s].  They are not counted at each message, because a
#: count takes longer than all other work for a message.
SUBSCRIBER_COUNT_PERIOD = 0.2
#: The shortest time between two messages of the driven path [s].
MIN_PATH_PERIOD = 0.5
#: The frame of the poses until the first odometry message names its frame.
FRAME = 'odom'
#: The QoS of a topic on which a late subscriber still gets the newest message.
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class NoEventCallbacks:
    """
    Replaces the event callbacks of an rclpy publisher, and creates no event handlers.

    rclpy gives each publisher two, which take time in every cycle of the executor.  A subscriber
    with an incompatible QoS logs the problem itself.
    """

    def create_event_handlers(self, *_: object) -> list[Any]:
        """Return an empty list, so that the rclpy publisher gets no handlers of QoS events."""
        return []


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
    A thread that sends the messages of all debug topics of a node; the first message starts it.

    :param velocity_topics: none of them may be that of a debug topic
    :param may_publish: whether messages may be sent now; otherwise they are dropped
    :param on_error: called with the publisher and the error if a message could not be sent
    """

    def __init__(
            self, node: Node, velocity_topics: Container[str], may_publish: Callable[[], bool],
            on_error: Callable[[Publisher, Exception], None]) -> None:
        self.node, self._velocity_topics = node, velocity_topics
        self._may_publish, self._on_error = may_publish, on_error
        self._queue: SimpleQueue[tuple[Publisher, Serialize] | None] = SimpleQueue()
        self._thread: threading.Thread | None = None
        self._starting = threading.Lock()

    def create_publisher(self, kind: type, topic: str, qos: QoSProfile) -> Publisher:
        """
        Create a publisher for a debug topic, whose QoS the user can override with parameters.

        :raises UsageError: if the topic is that of the velocities, or such a QoS is not allowed
        """
        name = self.node.resolve_topic_name(topic)
        if name in self._velocity_topics:
            raise UsageError(
                f'{topic} is remapped to {name}, which moves the robot: what is shown needs a '
                'topic of its own')
        callbacks: Any = NoEventCallbacks()
        publisher: Publisher = with_qos_overrides(
            lambda options: self.node.create_publisher(
                kind, topic, qos, event_callbacks=callbacks, qos_overriding_options=options),
            _check_history)
        return publisher

    def publish(self, publisher: Publisher, serialize: Serialize) -> None:
        """
        Queue a message for the thread, and return at once; drop it behind MAX_QUEUE others.

        :param serialize: returns the serialized message; called in the thread
        """
        if self._queue.qsize() < MAX_QUEUE:
            self._queue.put((publisher, serialize))
        if self._thread is None:
            self._start()

    def close(self) -> None:
        """End the thread after it has sent what is queued; wait for it up to 1 s."""
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


class DebugTopic:
    """
    The base class of all publishers that show on a debug topic what the node does.

    :raises UsageError: if the topic is remapped to that of the velocities
    """

    def __init__(self, thread: PublisherThread, kind: type, topic: str, qos: QoSProfile) -> None:
        self._thread = thread
        self._publisher = thread.create_publisher(kind, topic, qos)
        self._clock = thread.node.get_clock()

    @property
    def _has_subscribers(self) -> bool:
        return bool(self._publisher.get_subscription_count())

    def _send(self, serialize: Serialize) -> None:
        self._thread.publish(self._publisher, serialize)


class SpeedFactorPublisher(DebugTopic):
    """Publishes the speed factor when it changes; later subscribers receive the newest, too."""

    def __init__(self, thread: PublisherThread, topic: str) -> None:
        super().__init__(thread, Float64, topic, LATCHED)

    def publish(self, factor: float) -> None:
        """Publish the speed factor."""
        self._send(lambda: bytes(serialize_message(Float64(data=factor))))


class CommandedVelocityPublisher(DebugTopic):
    """
    While there are subscribers, publishes a copy of each velocity that was sent to the robot.

    The QoS is best effort: a plot needs only the newest value, and a reliable publisher has work
    with subscribers that are slow, have ended or are frozen.

    :param frame: the frame of the robot, for the header of the messages
    """

    def __init__(self, thread: PublisherThread, topic: str, frame: str) -> None:
        super().__init__(
            thread, TwistStamped, topic,
            QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT))
        # Created once: creating a message takes longer than sending it.
        self._message = TwistStamped()
        self._message.header.frame_id = frame
        self._is_wanted = False
        self._check_time = float('-inf')

    def is_wanted(self) -> bool:
        """Return whether the topic has subscribers; this is asked often."""
        now = time.monotonic()
        if now - self._check_time >= SUBSCRIBER_COUNT_PERIOD:
            self._check_time = now
            self._is_wanted = self._has_subscribers
        return self._is_wanted

    def on_sent(self, event: Event) -> None:
        """Publish a copy of a ``VelocitySent`` with its time, if there are subscribers."""
        if isinstance(event, VelocitySent) and self._is_wanted:
            self._send(partial(
                self._serialize, event.velocity,
                self._clock.now().nanoseconds - round((time.monotonic() - event.time) * 1e9)))

    def _serialize(self, velocity: Velocity, time: int) -> bytes:
        message = self._message
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(time, 1_000_000_000)
        message.twist.linear.x = velocity.linear_x
        message.twist.angular.z = velocity.angular_z
        return bytes(serialize_message(message))


class DiagnosticsPublisher(DebugTopic):
    """
    Publishes a diagnosis of each robot when ``publish`` is called and there are subscribers.

    :param diagnose: returns the current diagnoses, by the name of the status and the hardware ID
    :raises ImportError: if diagnostic_msgs is not installed
    """

    def __init__(
            self, thread: PublisherThread,
            diagnose: Callable[[], Mapping[tuple[str, str], Diagnosis]]) -> None:
        from diagnostic_msgs.msg import DiagnosticArray
        super().__init__(thread, DiagnosticArray, DIAGNOSTICS, QoSProfile(depth=10))
        self._diagnose = diagnose

    def publish(self) -> None:
        """Publish the current diagnosis of each robot, if there are subscribers."""
        if self._has_subscribers and (diagnoses := self._diagnose()):
            message = conversions.diagnostics(diagnoses, self._clock.now().to_msg())
            self._send(lambda: bytes(serialize_message(message)))


class PathTopic(DebugTopic):
    """
    The base class of the publishers of ``nav_msgs/Path`` messages on a debug topic.

    :raises ImportError: if nav_msgs is not installed
    """

    def __init__(self, thread: PublisherThread, topic: str, qos: QoSProfile) -> None:
        from nav_msgs.msg import Path
        super().__init__(thread, Path, topic, qos)
        self.set_frame(FRAME)

    def set_frame(self, frame: str) -> None:
        """Use the frame of the odometry in all later messages."""
        self._serializer = PathSerializer(frame)

    def _send_path(self, poses: Sequence[bytes]) -> None:
        path = self._serializer.path(poses, self._clock.now().nanoseconds)
        self._send(lambda: path)


class PlannedPathPublisher(PathTopic):
    """Publishes the path before the robot drives it; later subscribers get it, too."""

    def __init__(self, thread: PublisherThread, topic: str) -> None:
        super().__init__(thread, topic, LATCHED)
        self._pose: Pose | None = None
        #: the plan that was published from the origin, because the robot's pose was unknown
        self._plan_from_origin: Plan | None = None

    def on_plan(self, plan: Plan) -> None:
        """Publish the path from the newest pose of odometry on; from the origin without one."""
        self._plan_from_origin = plan if self._pose is None else None
        self._publish(plan, self._pose or ORIGIN)

    def on_motion_started(self, event: MotionStarted) -> None:
        """Record that the robot moves now: odometry no longer moves the planned path."""
        del event
        self._plan_from_origin = None

    def on_odometry(self, event: OdometryReceived) -> None:
        """Publish the path again from the first known pose on, unless the robot moves."""
        self._pose = event.pose
        plan, self._plan_from_origin = self._plan_from_origin, None
        if plan is not None:
            self._publish(plan, event.pose)

    def _publish(self, plan: Plan, start: Pose) -> None:
        self._send_path([self._serializer.pose(pose) for pose in sample_path(plan, start)])


class DrivenPathPublisher(PathTopic):
    """While there are subscribers, publishes the path that the robot has driven, from odometry."""

    def __init__(self, thread: PublisherThread, topic: str) -> None:
        super().__init__(thread, topic, QoSProfile(depth=1))
        self._publish_time = float('-inf')

    def set_frame(self, frame: str) -> None:
        """Begin a new path in another frame of odometry."""
        super().set_frame(frame)
        self._history = PoseHistory(
            MAX_POSES, lambda pose: self._serializer.pose(pose, self._clock.now().nanoseconds))

    def on_odometry(self, event: OdometryReceived) -> None:
        """Add a pose; publish the path to subscribers once per MIN_PATH_PERIOD (0.5 s)."""
        self._history.add(event.pose)
        if event.time - self._publish_time >= MIN_PATH_PERIOD and self._has_subscribers:
            self._publish_time = event.time
            self._send_path(self._history.kept)
