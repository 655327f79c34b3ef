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
"""Start ROS and make a node, or say in one line why it cannot be."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
import contextlib
from itertools import pairwise
import os
import re

from kachaka_simple_control.control.output import print_only_on_success
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.escaping import escaped, quoted
from kachaka_simple_control.ros.names import (
    MAX_NAME_LENGTH,
    MAX_NAMESPACE_LENGTH,
    require_namespace,
    RobotNames,
)
import rclpy
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.expand_topic_name import expand_topic_name
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

#: The highest domain that DDS has ports for.
MAX_DOMAIN = 232
#: The longest name of a node that ROS takes.
MAX_NODE_NAME_LENGTH = 255
#: What ROS would take for something else, in dozens of lines or none.
SWITCHES = {
    'ROS_AUTOMATIC_DISCOVERY_RANGE': ('SUBNET', 'LOCALHOST', 'OFF', 'SYSTEM_DEFAULT'),
    **dict.fromkeys(('RCUTILS_COLORIZED_OUTPUT', 'RCUTILS_LOGGING_USE_STDOUT',
                     'RCUTILS_LOGGING_BUFFERED_STREAM'), ('0', '1')),
}
#: What to write, by the first words of what ROS says that it could not parse.
HINTS = {
    'remap': 'write -r FROM:=TO, with names as in /kachaka/cmd_vel',
    'parameter': 'write -p NAME:=VALUE, with a value as in YAML',
    'params': 'name a file of parameters that is there and is YAML',
    'log': 'levels are debug, info, warn, error and fatal',
}
_UNREADABLE = re.compile(r"Couldn't parse ([a-z ]+): '(.*?)'\. Error: ", re.DOTALL)
_PLACES = re.compile(r', at /\S+:[0-9]+')


def start_ros(arguments: Sequence[str]) -> None:
    """
    Initialise ROS, without the signal handlers of its own.

    Call it before the program has other threads: what ROS itself prints is held back meanwhile.

    :param arguments: what ROS is told, from ``--ros-args`` on; others are left alone
    :raises UsageError: if ROS does not understand it, or the environment it finds
    """
    check_environment()
    check_remaps(arguments)
    try:
        with print_only_on_success():
            rclpy.init(args=[*arguments], signal_handler_options=SignalHandlerOptions.NO)
    except (RuntimeError, UnicodeError) as error:
        raise UsageError(_explained(str(error))) from None


def strip_ros_arguments(
        arguments: Sequence[str], remove: Callable[[list[str]], list[str]]) -> list[str]:
    """
    Return what is not for ROS, after a look at what is.

    :param arguments: of the process
    :param remove: rclpy's ``remove_ros_args``
    :returns: the others
    :raises UsageError: if ROS does not understand its own
    """
    check_environment()
    check_remaps(arguments)
    try:
        with print_only_on_success():
            return remove([*arguments])
    except (RuntimeError, UnicodeError) as error:
        raise UsageError(_explained(str(error))) from None


def check_environment() -> None:
    """
    Make sure that ROS can use what the environment tells it.

    :raises UsageError: if it cannot
    """
    domain = os.environ.get('ROS_DOMAIN_ID', '')
    if domain and not (re.fullmatch('[0-9]{1,9}', domain) and int(domain) <= MAX_DOMAIN):
        raise UsageError(
            f'ROS_DOMAIN_ID is {quoted(domain, 60)}; it must be a whole number from 0 to '
            f'{MAX_DOMAIN}')
    for name, values in SWITCHES.items():
        value = os.environ.get(name, '')
        if value and value not in values:
            raise UsageError(
                f'{name} is {quoted(value, 60)}; it must be one of {", ".join(values)}')


def check_remaps(arguments: Sequence[str]) -> None:
    """
    Make sure that names on the command line are names: what ROS says of others is no help.

    :param arguments: what ROS is told, from ``--ros-args`` on
    :raises UsageError: if one is not
    """
    inside = False
    for option, rule in pairwise([*arguments, '']):
        inside = (inside or option == '--ros-args') and option != '--'
        if not inside or option not in ('-r', '--remap'):
            continue
        match, is_rule, name = rule.partition(':=')
        kind = match.rpartition(':')[2]
        if not is_rule:
            raise UsageError(f'{quoted(rule, 60)} is no remap rule: {HINTS["remap"]}')
        if kind == '__ns':
            require_namespace(name, 'the namespace in -r __ns:=', MAX_NAMESPACE_LENGTH)
        most = MAX_NODE_NAME_LENGTH if kind in ('__node', '__name') else MAX_NAME_LENGTH
        if len(name) > most:
            raise UsageError(
                f'{quoted(match, 60)} is remapped to {quoted(name, 60)}, which has {len(name)} '
                f'characters; ROS takes {most} at most: take a shorter name')


def _explained(text: str) -> str:
    """Return what ROS says, without the places in its source, and with what to do."""
    if text.startswith('['):
        return (f'ROS does not know {escaped(text.strip("[]"), 100)} among its arguments: after '
                '--ros-args stand -p NAME:=VALUE, -r FROM:=TO, --params-file FILE and the like; '
                'arguments of the command itself come before')
    found = _UNREADABLE.search(text)
    if found is None:
        return f'ROS could not be started: {escaped(_PLACES.sub("", text))}'
    hint = HINTS.get(found[1].split()[0], 'see `ros2 run --help`')
    return f'ROS cannot read the {found[1]} {quoted(found[2], 60)}: {hint}'


#: What every node of rclpy has.
TOPICS = ('/rosout', '/parameter_events')
SERVICES = (
    '~/describe_parameters', '~/get_parameter_types', '~/get_parameters', '~/list_parameters',
    '~/set_parameters', '~/set_parameters_atomically', '~/get_type_description')


@contextlib.contextmanager
def one_line_errors(name: str) -> Iterator[None]:
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
            text = (f'with its namespace, a name of its has more than {MAX_NAME_LENGTH} '
                    'characters; ROS '
                    f'takes {MAX_NAME_LENGTH} at most: take a shorter namespace or name')
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
        if len(resolved) <= MAX_NAME_LENGTH:
            raise UsageError(
                f'{escaped(name, 60)} is remapped to what is no name of a {kind}, or has more '
                f'than {MAX_NAME_LENGTH} characters: choose another one') from None
    if len(resolved) > MAX_NAME_LENGTH:
        raise UsageError(
            f'the {kind} {escaped(name, 60)} is {escaped(resolved, 60)} in full, which has '
            f'{len(resolved)} characters; ROS takes {MAX_NAME_LENGTH} at most: take a shorter '
            'namespace '
            'or name')
    return resolved
