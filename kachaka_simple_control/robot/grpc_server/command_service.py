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
"""Calls that send the robot to do something by itself."""

from __future__ import annotations

from typing import Any

from kachaka_api.generated import kachaka_api_pb2 as pb2
from kachaka_simple_control.robot.errands import Errand, Outcome
from kachaka_simple_control.robot.error_codes import (
    ERROR_NOTHING_TO_DO,
    ERROR_UNKNOWN_NAME,
    SUCCESS,
)
from kachaka_simple_control.robot.grpc_server import messages, orders
from kachaka_simple_control.robot.grpc_server.station import Station
from kachaka_simple_control.robot.grpc_server.topic import constant, Topic


class CommandService:
    """Commands, how they go, and how they went."""

    def __init__(self, station: Station) -> None:
        """
        Serve a robot.

        :param station: where it is
        """
        self._station = station
        self._errand = Topic(station, station.robot.errand)
        self._outcomes = Topic(station, station.robot.outcomes)
        self._constant = constant(station)

    async def StartCommand(
            self, request: pb2.StartCommandRequest, context: Any) -> pb2.StartCommandResponse:
        """Begin a command; it waits behind the others unless it is to end them."""
        station = self._station
        identity = f'{station.new_cursor():016x}'
        errand = orders.errand(request, station, identity)
        if isinstance(errand, int):
            return pb2.StartCommandResponse(result=messages.result(errand))
        code = station.robot.start_errand(errand, station.now(), request.cancel_all)
        station.announce()
        return pb2.StartCommandResponse(
            result=messages.result(code), command_id=identity if code == SUCCESS else '')

    async def CancelCommand(
            self, request: pb2.EmptyRequest, context: Any) -> pb2.CancelCommandResponse:
        """End all commands at once."""
        errand = self._station.robot.cancel_errands(self._station.now())
        self._station.announce()
        code = ERROR_NOTHING_TO_DO if errand is None else SUCCESS
        return pb2.CancelCommandResponse(result=messages.result(code), command=_command(errand))

    async def GetCommandState(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetCommandStateResponse:
        """Tell what the robot does."""
        cursor, errand = await self._errand.get(request.metadata.cursor)
        return pb2.GetCommandStateResponse(
            metadata=messages.metadata(cursor),
            state=pb2.COMMAND_STATE_RUNNING if errand else pb2.COMMAND_STATE_PENDING,
            command=_command(errand),
            command_id=errand.identity if errand else '')

    async def GetLastCommandResult(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetLastCommandResultResponse:
        """Tell how the last command went that is over."""
        cursor, outcomes = await self._outcomes.get(request.metadata.cursor)
        if not outcomes:
            return pb2.GetLastCommandResultResponse(metadata=messages.metadata(cursor))
        last = outcomes[-1]
        return pb2.GetLastCommandResultResponse(
            metadata=messages.metadata(cursor), result=messages.result(last.code),
            command=_command(last.errand), command_id=last.errand.identity)

    async def GetHistoryList(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetHistoryListResponse:
        """Tell how all commands went, newest last (chosen)."""
        cursor, outcomes = await self._outcomes.get(request.metadata.cursor)
        return pb2.GetHistoryListResponse(
            metadata=messages.metadata(cursor), histories=[_history(item) for item in outcomes])

    async def Proceed(self, request: pb2.EmptyRequest, context: Any) -> pb2.ProceedResponse:
        """End a lock."""
        code = self._station.robot.end_stay(self._station.now())
        self._station.announce()
        return pb2.ProceedResponse(result=messages.result(code))

    async def GetShortcuts(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetShortcutsResponse:
        """Tell that there are none."""
        cursor, _ = await self._constant.get(request.metadata.cursor)
        return pb2.GetShortcutsResponse(metadata=messages.metadata(cursor))

    async def StartShortcutCommand(
            self, request: pb2.StartShortcutCommandRequest, context: Any
            ) -> pb2.StartShortcutCommandResponse:
        """Refuse: there are none."""
        return pb2.StartShortcutCommandResponse(result=messages.result(ERROR_UNKNOWN_NAME))


def _command(errand: Errand | None) -> pb2.Command | None:
    return errand.note.command if errand and isinstance(errand.note, orders.Order) else None


def _history(outcome: Outcome) -> pb2.History:
    note = outcome.errand.note
    return pb2.History(
        id=outcome.errand.identity, command=_command(outcome.errand), success=outcome.is_success,
        error_code=outcome.code,
        command_executed_time=note.time if isinstance(note, orders.Order) else 0)
