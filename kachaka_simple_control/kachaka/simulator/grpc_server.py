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
"""The gRPC server through which clients control the simulated robot."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
import contextlib
import socket
import threading
from typing import TypeVar

import grpc
from kachaka_api.generated.kachaka_api_pb2_grpc import add_KachakaApiServicer_to_server
from kachaka_simple_control.kachaka.simulator.grpc_services import SimulatedKachakaServicer
from kachaka_simple_control.kachaka.simulator.grpc_state import Clock, SimulatorState
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka

#: The port of a real robot, and the loopback address: at this address only programs on the same
#: machine reach the simulated robot.
PORT = 26400
LOOPBACK = '127.0.0.1'
#: Without this option, a second server on the same port could start and would receive half of the
#: calls.
OPTIONS = (('grpc.so_reuseport', 0),)


T = TypeVar('T')


class GrpcServer:
    """
    The gRPC server through which clients control a simulated robot.

    Create, start and stop the server in the same asyncio event loop.

    :param robot: the simulated robot; from now on, other code may use it only through ``call()``
    :param clock: the clock that gives the robot its time
    """

    def __init__(self, robot: SimulatedKachaka, clock: Clock) -> None:
        self.state = SimulatorState(robot, clock)
        #: the address at which the server listens, as HOST:PORT
        self.address = ''
        self._server = grpc.aio.server(options=OPTIONS)
        add_KachakaApiServicer_to_server(SimulatedKachakaServicer(self.state), self._server)
        self._state_task: asyncio.Task[None] | None = None

    async def start(self, host: str = LOOPBACK, port: int = PORT) -> str:
        """
        Start the server, which then listens for clients at an address.

        :param host: the name or IP address of a network interface of this machine
        :param port: the TCP port; 0 for any free port
        :returns: the address for clients, as HOST:PORT
        :raises OSError: if the port cannot be bound
        """
        _require_bindable(host, port)
        name = f'[{host}]' if ':' in host else host
        try:
            port = self._server.add_insecure_port(f'{name}:{port}')
        except RuntimeError as error:
            raise OSError(str(error)) from error
        await self._server.start()
        self._loop = asyncio.get_running_loop()
        self._state_task = self._loop.create_task(self.state.run())
        self.address = f'{name}:{port}'
        return self.address

    async def stop(self) -> None:
        """Stop the server, and cancel all gRPC calls that are in progress."""
        await self._server.stop(None)
        if self._state_task is not None:
            self._state_task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._state_task

    def call(self, function: Callable[[SimulatedKachaka, float], T]) -> T:
        """
        Run a function in the server's event loop, and return what the function returns.

        No gRPC call is executed while the function runs.

        Call this method only from a thread that does not run the event loop.

        :param function: the function; its arguments are the simulated robot and the time of the
            steady clock [s]
        :returns: the return value of the function
        """
        async def work() -> T:
            answer = function(self.state.robot, self.state.now())
            self.state.notify()
            return answer
        return asyncio.run_coroutine_threadsafe(work(), self._loop).result()

    def wake(self) -> None:
        """
        Make the server read its clock again.

        This is for tests that set the time of the clock.  Such a test must call this method after
        each change of the time.
        """
        self.call(lambda *_: None)


def _require_bindable(host: str, port: int) -> None:
    """
    Check that a TCP port can be bound.

    The gRPC library does not say why a port cannot be bound, but this function does.

    :param host: the name or IP address of a network interface of this machine
    :param port: the TCP port
    :raises OSError: if the port cannot be bound; the error has the reason
    """
    family, kind, protocol, _, address = socket.getaddrinfo(
        host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
    with socket.socket(family, kind, protocol) as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        trial.bind(address)


@contextlib.contextmanager
def serving(
        robot: SimulatedKachaka, port: int = 0, host: str = LOOPBACK,
        clock: Clock | None = None) -> Iterator[GrpcServer]:
    """
    Run a gRPC server for a simulated robot, in a new thread, during a ``with`` block.

    :param robot: the simulated robot; its start time must come from ``clock``
    :param port: the TCP port; 0 for any free port
    :param host: the name or IP address of a network interface of this machine
    :param clock: the clock that gives the robot its time; default: the clock of this machine
    :returns: a context manager, which gives the block the running ``GrpcServer``
    :raises OSError: if the port cannot be bound
    """
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever, name='grpc-server')
    thread.start()

    async def start() -> GrpcServer:
        server = GrpcServer(robot, clock or Clock())
        await server.start(host, port)
        return server

    try:
        server = asyncio.run_coroutine_threadsafe(start(), loop).result()
        try:
            yield server
        finally:
            asyncio.run_coroutine_threadsafe(server.stop(), loop).result()
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()
