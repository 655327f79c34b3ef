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
"""Protobuf messages of the simulated robot, and the transform from odometry to the map."""

from __future__ import annotations

import math

from kachaka_api.generated import kachaka_api_pb2 as pb2
from kachaka_simple_control.kachaka.error_codes import SUCCESS
from kachaka_simple_control.kachaka.simulator.drive_model import ODOMETRY_FRAME, ROBOT_FRAME
from kachaka_simple_control.motion.geometry import compose, ORIGIN, Pose, relative_to, Velocity


def result(code: int) -> pb2.Result:
    """
    Return the result message of a request.

    :param code: 0 for success, else the error code
    """
    return pb2.Result(success=code == SUCCESS, error_code=code)


def rotation(angle: float) -> pb2.Quaternion:
    """
    Return the quaternion message of a rotation about the z axis.

    :param angle: the angle [rad], counter-clockwise positive
    """
    return pb2.Quaternion(z=math.sin(angle / 2.0), w=math.cos(angle / 2.0))


def pose(value: Pose) -> pb2.Pose:
    """Return a pose message, with the heading wrapped to [-pi, pi]."""
    return pb2.Pose(x=value.x, y=value.y, theta=math.remainder(value.theta, math.tau))


def odometry(where: Pose, velocity: Velocity, stamp: int) -> pb2.RosOdometry:
    """
    Return an odometry message in the layout of ROS; all covariances are 0.

    :param where: the odometry pose
    :param velocity: the velocity
    :param stamp: the time of the sample [ns since 1970]
    """
    return pb2.RosOdometry(
        header=pb2.RosHeader(stamp_nsec=stamp, frame_id=ODOMETRY_FRAME),
        child_frame_id=ROBOT_FRAME,
        pose=pb2.Pose3dWithCovariance(
            pose=pb2.Pose3d(
                position=pb2.Vector3(x=where.x, y=where.y),
                orientation=rotation(where.theta)),
            covariance=[0.0] * 36),
        twist=pb2.TwistWithCovariance(
            twist=pb2.Twist(
                linear=pb2.Vector3(x=velocity.linear_x),
                angular=pb2.Vector3(z=velocity.angular_z)),
            covariance=[0.0] * 36))


def transform(where: Pose, frame: str, child: str, stamp: int) -> pb2.RosTransformStamped:
    """
    Return the transform message from a frame to its child frame.

    :param where: the pose of the child frame in the parent frame
    :param frame: the parent frame
    :param child: the child frame
    :param stamp: the time of the transform [ns since 1970]
    """
    return pb2.RosTransformStamped(
        header=pb2.RosHeader(stamp_nsec=stamp, frame_id=frame), child_frame_id=child,
        translation=pb2.Vector3(x=where.x, y=where.y), rotation=rotation(where.theta))


class MapToOdom:
    """The transform from odometry to the map: the identity until ``correct()`` is called."""

    def __init__(self) -> None:
        #: the pose of the odometry origin on the map
        self.offset = ORIGIN

    def to_map(self, pose: Pose) -> Pose:
        """Convert a pose in odometry to a pose on the map."""
        return compose(self.offset, pose)

    def to_odometry(self, pose: Pose) -> Pose:
        """Convert a pose on the map to a pose in odometry."""
        return relative_to(self.offset, pose)

    def correct(self, map_pose: Pose, odometry_pose: Pose) -> None:
        """
        Set the transform so that it maps the odometry pose to the map pose.

        :param map_pose: the pose on the map
        :param odometry_pose: the pose in odometry
        """
        self.offset = compose(map_pose, relative_to(odometry_pose, ORIGIN))
