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
The process of one loop; ``python -m benchmarks.loop_process NAME MODE RATE NAMESPACE``.

Modes: ``serve`` reads movements from standard input; ``drive`` makes one long movement;
``lesson`` makes the first movements of the lesson; ``signals`` makes a new node after every
signal; ``together`` drives all robots of a list of namespaces at once.  The process writes one
JSON value per line to standard output.
"""

from __future__ import annotations

import json
import signal
import sys
import threading
import time

from benchmarks.loops import GIVEN_UP, Loop, LOOPS, Ours  # noqa: I100
from benchmarks.resource_usage import ResourceMeter
from kachaka_simple_control.motion.drive_order import DriveOrder
from kachaka_simple_control.motion.steps import Motion, Move
from kachaka_simple_control.ros.drive_node import DriveNode
import rclpy

VELOCITY = 0.1
#: The duration of a movement that will be interrupted [s].
LONG = 30.0


def write(value: object) -> None:
    """Write a value to standard output as one JSON line."""
    print(json.dumps(value), flush=True)


def serve(loop: Loop, meter: ResourceMeter) -> None:
    """Connect to the robot; then make and measure the movements of each input line."""
    loop.connect()
    write('ready')
    for line in sys.stdin:
        write(measure_movements(loop, meter, json.loads(line)))


def measure_movements(
        loop: Loop, meter: ResourceMeter, durations: list[float]) -> dict[str, object]:
    """Move forward and backward alternately, until a fault."""
    faults: list[str] = []
    with meter:
        for count, duration in enumerate(durations):
            faults += move(loop, -VELOCITY if count % 2 else VELOCITY, duration)
            if faults:
                break
    report = meter.report()
    if faults:
        loop.recover()
    return {**report, 'faults': faults}


def move(loop: Loop, velocity: float, duration: float) -> list[str]:
    """Hold a forward velocity [m/s] for a duration [s]; return a list with the fault, if any."""
    try:
        loop.move(velocity, duration)
    except GIVEN_UP as error:
        return [str(error)]
    return []


def drive(loop: Loop, _meter: ResourceMeter) -> None:
    """Start a long movement at once, and write the time at which the robot was discovered."""
    threading.Thread(target=_write_match, args=(loop,), daemon=True).start()
    loop.move(VELOCITY, LONG)


def lesson(loop: Loop, _meter: ResourceMeter) -> None:
    """Make the first movements of the lesson: rest, forward, rest."""
    write('started')
    for velocity, duration in ((0.0, 1.0), (VELOCITY, 1.0), (0.0, 0.5)):
        loop.move(velocity, duration)


def signals(rate: float, namespace: str) -> None:
    """
    Move until a signal, then move again with a new node, and repeat.

    A new node is necessary, because a signal stops a node permanently. The program's own signal
    handler keeps the process alive. The node handles each signal as in a program without a
    handler. There is no guardian: it does not affect the measurement, and starting hundreds of
    guardians would take ten minutes.
    """
    signal.signal(signal.SIGINT, lambda *_: None)
    while True:
        loop = Ours(rate, namespace, prime_time=0.0, guardian=False)
        move(loop, VELOCITY, LONG)
        loop.close()


def together(rate: float, namespaces: str) -> None:
    """Move several robots at once, and write the largest number of Python threads meanwhile."""
    names, counts = namespaces.split(','), [0]
    node = DriveNode('together', {name: {} for name in names})
    motion = Motion('together', (Move(VELOCITY, 0.0, 0.5),))
    orders = {robot: DriveOrder.of(motion, robot.settings.profile.planning_limits, rate)
              for robot in node.robots.values()}
    # The benchmark subscribes, too, and must not miss the first velocity.
    while any(robot.publisher.get_subscription_count() < 2 for robot in orders):
        time.sleep(0.01)
    node.event_bus.subscribe(lambda _: counts.append(threading.active_count()), robot=names[0])
    try:
        node.commander.drive(orders)
    finally:
        node.destroy_node()
        write(max(counts))


def main() -> None:
    """Run the loop in the mode that the arguments name, and end like the lesson's program."""
    name, mode, rate, namespace = sys.argv[1], sys.argv[2], float(sys.argv[3]), sys.argv[4]
    meter = ResourceMeter()
    rclpy.init()
    if run := {'signals': signals, 'together': together}.get(mode):
        run(rate, namespace)
        return
    loop: Loop = LOOPS[name](rate, namespace)
    try:
        {'serve': serve, 'drive': drive, 'lesson': lesson}[mode](loop, meter)
    except KeyboardInterrupt:
        pass
    finally:
        loop.stop()
        loop.close()
        rclpy.try_shutdown()


def _write_match(loop: Loop) -> None:
    while not loop.has_matched:
        time.sleep(0.005)
    write(time.time())


if __name__ == '__main__':
    main()
