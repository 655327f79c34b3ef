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
The simulated robot, with a gRPC server or as a Python object, without ROS.

To run the robot in its own process, use one of these commands.  The first line on standard output
has the address::

    kachaka_sim --grpc-port 0
    python -m kachaka_simple_control.kachaka.sim_command --grpc-port 0
    ready: simulated Kachaka at 127.0.0.1:40153

To run the robot in a thread of your own program::

    from kachaka_simple_control.kachaka.simulator.grpc_server import serving
    from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka

    with serving(SimulatedKachaka(time.monotonic())) as server:
        client = kachaka_api.KachakaApiClient(server.address)
        ...
        pose, velocity = server.call(lambda robot, now: robot.state(now))

``serving`` also has the parameters ``port`` (0: any free port), ``host`` and ``clock``.

If your program already runs ``grpc.aio`` in an event loop, run the robot in its own process, or
run ``GrpcServer`` in that event loop.  Two event loops with ``grpc.aio`` in one process disturb
each other.

This package can be imported without grpc and kachaka_api.  Its modules ``grpc_*`` need both.
"""
