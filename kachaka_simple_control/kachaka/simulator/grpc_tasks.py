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
"""Commands that come over gRPC, as tasks of the simulated robot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import math
from typing import Any

from kachaka_api.generated import kachaka_api_pb2 as pb2
from kachaka_simple_control.kachaka.error_codes import (
    ERROR_NO_FURNITURE,
    ERROR_NOT_A_VELOCITY,
    ERROR_NOTHING_TO_DO,
    ERROR_OUT_OF_RANGE,
    ERROR_UNKNOWN_NAME,
    SUCCESS,
)
from kachaka_simple_control.kachaka.simulator import grpc_messages
from kachaka_simple_control.kachaka.simulator.grpc_state import (
    constant,
    LongPollValue,
    SimulatorState,
)
from kachaka_simple_control.kachaka.simulator.tasks import (
    Action,
    DriveStraight,
    plan_to_pose,
    StandStill,
    Task,
    TaskResult,
    TurnInPlace,
)
from kachaka_simple_control.motion.geometry import Pose

#: How long it speaks, whatever it says [s]; chosen.  It makes no sound.
SPEAKING = 1.0
#: The place of its dock, which every Kachaka has; the name is that of the maker's examples.
HOME = 'home'


@dataclass(frozen=True)
class ReceivedCommand:
    """
    What a client sent.

    :param command: the command
    :param time: when it came [s since 1970]
    """

    command: pb2.Command
    time: int


def task_from_request(
        request: pb2.StartCommandRequest, station: SimulatorState, identity: str) -> Task | int:
    """
    Return what the robot has to do for a request.

    :param request: the request
    :param station: where the robot is
    :param identity: the name of the errand
    :returns: the errand, or the code of the error if there is none for it
    """
    name = request.command.WhichOneof('command')
    if name is None:
        return ERROR_UNKNOWN_NAME
    command = getattr(request.command, name)
    if not all(math.isfinite(value) for _, value in command.ListFields()
               if isinstance(value, float)):
        return ERROR_NOT_A_VELOCITY
    legs = ACTIONS[name](command, station) if name in ACTIONS else ERROR_UNKNOWN_NAME
    if isinstance(legs, int):
        return legs
    if request.HasField('lock_on_end'):
        legs = (*legs, StandStill(request.lock_on_end.duration_sec, can_be_ended=True))
    return Task(
        identity, legs,
        ends_docked=name in {'return_home_command', 'move_to_location_command'},
        note=ReceivedCommand(request.command, station.clock.stamp() // 10**9))


def _home(command: Any, station: SimulatorState) -> tuple[Action, ...]:
    return station.robot.way_home(station.now())


def _location(command: pb2.MoveToLocationCommand, station: SimulatorState) -> tuple[
        Action, ...] | int:
    return _home(command, station) if command.target_location_id == HOME else ERROR_UNKNOWN_NAME


def _pose(command: pb2.MoveToPoseCommand, station: SimulatorState) -> tuple[Action, ...]:
    goal = Pose(command.x, command.y, command.yaw)
    return plan_to_pose(station.localisation.to_odometry(goal))


def _lock(command: pb2.LockCommand, station: SimulatorState) -> tuple[Action, ...] | int:
    if command.duration_sec < 0.0:
        return ERROR_OUT_OF_RANGE
    return (StandStill(command.duration_sec, can_be_ended=True),)


def _muted(
        command: pb2.MoveByVelocityWithMutedSensorsCommand,
        station: SimulatorState) -> tuple[Action, ...]:
    velocity = command.signed_velocity
    return (DriveStraight(velocity * command.move_duration_sec, abs(velocity)),)


def _return_shelf(command: pb2.ReturnShelfCommand, station: SimulatorState) -> int:
    return ERROR_UNKNOWN_NAME if command.target_shelf_id else ERROR_NO_FURNITURE


#: How each command is done.  There is no furniture: what is about it fails as without any.
ACTIONS: dict[str, Callable[[Any, SimulatorState], tuple[Action, ...] | int]] = {
    'move_forward_command': lambda command, station: (
        DriveStraight(command.distance_meter, command.speed),),
    'rotate_in_place_command': lambda command, station: (TurnInPlace(command.angle_radian),),
    'move_to_pose_command': _pose,
    'move_to_location_command': _location,
    'return_home_command': _home,
    'lock_command': _lock,
    'speak_command': lambda command, station: (StandStill(SPEAKING),),
    'localize_command': lambda command, station: (TurnInPlace(math.tau),),
    'move_by_velocity_with_muted_sensors_command': _muted,
    'undock_shelf_command': lambda command, station: ERROR_NO_FURNITURE,
    'return_shelf_command': _return_shelf,
}


class CommandService:
    """Commands, how they go, and how they went."""

    def __init__(self, station: SimulatorState) -> None:
        """
        Serve a robot.

        :param station: where it is
        """
        self._station = station
        self._errand = LongPollValue(station, station.robot.task)
        self._outcomes = LongPollValue(station, station.robot.task_results)
        self._constant = constant(station)

    async def StartCommand(
            self, request: pb2.StartCommandRequest, context: Any) -> pb2.StartCommandResponse:
        """Begin a command; it waits behind the others unless it is to end them."""
        station = self._station
        identity = f'{station.new_cursor():016x}'
        errand = task_from_request(request, station, identity)
        if isinstance(errand, int):
            return pb2.StartCommandResponse(result=grpc_messages.result(errand))
        code = station.robot.start_task(errand, station.now(), request.cancel_all)
        station.notify()
        return pb2.StartCommandResponse(
            result=grpc_messages.result(code), command_id=identity if code == SUCCESS else '')

    async def CancelCommand(
            self, request: pb2.EmptyRequest, context: Any) -> pb2.CancelCommandResponse:
        """End all commands at once."""
        errand = self._station.robot.cancel_tasks(self._station.now())
        self._station.notify()
        code = ERROR_NOTHING_TO_DO if errand is None else SUCCESS
        return pb2.CancelCommandResponse(
            result=grpc_messages.result(code), command=_command(errand))

    async def GetCommandState(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetCommandStateResponse:
        """Tell what the robot does."""
        cursor, errand = await self._errand.get(request.metadata.cursor)
        return pb2.GetCommandStateResponse(
            metadata=grpc_messages.metadata(cursor),
            state=pb2.COMMAND_STATE_RUNNING if errand else pb2.COMMAND_STATE_PENDING,
            command=_command(errand),
            command_id=errand.identity if errand else '')

    async def GetLastCommandResult(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetLastCommandResultResponse:
        """Tell how the last command went that is over."""
        cursor, outcomes = await self._outcomes.get(request.metadata.cursor)
        if not outcomes:
            return pb2.GetLastCommandResultResponse(metadata=grpc_messages.metadata(cursor))
        last = outcomes[-1]
        return pb2.GetLastCommandResultResponse(
            metadata=grpc_messages.metadata(cursor), result=grpc_messages.result(last.code),
            command=_command(last.task), command_id=last.task.identity)

    async def GetHistoryList(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetHistoryListResponse:
        """Tell how all commands went, newest last (chosen)."""
        cursor, outcomes = await self._outcomes.get(request.metadata.cursor)
        return pb2.GetHistoryListResponse(
            metadata=grpc_messages.metadata(cursor),
            histories=[_history(item) for item in outcomes])

    async def Proceed(self, request: pb2.EmptyRequest, context: Any) -> pb2.ProceedResponse:
        """End a lock."""
        code = self._station.robot.end_stay(self._station.now())
        self._station.notify()
        return pb2.ProceedResponse(result=grpc_messages.result(code))

    async def GetShortcuts(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetShortcutsResponse:
        """Tell that there are none."""
        cursor, _ = await self._constant.get(request.metadata.cursor)
        return pb2.GetShortcutsResponse(metadata=grpc_messages.metadata(cursor))

    async def StartShortcutCommand(
            self, request: pb2.StartShortcutCommandRequest, context: Any
            ) -> pb2.StartShortcutCommandResponse:
        """Refuse: there are none."""
        return pb2.StartShortcutCommandResponse(result=grpc_messages.result(ERROR_UNKNOWN_NAME))


def _command(errand: Task | None) -> pb2.Command | None:
    return errand.note.command if errand and isinstance(errand.note, ReceivedCommand) else None


def _history(outcome: TaskResult) -> pb2.History:
    note = outcome.task.note
    return pb2.History(
        id=outcome.task.identity, command=_command(outcome.task), success=outcome.is_success,
        error_code=outcome.code,
        command_executed_time=note.time if isinstance(note, ReceivedCommand) else 0)
