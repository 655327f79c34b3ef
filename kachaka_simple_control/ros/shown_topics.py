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
"""Publish what is to be seen, beside the velocities and never in their way."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
import warnings

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.escaping import escaped
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from rcl_interfaces.msg import SetParametersResult
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import HistoryPolicy, QoSProfile
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions

#: The deepest queue that can be asked for; DDS takes memory for it [messages].
DEEPEST = 100_000
_DEPTHS = f'from 1 to {DEEPEST}'


class Unwatched:
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


def shown_topic(
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
    publisher: Publisher = with_quality(
        lambda options: node.create_publisher(
            kind, topic, quality, event_callbacks=Unwatched(),  # type: ignore[arg-type]
            qos_overriding_options=options),
        _refuse_to_wait)
    return publisher


def with_quality(
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
    is_possible = 1 <= quality.depth <= DEEPEST
    return SetParametersResult(
        successful=is_possible,
        reason='' if is_possible else f'depth is {quality.depth}; it must be {_DEPTHS}')


def _refuse_to_wait(quality: QoSProfile) -> SetParametersResult:
    # A full history makes publishing wait for readers, and the robot's thread with it.
    if quality.history == HistoryPolicy.KEEP_ALL:
        return SetParametersResult(
            successful=False, reason='history keep_all would let a slow reader hold up the drive')
    return SetParametersResult(successful=True)
