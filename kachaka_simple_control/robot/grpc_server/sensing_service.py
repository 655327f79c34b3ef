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
"""Calls that tell where the robot is."""

from __future__ import annotations

import math
from typing import Any

from kachaka_api.generated import kachaka_api_pb2 as pb2
from kachaka_simple_control.motion.kinematics import Pose
from kachaka_simple_control.robot.error_codes import ERROR_NOT_A_VELOCITY, SUCCESS
from kachaka_simple_control.robot.grpc_server import messages
from kachaka_simple_control.robot.grpc_server.station import Station
from kachaka_simple_control.robot.grpc_server.topic import Topic
from kachaka_simple_control.robot.odometer import ODOMETRY_PERIOD


class SensingService:
    """Odometry and its relatives, new every 20 ms (chosen: the official bridge asks as often)."""

    def __init__(self, station: Station) -> None:
        """
        Serve a robot.

        :param station: where it is
        """
        self._station = station
        self._odometry = Topic(station, self._read_odometry, ODOMETRY_PERIOD)
        self._pose = Topic(station, self._read_pose, ODOMETRY_PERIOD)

    async def GetRosOdometry(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetRosOdometryResponse:
        """Tell where the robot thinks it is, and how fast."""
        cursor, odometry = await self._odometry.get(request.metadata.cursor)
        return pb2.GetRosOdometryResponse(metadata=messages.metadata(cursor), odometry=odometry)

    async def GetRosWheelOdometry(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetRosWheelOdometryResponse:
        """Tell the same as the wheels have it (chosen)."""
        cursor, odometry = await self._odometry.get(request.metadata.cursor)
        return pb2.GetRosWheelOdometryResponse(
            metadata=messages.metadata(cursor), odometry=odometry)

    async def GetRobotPose(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetRobotPoseResponse:
        """Tell where the robot believes to be on its map."""
        cursor, pose = await self._pose.get(request.metadata.cursor)
        return pb2.GetRobotPoseResponse(metadata=messages.metadata(cursor), pose=pose)

    async def SetRobotPose(
            self, request: pb2.SetRobotPoseRequest, context: Any) -> pb2.SetRobotPoseResponse:
        """Let the robot believe to be somewhere; it stays where it is."""
        station, pose = self._station, request.pose
        believed = Pose(pose.x, pose.y, pose.theta)
        if not all(map(math.isfinite, (pose.x, pose.y, pose.theta))):
            return pb2.SetRobotPoseResponse(result=messages.result(ERROR_NOT_A_VELOCITY))
        station.localisation.correct(believed, station.robot.odometry(station.now())[0])
        station.announce()
        return pb2.SetRobotPoseResponse(result=messages.result(SUCCESS))

    def _read_pose(self, now: float) -> pb2.Pose:
        pose, _ = self._station.robot.odometry(now)
        return messages.pose(self._station.localisation.to_map(pose))

    def _read_odometry(self, now: float) -> pb2.RosOdometry:
        pose, velocity = self._station.robot.odometry(now)
        return messages.odometry(pose, velocity, self._station.clock.stamp())
