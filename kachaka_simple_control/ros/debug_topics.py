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
"""Topics that show what a node does, published by a thread of their own."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from queue import SimpleQueue
import threading
import time
from typing import Any, TYPE_CHECKING
import warnings

from geometry_msgs.msg import TwistStamped
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.escaping import escaped
from kachaka_simple_control.files.robot_profile import RobotProfile
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.ros.session_status import diagnose, StatusReader, TickStatistics
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from kachaka_simple_control.telemetry.diagnosis import Diagnosis
from kachaka_simple_control.telemetry.events import (
    Event,
    EventBus,
    EventHandler,
    MotionStarted,
    OdometryReceived,
    VelocitySent,
)
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions
from rclpy.serialization import serialize_message

if TYPE_CHECKING:
    from kachaka_simple_control.ros.diagnostics import DiagnosticsPublisher

#: The deepest queue that can be asked for; DDS takes memory for it [messages].
MAX_DEPTH = 100_000
_DEPTHS = f'from 1 to {MAX_DEPTH}'
#: How many messages may wait for the publisher thread; what comes then is dropped.
MAX_QUEUE = 200
#: How long the publisher thread may take to end [s].
THREAD_EXIT_TIMEOUT = 1.0
TOPIC = '~/commanded_velocity'
#: How often subscribers are counted [s]: counting takes longer than all the rest here.
VIEWER_CHECK_PERIOD = 0.2
#: How often a diagnosis is made [s].
DIAGNOSTICS_PERIOD = 1.0


class NoEventCallbacks:
    """
    Replaces the event callbacks of a publisher by none.

    By default each publisher has two, which cost every turn of the executor more than they are
    worth here: a subscriber that asks for an incompatible QoS is told so on its own side.
    """

    def create_event_handlers(self, *_: object) -> list[Any]:
        """Return no handlers."""
        return []


def create_debug_publisher(
        node: Node, velocities: VelocityPublisher, kind: type, topic: str,
        qos: QoSProfile) -> Publisher:
    """
    Create a publisher whose QoS can be changed by the parameters that ROS has for that.

    :param velocities: the publisher that moves the robot
    :param kind: the type of the message
    :param topic: its name, before remapping
    :param qos: its default QoS
    :raises UsageError: if the topic is the one that moves the robot, or the QoS is refused
    """
    name = node.resolve_topic_name(topic)
    if name == velocities.topic_name:
        raise UsageError(
            f'{topic} is remapped to {name}, which moves the robot: what is shown needs a topic '
            'of its own')
    publisher: Publisher = with_qos_overrides(
        lambda options: node.create_publisher(
            kind, topic, qos, event_callbacks=NoEventCallbacks(),  # type: ignore[arg-type]
            qos_overriding_options=options),
        _check_history)
    return publisher


def with_qos_overrides(
        create: Callable[[QoSOverridingOptions], Any],
        check: Callable[[QoSProfile], SetParametersResult] | None = None) -> Any:
    """
    Return what a function creates, with a QoS that parameters may change.

    :param create: takes the options for overriding
    :param check: refuses a QoS
    :raises UsageError: if a parameter asks for a QoS that is refused
    """
    def check_all(qos: QoSProfile) -> SetParametersResult:
        result = _check_depth(qos)
        return check(qos) if check is not None and result.successful else result

    try:
        with warnings.catch_warnings():
            # For a depth of 0 rclpy takes another one, and only warns.
            warnings.simplefilter('error', UserWarning)
            return create(QoSOverridingOptions.with_default_policies(callback=check_all))
    except (InvalidQosOverridesError, ParameterException, RuntimeError, TypeError,
            UserWarning) as error:
        # Of several lines only the first says what is wrong.
        text = escaped(str(error).splitlines()[0], 400)
        if isinstance(error, (TypeError, UserWarning)):
            text = f'a quality of service cannot be had: {text}; the depth must be {_DEPTHS}'
        raise UsageError(text) from None


def _check_depth(qos: QoSProfile) -> SetParametersResult:
    # Of this DDS would print a dozen lines.
    is_possible = 1 <= qos.depth <= MAX_DEPTH
    return SetParametersResult(
        successful=is_possible,
        reason='' if is_possible else f'depth is {qos.depth}; it must be {_DEPTHS}')


def _check_history(qos: QoSProfile) -> SetParametersResult:
    # A full history makes publishing wait for readers, and the robot's thread with it.
    if qos.history == HistoryPolicy.KEEP_ALL:
        return SetParametersResult(
            successful=False, reason='history keep_all would let a slow reader hold up the drive')
    return SetParametersResult(successful=True)


#: Returns a serialised message; called in the thread that publishes it.
Serialize = Callable[[], bytes]


class PublisherThread:
    """
    One thread that publishes all debug topics of a node; it starts with the first message.

    :param may_publish: whether anything may be published now
    :param on_error: called with each message's error
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
        """Publish what is in the queue, and nothing more."""
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
            except Exception as error:  # whatever it is, the next message is another one
                self._on_error(publisher, error)

    def _publish(self, publisher: Publisher, serialize: Serialize) -> None:
        publisher.publish(serialize())


class CommandedVelocityPublisher:
    """
    Publishes velocities after they were sent, as long as there are subscribers.

    The thread that moves the robot only counts subscribers now and then, and puts a velocity into
    a queue.  Best effort: for a plot the newest counts, and a reliable writer has more to do for
    readers that are slow, gone or frozen.

    :param velocities: the publisher that moves the robot
    :param frame: the frame of the robot
    :raises UsageError: if the topic is remapped to where it would move the robot
    """

    def __init__(
            self, node: Node, velocities: VelocityPublisher, thread: PublisherThread,
            frame: str) -> None:
        self._publisher = create_debug_publisher(
            node, velocities, TwistStamped, TOPIC,
            QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT))
        self._thread = thread
        self._clock = node.get_clock()
        # Made once: a message takes longer to make than to send.
        self._message = TwistStamped()
        self._message.header.frame_id = frame
        self._has_subscribers = False
        self._check_time = float('-inf')

    def on_sent(self, event: Event) -> None:
        """Publish the velocity of a ``VelocitySent``, which left just now."""
        if not isinstance(event, VelocitySent):
            return
        if event.time - self._check_time >= VIEWER_CHECK_PERIOD:
            self._check_time = event.time
            self._has_subscribers = self._publisher.get_subscription_count() > 0
        if self._has_subscribers:
            self._thread.publish(self._publisher, partial(
                self._serialize, event.velocity, self._clock.now().nanoseconds))

    def _serialize(self, velocity: Velocity, time: int) -> bytes:
        message = self._message
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(time, 1_000_000_000)
        message.twist.linear.x = velocity.linear_x
        message.twist.angular.z = velocity.angular_z
        return bytes(serialize_message(message))


#: Takes a plan, a frame or an event.
Handler = Callable[[Any], None]


class IntrospectionPublishers:
    """
    The topics beside the velocities: paths, commanded velocity, diagnostics.

    What fails is logged once and not published from then on; the drive goes on.

    :param velocities: the publisher that moves the robot
    :raises UsageError: if a topic is remapped to where it would move the robot
    """

    def __init__(self, node: Node, velocities: VelocityPublisher, profile: RobotProfile) -> None:
        self._node = node
        self._statistics = TickStatistics()
        self._status_reader: StatusReader | None = None
        self._thread = PublisherThread(lambda: self._is_open, self._log_error)
        self._failed: set[str] = set()
        self._on_plan: list[Handler] = []
        self._on_frame: list[Handler] = []
        #: by type of event; called only while the session is open
        self._on_event: dict[type, list[Handler]] = {}
        #: called with all events, at any time: they return at once
        self._always: list[EventHandler] = [self._failing_once(TOPIC, CommandedVelocityPublisher(
            node, velocities, self._thread, profile.frame).on_sent)]
        self._add_paths(velocities)
        self._add_diagnostics(velocities, profile.name)

    def attach(self, event_bus: EventBus, status_reader: StatusReader) -> None:
        """Publish what happens from now on."""
        self._status_reader = status_reader
        for handler in (*self._always, self._handle):
            event_bus.subscribe(handler)

    def on_plan(self, plan: Plan) -> None:
        """Publish a plan that is driven next."""
        for handler in self._on_plan:
            handler(plan)

    def in_frame(self, frame: str) -> None:
        """Use the frame that odometry is in."""
        for handler in self._on_frame:
            handler(frame)

    def close(self) -> None:
        """Publish nothing more."""
        self._thread.close()

    @property
    def _is_open(self) -> bool:
        return self._status_reader is not None and not self._status_reader.is_closed

    def _handle(self, event: Event) -> None:
        handlers = self._on_event.get(type(event))
        if handlers and self._is_open:
            for handler in handlers:
                handler(event)

    def _add_paths(self, velocities: VelocityPublisher) -> None:
        # Imported here: a drive needs no nav_msgs, it only shows less of itself.
        try:
            from kachaka_simple_control.ros.path_topics import (
                DRIVEN,
                DrivenPathPublisher,
                PLANNED,
                PlannedPathPublisher,
            )
        except ImportError:
            return
        planned = PlannedPathPublisher(self._node, velocities, self._thread)
        driven = DrivenPathPublisher(self._node, velocities, self._thread)
        self._on_plan.append(self._failing_once(PLANNED, planned.on_plan))
        self._on_frame += [self._failing_once(PLANNED, planned.in_frame),
                           self._failing_once(DRIVEN, driven.in_frame)]
        self._on_event[MotionStarted] = [self._failing_once(PLANNED, planned.on_motion_started)]
        self._on_event[OdometryReceived] = [self._failing_once(PLANNED, planned.on_odometry),
                                            self._failing_once(DRIVEN, driven.on_odometry)]

    def _add_diagnostics(self, velocities: VelocityPublisher, robot: str) -> None:
        try:
            from kachaka_simple_control.ros.diagnostics import DiagnosticsPublisher
        except ImportError:
            return
        diagnostics = DiagnosticsPublisher(
            self._node, velocities, self._thread, robot, self._diagnose)
        self._on_plan.append(self._statistics.on_plan)
        self._always.append(self._statistics.on_event)
        # A timer would otherwise follow /clock, which may stand still while the robot drives.
        self._timer = self._node.create_timer(
            DIAGNOSTICS_PERIOD,
            self._failing_once('/diagnostics', lambda _: self._publish_diagnosis(diagnostics)),
            clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _publish_diagnosis(self, diagnostics: DiagnosticsPublisher) -> None:
        self._statistics.process()
        diagnostics.publish()

    def _diagnose(self) -> Diagnosis | None:
        if self._status_reader is None or self._status_reader.is_closed:
            return None
        now = time.monotonic()
        return diagnose(self._statistics, self._status_reader.read(now), now)

    def _failing_once(self, name: str, handler: Handler) -> Handler:
        """Return a handler that logs its first error, and does nothing from then on."""
        has_failed = False

        def guarded(argument: Any = None) -> None:
            nonlocal has_failed
            if has_failed:
                return
            try:
                handler(argument)
            except Exception as error:  # whatever it is, the robot comes first
                has_failed = True
                self._node.get_logger().warning(
                    f'{name} is shown no more: {type(error).__name__}: {error}')
        return guarded

    def _log_error(self, publisher: Publisher, error: Exception) -> None:
        name = str(publisher.topic_name)
        if self._is_open and name not in self._failed:
            self._failed.add(name)
            self._node.get_logger().warning(
                f'{name} could not be shown: {type(error).__name__}: {error}')
