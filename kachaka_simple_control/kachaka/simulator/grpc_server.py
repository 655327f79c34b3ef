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
"""
The gRPC server through which clients control the simulated robot.

Tested by test/kachaka/simulator/test_grpc_sdk.py.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
import contextlib
import socket
import threading
from typing import TypeVar

import grpc
from kachaka_api.generated.kachaka_api_pb2_grpc import add_KachakaApiServicer_to_server
from kachaka_simple_control.kachaka.simulator.contact import Contact
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

    Create, start and stop it in the same asyncio event loop.

    :param robot: from now on, other code may use it only through ``call()``
    :param on_contact: called once in the event loop, when it has touched something on its floor
    """

    def __init__(
            self, robot: SimulatedKachaka, clock: Clock,
            on_contact: Callable[[Contact], None] = lambda _: None) -> None:
        self.state = SimulatorState(robot, clock, on_contact)
        #: the address at which the server listens, as HOST:PORT
        self.address = ''
        self._server = grpc.aio.server(options=OPTIONS)
        add_KachakaApiServicer_to_server(SimulatedKachakaServicer(self.state), self._server)
        self._state_task: asyncio.Task[None] | None = None

    async def start(self, host: str = LOOPBACK, port: int = PORT) -> str:
        """
        Start to listen for clients; return the address as HOST:PORT.

        :param port: the TCP port; 0 for any free port
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
        Run a function with the robot and the time in the server's event loop; return its result.

        No gRPC call is executed meanwhile.  Not from the event loop's own thread.
        """
        async def work() -> T:
            answer = function(self.state.robot, self.state.now())
            self.state.notify()
            return answer
        return asyncio.run_coroutine_threadsafe(work(), self._loop).result()

    def wake(self) -> None:
        """Make the server read its clock again, after a test has set it."""
        self.call(lambda *_: None)


def _require_bindable(host: str, port: int) -> None:
    """
    Check that a TCP port can be bound: the gRPC library does not say why it cannot.

    :raises OSError: with the reason
    """
    family, kind, protocol, _, address = socket.getaddrinfo(
        host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
    with socket.socket(family, kind, protocol) as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        trial.bind(address)


@contextlib.contextmanager
def serving(
        robot: SimulatedKachaka, port: int = 0, host: str = LOOPBACK,
        clock: Clock | None = None,
        on_contact: Callable[[Contact], None] = lambda _: None) -> Iterator[GrpcServer]:
    """
    Run a gRPC server for a simulated robot, in a new thread, during a ``with`` block.

    :param robot: its start time must come from ``clock``
    :param port: the TCP port; 0 for any free port
    :param on_contact: called once, in that thread, when the robot has touched something
    :raises OSError: if the port cannot be bound
    """
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever, name='grpc-server')
    thread.start()

    async def start() -> GrpcServer:
        server = GrpcServer(robot, clock or Clock(), on_contact)
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
