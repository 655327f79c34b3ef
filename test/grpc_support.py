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
"""A simulated robot over gRPC whose clock the tests set."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import threading
import time

import grpc
from kachaka_api.generated import kachaka_api_pb2 as pb2
from kachaka_api.generated.kachaka_api_pb2_grpc import KachakaApiStub
from kachaka_simple_control.kachaka.simulator.grpc_server import GrpcServer, serving
from kachaka_simple_control.kachaka.simulator.grpc_state import Clock
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka

#: Long enough for any answer, short enough for one that must not come [s].
DEADLINE, SILENCE = 10.0, 0.15
NOTHING = pb2.EmptyRequest()


class StillClock(Clock):
    """A clock that a test sets."""

    def __init__(self, start: float = 1000.0) -> None:
        """Start at a time other than zero."""
        self.time = start

    def now(self) -> float:
        """Return the time [s]."""
        return self.time

    def stamp(self) -> int:
        """Return the time [ns]."""
        return int(self.time * 1e9)

    def delay(self, until: float) -> float | None:
        """Return 0 for a time in the past, else None: the test wakes the server."""
        return 0.0 if until <= self.time else None


class FastClock(Clock):
    """A clock that is a hundred times as fast."""

    SPEED = 100.0

    def __init__(self) -> None:
        """Start now."""
        self._begin = time.monotonic()

    def now(self) -> float:
        """Return the time [s]."""
        return self._begin + (time.monotonic() - self._begin) * self.SPEED

    def delay(self, until: float) -> float | None:
        """Return the real time to wait [s]."""
        return max(until - self.now(), 0.0) / self.SPEED


class Bench:
    """A robot, its server, and a bare client."""

    def __init__(self, server: GrpcServer, clock: Clock, channel: grpc.Channel) -> None:
        """Keep server and clock, and make a stub."""
        self.server = server
        self.clock = clock
        self.stub = KachakaApiStub(channel)

    def pass_time(self, duration: float) -> None:
        """Let time pass [s]."""
        self.clock.time += duration
        self.server.wake()

    def call(self, name: str, request: object = NOTHING, timeout: float = DEADLINE) -> object:
        """Call the robot; return its response."""
        return getattr(self.stub, name)(request, timeout=timeout)

    def get(self, name: str, cursor: int = 0, timeout: float = DEADLINE) -> object:
        """Return a reading that is newer than a cursor."""
        return self.call(name, pb2.GetRequest(metadata=pb2.Metadata(cursor=cursor)), timeout)

    def is_silent(self, name: str, cursor: int) -> bool:
        """Return whether there is no reading newer than a cursor."""
        try:
            self.get(name, cursor, SILENCE)
        except grpc.RpcError as error:
            if error.code() != grpc.StatusCode.DEADLINE_EXCEEDED:
                raise
            return True
        return False

    def later(self, name: str, cursor: int) -> grpc.Future:
        """Start to wait for a reading newer than a cursor."""
        future = getattr(self.stub, name).future(
            pb2.GetRequest(metadata=pb2.Metadata(cursor=cursor)), timeout=DEADLINE)
        # The call must have arrived before the test goes on.
        threading.Event().wait(0.05)
        assert not future.done()
        return future

    def velocity(self, linear: float, angular: float = 0.0) -> pb2.Result:
        """Send a velocity, in parts of the largest."""
        return self.call('SetRobotVelocity', pb2.SetRobotVelocityRequest(
            linear=linear, angular=angular)).result

    def enable(self, enable: bool = True) -> pb2.Result:
        """Switch manual control."""
        return self.call('SetManualControlEnabled', pb2.SetManualControlEnabledRequest(
            enable=enable)).result

    def x(self) -> float:
        """Return the true x of the robot [m]."""
        return self.server.call(lambda robot, now: robot.state(now)[0].x)


@contextlib.contextmanager
def bench(clock: Clock | None = None, **options: object) -> Iterator[Bench]:
    """Serve a robot for the length of a test."""
    clock = clock or StillClock()
    with serving(SimulatedKachaka(clock.now(), **options), clock=clock) as server, \
            grpc.insecure_channel(server.address) as channel:
        yield Bench(server, clock, channel)
