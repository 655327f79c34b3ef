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
The program that drives; ``python -m benchmarks.lossy_link.driver RATE``.

It leaves the service for manual control alone, which answers late when packets are lost: the
bridge switches manual control on with the first zero that it gets.

A user's program as the README shows it, which does what it is told on its standard input, a JSON
array a line, and answers in the same way:

``["move", V, T]``
    moves in a thread, and does not answer
``["stop"]``
    stops the robot; answers when that began, and how the movement ended
``["wait"]``
    waits for the end of the movement; answers how it ended
``["ask", REPEATEDLY]``
    asks for manual control, once or as the node does at the start; answers how long that took
``["renew"]``
    makes a new node; answers nothing of interest
"""

from __future__ import annotations

import json
import sys
import threading
import time

from kachaka_simple_control import ControlError, KachakaSimpleControl
from kachaka_simple_control.control.waiting import wait_until
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.ros.manual_control_client import ManualControlClient
import rclpy
from rclpy.parameter import Parameter

SERVICE = f'{KACHAKA.namespace}/{KACHAKA.manual_control_service}'
#: How long an answer is waited for: as long as the node does by default [s].
ANSWER = 10.0


class Driver:
    """A node, and the movement it makes."""

    def __init__(self, rate: float) -> None:
        """
        Make the node.

        :param rate: how often it sends a velocity [Hz]
        """
        self._rate = rate
        self._thread: threading.Thread | None = None
        self._ended_by: str | None = None
        self._make()

    def move(self, linear_x: float, duration: float) -> None:
        """
        Begin to move, in a thread.

        :param linear_x: forward velocity [m/s]
        :param duration: how long [s]
        """
        self._ended_by = None
        self._thread = threading.Thread(target=self._move, args=(linear_x, duration))
        self._thread.start()

    def stop(self) -> dict[str, object]:
        """
        Stop the robot.

        :returns: when that began [s], after how long odometry confirmed it [s], and why the
            movement ended
        """
        began = time.monotonic()
        self.node.stop_robot()
        confirmed = self.node.stop_confirmed_after
        return {'began': began, 'confirmed': confirmed, **self.wait()}

    def wait(self) -> dict[str, object]:
        """
        Wait for the end of the movement.

        :returns: why it ended; None if it was whole
        """
        assert self._thread is not None
        self._thread.join()
        return {'ended by': self._ended_by}

    def ask(self, repeatedly: bool) -> float | None:
        """
        Ask for manual control.

        :param repeatedly: as the node does before its first movement; else once, as it does in
            a long one
        :returns: how long the answer took [s]; None if it did not come
        """
        begin = time.monotonic()
        if repeatedly:
            try:
                self._service.enable(ANSWER)
            except ControlError:
                return None
            return time.monotonic() - begin
        answer = self._service.request(True)
        return time.monotonic() - begin if wait_until(lambda: answer.done, ANSWER) else None

    def renew(self) -> None:
        """Make a new node: some faults end one for good."""
        self.node.destroy_node()
        self._make()

    def _make(self) -> None:
        wanted = {'rate': self._rate, 'manual_control': False}
        self.node = KachakaSimpleControl(parameter_overrides=[
            Parameter(name, value=value) for name, value in wanted.items()])
        self._service = ManualControlClient(self.node, SERVICE, lambda: None)

    def _move(self, linear_x: float, duration: float) -> None:
        try:
            self.node.move_robot(linear_x, 0.0, duration)
        except ControlError as error:
            self._ended_by = str(error)


def main() -> None:
    """Do what is asked for, until nobody asks any more."""
    rclpy.init()
    driver = Driver(float(sys.argv[1]))
    for line in sys.stdin:
        name, *arguments = json.loads(line)
        answer = getattr(driver, name)(*arguments)
        if name != 'move':
            print(json.dumps(answer), flush=True)
    driver.node.destroy_node()
    rclpy.try_shutdown()


if __name__ == '__main__':
    main()
