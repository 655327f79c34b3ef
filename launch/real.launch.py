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
Drive a real Kachaka.

Its bridge comes with the node and goes after it, so that the stop always reaches the robot first.

What it takes beside its own arguments is what ``lesson.launch.py`` takes.
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration

LESSON = Path(__file__).with_name('lesson.launch.py')


def generate_launch_description():
    """
    Say what to start.

    :returns: the description
    """
    return LaunchDescription([
        DeclareLaunchArgument(
            'address', description='Address of the robot, HOST or HOST:PORT; must be given'),
        DeclareLaunchArgument(
            'options', default_value='',
            description='More options of the command, as in a shell; parameters after --ros-args'),
        IncludeLaunchDescription(
            PythonLaunchDescriptionSource(str(LESSON)),
            launch_arguments={
                'options': ['--yes --address=', LaunchConfiguration('address'), ' ',
                            LaunchConfiguration('options')],
            }.items()),
    ])
