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
"""Calls that tell what robot this is, and how it is."""

from __future__ import annotations

import json
from typing import Any

from kachaka_api.generated import kachaka_api_pb2 as pb2
from kachaka_simple_control.robot.error_codes import SUCCESS, TEXTS
from kachaka_simple_control.robot.grpc_server import messages
from kachaka_simple_control.robot.grpc_server.station import Station
from kachaka_simple_control.robot.grpc_server.topic import constant, Topic

#: Chosen, so that nobody takes it for a real one.
SERIAL_NUMBER = 'SIMULATED'
#: The release of the robot's software that the SDK we read belongs to.
VERSION = '3.17.5'
#: The list of errors in the robot's form; both of its languages are English here.
ERRORS = json.dumps([
    {'code': code, 'error_type': kind, 'title': text, 'description': '',
     'title_en': text, 'description_en': '', 'ref_url': ''}
    for code, kind, text in TEXTS])


class StateService:
    """Names, readiness, errors."""

    def __init__(self, station: Station) -> None:
        """
        Serve a robot.

        :param station: where it is
        """
        self._errors = Topic(station, station.robot.errors)
        self._constant = constant(station)

    async def GetRobotSerialNumber(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetRobotSerialNumberResponse:
        """Tell a serial number that no real robot has."""
        cursor, _ = await self._constant.get(request.metadata.cursor)
        return pb2.GetRobotSerialNumberResponse(
            metadata=messages.metadata(cursor), serial_number=SERIAL_NUMBER)

    async def GetRobotVersion(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetRobotVersionResponse:
        """Tell the release of the software."""
        cursor, _ = await self._constant.get(request.metadata.cursor)
        return pb2.GetRobotVersionResponse(metadata=messages.metadata(cursor), version=VERSION)

    async def IsReady(self, request: pb2.EmptyRequest, context: Any) -> pb2.IsReadyResponse:
        """Say yes."""
        return pb2.IsReadyResponse(ready=True)

    async def GetError(self, request: pb2.GetRequest, context: Any) -> pb2.GetErrorResponse:
        """Tell what is wrong now."""
        cursor, codes = await self._errors.get(request.metadata.cursor)
        return pb2.GetErrorResponse(metadata=messages.metadata(cursor), error_codes=codes)

    async def GetRobotErrorCodeJson(
            self, request: pb2.EmptyRequest, context: Any) -> pb2.GetRobotErrorCodeJsonResponse:
        """Tell what the codes mean."""
        return pb2.GetRobotErrorCodeJsonResponse(
            json=ERRORS, result=messages.result(SUCCESS))
