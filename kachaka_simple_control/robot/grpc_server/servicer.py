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
"""All calls of the robot's service: answered by the part that can, or refused."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

import grpc
from kachaka_api.generated.kachaka_api_pb2_grpc import KachakaApiServicer
from kachaka_simple_control.robot.grpc_server.command_service import CommandService
from kachaka_simple_control.robot.grpc_server.driving_service import DrivingService
from kachaka_simple_control.robot.grpc_server.equipment_service import EquipmentService
from kachaka_simple_control.robot.grpc_server.layout_service import LayoutService
from kachaka_simple_control.robot.grpc_server.sensing_service import SensingService
from kachaka_simple_control.robot.grpc_server.state_service import StateService
from kachaka_simple_control.robot.grpc_server.station import Station
from kachaka_simple_control.robot.grpc_server.transform_service import TransformService

#: Every call that the robot's service has.
CALLS = tuple(name for name in vars(KachakaApiServicer) if name[0].isupper())
PARTS = (
    CommandService, DrivingService, EquipmentService, LayoutService, SensingService, StateService,
    TransformService)
#: The calls that a simulated robot has no answer to.
UNIMPLEMENTED = tuple(
    name for name in CALLS if not any(hasattr(part, name) for part in PARTS))


class SimulatedKachakaServicer(KachakaApiServicer):  # type: ignore[misc]
    """The service of a Kachaka, put together from its parts."""

    def __init__(self, station: Station) -> None:
        """
        Serve a robot.

        :param station: where it is
        """
        for part in (kind(station) for kind in PARTS):
            for name in CALLS:
                if hasattr(part, name):
                    setattr(self, name, getattr(part, name))
        for name in UNIMPLEMENTED:
            setattr(self, name, _refusal(name))


def _refusal(name: str) -> Callable[[Any, Any], Awaitable[None]]:
    async def refuse(_request: Any, context: Any) -> None:
        await context.abort(
            grpc.StatusCode.UNIMPLEMENTED, f'the simulated Kachaka has no {name}')
    return refuse
