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
"""Package metadata, for pip and for colcon alike; the only copy of it."""

from setuptools import find_packages, setup

package_name = 'kachaka_simple_control'

setup(
    name=package_name,
    version='0.2.0',
    description='Drive a robot by exactly timed velocities, and stop it whatever happens',
    author='kachaka_simple_control contributors',
    author_email='kachaka-simple-control@example.com',
    maintainer='kachaka_simple_control contributors',
    maintainer_email='kachaka-simple-control@example.com',
    license='Apache-2.0',
    python_requires='>=3.10',
    packages=find_packages(include=[package_name, package_name + '.*']),
    package_data={package_name: [
        'py.typed', 'console/*.json', 'console/static/*', 'fleets/*', 'floors/*',
        'motions/*', 'report/*.css', 'report/templates/*', 'robots/*', 'ros/*.xml']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/config', ['config/kachaka.rviz']),
        ('share/' + package_name + '/launch', [
            'launch/lesson.launch.py', 'launch/real.launch.py', 'launch/simulation.launch.py']),
    ],
    # Motions and robots are files, those of the package as well.
    install_requires=['setuptools', 'PyYAML>=5.4', 'jsonschema>=3.2'],
    extras_require={
        # ROS 2 from PyPI where none is installed, on Linux with glibc on x86-64, and all that the
        # commands draw and show with.
        'jazzy': [
            'ros-jazzy-rclpy[fastrtps]', 'ros-jazzy-diagnostic-msgs', 'ros-jazzy-geometry-msgs',
            'ros-jazzy-nav-msgs', 'ros-jazzy-sensor-msgs', 'ros-jazzy-std-srvs',
            'kachaka_simple_control[plot,report,live,recording,completion,console]'],
        'kilted': [
            'ros-kilted-rclpy[fastrtps]', 'ros-kilted-diagnostic-msgs',
            'ros-kilted-geometry-msgs', 'ros-kilted-nav-msgs',
            'ros-kilted-sensor-msgs', 'ros-kilted-std-srvs',
            'kachaka_simple_control[plot,report,live,recording,completion,console]'],
        'plot': ['matplotlib>=3.5'],
        # The page of a report, with its pictures; without it, the figures and the recording.
        'report': ['Jinja2>=3.0', 'matplotlib>=3.5'],
        # A drive shown in a terminal; without it, in plain lines.
        'live': ['rich>=11.2'],
        # The recording beside a report; without it, the report alone.
        'recording': ['mcap>=1.5'],
        # Completion of the command in a shell.
        'completion': ['argcomplete>=1.8'],
        # The console in the browser.
        'console': ['tornado>=6.1'],
        'test': ['pytest', 'hypothesis'],
        # What the SDK of the robot needs; itself it is installed with --no-deps, for its pins name
        # one old grpcio that not every Python has, and a numpy that a sourced ROS may not have.
        'kachaka': ['grpcio>=1.66.1', 'protobuf>=5.27.2', 'numpy'],
    },
    zip_safe=True,
    entry_points={
        'console_scripts': [
            'kachaka_simple_control = kachaka_simple_control.__main__:main',
            'kachaka_calibrate = kachaka_simple_control.entry_points:calibrate',
            'kachaka_console = kachaka_simple_control.entry_points:console',
            'kachaka_compare = kachaka_simple_control.entry_points:compare',
            'kachaka_fleet = kachaka_simple_control.entry_points:fleet',
            'kachaka_bridge = kachaka_simple_control.entry_points:bridge',
            'kachaka_sim = kachaka_simple_control.entry_points:simulate',
        ],
    },
)
