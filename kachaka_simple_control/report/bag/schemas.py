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
"""Definitions of the messages in a recording, by field, as rosbag2 lays them down."""

from __future__ import annotations

VELOCITY_TYPES = {
    'Twist': 'geometry_msgs/msg/Twist', 'TwistStamped': 'geometry_msgs/msg/TwistStamped'}
ODOMETRY_TYPE = 'nav_msgs/msg/Odometry'
PATH_TYPE = 'nav_msgs/msg/Path'

#: Type and name of each field, in order.
FIELDS = {
    'builtin_interfaces/Time': ('int32 sec', 'uint32 nanosec'),
    'std_msgs/Header': ('builtin_interfaces/Time stamp', 'string frame_id'),
    'geometry_msgs/Vector3': ('float64 x', 'float64 y', 'float64 z'),
    'geometry_msgs/Point': ('float64 x', 'float64 y', 'float64 z'),
    'geometry_msgs/Quaternion': ('float64 x', 'float64 y', 'float64 z', 'float64 w'),
    'geometry_msgs/Twist': ('geometry_msgs/Vector3 linear', 'geometry_msgs/Vector3 angular'),
    'geometry_msgs/TwistStamped': ('std_msgs/Header header', 'geometry_msgs/Twist twist'),
    'geometry_msgs/TwistWithCovariance': (
        'geometry_msgs/Twist twist', 'float64[36] covariance'),
    'geometry_msgs/Pose': (
        'geometry_msgs/Point position', 'geometry_msgs/Quaternion orientation'),
    'geometry_msgs/PoseStamped': ('std_msgs/Header header', 'geometry_msgs/Pose pose'),
    'geometry_msgs/PoseWithCovariance': ('geometry_msgs/Pose pose', 'float64[36] covariance'),
    'nav_msgs/Odometry': (
        'std_msgs/Header header', 'string child_frame_id',
        'geometry_msgs/PoseWithCovariance pose', 'geometry_msgs/TwistWithCovariance twist'),
    'nav_msgs/Path': ('std_msgs/Header header', 'geometry_msgs/PoseStamped[] poses'),
}
RULE = '=' * 80


def definition(message_type: str) -> str:
    """
    Return the definition of a message, and after it those of all that it is made of.

    :param message_type: its full name, as in ``nav_msgs/msg/Odometry``
    :returns: the text, as it stands in the schema of a recording
    """
    first = message_type.replace('/msg/', '/')
    others = [name for name in _parts(first) if name != first]
    return _text(first) + ''.join(
        f'{RULE}\nMSG: {name}\n{_text(name)}' for name in dict.fromkeys(others))


def _text(name: str) -> str:
    return ''.join(f'{field}\n' for field in FIELDS[name])


def _parts(name: str) -> list[str]:
    kinds = [field.partition(' ')[0].partition('[')[0] for field in FIELDS[name]]
    return [name, *(part for kind in kinds if kind in FIELDS for part in _parts(kind))]
