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
"""What a program that drives tells first: who it is, and whom it drives."""

from __future__ import annotations

from dataclasses import asdict
from importlib import metadata
import os
import platform
import time

from kachaka_simple_control.report.events import Opened
from kachaka_simple_control.robot.robot_profile import RobotProfile
from kachaka_simple_control.ros.names import RobotNames
from kachaka_simple_control.ros.settings import Settings
from rclpy.node import Node
from rclpy.utilities import get_rmw_implementation_identifier

PACKAGE = 'kachaka_simple_control'


def opened(
        node: Node, title: str, profile: RobotProfile, names: RobotNames,
        settings: Settings) -> Opened:
    """
    Return what there is to tell when a program begins.

    :param node: the node that drives
    :param title: what people call what it drives
    :param profile: the kind of robot
    :param names: the names of this one, before remapping
    :param settings: the parameters of the node
    :returns: the first event
    """
    return Opened(
        title=title,
        robot=profile.name,
        limits=profile.limits,
        hold=profile.hold,
        epoch=time.time() - time.monotonic(),
        velocity_topic=node.resolve_topic_name(names.velocity),
        odometry_topic=node.resolve_topic_name(names.odometry) if names.odometry else None,
        message_type=profile.message_type,
        frame=profile.frame,
        footprint=profile.footprint,
        settings={**asdict(settings), 'domain': node.context.get_domain_id()},
        versions=versions())


def versions() -> dict[str, str]:
    """
    Return what the program stands on.

    :returns: versions by name; 'unknown' where nobody tells
    """
    try:
        own = metadata.version(PACKAGE)
    except metadata.PackageNotFoundError:
        own = 'unknown'
    return {
        PACKAGE: own,
        'ROS': os.environ.get('ROS_DISTRO', 'unknown'),
        'RMW': get_rmw_implementation_identifier(),
        'Python': platform.python_version(),
        'system': platform.platform(),
    }
