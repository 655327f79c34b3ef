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
The names of the topics and services of a robot and of the node, and checks of such names.

Tested by test/ros/test_parameters.py.
"""

from __future__ import annotations

from dataclasses import dataclass
import re

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.files.robot_profile import RobotProfile
from kachaka_simple_control.text import quoted

#: The longest name of a topic or a service [characters]: RMW_TOPIC_MAX_NAME_LENGTH.  This is the
#: limit of DDS (255) minus the prefixes of ROS.
MAX_NAME_LENGTH = 247
#: The longest namespace [characters]: RMW_NAMESPACE_MAX_LENGTH.  It leaves space for a name.
MAX_NAMESPACE_LENGTH = 245
#: The debug topics of the node.
COMMANDED_VELOCITY, SPEED_FACTOR = '~/commanded_velocity', '~/speed_factor'
PLANNED_PATH, DRIVEN_PATH = '~/planned_path', '~/driven_path'
DIAGNOSTICS = '/diagnostics'
#: The topics of a Kachaka's bridge with the charge of its battery and with its errors, relative to
#: the namespace of the robot.  Source: the bridge of pf-robotics/kachaka-api.
BATTERY, ERRORS = 'robot_info/battery_percentage', 'diagnostics/error_status'
#: The service of our bridge that lets the laser of a Kachaka run for 5 s; the maker's has none.
LASER_ACTIVATION = 'lidar/activate'
INTROSPECTION_TOPICS = (
    COMMANDED_VELOCITY, SPEED_FACTOR, PLANNED_PATH, DRIVEN_PATH, DIAGNOSTICS)
_NAMESPACE = re.compile('(/+[A-Za-z_][A-Za-z0-9_]*)*/*')


def of_robot(name: str, robot: str) -> str:
    """
    Return the name of a topic or service of one robot, such as ``~/NAME/stop`` for ``~/stop``.

    :param robot: its name; empty for the only robot of a node, which adds nothing
    """
    return name.replace('~/', f'~/{robot}/') if robot else name


@dataclass(frozen=True)
class RobotNames:
    """
    The full names of the topics and the service of one robot, before remapping.

    :param odometry: None if the robot has no odometry
    :param manual_control: the service that switches it on and off; None if it is not used
    :param laser: the topic of its scans; None if they are not read
    :param laser_activation: the service that lets its laser run; None if it has none
    """

    velocity: str
    odometry: str | None
    manual_control: str | None
    laser: str | None = None
    laser_activation: str | None = None


def names_of(
        profile: RobotProfile, namespace: str, manual_control: bool,
        watch: bool = False) -> RobotNames:
    """
    Return the full names of the topics and the services of one robot, before remapping.

    :param manual_control: whether to use that service, if this kind of robot has one
    :param watch: whether to read its laser
    :raises UsageError: if the namespace is invalid or too long
    """
    longest = max(len(name) for name in (
        profile.velocity_topic, profile.odometry_topic, profile.manual_control_service) if name)
    require_namespace(f'/{namespace}', 'robot_namespace', MAX_NAME_LENGTH - 1 - longest)

    def absolute(name: str) -> str:
        return f'/{namespace.strip("/")}/{name}'.replace('//', '/')

    odometry, service = profile.odometry_topic, profile.manual_control_service
    laser = profile.laser if watch else None
    return RobotNames(
        velocity=absolute(profile.velocity_topic),
        odometry=absolute(odometry) if odometry else None,
        manual_control=absolute(service) if service and manual_control else None,
        laser=None if laser is None else absolute(laser.topic),
        laser_activation=absolute(LASER_ACTIVATION) if laser and profile.is_kachaka else None)


def require_length(text: str, name: str, longest: int, what: str = 'name') -> None:
    """
    Check that a ROS name is not too long.

    :param text: the beginning of the error message; it contains the name
    :param what: what the user can make shorter
    :raises UsageError: if the name is too long
    """
    if len(name) > longest:
        raise UsageError(
            f'{text}, which has {len(name)} characters; ROS takes {longest} at most: take a '
            f'shorter {what}')


def require_namespace(namespace: str, what: str, longest: int) -> None:
    """
    Check that a ROS namespace is valid and not too long.

    :param what: how the error message calls the namespace, for example ``robot_namespace``
    :param longest: the largest number of characters, including the first slash
    :raises UsageError: if it is not
    """
    # fullmatch, because match with $ would accept a line break at the end.
    if not _NAMESPACE.fullmatch(namespace):
        raise UsageError(
            f'{what} is {quoted(namespace, 60)}; a namespace begins with a slash and has words '
            'between slashes, of letters, digits and _, with no digit first, as in /kachaka')
    if (length := len(namespace.strip('/')) + 1) > longest:
        raise UsageError(
            f'{what} is {quoted(namespace, 60)}, which has {length} characters; it may have '
            f'{longest}, for the names in it must not be longer than the {MAX_NAME_LENGTH} that '
            'ROS takes: take a shorter one')
