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
A simulated robot with faults, a program that executes commands, each a line with a JSON string.

``delay S``, ``refuse CODE``, ``json TEXT``, ``errors CODE ...`` and ``forget`` (manual control)
set the robot; ``cut``, ``hang`` and ``flow`` set the connection to it.  ``rows`` returns the
velocities that it received, ``pose`` where it is, ``scans`` how often it was asked for a scan,
``laser`` how long its laser will run [s]; the response to each line is one line of JSON.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
import contextlib
import json
import math
import os
import select
import socket
import sys
import threading
import time

import grpc
from kachaka_api.generated import kachaka_api_pb2 as pb2
from kachaka_api.generated import kachaka_api_pb2_grpc as pb2_grpc
from kachaka_simple_control.kachaka.simulator import grpc_messages
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka


class Wire:
    """Forwards bytes between an address of its own and the robot; can be cut, or hang."""

    def __init__(self, target, port):
        """Listen and forward."""
        self._target, self._port = target, port
        self.flows = threading.Event()
        self._lock = threading.Lock()
        self._sockets = []
        self._listener = None
        self.flow()

    def flow(self):
        """Forward; also after a cut."""
        if self._listener is None:
            self._listener = socket.create_server(('127.0.0.1', self._port))
            self._port = self._listener.getsockname()[1]
            threading.Thread(target=self._accept, args=(self._listener,), daemon=True).start()
        self.flows.set()
        return self._port

    def hang(self):
        """Accept connections and bytes, and forward nothing."""
        self.flows.clear()

    def cut(self):
        """Close all connections, and listen no more."""
        listener, self._listener = self._listener, None
        with contextlib.suppress(OSError):
            listener.shutdown(socket.SHUT_RDWR)
        listener.close()
        with self._lock:
            for one in self._sockets:
                with contextlib.suppress(OSError):
                    one.shutdown(socket.SHUT_RDWR)
            self._sockets.clear()
        self.flows.set()

    def _accept(self, listener):
        with contextlib.suppress(OSError):
            while True:
                near, _ = listener.accept()
                far = socket.create_connection(('127.0.0.1', self._target))
                with self._lock:
                    self._sockets += [near, far]
                threading.Thread(target=self._forward, args=(near, far), daemon=True).start()

    def _forward(self, near, far):
        with contextlib.suppress(OSError), near, far:
            for one in (near, far):
                one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            while True:
                for source in select.select([near, far], [], [])[0]:
                    data = source.recv(65536)
                    self.flows.wait()
                    if not data:
                        return
                    (far if source is near else near).sendall(data)


class Robot(pb2_grpc.KachakaApiServicer):
    """A simulated robot with faults that records its calls; they run in parallel."""

    def __init__(self):
        """Begin without faults."""
        self.robot = SimulatedKachaka(time.monotonic())
        self.lock = threading.Lock()
        self.rows, self.asked = [], []
        self.delay, self.refusal, self.codes, self.json = 0.0, 0, [], '[]'
        #: the laser takes a scan each 0.1 s until this time; one was taken long ago
        self.laser_until, self.scan, self.scans_asked = -math.inf, 1, 0

    def SetRobotVelocity(self, request, context):  # noqa: N802
        """Drive, after a delay."""
        time.sleep(self.delay)
        with self.lock:
            now = time.monotonic()
            code = self.refusal or self.robot.set_robot_velocity(
                request.linear, request.angular, now)
            self.rows.append((now, request.linear, request.angular, code))
        return pb2.SetRobotVelocityResponse(result=grpc_messages.result(code))

    def SetManualControlEnabled(self, request, context):  # noqa: N802
        """Switch it, after a delay."""
        time.sleep(self.delay)
        with self.lock:
            code = self.refusal or self.robot.set_manual_control(request.enable, time.monotonic())
            self.asked.append((time.monotonic(), request.enable, code))
        return pb2.SetManualControlEnabledResponse(result=grpc_messages.result(code))

    def GetRosOdometry(self, request, context):  # noqa: N802
        """Return it 20 ms later."""
        time.sleep(0.02 + self.delay)
        with self.lock:
            pose, velocity = self.robot.odometry(time.monotonic())
        return pb2.GetRosOdometryResponse(
            metadata=pb2.Metadata(cursor=time.monotonic_ns()),
            odometry=grpc_messages.odometry(pose, velocity, 0))

    def GetRosLaserScan(self, request, context):  # noqa: N802
        """Return the newest scan, as soon as there is one newer than the cursor."""
        self.scans_asked += 1
        while context.is_active():
            now = time.monotonic()
            if now < self.laser_until:
                self.scan = int(10.0 * now)
            if self.scan != request.metadata.cursor:
                break
            time.sleep(0.01)
        return pb2.GetRosLaserScanResponse(
            metadata=pb2.Metadata(cursor=self.scan), scan=pb2.RosLaserScan(
                header=pb2.RosHeader(stamp_nsec=self.scan, frame_id='laser'),
                angle_min=-1.0, angle_max=1.0, angle_increment=1.0, scan_time=0.1, range_min=0.1,
                range_max=8.0, ranges=[0.5, math.inf, math.nan], intensities=[1.0] * 3))

    def ActivateLaserScan(self, request, context):  # noqa: N802
        """Let the laser run, unless all is refused."""
        if not self.refusal:
            self.laser_until = time.monotonic() + request.duration_sec
        return pb2.ActivateLaserScanResponse(result=grpc_messages.result(self.refusal))

    def GetError(self, request, context):  # noqa: N802
        """Return the error codes."""
        time.sleep(self.delay)
        return pb2.GetErrorResponse(error_codes=self.codes)

    def GetRobotErrorCodeJson(self, request, context):  # noqa: N802
        """Return the text that was set, JSON or not."""
        return pb2.GetRobotErrorCodeJsonResponse(
            json=self.json, result=pb2.Result(success=True))

    def GetRobotSerialNumber(self, request, context):  # noqa: N802
        """Return a name."""
        return pb2.GetRobotSerialNumberResponse(serial_number='FAULTY')

    def GetRobotVersion(self, request, context):  # noqa: N802
        """Return a number."""
        return pb2.GetRobotVersionResponse(version='1.0')


def execute(robot, wire, command):
    """Execute a command, and return the response."""
    word, _, rest = command.partition(' ')
    if word == 'delay':
        robot.delay = float(rest)
    elif word == 'refuse':
        robot.refusal = int(rest)
    elif word == 'errors':
        robot.codes = [int(code) for code in rest.split()]
    elif word == 'json':
        robot.json = rest
    with robot.lock:
        now = time.monotonic()
        if word == 'forget':
            robot.robot.set_manual_control(False, now)
        pose, velocity = robot.robot.state(now)
        answers = {
            'rows': robot.rows, 'asked': robot.asked, 'scans': robot.scans_asked,
            'laser': robot.laser_until - now,
            'pose': (now, pose.x, pose.y, pose.theta, velocity.linear_x),
            'enabled': robot.robot.manual_control(now)}
    if word in ('cut', 'hang', 'flow'):
        getattr(wire, word)()
    return answers.get(word, now)


def main():
    """Serve until standard input ends."""
    robot = Robot()
    server = grpc.server(ThreadPoolExecutor(32))
    pb2_grpc.add_KachakaApiServicer_to_server(robot, server)
    target = server.add_insecure_port('127.0.0.1:0')
    server.start()
    wire = Wire(target, int(sys.argv[1]) if len(sys.argv) > 1 else 0)
    print(json.dumps(wire.flow()), flush=True)
    for line in sys.stdin:
        print(json.dumps(execute(robot, wire, json.loads(line))), flush=True)
    os._exit(0)


if __name__ == '__main__':
    main()
