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
"""The gRPC server of the simulated robot."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator
import contextlib
import socket
import threading
from typing import Any, TypeVar

import grpc
from kachaka_api.generated.kachaka_api_pb2_grpc import (
    add_KachakaApiServicer_to_server,
    KachakaApiServicer,
)
from kachaka_simple_control.kachaka.simulator.grpc_services import (
    DrivingService,
    EquipmentService,
    MapService,
    SensingService,
    StateService,
    TransformService,
)
from kachaka_simple_control.kachaka.simulator.grpc_state import Clock, SimulatorState
from kachaka_simple_control.kachaka.simulator.grpc_tasks import CommandService
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka

#: Every call that the robot's service has.
CALLS = tuple(name for name in vars(KachakaApiServicer) if name[0].isupper())
PARTS = (
    CommandService, DrivingService, EquipmentService, MapService, SensingService, StateService,
    TransformService)
#: The calls that a simulated robot has no answer to.
UNIMPLEMENTED = tuple(
    name for name in CALLS if not any(hasattr(part, name) for part in PARTS))


class SimulatedKachakaServicer(KachakaApiServicer):  # type: ignore[misc]
    """The service of a Kachaka, put together from its parts."""

    def __init__(self, station: SimulatorState) -> None:
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


#: Where a Kachaka listens.
PORT = 26400
#: Nobody else on the network can reach a simulated robot unless somebody wants it.
LOOPBACK = '127.0.0.1'
#: Without it, a second server on the same port would take every other call of the first.
OPTIONS = (('grpc.so_reuseport', 0),)


class GrpcServer:
    """A robot behind an address; of one event loop."""

    def __init__(self, robot: SimulatedKachaka, clock: Clock) -> None:
        """
        Prepare it; call it in the loop that it is to run in.

        :param robot: the robot; the server alone calls it from now on
        :param clock: the time
        """
        self.station = SimulatorState(robot, clock)
        self._server = grpc.aio.server(options=OPTIONS)
        add_KachakaApiServicer_to_server(SimulatedKachakaServicer(self.station), self._server)
        self._keeping: asyncio.Task[None] | None = None

    async def start(self, host: str = LOOPBACK, port: int = PORT) -> str:
        """
        Listen.

        :param host: the name or number of an address of this machine
        :param port: the port; 0 for any that is free
        :returns: the address to call, as HOST:PORT
        :raises OSError: if nobody can listen there
        """
        _try(host, port)
        name = f'[{host}]' if ':' in host else host
        try:
            port = self._server.add_insecure_port(f'{name}:{port}')
        except RuntimeError as error:
            raise OSError(str(error)) from error
        await self._server.start()
        self._keeping = asyncio.create_task(self.station.run())
        return f'{name}:{port}'

    async def stop(self) -> None:
        """End, and every call under way with it."""
        await self._server.stop(None)
        if self._keeping is not None:
            self._keeping.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._keeping


def _try(host: str, port: int) -> None:
    # grpc tells only that it could not; the system tells why.
    family, kind, protocol, _, address = socket.getaddrinfo(
        host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
    with socket.socket(family, kind, protocol) as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        trial.bind(address)


T = TypeVar('T')


class ServerThread:
    """
    A running server, for the other threads.

    :param address: where it listens, as HOST:PORT
    """

    def __init__(self, address: str, server: GrpcServer, loop: asyncio.AbstractEventLoop) -> None:
        """
        Note what runs.

        :param address: where it listens, as HOST:PORT
        :param server: the server
        :param loop: the loop it runs in
        """
        self.address = address
        self._server = server
        self._loop = loop

    def call(self, function: Callable[[SimulatedKachaka, float], T]) -> T:
        """
        Ask or tell the robot something, between two calls of its clients.

        :param function: what to do, given the robot and the time now [s]
        :returns: what it returned
        """
        async def work() -> T:
            station = self._server.station
            answer = function(station.robot, station.now())
            station.notify()
            return answer
        return asyncio.run_coroutine_threadsafe(work(), self._loop).result()

    def wake(self) -> None:
        """Look at the clock again, which somebody moved."""
        self.call(lambda *_: None)


@contextlib.contextmanager
def serving(
        robot: SimulatedKachaka,
        port: int = 0,
        host: str = LOOPBACK,
        clock: Clock | None = None) -> Iterator[ServerThread]:
    """
    Show a robot over gRPC for the length of a ``with`` block.

    :param robot: the robot, whose time is that of the clock
    :param port: where to listen; 0 for any port that is free
    :param host: the name or number of an address of this machine
    :param clock: the time; that of this machine by default
    :returns: a context manager for the running server
    :raises OSError: if nobody can listen there
    """
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever, name='grpc-server')
    thread.start()

    async def prepare() -> tuple[GrpcServer, str]:
        server = GrpcServer(robot, clock or Clock())
        return server, await server.start(host, port)

    try:
        server, address = asyncio.run_coroutine_threadsafe(prepare(), loop).result()
        try:
            yield ServerThread(address, server, loop)
        finally:
            asyncio.run_coroutine_threadsafe(server.stop(), loop).result()
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()
