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
"""A server in a thread of its own, for a program that has other things to do."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
import contextlib
import threading
from typing import TypeVar

from kachaka_simple_control.robot.grpc_server.clock import Clock
from kachaka_simple_control.robot.grpc_server.server import GrpcServer, LOOPBACK
from kachaka_simple_control.robot.simulated import SimulatedKachaka

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
            station.announce()
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
