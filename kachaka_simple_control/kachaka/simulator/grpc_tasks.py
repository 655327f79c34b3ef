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
"""Convert commands received over gRPC to tasks of the simulated robot."""

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
    LongPollValue,
    Service,
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

#: The duration of a speak command with any text [s] (assumed).  The command makes no sound.
SPEAK_DURATION = 1.0
#: The location of the dock, which every Kachaka has; the manufacturer's examples use this name.
HOME = 'home'


@dataclass(frozen=True)
class ReceivedCommand:
    """
    A command received from a client.

    :param command: the command
    :param time: the time of receipt [s since 1970]
    """

    command: pb2.Command
    time: int


def task_from_request(
        request: pb2.StartCommandRequest, state: SimulatorState, identity: str) -> Task | int:
    """
    Return the task for a request, or an error code.

    :param request: the request
    :param state: the robot and its clock
    :param identity: the unique name for the task
    """
    name = request.command.WhichOneof('command')
    if name is None:
        return ERROR_UNKNOWN_NAME
    command = getattr(request.command, name)
    if not all(math.isfinite(value) for _, value in command.ListFields()
               if isinstance(value, float)):
        return ERROR_NOT_A_VELOCITY
    actions = ACTIONS[name](command, state) if name in ACTIONS else ERROR_UNKNOWN_NAME
    if isinstance(actions, int):
        return actions
    if request.HasField('lock_on_end'):
        actions = (*actions, StandStill(request.lock_on_end.duration_sec, can_be_ended=True))
    return Task(
        identity, actions,
        ends_docked=name in {'return_home_command', 'move_to_location_command'},
        note=ReceivedCommand(request.command, state.clock.stamp() // 10**9))


def _return_home(command: Any, state: SimulatorState) -> tuple[Action, ...]:
    return state.robot.actions_to_dock(state.now())


def _move_to_location(
        command: pb2.MoveToLocationCommand, state: SimulatorState) -> tuple[Action, ...] | int:
    if command.target_location_id != HOME:
        return ERROR_UNKNOWN_NAME
    return _return_home(command, state)


def _move_to_pose(command: pb2.MoveToPoseCommand, state: SimulatorState) -> tuple[Action, ...]:
    goal = Pose(command.x, command.y, command.yaw)
    return plan_to_pose(state.map_to_odom.to_odometry(goal))


def _lock(command: pb2.LockCommand, state: SimulatorState) -> tuple[Action, ...] | int:
    if command.duration_sec < 0.0:
        return ERROR_OUT_OF_RANGE
    return (StandStill(command.duration_sec, can_be_ended=True),)


def _move_by_velocity(
        command: pb2.MoveByVelocityWithMutedSensorsCommand,
        state: SimulatorState) -> tuple[Action, ...]:
    velocity = command.signed_velocity
    return (DriveStraight(velocity * command.move_duration_sec, abs(velocity)),)


def _return_shelf(command: pb2.ReturnShelfCommand, state: SimulatorState) -> int:
    return ERROR_UNKNOWN_NAME if command.target_shelf_id else ERROR_NO_FURNITURE


#: For each command, a function that returns its actions, or an error code if it needs furniture.
ACTIONS: dict[str, Callable[[Any, SimulatorState], tuple[Action, ...] | int]] = {
    'move_forward_command': lambda command, state: (
        DriveStraight(command.distance_meter, command.speed),),
    'rotate_in_place_command': lambda command, state: (TurnInPlace(command.angle_radian),),
    'move_to_pose_command': _move_to_pose,
    'move_to_location_command': _move_to_location,
    'return_home_command': _return_home,
    'lock_command': _lock,
    'speak_command': lambda command, state: (StandStill(SPEAK_DURATION),),
    'localize_command': lambda command, state: (TurnInPlace(math.tau),),
    'move_by_velocity_with_muted_sensors_command': _move_by_velocity,
    'undock_shelf_command': lambda command, state: ERROR_NO_FURNITURE,
    'return_shelf_command': _return_shelf,
}


class CommandService(Service):
    """The gRPC calls for commands: start, cancel, state and results."""

    def __init__(self, state: SimulatorState) -> None:
        super().__init__(state)
        self._task = LongPollValue(state, state.robot.task)
        self._results = LongPollValue(state, state.robot.task_results)

    async def StartCommand(
            self, request: pb2.StartCommandRequest, context: Any) -> pb2.StartCommandResponse:
        """Start a command; it waits for earlier commands, or cancels them on request."""
        state = self._state
        identity = f'{state.new_cursor():016x}'
        task = task_from_request(request, state, identity)
        if isinstance(task, int):
            return pb2.StartCommandResponse(result=grpc_messages.result(task))
        code = state.robot.start_task(task, state.now(), request.cancel_all)
        state.notify()
        return pb2.StartCommandResponse(
            result=grpc_messages.result(code), command_id=identity if code == SUCCESS else '')

    async def CancelCommand(
            self, request: pb2.EmptyRequest, context: Any) -> pb2.CancelCommandResponse:
        """Cancel all commands."""
        task = self._state.robot.cancel_tasks(self._state.now())
        self._state.notify()
        code = ERROR_NOTHING_TO_DO if task is None else SUCCESS
        return pb2.CancelCommandResponse(result=grpc_messages.result(code), command=_command(task))

    async def GetCommandState(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetCommandStateResponse:
        """Return the state and the running command, if there is one."""
        cursor, task = await self._task.get(request.metadata.cursor)
        return pb2.GetCommandStateResponse(
            metadata=pb2.Metadata(cursor=cursor),
            state=pb2.COMMAND_STATE_RUNNING if task else pb2.COMMAND_STATE_PENDING,
            command=_command(task),
            command_id=task.identity if task else '')

    async def GetLastCommandResult(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetLastCommandResultResponse:
        """Return the result of the last ended command."""
        cursor, results = await self._results.get(request.metadata.cursor)
        if not results:
            return pb2.GetLastCommandResultResponse(metadata=pb2.Metadata(cursor=cursor))
        last = results[-1]
        return pb2.GetLastCommandResultResponse(
            metadata=pb2.Metadata(cursor=cursor), result=grpc_messages.result(last.code),
            command=_command(last.task), command_id=last.task.identity)

    async def GetHistoryList(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetHistoryListResponse:
        """Return the results of all commands, newest last; this order is an assumption."""
        cursor, results = await self._results.get(request.metadata.cursor)
        return pb2.GetHistoryListResponse(
            metadata=pb2.Metadata(cursor=cursor),
            histories=[_history(result) for result in results])

    async def Proceed(self, request: pb2.EmptyRequest, context: Any) -> pb2.ProceedResponse:
        """End the current lock, a standstill that waits for the client."""
        code = self._state.robot.end_standstill(self._state.now())
        self._state.notify()
        return pb2.ProceedResponse(result=grpc_messages.result(code))

    async def GetShortcuts(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetShortcutsResponse:
        """Return an empty list of shortcuts."""
        return pb2.GetShortcutsResponse(metadata=await self.constant_metadata(request))

    async def StartShortcutCommand(
            self, request: pb2.StartShortcutCommandRequest, context: Any
            ) -> pb2.StartShortcutCommandResponse:
        """Refuse the request, because there are no shortcuts."""
        return pb2.StartShortcutCommandResponse(result=grpc_messages.result(ERROR_UNKNOWN_NAME))


def _command(task: Task | None) -> pb2.Command | None:
    return task.note.command if task and isinstance(task.note, ReceivedCommand) else None


def _history(result: TaskResult) -> pb2.History:
    note = result.task.note
    return pb2.History(
        id=result.task.identity, command=_command(result.task), success=result.is_success,
        error_code=result.code,
        command_executed_time=note.time if isinstance(note, ReceivedCommand) else 0)
