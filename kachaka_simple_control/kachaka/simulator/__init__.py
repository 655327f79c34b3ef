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
A simulated Kachaka robot without ROS, with a gRPC server or as a Python object.

To run the robot in its own process, use one of these commands::

    kachaka_sim --grpc-port 0
    python -m kachaka_simple_control.kachaka.sim_command --grpc-port 0

The first line on standard output has the address of the gRPC server::

    ready: simulated Kachaka at 127.0.0.1:40153

To run the robot in a thread of your own program::

    from kachaka_simple_control.kachaka.simulator.grpc_server import serving
    from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka

    with serving(SimulatedKachaka(time.monotonic())) as server:
        client = kachaka_api.KachakaApiClient(server.address)
        ...
        pose, velocity = server.call(lambda robot, now: robot.state(now))

``serving`` also has the parameters ``port``, ``host`` and ``clock``.  Port 0 is any free port.

If your program already runs ``grpc.aio`` in an event loop, run the robot in its own process, or
run the class ``GrpcServer`` in that event loop.  Two event loops with ``grpc.aio`` in one process
disturb each other.

This package can be imported without grpc and kachaka_api.  Only its modules ``grpc_*`` need both.
"""
