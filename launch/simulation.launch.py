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
Drive a simulated robot, and look at it in RViz if wanted.

The robot comes with the node and goes after it, so that the stop always reaches it first.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

SHARE = FindPackageShare('kachaka_simple_control')


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
            'robot_namespace', default_value='',
            description='ROS namespace of the robot; empty: /kachaka'),
        DeclareLaunchArgument(
            'wait', default_value='false',
            description='Whether to stand by: the service ~/run starts the motion'),
        DeclareLaunchArgument(
            'report', default_value='',
            description='A new folder to leave a report in; empty: none'),
        DeclareLaunchArgument(
            'options', default_value='',
            description='More options of the command, as in a shell; parameters after --ros-args'),
        DeclareLaunchArgument(
            'rviz', default_value='false', description='Whether to start RViz'),
        Node(
            package='rviz2', executable='rviz2', name='rviz2',
            arguments=['-d', PathJoinSubstitution([SHARE, 'config', 'kachaka.rviz'])],
            condition=IfCondition(LaunchConfiguration('rviz'))),
        IncludeLaunchDescription(
            PythonLaunchDescriptionSource(
                PathJoinSubstitution([SHARE, 'launch', 'lesson.launch.py'])),
            launch_arguments={
                **{name: LaunchConfiguration(name)
                   for name in ('motion', 'rate', 'robot_namespace', 'wait', 'report')},
                'options': ['--sim ', LaunchConfiguration('options')],
            }.items()),
    ])
