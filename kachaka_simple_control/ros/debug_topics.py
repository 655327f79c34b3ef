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


class NoEventCallbacks:
    """
    In place of the events of a publisher.

    By default each has two, which cost every turn of the executor more than they are worth here:
    whoever asks for a quality that is not offered is told so on the other side.
    """

    def create_event_handlers(self, *_: object) -> list[Any]:
        """
        Handle no event.

        :returns: nothing
        """
        return []


def create_debug_publisher(
        node: Node, velocities: VelocityPublisher, kind: type, topic: str,
        quality: QoSProfile) -> Publisher:
    """
    Make a publisher of something that is shown.

    Its quality of service can be changed by the parameters that ROS has for that.

    :param node: whose it is
    :param velocities: the publisher that moves the robot
    :param kind: the type of the message
    :param topic: its name, before remapping
    :param quality: the quality of service where nobody wants another one
    :returns: the publisher
    :raises UsageError: if the topic is the one that moves the robot, or a quality cannot be had
    """
    name = node.resolve_topic_name(topic)
    if name == velocities.topic_name:
        raise UsageError(
            f'{topic} is remapped to {name}, which moves the robot: what is shown needs a topic '
            'of its own')
    publisher: Publisher = with_qos_overrides(
        lambda options: node.create_publisher(
            kind, topic, quality, event_callbacks=NoEventCallbacks(),  # type: ignore[arg-type]
            qos_overriding_options=options),
        _refuse_to_wait)
    return publisher


def with_qos_overrides(
        make: Callable[[QoSOverridingOptions], Any],
        check: Callable[[QoSProfile], SetParametersResult] | None = None) -> Any:
    """
    Make something whose quality of service parameters may change.

    :param make: makes it, told which of its qualities can be changed
    :param check: refuses a quality
    :returns: what was made
    :raises UsageError: if a parameter asks for a quality that cannot be had
    """
    def checked(quality: QoSProfile) -> SetParametersResult:
        possible = _refuse_depth(quality)
        return check(quality) if check is not None and possible.successful else possible

    try:
        with warnings.catch_warnings():
            # For a depth of 0 rclpy takes another one, and only warns.
            warnings.simplefilter('error', UserWarning)
            return make(QoSOverridingOptions.with_default_policies(callback=checked))
    except (InvalidQosOverridesError, ParameterException, RuntimeError, TypeError,
            UserWarning) as error:
        # Of several lines only the first says what is wrong.
        text = escaped(str(error).splitlines()[0], 400)
        if isinstance(error, (TypeError, UserWarning)):
            text = f'a quality of service cannot be had: {text}; the depth must be {_DEPTHS}'
        raise UsageError(text) from None


def _refuse_depth(quality: QoSProfile) -> SetParametersResult:
    # Of this DDS would print a dozen lines.
    is_possible = 1 <= quality.depth <= MAX_DEPTH
    return SetParametersResult(
        successful=is_possible,
        reason='' if is_possible else f'depth is {quality.depth}; it must be {_DEPTHS}')


def _refuse_to_wait(quality: QoSProfile) -> SetParametersResult:
    # A full history makes publishing wait for readers, and the robot's thread with it.
    if quality.history == HistoryPolicy.KEEP_ALL:
        return SetParametersResult(
            successful=False, reason='history keep_all would let a slow reader hold up the drive')
    return SetParametersResult(successful=True)


#: So many messages may wait for DDS; what comes then is left away.
MAX_QUEUE = 200
#: How long the thread may take to end [s].
THREAD_EXIT_TIMEOUT = 1.0

#: Makes a message, in the thread that publishes it.
Make = Callable[[], bytes]


class PublisherThread:
    """One thread for all that a node shows; it begins with the first message."""

    def __init__(self, is_open: Callable[[], bool]) -> None:
        """
        Publish nothing yet.

        :param is_open: whether anything may be published yet
        """
        self._is_open = is_open
        self._waiting: SimpleQueue[tuple[Publisher, Make] | None] = SimpleQueue()
        self._thread: threading.Thread | None = None
        self._starting = threading.Lock()
        #: what is told when something could not be made
        self.on_error: Callable[[Publisher, Exception], None] = _ignore

    def publish(self, publisher: Publisher, make: Make) -> None:
        """
        Publish something soon, in its turn; returns at once.

        :param publisher: where
        :param make: returns the message as bytes
        """
        if self._waiting.qsize() < MAX_QUEUE:
            self._waiting.put((publisher, make))
        if self._thread is None:
            self._start()

    def close(self) -> None:
        """Publish nothing more."""
        self._waiting.put(None)
        if self._thread is not None:
            self._thread.join(THREAD_EXIT_TIMEOUT)

    def _start(self) -> None:
        with self._starting:
            if self._thread is None:
                self._thread = threading.Thread(target=self._serve, name='shown', daemon=True)
                self._thread.start()

    def _serve(self) -> None:
        while (waiting := self._waiting.get()) is not None:
            publisher, make = waiting
            try:
                if self._is_open():
                    self._publish(publisher, make)
            except Exception as error:  # whatever it is, the next message is another one
                self.on_error(publisher, error)

    def _publish(self, publisher: Publisher, make: Make) -> None:
        publisher.publish(make())


def _ignore(publisher: Publisher, error: Exception) -> None:
    """Tell nobody."""


TOPIC = '~/commanded_velocity'
#: How often to check whether anybody subscribes [s]: the check takes longer than all the rest.
VIEWER_CHECK_PERIOD = 0.2


class CommandedVelocityPublisher:
    """
    Publishes velocities after they left, as long as somebody subscribes.

    The thread that moves the robot does no more for it than to look whether anybody does, and to
    put a velocity into a queue.  Best effort: for a plot the newest counts, and a reliable writer
    has more to do for readers that are slow, gone or frozen.
    """

    def __init__(
            self, node: Node, velocities: VelocityPublisher, aside: PublisherThread,
            frame: str) -> None:
        """
        Publish nothing yet.

        :param node: whose topic it is
        :param velocities: the publisher that moves the robot
        :param aside: publishes without holding anybody up
        :param frame: the frame of the robot
        :raises UsageError: if the topic is remapped to where it would move the robot
        """
        self._publisher = create_debug_publisher(
            node, velocities, TwistStamped, TOPIC,
            QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT))
        self._aside = aside
        self._clock = node.get_clock()
        # Made once: a message takes longer to make than to send.
        self._message = TwistStamped()
        self._message.header.frame_id = frame
        self._is_watched = False
        self._looked = float('-inf')

    def on_sent(self, event: Event) -> None:
        """
        Publish what was sent.

        :param event: what happened; a velocity that is told of has left just now
        """
        if not isinstance(event, VelocitySent):
            return
        if event.time - self._looked >= VIEWER_CHECK_PERIOD:
            self._looked = event.time
            self._is_watched = self._publisher.get_subscription_count() > 0
        if self._is_watched:
            self._aside.publish(self._publisher, partial(
                self._packed, event.velocity, self._clock.now().nanoseconds))

    def _packed(self, velocity: Velocity, time: int) -> bytes:
        message = self._message
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(time, 1_000_000_000)
        message.twist.linear.x = velocity.linear_x
        message.twist.angular.z = velocity.angular_z
        return bytes(serialize_message(message))


#: How often a diagnosis is made [s].
DIAGNOSTICS_PERIOD = 1.0

Show = Callable[[Any], None]


class IntrospectionPublishers:
    """
    The topics beside the velocities: paths, commanded velocity, diagnostics.

    Whatever fails in it is told once and left away from then on; the drive goes on.
    """

    def __init__(self, node: Node, velocities: VelocityPublisher, profile: RobotProfile) -> None:
        """
        Publish nothing yet.

        :param node: whose topics they are
        :param velocities: the publisher that moves the robot
        :param profile: the kind of robot
        :raises UsageError: if a topic is remapped to where it would move the robot
        """
        self._node = node
        self._tally = TickStatistics()
        self._lookout: StatusReader | None = None
        self._aside = PublisherThread(lambda: self._is_open)
        self._aside.on_error = self._could_not
        self._failed: set[str] = set()
        self._plans: list[Show] = []
        self._frames: list[Show] = []
        self._events: dict[type, list[Show]] = {}
        #: told everything, at any time: quick, and careful on their own
        self._hearers: list[EventHandler] = [
            self._safe(TOPIC,
            CommandedVelocityPublisher(node, velocities, self._aside, profile.frame).on_sent)]
        self._show_paths(velocities)
        self._show_diagnostics(velocities, profile.name)

    def attach(self, audience: EventBus, lookout: StatusReader) -> None:
        """
        Show what happens from now on.

        :param audience: tells it
        :param lookout: looks at the session with the robot
        """
        self._lookout = lookout
        for hearer in (*self._hearers, self._hear):
            audience.subscribe(hearer)

    def on_plan(self, plan: Plan) -> None:
        """
        Show a plan that is driven next.

        :param plan: the plan
        """
        for show in self._plans:
            show(plan)

    def in_frame(self, frame: str) -> None:
        """
        Take note of the frame that odometry is in.

        :param frame: its name
        """
        for show in self._frames:
            show(frame)

    def close(self) -> None:
        """Publish nothing more."""
        self._aside.close()

    @property
    def _is_open(self) -> bool:
        return self._lookout is not None and not self._lookout.is_closed

    def _hear(self, event: Event) -> None:
        shows = self._events.get(type(event))
        if shows and self._is_open:
            for show in shows:
                show(event)

    def _show_paths(self, velocities: VelocityPublisher) -> None:
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
        planned = PlannedPathPublisher(self._node, velocities, self._aside)
        driven = DrivenPathPublisher(self._node, velocities, self._aside)
        self._plans.append(self._safe(PLANNED, planned.on_plan))
        self._frames += [
            self._safe(PLANNED, planned.in_frame), self._safe(DRIVEN, driven.in_frame)]
        self._events[MotionStarted] = [self._safe(PLANNED, planned.on_motion_started)]
        self._events[OdometryReceived] = [
            self._safe(PLANNED, planned.on_odometry), self._safe(DRIVEN, driven.on_odometry)]

    def _show_diagnostics(self, velocities: VelocityPublisher, robot: str) -> None:
        try:
            from kachaka_simple_control.ros.diagnostics import DiagnosticsPublisher
        except ImportError:
            return
        diagnostics = DiagnosticsPublisher(
            self._node, velocities, self._aside, robot, self._condition)
        self._plans.append(self._tally.on_plan)
        self._hearers.append(self._tally.on_event)
        # A timer would otherwise follow /clock, which may stand still while the robot drives.
        self._timer = self._node.create_timer(
            DIAGNOSTICS_PERIOD, self._safe('/diagnostics', lambda _: self._diagnose(diagnostics)),
            clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _diagnose(self, diagnostics: DiagnosticsPublisher) -> None:
        self._tally.process()
        diagnostics.publish()

    def _condition(self) -> Diagnosis | None:
        if self._lookout is None or self._lookout.is_closed:
            return None
        now = time.monotonic()
        return diagnose(self._tally, self._lookout.read(now), now)

    def _safe(self, name: str, show: Show) -> Show:
        """Return what shows something, but fails only once and ends nothing."""
        has_failed = False

        def guarded(what: Any = None) -> None:
            nonlocal has_failed
            if has_failed:
                return
            try:
                show(what)
            except Exception as error:  # whatever it is, the robot comes first
                has_failed = True
                self._node.get_logger().warning(
                    f'{name} is shown no more: {type(error).__name__}: {error}')
        return guarded

    def _could_not(self, publisher: Publisher, error: Exception) -> None:
        name = str(publisher.topic_name)
        if self._is_open and name not in self._failed:
            self._failed.add(name)
            self._node.get_logger().warning(
                f'{name} could not be shown: {type(error).__name__}: {error}')
