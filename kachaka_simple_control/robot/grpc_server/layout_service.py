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
"""Calls about what is around the robot: its dock, and nothing else."""

from __future__ import annotations

from typing import Any

from kachaka_api.generated import kachaka_api_pb2 as pb2
from kachaka_simple_control.robot.error_codes import ERROR_UNKNOWN_NAME, SUCCESS
from kachaka_simple_control.robot.grpc_server import messages
from kachaka_simple_control.robot.grpc_server.orders import HOME
from kachaka_simple_control.robot.grpc_server.station import Station
from kachaka_simple_control.robot.grpc_server.topic import constant


class LayoutService:
    """Places, furniture and maps; of all this there is the dock alone."""

    def __init__(self, station: Station) -> None:
        """
        Serve a robot.

        :param station: where it is
        """
        self._dock = messages.pose(station.robot.dock)
        self._constant = constant(station)

    async def GetLocations(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetLocationsResponse:
        """Tell where the dock is."""
        return pb2.GetLocationsResponse(
            metadata=await self._metadata(request), default_location_id=HOME,
            locations=[pb2.Location(
                id=HOME, name=HOME, pose=self._dock, type=pb2.LOCATION_TYPE_CHARGER)])

    async def GetLocationsDigest(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetLocationsDigestResponse:
        """Tell that there is a dock."""
        return pb2.GetLocationsDigestResponse(
            metadata=await self._metadata(request),
            locations=[pb2.LocationDigest(id=HOME, name=HOME, type=pb2.LOCATION_TYPE_CHARGER)])

    async def GetShelves(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetShelvesResponse:
        """Tell that there are none."""
        return pb2.GetShelvesResponse(metadata=await self._metadata(request))

    async def GetShelvesDigest(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetShelvesDigestResponse:
        """Tell that there are none."""
        return pb2.GetShelvesDigestResponse(metadata=await self._metadata(request))

    async def GetMovingShelfId(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetMovingShelfIdResponse:
        """Tell that the robot carries none."""
        return pb2.GetMovingShelfIdResponse(metadata=await self._metadata(request))

    async def ResetShelfPose(
            self, request: pb2.ResetShelfPoseRequest, context: Any) -> pb2.ResetShelfPoseResponse:
        """Reset all there are, or refuse the one that there is not."""
        code = ERROR_UNKNOWN_NAME if request.shelf_id else SUCCESS
        return pb2.ResetShelfPoseResponse(result=messages.result(code))

    async def GetMapList(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetMapListResponse:
        """Tell that there are none."""
        return pb2.GetMapListResponse(metadata=await self._metadata(request))

    async def GetCurrentMapId(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetCurrentMapIdResponse:
        """Tell that there is none."""
        return pb2.GetCurrentMapIdResponse(metadata=await self._metadata(request))

    async def _metadata(self, request: pb2.GetRequest) -> pb2.Metadata:
        cursor, _ = await self._constant.get(request.metadata.cursor)
        return messages.metadata(cursor)
