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
"""The message definitions and the ``metadata.yaml`` that rosbag2 needs."""

from __future__ import annotations

from dataclasses import dataclass
import json

VELOCITY_TYPES = {
    'Twist': 'geometry_msgs/msg/Twist', 'TwistStamped': 'geometry_msgs/msg/TwistStamped'}
ODOMETRY_TYPE = 'nav_msgs/msg/Odometry'
PATH_TYPE = 'nav_msgs/msg/Path'
FACTOR_TYPE = 'std_msgs/msg/Float64'

#: The type and the name of each field, in order, by message type.
FIELDS = {
    'builtin_interfaces/Time': ('int32 sec', 'uint32 nanosec'),
    'std_msgs/Float64': ('float64 data',),
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
    Return the MCAP schema of a message type: the definitions of the type and its field types.

    :param message_type: its full name, for example ``nav_msgs/msg/Odometry``
    """
    first = message_type.replace('/msg/', '/')
    others = [name for name in _parts(first) if name != first]
    return _fields(first) + ''.join(
        f'{RULE}\nMSG: {name}\n{_fields(name)}' for name in dict.fromkeys(others))


def _fields(name: str) -> str:
    return ''.join(f'{field}\n' for field in FIELDS[name])


def _parts(name: str) -> list[str]:
    kinds = [field.partition(' ')[0].partition('[')[0] for field in FIELDS[name]]
    return [name, *(part for kind in kinds if kind in FIELDS for part in _parts(kind))]


#: The metadata version of Humble; later releases also read it.
VERSION = 5
#: The numbers of QoS policies: Humble reads only numbers, later releases read both.
KEEP_LAST, RELIABLE, BEST_EFFORT, TRANSIENT_LOCAL, VOLATILE, AUTOMATIC = 1, 1, 2, 1, 2, 1
#: An infinite duration, RMW_DURATION_INFINITE, in seconds and nanoseconds.
INFINITE = (9223372036, 854775807)


@dataclass
class Topic:
    """
    A topic in a recording.

    :param name: its resolved name
    :param message_type: the full name of its message type
    :param depth: the history depth of its publisher
    :param reliability: the reliability of its publisher
    :param durability: the durability of its publisher
    :param channel: the id of its channel in the file
    :param count: the number of its messages in the file
    """

    name: str
    message_type: str
    depth: int = 10
    reliability: int = RELIABLE
    durability: int = VOLATILE
    channel: int = 0
    count: int = 0

    @property
    def qualities(self) -> str:
        """Return the QoS profile that the publisher of the topic offers, as YAML."""
        lines = [
            f'history: {KEEP_LAST}', f'depth: {self.depth}', f'reliability: {self.reliability}',
            f'durability: {self.durability}', *_duration('deadline'), *_duration('lifespan'),
            f'liveliness: {AUTOMATIC}', *_duration('liveliness_lease_duration'),
            'avoid_ros_namespace_conventions: false']
        return '- ' + '\n  '.join(lines)


def _duration(name: str) -> list[str]:
    return [f'{name}:', f'  sec: {INFINITE[0]}', f'  nsec: {INFINITE[1]}']


def bag_information(topics: list[Topic], first: int, last: int, file: str) -> str:
    """
    Return the description of a recording that rosbag2 needs, as YAML.

    :param topics: its topics
    :param first: the stamp of its first message [ns since 1970]; 0 if there is none
    :param last: the stamp of its last message [ns since 1970]; 0 if there is none
    :param file: the name of its file
    """
    total = sum(topic.count for topic in topics)
    span = ['duration:', f'  nanoseconds: {last - first}',
            'starting_time:', f'  nanoseconds_since_epoch: {first}',
            f'message_count: {total}']
    lines = [f'version: {VERSION}', 'storage_identifier: mcap', *span,
             'topics_with_message_count:', *(line for topic in topics for line in _lines(topic)),
             'compression_format: ""', 'compression_mode: ""',
             'relative_file_paths:', f'  - {file}',
             'files:', f'  - path: {file}',
             *(f'    {line}' for line in (*span[2:4], *span[:2], span[4]))]
    return '\n'.join(lines) + '\n'


def folder_information(information: str) -> str:
    """
    Return the text of ``metadata.yaml``, which makes a directory a rosbag2 bag.

    :param information: the description of the recording from ``bag_information``
    """
    return 'rosbag2_bagfile_information:\n' + ''.join(
        f'  {line}\n' for line in information.splitlines())


def _lines(topic: Topic) -> list[str]:
    # A JSON string is a valid YAML string.
    return ['  - topic_metadata:',
            f'      name: {json.dumps(topic.name)}',
            f'      type: {topic.message_type}',
            '      serialization_format: cdr',
            f'      offered_qos_profiles: {json.dumps(topic.qualities)}',
            f'    message_count: {topic.count}']
