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
"""Calls that tell where the robot's frames are."""

from __future__ import annotations

from collections.abc import AsyncIterator
import math
from typing import Any

from kachaka_api.generated import kachaka_api_pb2 as pb2
from kachaka_simple_control.motion.kinematics import ORIGIN, Pose
from kachaka_simple_control.robot.grpc_server import messages
from kachaka_simple_control.robot.grpc_server.messages import (
    MAP_FRAME,
    ODOMETRY_FRAME,
    ROBOT_FRAME,
)
from kachaka_simple_control.robot.grpc_server.station import Station
from kachaka_simple_control.robot.grpc_server.topic import constant, Topic
from kachaka_simple_control.robot.odometer import ODOMETRY_PERIOD

BODY_FRAME = 'base_link'
LASER_FRAME = 'laser_frame'
#: Where the laser looks from; figures of kachaka_description in pf-robotics/kachaka-api.
LASER, LASER_HEIGHT = Pose(0.156, 0.0, math.pi / 2.0), 0.1049


class TransformService:
    """From the map to the robot, and from the robot to its parts."""

    def __init__(self, station: Station) -> None:
        """
        Serve a robot.

        :param station: where it is
        """
        self._station = station
        self._moving = Topic(station, self._read, ODOMETRY_PERIOD)
        self._constant = constant(station)

    async def GetStaticTransform(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetStaticTransformResponse:
        """Tell where the body and the laser are on the robot."""
        cursor, _ = await self._constant.get(request.metadata.cursor)
        stamp = self._station.clock.stamp()
        laser = messages.transform(LASER, BODY_FRAME, LASER_FRAME, stamp)
        laser.translation.z = LASER_HEIGHT
        body = messages.transform(ORIGIN, ROBOT_FRAME, BODY_FRAME, stamp)
        return pb2.GetStaticTransformResponse(
            metadata=messages.metadata(cursor), transforms=[body, laser])

    async def GetDynamicTransform(
            self, request: pb2.EmptyRequest, context: Any
            ) -> AsyncIterator[pb2.GetDynamicTransformResponse]:
        """Tell where the robot is, again and again until the client goes."""
        cursor = 0
        while True:
            cursor, transforms = await self._moving.get(cursor)
            yield pb2.GetDynamicTransformResponse(transforms=transforms)

    def _read(self, now: float) -> list[pb2.RosTransformStamped]:
        station = self._station
        pose, _ = station.robot.odometry(now)
        stamp, offset = station.clock.stamp(), station.localisation.offset
        return [
            messages.transform(offset, MAP_FRAME, ODOMETRY_FRAME, stamp),
            messages.transform(pose, ODOMETRY_FRAME, ROBOT_FRAME, stamp)]
