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
"""The names of a node: they must fit, and each be one thing's."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
import contextlib

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.escaping import escaped
from kachaka_simple_control.execution.output import print_only_on_success
from kachaka_simple_control.ros.names import LONGEST, RobotNames
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.expand_topic_name import expand_topic_name
from rclpy.node import Node

#: What every node of rclpy has.
TOPICS = ('/rosout', '/parameter_events')
SERVICES = (
    '~/describe_parameters', '~/get_parameter_types', '~/get_parameters', '~/list_parameters',
    '~/set_parameters', '~/set_parameters_atomically', '~/get_type_description')


@contextlib.contextmanager
def refused_in_one_line(name: str) -> Iterator[None]:
    """
    Turn what ROS says of a node that cannot be made into one line.

    :param name: of the node, which is made in the block
    :returns: a context manager, which holds back what ROS prints of an error
    :raises UsageError: if there can be no such node
    """
    try:
        with print_only_on_success():
            yield
    except (NameValidationException, ParameterException, RuntimeError, UnicodeError) as error:
        text = escaped(str(error).splitlines()[0])
        if 'Failed to construct ~' in text or 'should not exceed' in text:
            # Of the services that every node has, the longest name does not fit.
            text = (f'with its namespace, a name of its has more than {LONGEST} characters; ROS '
                    f'takes {LONGEST} at most: take a shorter namespace or name')
        raise UsageError(f'there can be no node {escaped(name, 60)}: {text}') from None


def check_node_names(
        node: Node, robot: RobotNames, topics: Iterable[str], services: Iterable[str],
) -> None:
    """
    Make sure that no name of a node is too long or taken by something else of it.

    :param node: the node, which has none of them yet
    :param robot: the names of the robot
    :param topics: its own topics, beside those that every node has
    :param services: likewise its own services
    :raises UsageError: if that is not so
    """
    roles = {robot.velocity: 'which moves the robot', robot.odometry: "the robot's odometry",
             robot.manual_control: "the robot's manual control"}
    _check(node, [robot.velocity, robot.odometry, *topics, *TOPICS], roles, 'topic')
    _check(node, [robot.manual_control, *services, *SERVICES], roles, 'service')


def _check(
        node: Node, names: list[str | None], roles: dict[str | None, str], kind: str) -> None:
    taken: dict[str, str] = {}
    for name in filter(None, names):
        resolved = _resolved(node, name, kind)
        other = taken.setdefault(resolved, name)
        if other != name:
            # Of the two it is told which was remapped.
            moved, other = (other, name) if name == resolved else (name, other)
            whose = roles.get(other, f'where {escaped(other, 60)} is')
            purpose = ': what is shown needs a topic of its own' if kind == 'topic' else (
                ': it needs a name of its own')
            raise UsageError(
                f'{escaped(moved, 60)} is remapped to {escaped(resolved, 60)}, {whose}{purpose}')


def _resolved(node: Node, name: str, kind: str) -> str:
    resolve = node.resolve_topic_name if kind == 'topic' else node.resolve_service_name
    try:
        resolved = resolve(name)
    except (NameValidationException, RuntimeError):
        resolved = expand_topic_name(name, node.get_name(), node.get_namespace())
        if len(resolved) <= LONGEST:
            raise UsageError(
                f'{escaped(name, 60)} is remapped to what is no name of a {kind}, or has more '
                f'than {LONGEST} characters: choose another one') from None
    if len(resolved) > LONGEST:
        raise UsageError(
            f'the {kind} {escaped(name, 60)} is {escaped(resolved, 60)} in full, which has '
            f'{len(resolved)} characters; ROS takes {LONGEST} at most: take a shorter namespace '
            'or name')
    return resolved
