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
"""What rosbag2 wants to know of a recording beside its messages, in its own YAML."""

from __future__ import annotations

from dataclasses import dataclass
import json

#: The format of Humble, which those after it read as well.
VERSION = 5
#: Qualities of service by number: Humble reads no names, and those after it read numbers too.
KEEP_LAST, RELIABLE, BEST_EFFORT, TRANSIENT_LOCAL, VOLATILE, AUTOMATIC = 1, 1, 2, 1, 2, 1
#: No limit, in seconds and nanoseconds: RMW_DURATION_INFINITE.
INFINITE = (9223372036, 854775807)


@dataclass
class Topic:
    """
    A topic in a recording.

    :param name: its resolved name
    :param message_type: the full name of its messages' type
    :param depth: how many messages its publisher keeps
    :param reliability: of its publisher
    :param durability: of its publisher
    :param count: how many of its messages are in the file
    """

    name: str
    message_type: str
    depth: int = 10
    reliability: int = RELIABLE
    durability: int = VOLATILE
    count: int = 0

    @property
    def qualities(self) -> str:
        """Return the quality of service that its publisher offers."""
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
    Return what a recording holds.

    :param topics: its topics
    :param first: the stamp of its first message [ns since 1970]; 0 if there is none
    :param last: the stamp of its last message [ns since 1970]; 0 if there is none
    :param file: the file it is in
    :returns: the YAML
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
    Return what makes a folder with a recording a bag: its ``metadata.yaml``.

    :param information: what the recording holds
    :returns: the YAML
    """
    return 'rosbag2_bagfile_information:\n' + ''.join(
        f'  {line}\n' for line in information.splitlines())


def _lines(topic: Topic) -> list[str]:
    # What JSON quotes, YAML reads.
    return ['  - topic_metadata:',
            f'      name: {json.dumps(topic.name)}',
            f'      type: {topic.message_type}',
            '      serialization_format: cdr',
            f'      offered_qos_profiles: {json.dumps(topic.qualities)}',
            f'    message_count: {topic.count}']
