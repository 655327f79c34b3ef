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
Drive a robot that is there already: the lesson, or another motion; look at it in RViz if wanted.

Each argument but ``rviz`` is an option or a parameter of the command ``kachaka_simple_control``;
one that is left empty is left to the command.
"""

from pathlib import Path
import shlex

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

#: Arguments that are options of the same name.
OPTIONS = ('rate', 'robot', 'report')
#: Arguments that are switches.
SWITCHES = ('wait', 'quiet')
TRUE = ('true', '1', 'yes', 'on')
FALSE = ('false', '0', 'no', 'off', '')
VIEW = Path(__file__).parent.parent / 'config' / 'kachaka.rviz'


def generate_launch_description():
    """
    Say what to start.

    :returns: the description
    """
    return LaunchDescription([
        DeclareLaunchArgument(
            'motion', default_value='',
            description='A motion of `kachaka_simple_control --list`, or the path of a file; '
                        'empty: the lesson'),
        DeclareLaunchArgument(
            'rate', default_value='',
            description='How often a velocity is sent [Hz]; empty: what the motion says, or 10'),
        DeclareLaunchArgument(
            'robot', default_value='',
            description='kachaka, turtlebot3, generic, or the path of a profile; empty: what the '
                        'motion says, or kachaka'),
        DeclareLaunchArgument(
            'robot_namespace', default_value='',
            description='ROS namespace of the robot; empty: that of its profile'),
        DeclareLaunchArgument(
            'namespace', default_value='', description='ROS namespace of the node'),
        DeclareLaunchArgument(
            'name', default_value='kachaka_simple_control', description='Name of the node'),
        DeclareLaunchArgument(
            'wait', default_value='false',
            description='Whether to stand by: the service ~/run starts the motion'),
        DeclareLaunchArgument(
            'report', default_value='',
            description='A new folder to leave a report in; empty: none'),
        DeclareLaunchArgument(
            'quiet', default_value='false',
            description="Whether to show nothing but the node's log lines while it drives"),
        DeclareLaunchArgument(
            'options', default_value='',
            description='More options of the command, as in a shell; parameters after --ros-args'),
        DeclareLaunchArgument(
            'rviz', default_value='false', description='Whether to start RViz'),
        # First: without RViz nothing is to drive.
        Node(
            package='rviz2', executable='rviz2', name='rviz2', arguments=['-d', str(VIEW)],
            condition=IfCondition(LaunchConfiguration('rviz'))),
        OpaqueFunction(function=start),
    ])


def start(context):
    """
    Return the node, told what the arguments say.

    :param context: of the launch
    :returns: what to start
    :raises ValueError: if a switch is neither true nor false
    """
    def said(name):
        return LaunchConfiguration(name).perform(context)

    arguments = [said('motion')] if said('motion') else []
    for name in OPTIONS:
        # In one word: what begins with a dash is no option then.
        arguments += [f'--{name}={said(name)}'] if said(name) else []
    for name in SWITCHES:
        arguments += [f'--{name}'] if is_true(name, said(name)) else []
    robot_namespace = said('robot_namespace')
    return [Node(
        package='kachaka_simple_control', executable='kachaka_simple_control',
        name=said('name'), namespace=said('namespace'),
        arguments=[*arguments, *shlex.split(said('options'))],
        parameters=[{'robot_namespace': robot_namespace}] if robot_namespace else [],
        output='screen', emulate_tty=True)]


def is_true(name, text):
    """
    Tell whether a switch is on.

    :param name: of its argument
    :param text: what was said
    :returns: whether it is
    :raises ValueError: if it is neither on nor off
    """
    if text.lower() not in TRUE + FALSE:
        raise ValueError(f'{name} is {text!r}; it must be true or false')
    return text.lower() in TRUE
