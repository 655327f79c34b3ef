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
Start ROS and create a node; each error becomes one line of text for the user.

Tested by test/ros/test_environment.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
import contextlib
from itertools import pairwise
import os
import re
import sys

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.process.output import print_only_on_success
from kachaka_simple_control.ros.dds_transport import use_udp_transport, will_share_memory
from kachaka_simple_control.ros.environment import check_environment, use_log_folder
from kachaka_simple_control.ros.names import (
    MAX_NAME_LENGTH,
    MAX_NAMESPACE_LENGTH,
    require_length,
    require_namespace,
    RobotNames,
)
from kachaka_simple_control.ros.parameter_files import check_parameter_files
from kachaka_simple_control.text import escaped, quoted
import rclpy
from rclpy.context import Context
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.expand_topic_name import expand_topic_name
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

#: The longest name of a node that ROS accepts [characters].
MAX_NODE_NAME_LENGTH = 255
#: The advice for an argument that ROS could not parse.  The key is the first word of the kind of
#: argument in the error message of ROS.
HINTS = {
    'remap': 'write -r FROM:=TO, with names as in /kachaka/cmd_vel',
    'parameter': 'write -p NAME:=VALUE, with a value as in YAML',
    'params': 'name a file of parameters that is there and is YAML',
    'log': 'levels are debug, info, warn, error and fatal',
}
_UNPARSED = re.compile(r"Couldn't parse ([a-z ]+): '(.*?)'\. Error: ", re.DOTALL)
_SOURCE_LOCATION = re.compile(r', at /\S+:[0-9]+')
#: Topics and services of every rclpy node.
TOPICS = ('/rosout', '/parameter_events')
SERVICES = (
    '~/describe_parameters', '~/get_parameter_types', '~/get_parameters', '~/list_parameters',
    '~/set_parameters', '~/set_parameters_atomically', '~/get_type_description')


def start_ros(arguments: Sequence[str]) -> None:
    """
    Initialise ROS, but without the signal handlers of rclpy.

    Before the program starts other threads: standard error is redirected for a moment.

    :param arguments: from ``--ros-args`` on; others are ignored
    :raises UsageError: if ROS does not understand the arguments or an environment variable
    """
    with _checked(arguments):
        rclpy.init(args=[*arguments], signal_handler_options=SignalHandlerOptions.NO)


def ensure_started(context: Context | None) -> list[str]:
    """
    Initialise ROS for a node, unless the program has done so.

    :param context: the ROS context of the node; None for the default one
    :returns: warnings for the log of the node
    :raises UsageError: if an environment variable lets nothing work, or there is no network
    """
    is_started, warnings = rclpy.ok(context=context), []
    if is_started and will_share_memory():
        warnings.append(
            'ROS_AUTOMATIC_DISCOVERY_RANGE is LOCALHOST, and rclpy.init() was called before this '
            'node was made: DDS uses shared memory, in which a process that is killed delays '
            'velocities and stops by 0.3 s; make this node first: it calls rclpy.init()')
    use_udp_transport()
    check_environment()
    if not is_started:
        if warning := use_log_folder():
            warnings.append(warning)
        rclpy.init(context=context)
    return warnings


def strip_ros_arguments(arguments: Sequence[str]) -> list[str]:
    """
    Return the arguments of a command line that are not for ROS.

    :raises UsageError: if ROS does not understand the ROS arguments or an environment variable
    """
    with _checked(arguments):
        return list(remove_ros_args([*arguments]))


@contextlib.contextmanager
def _checked(arguments: Sequence[str]) -> Iterator[None]:
    """
    Check ROS arguments and environment variables, then run the block of a ``with`` statement.

    :raises UsageError: in one line, also for an error of rclpy in the block
    """
    check_environment()
    if warning := use_log_folder():
        print(warning, file=sys.stderr)
    _check_remaps(arguments)
    check_parameter_files(arguments)
    try:
        with print_only_on_success():
            yield
    except (RuntimeError, UnicodeError) as error:
        raise UsageError(_explanation(str(error))) from None


def _check_remaps(arguments: Sequence[str]) -> None:
    """
    Check the names in remap rules of the form ``-r FROM:=TO``: ROS does not say what is wrong.

    :raises UsageError: if a rule or a namespace is invalid, or a name is too long
    """
    is_for_ros = False
    for option, rule in pairwise([*arguments, '']):
        is_for_ros = (is_for_ros or option == '--ros-args') and option != '--'
        if not is_for_ros or option not in ('-r', '--remap'):
            continue
        match, is_rule, name = rule.partition(':=')
        kind = match.rpartition(':')[2]
        if not is_rule:
            raise UsageError(f'{quoted(rule, 60)} is no remap rule: {HINTS["remap"]}')
        if kind == '__ns':
            require_namespace(name, 'the namespace in -r __ns:=', MAX_NAMESPACE_LENGTH)
        require_length(
            f'{quoted(match, 60)} is remapped to {quoted(name, 60)}', name,
            MAX_NODE_NAME_LENGTH if kind in ('__node', '__name') else MAX_NAME_LENGTH)


def _explanation(text: str) -> str:
    """Turn the text of an rclpy error into one line, with advice and without its source places."""
    if text.startswith('['):
        return (f'ROS does not know {escaped(text.strip("[]"), 100)} among its arguments: after '
                '--ros-args stand -p NAME:=VALUE, -r FROM:=TO, --params-file FILE and the like; '
                'arguments of the command itself come before')
    found = _UNPARSED.search(text)
    if found is None:
        return f'ROS could not be started: {escaped(_SOURCE_LOCATION.sub("", text))}'
    hint = HINTS.get(found[1].split()[0], 'see `ros2 run --help`')
    return f'ROS cannot read the {found[1]} {quoted(found[2], 60)}: {hint}'


@contextlib.contextmanager
def one_line_errors(name: str) -> Iterator[None]:
    """Turn an error in a ``with`` block that creates a node into a UsageError of one line."""
    try:
        with print_only_on_success():
            yield
    except (NameValidationException, ParameterException, RuntimeError, UnicodeError) as error:
        text = escaped(str(error).splitlines()[0])
        if 'Failed to construct ~' in text or 'should not exceed' in text:
            # The longest name is the name of a service that every node has.
            text = (f'with its namespace, one of its names has more than {MAX_NAME_LENGTH} '
                    f'characters; ROS takes {MAX_NAME_LENGTH} at most: take a shorter namespace '
                    'or name')
        if os.environ.get('ROS_SECURITY_ENABLE') == 'true' and 'security' in text.lower():
            text += '; unset ROS_SECURITY_ENABLE to go without'
        raise UsageError(f'there can be no node {escaped(name, 60)}: {text}') from None


def check_node_names(
        node: Node, robots: Sequence[RobotNames], topics: Iterable[str],
        services: Iterable[str]) -> None:
    """
    Check that the names of a node's topics and services, remapped, are short enough and differ.

    :param node: before it has created them
    :raises UsageError: if a name is too long, or two names are equal
    """
    roles: dict[str | None, str] = {}
    for robot in robots:
        if robot.velocity in roles:
            raise UsageError(
                f'two robots obey {robot.velocity}: give each a robot_namespace of its own')
        roles |= {robot.velocity: 'which moves the robot', robot.odometry: "the robot's odometry",
                  robot.manual_control: "the robot's manual control"}
    _check_distinct(node, [
        *(name for robot in robots for name in (robot.velocity, robot.odometry)), *topics,
        *TOPICS], roles, 'topic')
    _check_distinct(
        node, [*(robot.manual_control for robot in robots), *services, *SERVICES], roles,
        'service')


def _check_distinct(
        node: Node, names: list[str | None], roles: dict[str | None, str], kind: str) -> None:
    taken: dict[str, str] = {}
    for name in filter(None, names):
        resolved = _resolved(node, name, kind)
        other = taken.setdefault(resolved, name)
        if other != name:
            # The message names the topic or service that was remapped.
            moved, other = (other, name) if name == resolved else (name, other)
            role = roles.get(other, f'where {escaped(other, 60)} is')
            advice = ('what is shown needs a topic of its own' if kind == 'topic' else
                      'it needs a name of its own')
            raise UsageError(
                f'{escaped(moved, 60)} is remapped to {escaped(resolved, 60)}, {role}: {advice}')


def _resolved(node: Node, name: str, kind: str) -> str:
    """
    Return the full name of a topic or service, with namespace and remapping applied.

    :raises UsageError: if it is invalid or too long
    """
    resolve = node.resolve_topic_name if kind == 'topic' else node.resolve_service_name
    try:
        resolved, is_valid = resolve(name), True
    except (NameValidationException, RuntimeError):
        resolved, is_valid = expand_topic_name(name, node.get_name(), node.get_namespace()), False
    require_length(
        f'the {kind} {escaped(name, 60)} is {escaped(resolved, 60)} in full', resolved,
        MAX_NAME_LENGTH, 'namespace or name')
    if not is_valid:
        raise UsageError(
            f'{escaped(name, 60)} is remapped to what is no name of a {kind}, or has more than '
            f'{MAX_NAME_LENGTH} characters: choose another one')
    return str(resolved)
