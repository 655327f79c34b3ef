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
"""Calls that drive the robot by velocities."""

from __future__ import annotations

from typing import Any

from kachaka_api.generated import kachaka_api_pb2 as pb2
from kachaka_simple_control.robot.grpc_server import messages
from kachaka_simple_control.robot.grpc_server.station import Station
from kachaka_simple_control.robot.grpc_server.topic import Topic


class DrivingService:
    """Manual control, velocities, and the emergency stop."""

    def __init__(self, station: Station) -> None:
        """
        Serve a robot.

        :param station: where it is
        """
        self._station = station
        self._manual_control = Topic(station, station.robot.manual_control)

    async def SetRobotVelocity(
            self, request: pb2.SetRobotVelocityRequest, context: Any
            ) -> pb2.SetRobotVelocityResponse:
        """Drive with a velocity, for the hold; more than the largest is the largest."""
        code = self._station.robot.set_robot_velocity(
            request.linear, request.angular, self._station.now())
        # Not announced: nobody waits for it, and it has to be quick.
        return pb2.SetRobotVelocityResponse(result=messages.result(code))

    async def SetManualControlEnabled(
            self, request: pb2.SetManualControlEnabledRequest, context: Any
            ) -> pb2.SetManualControlEnabledResponse:
        """Take velocities for 60 s, or none."""
        code = self._station.robot.set_manual_control(request.enable, self._station.now())
        self._station.announce()
        return pb2.SetManualControlEnabledResponse(result=messages.result(code))

    async def SetEmergencyStop(
            self, request: pb2.EmptyRequest, context: Any) -> pb2.SetEmergencyStopResponse:
        """Stop, and stay until the power button is pressed."""
        code = self._station.robot.set_emergency_stop(self._station.now())
        self._station.announce()
        return pb2.SetEmergencyStopResponse(result=messages.result(code))

    async def GetManualControlEnabled(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetManualControlEnabledResponse:
        """Tell whether velocities are taken."""
        cursor, enabled = await self._manual_control.get(request.metadata.cursor)
        return pb2.GetManualControlEnabledResponse(
            metadata=messages.metadata(cursor), enabled=enabled)
