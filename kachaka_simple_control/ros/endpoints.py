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
Find the DDS participants of publishers and subscriptions, and compare and change their QoS.

Tested by test/ros/test_robot_discovery.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any
import uuid
import warnings

from geometry_msgs.msg import Twist
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.text import escaped
from rcl_interfaces.msg import SetParametersResult
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.qos import qos_check_compatible, QoSCompatibility, QoSProfile
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions

#: The quality of service of a service.  The default queue holds ten requests.  A request that
#: arrives while the queue is full is lost, and its client waits forever.
SERVICE_QOS = QoSProfile(depth=1000)
#: Length of the part of a GID that identifies the participant [bytes].  A participant is one
#: context of one process.
PARTICIPANT_LENGTH = 12
#: The largest allowed depth of a queue [messages]: DDS reserves memory for it.
MAX_DEPTH = 100_000
_DEPTHS = f'from 1 to {MAX_DEPTH}'
#: QoS policies of a publisher and a subscription that must be compatible.
_POLICIES = ('reliability', 'durability', 'deadline', 'liveliness', 'liveliness_lease_duration')


def participants(infos: Iterable[Any]) -> list[bytes]:
    """
    Return the identifier of the DDS participant of each publisher or subscription.

    It shows which program has it; node names are not transmitted between some ROS distributions.
    """
    return [bytes(info.endpoint_gid[:PARTICIPANT_LENGTH]) for info in infos]


def own_participant(node: Node) -> bytes:
    """
    Return the identifier of the DDS participant to which a node belongs.

    It is a part of the GID of a publisher, which rclpy does not offer.  So a publisher is created
    on a topic with a unique name, and found in the ROS graph.
    """
    topic = f'/_kachaka_simple_control/participant_{uuid.uuid4().hex}'
    publisher = node.create_publisher(Twist, topic, 1)
    (participant,) = participants(node.get_publishers_info_by_topic(topic))
    node.destroy_publisher(publisher)
    return participant


def incompatibility(offered: QoSProfile, requested: QoSProfile) -> str:
    """
    Describe why a publisher and a subscription do not match: each QoS policy with both values.

    :returns: empty if all policies match
    """
    if _is_compatible(offered, requested):
        return ''
    # Check one policy at a time; all other policies are as the publisher offers them.
    return ', '.join(
        f'{policy} (it asks for {_text(requested, policy)}, and {_text(offered, policy)} is '
        'offered)'
        for policy in _POLICIES
        if not _is_compatible(offered, _with_policy(offered, requested, policy)))


def _is_compatible(offered: QoSProfile, requested: QoSProfile) -> bool:
    return bool(qos_check_compatible(offered, requested)[0] != QoSCompatibility.ERROR)


def _with_policy(base: QoSProfile, source: QoSProfile, policy: str) -> QoSProfile:
    profile = QoSProfile(depth=1, **{name: getattr(base, name) for name in _POLICIES})
    setattr(profile, policy, getattr(source, policy))
    return profile


def _text(profile: QoSProfile, policy: str) -> str:
    value = getattr(profile, policy)
    if hasattr(value, 'nanoseconds'):
        # A duration that is not set is infinite.
        seconds = value.nanoseconds / 1e9
        return f'{seconds:g} s' if 0.0 < seconds < 1e9 else 'none'
    return str(value.name).lower()


def with_qos_overrides(
        create: Callable[[QoSOverridingOptions], Any],
        check: Callable[[QoSProfile], SetParametersResult] | None = None) -> Any:
    """
    Create and return a publisher or subscription whose QoS can be changed with ROS parameters.

    :param check: returns whether a QoS is allowed; None to check only the depth of the queue
    :raises UsageError: if a parameter sets a QoS that is not possible or not allowed
    """
    def check_all(qos: QoSProfile) -> SetParametersResult:
        result = _check_depth(qos)
        return check(qos) if check is not None and result.successful else result

    try:
        with warnings.catch_warnings():
            # For a depth of 0, rclpy only warns and uses another depth.
            warnings.simplefilter('error', UserWarning)
            return create(QoSOverridingOptions.with_default_policies(callback=check_all))
    except (InvalidQosOverridesError, ParameterException, RuntimeError, TypeError,
            UserWarning) as error:
        # Only the first line of the message says what is wrong.
        text = escaped(str(error).splitlines()[0], 400)
        if isinstance(error, (TypeError, UserWarning)):
            text = f'a quality of service is not possible: {text}; the depth must be {_DEPTHS}'
        raise UsageError(text) from None


def _check_depth(qos: QoSProfile) -> SetParametersResult:
    # Checked here, because the error message of DDS is a dozen lines long.
    is_possible = 1 <= qos.depth <= MAX_DEPTH
    return SetParametersResult(
        successful=is_possible,
        reason='' if is_possible else f'depth is {qos.depth}; it must be {_DEPTHS}')
