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
The latency that the bridge to a real robot adds to the gRPC call.

Measured from publishing a velocity to its arrival at the robot, and from a bare gRPC call to its
arrival, in turns, at the same rates, with the same robot; all processes are on this machine.
``python -m benchmarks.experiments.bridge_latency`` prints the table of ``docs/kachaka.md``.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
import contextlib
import json
import signal
import sys
import threading
import time
from typing import Any

from benchmarks import ROOT
from benchmarks.process_usage import process_time
from benchmarks.resource_usage import BILLION, sleep_until
from benchmarks.tables import Table
from kachaka_simple_control.analysis.message_timing import median, quantile
from program import JsonProcess
from ros_domain import isolate_ros
from ros_support import BridgeProcess
from waiting import poll

RATES = (10, 50, 100)
#: The duration of a turn of the bridge or the bare call at each rate [s], and the number of turns.
BLOCK, TURNS = 6.0, 3
#: The threshold of the bridge's median latency, relative to the median of the bare call.
MAX_RATIO = 2.0
NAMES = ('floor', 'bridge')
HEAD = ('rate', 'bare call, median / 95 %', 'through the bridge, median / 95 %',
        'of the bare call', 'CPU a command: bare / bridge')
#: The difference between two velocities, relative to the largest; it identifies each message.
STEP = 1e-4
MAX_LINEAR = 0.3

Send = Callable[[float], None]


def measure(
        rates: Sequence[int] = RATES, block: float = BLOCK,
        turns: int = TURNS) -> list[dict[str, Any]]:
    """
    Measure the latency of the bridge and of the bare gRPC call, in turns.

    :returns: for the bridge and the bare call at each rate: ``who``, ``rate`` [Hz], ``latency``
        (of each velocity that arrived [s]), ``sent``, and ``cpu`` (CPU time of the caller or the
        bridge for each velocity [s])
    """
    isolate_ros()
    entries = [{'who': who, 'rate': rate, 'latency': [], 'sent': 0, 'cpu': 0.0}
               for rate in rates for who in NAMES]
    with _Robot() as robot, _floor(robot) as floor, _bridge(robot) as bridge:
        for _ in range(turns):
            for entry in entries:
                send, cpu = floor if entry['who'] == 'floor' else bridge
                _measure_block(entry, send, cpu, robot, block)
    for entry in entries:
        entry['cpu'] /= entry['sent']
    return entries


def ratio(entries: Sequence[dict[str, Any]], rate: int) -> float:
    """Return the bridge's median latency at a rate [Hz], relative to the bare gRPC call."""
    medians = {entry['who']: median(entry['latency']) for entry in entries
               if entry['rate'] == rate}
    return medians['bridge'] / medians['floor']


def table(entries: Sequence[dict[str, Any]]) -> Table:
    """Return the table of latencies, with a row for each rate."""
    rates = dict.fromkeys(entry['rate'] for entry in entries)
    return Table('From asking to arrival at the robot', HEAD, tuple(
        _row(rate, *(_entry(entries, who, rate) for who in NAMES)) for rate in rates))


def lost(entries: Sequence[dict[str, Any]]) -> str:
    """Return a sentence about the velocities that were lost in the bridge."""
    through = [entry for entry in entries if entry['who'] == 'bridge']
    sent = sum(entry['sent'] for entry in through)
    missing = sent - sum(len(entry['latency']) for entry in through)
    return f'Of {sent} velocities {missing} did not arrive.'


def _entry(entries: Sequence[dict[str, Any]], who: str, rate: int) -> dict[str, Any]:
    return next(entry for entry in entries if (entry['who'], entry['rate']) == (who, rate))


def _row(rate: int, floor: dict[str, Any], bridge: dict[str, Any]) -> tuple[str, ...]:
    cpu = ' / '.join(f'{1e3 * entry["cpu"]:.2f}' for entry in (floor, bridge))
    return (f'{rate} Hz', _latency(floor), _latency(bridge),
            f'{ratio((floor, bridge), rate):.2f}', f'{cpu} ms')


def _latency(entry: dict[str, Any]) -> str:
    parts = ' / '.join(f'{1e3 * quantile(entry["latency"], part):.2f}' for part in (0.5, 0.95))
    return f'{parts} ms'


def _measure_block(
        entry: dict[str, Any], send: Send, cpu: Callable[[], float], robot: _Robot,
        block: float) -> None:
    period = BILLION // entry['rate']
    count = int(block * entry['rate'])
    robot.rows()
    sent: dict[int, float] = {}
    before, due = cpu(), time.monotonic_ns() + period
    for index in range(1, count + 1):
        sleep_until(due)
        due += period
        sent[index] = time.monotonic()
        send(index * STEP)
    time.sleep(0.1)
    entry['cpu'] += cpu() - before
    entry['sent'] += count
    arrived = {round(linear / STEP): at for at, linear in reversed(robot.rows())}
    entry['latency'] += [arrived[index] - at for index, at in sent.items() if index in arrived]
    send(0.0)
    time.sleep(0.2)


@contextlib.contextmanager
def _floor(robot: _Robot) -> Iterator[tuple[Send, Callable[[], float]]]:
    import grpc
    from kachaka_api.generated import kachaka_api_pb2 as pb2
    from kachaka_api.generated.kachaka_api_pb2_grpc import KachakaApiStub
    with grpc.insecure_channel(robot.address) as channel:
        stub = KachakaApiStub(channel)

        def send(linear: float) -> None:
            stub.SetRobotVelocity(pb2.SetRobotVelocityRequest(linear=linear), timeout=1.0)

        yield send, time.process_time


@contextlib.contextmanager
def _bridge(robot: _Robot) -> Iterator[tuple[Send, Callable[[], float]]]:
    from geometry_msgs.msg import Twist
    import rclpy
    process = BridgeProcess('--address', robot.address, cwd=ROOT)
    rclpy.init()
    node = rclpy.create_node('bridge_latency')
    publisher = node.create_publisher(Twist, '/kachaka/manual_control/cmd_vel', 10)
    message = Twist()

    def send(linear: float) -> None:
        message.linear.x = linear * MAX_LINEAR
        publisher.publish(message)

    try:
        heard = poll(lambda: robot.rows() or send(STEP), 20.0, 0.1)
        assert heard, f'the bridge hears nothing; {process}'
        yield send, lambda: process_time(process.process.pid)
    finally:
        process.close(10.0, signal.SIGTERM)
        node.destroy_node()
        rclpy.shutdown()


class _Robot(JsonProcess):
    """A robot in its own process, which records the arrival of velocities."""

    def __init__(self) -> None:
        super().__init__(
            [sys.executable, '-m', 'benchmarks.experiments.bridge_latency', '--be-robot'],
            cwd=ROOT)
        self.address = self.read()

    def rows(self) -> list[tuple[float, float]]:
        """Return the arrivals since the last call: time [s] and forward velocity [m/s]."""
        self.write('rows')
        rows: list[tuple[float, float]] = self.read()
        return rows


def _be_robot() -> None:
    import grpc
    from kachaka_api.generated import kachaka_api_pb2 as pb2
    from kachaka_api.generated import kachaka_api_pb2_grpc as pb2_grpc
    rows: list[tuple[float, float]] = []
    lock = threading.Lock()
    done = pb2.SetRobotVelocityResponse(result=pb2.Result(success=True))

    class Servicer(pb2_grpc.KachakaApiServicer):  # type: ignore[misc]

        def SetRobotVelocity(self, request: Any, context: Any) -> Any:  # noqa: ARG002, N802
            with lock:
                rows.append((time.monotonic(), request.linear))
            return done

        def GetRobotSerialNumber(self, request: Any, context: Any) -> Any:  # noqa: ARG002, N802
            return pb2.GetRobotSerialNumberResponse(serial_number='BENCHMARK')

        def GetRobotVersion(self, request: Any, context: Any) -> Any:  # noqa: ARG002, N802
            return pb2.GetRobotVersionResponse(version='0')

    server = grpc.server(ThreadPoolExecutor(4))
    pb2_grpc.add_KachakaApiServicer_to_server(Servicer(), server)
    address = f'127.0.0.1:{server.add_insecure_port("127.0.0.1:0")}'
    print(json.dumps(address), flush=True)
    server.start()
    for _ in sys.stdin:
        with lock:
            print(json.dumps(rows), flush=True)
            rows.clear()


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print; return 1 if the threshold was missed, else 0."""
    parser = argparse.ArgumentParser(prog='bridge_latency', description=__doc__)
    parser.add_argument('--quick', action='store_true', help='measure little')
    parser.add_argument('--be-robot', action='store_true', help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.be_robot:
        _be_robot()
        return 0
    entries = measure(block=1.0, turns=1) if options.quick else measure()
    print(table(entries).markdown())
    print(lost(entries))
    missed = [rate for rate in RATES if ratio(entries, rate) > MAX_RATIO]
    print(f'Missed at {missed} Hz: more than {MAX_RATIO:g} times the bare call' if missed else
          f'Held: at the median at most {MAX_RATIO:g} times the bare call')
    return 1 if missed else 0


if __name__ == '__main__':
    sys.exit(main())
