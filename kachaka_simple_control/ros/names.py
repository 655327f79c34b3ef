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
"""Names of ROS: those of one robot and of the node, and what a name or a namespace may be."""

from __future__ import annotations

from dataclasses import dataclass
import re

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.files.robot_profile import RobotProfile
from kachaka_simple_control.text import quoted

#: The longest name of a topic or a service: RMW_TOPIC_MAX_NAME_LENGTH, which is what DDS takes
#: (255) minus the prefixes of ROS [characters].
MAX_NAME_LENGTH = 247
#: The longest namespace: RMW_NAMESPACE_MAX_LENGTH, which leaves room for a name in it.
MAX_NAMESPACE_LENGTH = 245
#: The topics on which a node shows what it does.
COMMANDED_VELOCITY, SPEED_FACTOR = '~/commanded_velocity', '~/speed_factor'
PLANNED_PATH, DRIVEN_PATH = '~/planned_path', '~/driven_path'
DIAGNOSTICS = '/diagnostics'
INTROSPECTION_TOPICS = (
    COMMANDED_VELOCITY, SPEED_FACTOR, PLANNED_PATH, DRIVEN_PATH, DIAGNOSTICS)
_NAMESPACE = re.compile('(/+[A-Za-z_][A-Za-z0-9_]*)*/*')


@dataclass(frozen=True)
class RobotNames:
    """
    Absolute names of one robot, before remapping.

    :param velocity: the topic on which it takes velocities
    :param odometry: the topic of its odometry; None if it has none
    :param manual_control: the service that switches manual control; None if it needs none
    """

    velocity: str
    odometry: str | None
    manual_control: str | None


def names_of(profile: RobotProfile, namespace: str, manual_control: bool) -> RobotNames:
    """
    Return the names of a robot.

    :param profile: the kind of robot
    :param namespace: the ROS namespace of this robot
    :param manual_control: whether to use its manual control, if it has one
    :raises UsageError: if the namespace is invalid, or so long that a name in it is too long
    """
    longest = max(len(name) for name in (
        profile.velocity_topic, profile.odometry_topic, profile.manual_control_service) if name)
    require_namespace(f'/{namespace}', 'robot_namespace', MAX_NAME_LENGTH - 1 - longest)

    def absolute(name: str) -> str:
        return f'/{namespace.strip("/")}/{name}'.replace('//', '/')

    odometry, service = profile.odometry_topic, profile.manual_control_service
    return RobotNames(
        velocity=absolute(profile.velocity_topic),
        odometry=absolute(odometry) if odometry else None,
        manual_control=absolute(service) if service and manual_control else None)


def require_length(text: str, name: str, longest: int, what: str = 'name') -> None:
    """
    Check the length of a name.

    :param text: the beginning of the message, with the name in it
    :param longest: how many characters ROS takes
    :param what: what should be shorter
    :raises UsageError: if it is too long
    """
    if len(name) > longest:
        raise UsageError(
            f'{text}, which has {len(name)} characters; ROS takes {longest} at most: take a '
            f'shorter {what}')


def require_namespace(namespace: str, what: str, longest: int) -> None:
    """
    Check that a namespace is one that ROS takes.

    :param what: what it is called in the message
    :param longest: how many characters it may have, from its first slash on
    :raises UsageError: if it is not
    """
    # fullmatch: a line break at the end would pass otherwise.
    if not _NAMESPACE.fullmatch(namespace):
        raise UsageError(
            f'{what} is {quoted(namespace, 60)}; a namespace begins with a slash and has words '
            'between slashes, of letters, digits and _, with no digit first, as in /kachaka')
    if (length := len(namespace.strip('/')) + 1) > longest:
        raise UsageError(
            f'{what} is {quoted(namespace, 60)}, which has {length} characters; it may have '
            f'{longest}, for the names in it must not be longer than the {MAX_NAME_LENGTH} that '
            'ROS takes: take a shorter one')
