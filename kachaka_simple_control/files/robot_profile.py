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
"""Profiles of robots: their names in ROS, limits and outline; and that of Kachaka."""

from __future__ import annotations

from dataclasses import dataclass

from kachaka_simple_control.motion.geometry import Box, Footprint
from kachaka_simple_control.motion.limits import Limits


@dataclass(frozen=True)
class RobotProfile:
    """
    The interface and the limits of a robot; names are relative to its ROS namespace.

    :param name: its name, for people
    :param namespace: its ROS namespace by default, absolute
    :param velocity_topic: the topic on which it takes velocities
    :param odometry_topic: the topic of its odometry; None if it has none
    :param manual_control_service: the service that lets it take velocities (std_srvs/SetBool);
        None if it always takes them
    :param manual_control_timeout: how long one enabling lasts [s]; infinite if it needs none
    :param hold: its command timeout: how long it keeps a velocity without a new one [s]
    :param limits: its largest velocities, accelerations and jerks
    :param message_type: the type of its velocities: Twist or TwistStamped, of geometry_msgs
    :param frame: the frame in the header of a TwistStamped
    :param footprint: its outline, for pictures; None if it is not known
    """

    name: str
    namespace: str
    velocity_topic: str
    odometry_topic: str | None
    manual_control_service: str | None
    manual_control_timeout: float
    hold: float
    limits: Limits
    message_type: str = 'Twist'
    frame: str = 'base_link'
    footprint: Footprint | None = None


#: Kachaka of Preferred Robotics, under the names of its maker's ROS 2 bridge; no file need be read
#: for it.  A figure is the maker's, from the file named beside it in the public repository
#: pf-robotics/kachaka-api, or it says that it is chosen.
KACHAKA = RobotProfile(
    name='kachaka',
    namespace='/kachaka',  # grpc_ros2_bridge.launch.xml
    velocity_topic='manual_control/cmd_vel',  # manual_control_component.cpp
    odometry_topic='odometry/odometry',  # odometry_component.cpp
    manual_control_service='manual_control/set_enabled',  # manual_control_component.cpp
    manual_control_timeout=60.0,  # docs/kachaka_api_client.ipynb, cell 77
    hold=0.3,  # docs/kachaka_api_client.ipynb, cell 81
    limits=Limits(
        max_linear_velocity=0.3, max_angular_velocity=1.57,  # python/kachaka_api/base.py
        # The maker publishes no accelerations.  Chosen: a gentle start, at full speed after
        # 0.85 s, and after 0.88 s when turning.  Decelerations are left out, and so the same.
        max_linear_acceleration=0.5, max_angular_acceleration=2.5,
        max_linear_jerk=2.0, max_angular_jerk=10.0),
    # kachaka_description; the axle is at the origin
    footprint=Box(length=0.387, width=0.240, ahead=0.0435))
