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
"""What the tests with real ROS share: a probe, and processes."""

from __future__ import annotations

import contextlib
import math
import os
from pathlib import Path
import subprocess
import sys
import threading
import time

#: The first discovery on a machine may take 3 s, and there may be other work on it.
PATIENCE = 15.0
ROOT = Path(__file__).resolve().parent.parent


def wait_until(condition, timeout=PATIENCE):
    """Wait for a condition, and answer whether it came true."""
    deadline = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.005)
    return True


def environment(**more):
    """Return the environment of a child that finds this package, installed or not."""
    path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get('PYTHONPATH')])])
    return {**os.environ, 'PYTHONPATH': path, **more}


def is_running(pid):
    """Tell whether a process is there and no zombie, which its parent may never collect."""
    try:
        status = Path(f'/proc/{pid}/stat').read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False
    return status.rpartition(')')[2].split()[0] != 'Z'


class BridgeProcess:
    """A bridge as a user starts it, and what it says."""

    def __init__(self, *options, **more):
        """Start it; with further arguments of Popen."""
        self.process = subprocess.Popen(
            [sys.executable, '-m', 'kachaka_simple_control.kachaka.bridge_command', *options],
            stderr=subprocess.PIPE, text=True, env=environment(), **more)
        self.lines = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        self.lines.extend(self.process.stderr)

    @property
    def text(self):
        """Return everything it has said."""
        return ''.join(self.lines)

    def wait(self, timeout=PATIENCE):
        """Wait for its end, and return its exit code."""
        code = self.process.wait(timeout)
        self._reader.join(timeout)
        return code

    def end(self):
        """End it, whatever state it is in."""
        self.process.kill()
        self.wait()
        for pipe in filter(None, (self.process.stdin, self.process.stderr)):
            pipe.close()


@contextlib.contextmanager
def bridge(*options, **more):
    """Run a bridge to the simulated robot for the length of a block."""
    process = BridgeProcess('--sim', *options, **more)
    try:
        yield process
    finally:
        process.end()


class Probe:
    """A node that drives a bridge and hears its odometry; spins in a thread of its own."""

    def __init__(self):
        """Join the domain."""
        from geometry_msgs.msg import Twist
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from std_srvs.srv import SetBool
        self._twist, self._set_bool = Twist, SetBool
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node('probe', context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()

    def _spin(self):
        while not self._over.is_set():
            self._executor.spin_once(timeout_sec=0.05)

    def close(self):
        """Leave the domain."""
        import rclpy
        self._over.set()
        self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)

    def publisher(self, namespace, process):
        """Return a publisher of velocities that a bridge listens to for certain."""
        publisher = self.node.create_publisher(
            self._twist, f'{namespace}/manual_control/cmd_vel', 10)

        def is_heard():
            # The reader may match later than the writer.  What is no number is refused aloud,
            # and changes nothing.
            self.send(publisher, math.nan)
            return 'the robot refused' in process.text

        assert wait_until(is_heard)
        return publisher

    def send(self, publisher, linear_x, angular_z=0.0):
        """Publish one velocity."""
        message = self._twist()
        message.linear.x, message.angular.z = linear_x, angular_z
        publisher.publish(message)

    def odometry(self, namespace, topic='odometry/odometry'):
        """Return a list that odometry is added to, with the time of its arrival."""
        from nav_msgs.msg import Odometry
        from rclpy.qos import qos_profile_sensor_data
        heard = []
        self.node.create_subscription(
            Odometry, f'{namespace}/{topic}',
            lambda message: heard.append((time.monotonic(), message)), qos_profile_sensor_data)
        assert wait_until(lambda: heard)
        return heard

    def set_enabled(self, namespace, enabled):
        """Call the service, and return its answer."""
        client = self.node.create_client(
            self._set_bool, f'{namespace}/manual_control/set_enabled')
        assert client.wait_for_service(PATIENCE)
        future = client.call_async(self._set_bool.Request(data=enabled))
        assert wait_until(future.done)
        return future.result()
