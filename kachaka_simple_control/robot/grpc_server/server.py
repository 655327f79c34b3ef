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
"""The server: an address, and the robot behind it."""

from __future__ import annotations

import asyncio
import contextlib
import socket

import grpc
from kachaka_api.generated.kachaka_api_pb2_grpc import add_KachakaApiServicer_to_server
from kachaka_simple_control.robot.grpc_server.clock import Clock
from kachaka_simple_control.robot.grpc_server.servicer import SimulatedKachakaServicer
from kachaka_simple_control.robot.grpc_server.station import Station
from kachaka_simple_control.robot.simulated import SimulatedKachaka

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
        self.station = Station(robot, clock)
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
        self._keeping = asyncio.create_task(self.station.keep())
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
