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
Record what is sent to many robots, in a process of its own, with the source timestamps of DDS.

``python -m benchmarks.fleet.observer NAME...`` answers each line of standard input with a line.
It takes the messages as bytes a few times a second, and waits for none, so it costs little.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import json
import select
import sys
import time
from typing import Any

from benchmarks import ROOT
from benchmarks.fleet.in_step import Records, Sent
from program import JsonProcess
from waiting import poll

#: How often messages are taken [s].
TAKE_PERIOD = 0.1
#: How many messages of a robot are kept until they are taken: five seconds at 20 Hz.
DEPTH = 100
#: How long an answer may take [s]: the observer shares the machine with all others.
ANSWER_TIMEOUT = 30.0


class Observer(JsonProcess):
    """
    The process of an observer.

    :param names: of the robots
    :param command: returns the command line to run, for another place on the network
    """

    exit_timeout = 2.0

    def __init__(
            self, names: Sequence[str], variables: dict[str, str],
            command: Callable[[Sequence[str]], list[str]] = list) -> None:
        self._names = names
        super().__init__(
            command([sys.executable, '-m', 'benchmarks.fleet.observer', *names]), cwd=ROOT,
            env=variables)
        self._ask('ready')

    def clear(self) -> None:
        """Forget all velocities, before another drive."""
        self._ask('clear')

    def wait_until_moving(self, timeout: float, names: Sequence[str] = ()) -> bool:
        """
        Wait until robots were sent a velocity that moves them.

        :param names: of the robots; empty for all
        :returns: False after the timeout [s]
        """
        wanted = {*(names or self._names)}
        return poll(lambda: wanted <= {*self._ask('moved')}, timeout, TAKE_PERIOD)

    def records(self) -> Records:
        """Return the velocities sent to each robot so far."""
        return {name: sorted(Sent(*sent) for sent in robot)
                for name, robot in self._ask('records').items()}

    def poses(self) -> dict[str, list[float]]:
        """Return the newest pose of each robot by odometry: x, y [m], heading [rad]."""
        return dict(self._ask('poses'))

    def _ask(self, what: str) -> Any:
        self.write(what)
        return self.read(ANSWER_TIMEOUT)


class Recorder:
    """Subscribes to the velocities and the odometry of robots."""

    def __init__(self, names: Sequence[str]) -> None:
        from geometry_msgs.msg import Twist
        from nav_msgs.msg import Odometry
        from rclpy.context import Context
        from rclpy.node import Node
        from rclpy.qos import QoSProfile, ReliabilityPolicy
        self._names, self._twist, self._odometry = names, Twist, Odometry
        context = Context()
        context.init(args=[])
        self._node = Node(
            'observer', context=context, enable_rosout=False, start_parameter_services=False)

        def subscribe(kind: type, topic: str, depth: int) -> Any:
            quality = QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)
            return self._node.create_subscription(
                kind, topic, lambda _: None, quality, raw=True)

        self._velocities = [
            subscribe(Twist, f'/{name}/manual_control/cmd_vel', DEPTH) for name in names]
        #: made at the first question for poses: most drives need no odometry here
        self._poses: list[Any] = []
        self._subscribe_to_odometry = lambda: [
            subscribe(Odometry, f'/{name}/odometry/odometry', 1) for name in names]
        self._sent: list[list[tuple[float, float, float]]] = [[] for _ in names]

    def take(self) -> None:
        """Take the velocities that have arrived."""
        from kachaka_simple_control.files.cdr import read_twist
        for subscription, sent in zip(self._velocities, self._sent):
            for data, info in self._arrived(subscription, self._twist):
                velocity = read_twist(data)
                sent.append((info['source_timestamp'] / 1e9, velocity.linear_x,
                             velocity.angular_z))

    def answer(self, what: str) -> object:
        """Return the answer to a question of ``Observer``."""
        if what == 'records':
            return dict(zip(self._names, self._sent))
        if what == 'poses':
            return self._newest_poses()
        if what == 'clear':
            for sent in self._sent:
                sent.clear()
        if what == 'moved':
            return [name for name, sent in zip(self._names, self._sent)
                    if any(linear or angular for _, linear, angular in sent)]
        return True

    def _newest_poses(self) -> dict[str, list[float]]:
        from kachaka_simple_control.motion.geometry import yaw
        from rclpy.serialization import deserialize_message
        self._poses = self._poses or self._subscribe_to_odometry()
        poses: dict[str, list[float]] = {}
        end = time.monotonic() + ANSWER_TIMEOUT / 2.0
        while len(poses) < len(self._names) and time.monotonic() < end:
            for name, subscription in zip(self._names, self._poses):
                for data, _ in self._arrived(subscription, self._odometry):
                    pose = deserialize_message(data, self._odometry).pose.pose
                    turned = pose.orientation
                    poses[name] = [pose.position.x, pose.position.y, yaw(
                        turned.x, turned.y, turned.z, turned.w)]
            self.take()
            time.sleep(TAKE_PERIOD)
        return poses

    @staticmethod
    def _arrived(subscription: Any, kind: type) -> Any:
        handle = subscription.handle
        with handle:
            while (taken := handle.take_message(kind, True)) is not None:
                yield taken


def main() -> None:
    """Record and answer until standard input is closed."""
    recorder = Recorder(sys.argv[1:])
    while True:
        is_asked, *_ = select.select([sys.stdin], [], [], TAKE_PERIOD)
        recorder.take()
        if is_asked:
            line = sys.stdin.readline()
            if not line:
                return
            print(json.dumps(recorder.answer(json.loads(line))), flush=True)


if __name__ == '__main__':
    main()
