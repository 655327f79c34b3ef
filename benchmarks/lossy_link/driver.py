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

It does not enable manual control by the service, whose responses are late with loss: the bridge
enables it with the first zero that it receives.

It reads commands from standard input, a JSON array a line, and writes a response to each but
``move``:

``["move", V, T]``
    moves in a thread; no response
``["stop"]``
    stops the robot; when that began, and how the movement ended
``["wait"]``
    waits for the end of the movement; how it ended
``["request_control", REPEATEDLY]``
    requests manual control, once or as the node does at its start; how long that took
``["renew_node"]``
    makes a new node; null
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
#: How long a response is awaited, as by the node by default [s].
RESPONSE_TIMEOUT = 10.0


class Driver:
    """A node that sends velocities at a rate [Hz], and its movement."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._thread: threading.Thread | None = None
        self._ended_by: str | None = None
        self._make()

    def move(self, linear_x: float, duration: float) -> None:
        """Start a movement forward [m/s] of a duration [s], in a thread."""
        self._ended_by = None
        self._thread = threading.Thread(target=self._move, args=(linear_x, duration))
        self._thread.start()

    def stop(self) -> dict[str, object]:
        """
        Stop the robot.

        :returns: when that began [s], time until odometry confirmed it [s], and why the movement
            ended
        """
        began = time.monotonic()
        self.node.stop_robot()
        confirmed = self.node.stop_confirmed_after
        return {'began': began, 'confirmed': confirmed, **self.wait()}

    def wait(self) -> dict[str, object]:
        """Wait for the end of the movement; return why it ended, None if it was complete."""
        assert self._thread is not None
        self._thread.join()
        return {'ended by': self._ended_by}

    def request_control(self, repeatedly: bool) -> float | None:
        """
        Request manual control.

        :param repeatedly: as the node does before its first movement; else once, as it does in
            a long one
        :returns: the time to the response [s]; None if it did not come
        """
        begin = time.monotonic()
        if repeatedly:
            try:
                self._service.enable(RESPONSE_TIMEOUT)
            except ControlError:
                return None
            return time.monotonic() - begin
        response = self._service.request(True)
        came = wait_until(lambda: response.done, RESPONSE_TIMEOUT)
        return time.monotonic() - begin if came else None

    def renew_node(self) -> None:
        """Make a new node: some faults are final."""
        self.node.destroy_node()
        self._make()

    def _make(self) -> None:
        parameters = {'rate': self._rate, 'manual_control': False}
        self.node = KachakaSimpleControl(parameter_overrides=[
            Parameter(name, value=value) for name, value in parameters.items()])
        self._service = ManualControlClient(self.node, SERVICE, lambda: None)

    def _move(self, linear_x: float, duration: float) -> None:
        try:
            self.node.move_robot(linear_x, 0.0, duration)
        except ControlError as error:
            self._ended_by = str(error)


def main() -> None:
    """Execute commands until standard input ends."""
    rclpy.init()
    driver = Driver(float(sys.argv[1]))
    for line in sys.stdin:
        name, *arguments = json.loads(line)
        response = getattr(driver, name)(*arguments)
        if name != 'move':
            print(json.dumps(response), flush=True)
    driver.node.destroy_node()
    rclpy.try_shutdown()


if __name__ == '__main__':
    main()
