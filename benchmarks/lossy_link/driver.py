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
The driving program; ``python -m benchmarks.lossy_link.driver RATE``.

The program does not call the service that enables manual control, because its responses are late
with packet loss.  The bridge enables manual control when it receives the first zero.

The program reads one JSON array per line from standard input, and writes a response to each
command except ``move``:

``["move", V, T]``
    move in a thread; no response
``["stop"]``
    stop the robot; response: the start of the stop, and how the movement ended
``["wait"]``
    wait for the end of the movement; response: how the movement ended
``["request_control", REPEATEDLY]``
    request manual control, once or repeatedly like the node at its start; response: the duration
``["renew_node"]``
    make a new node; response: null
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
#: The timeout of a response, equal to the node's default [s].
RESPONSE_TIMEOUT = 10.0


class Driver:
    """Moves a robot with a node that sends velocities at a rate [Hz]."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._thread: threading.Thread | None = None
        self._ended_by: str | None = None
        self._make()

    def move(self, linear_x: float, duration: float) -> None:
        """Start a movement in a thread: a forward velocity [m/s] for a duration [s]."""
        self._ended_by = None
        self._thread = threading.Thread(target=self._move, args=(linear_x, duration))
        self._thread.start()

    def stop(self) -> dict[str, object]:
        """
        Stop the robot.

        :returns: the start of the stop [s], the time until odometry confirmed it [s], and the
            reason why the movement ended
        """
        began = time.monotonic()
        self.node.stop_robot()
        confirmed = self.node.stop_confirmed_after
        return {'began': began, 'confirmed': confirmed, **self.wait()}

    def wait(self) -> dict[str, object]:
        """Wait for the end of the movement; return why it ended early, or None."""
        assert self._thread is not None
        self._thread.join()
        return {'ended by': self._ended_by}

    def request_control(self, repeatedly: bool) -> float | None:
        """
        Request manual control.

        :param repeatedly: True to repeat the request, like the node before its first movement;
            False for one request, like the node during a long movement
        :returns: the time to the response [s]; None if there was no response
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
        """Make a new node, because a node cannot move again after some faults."""
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
