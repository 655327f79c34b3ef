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
"""The official SDK drives the simulated robot unchanged: every method of both of its clients."""

from __future__ import annotations

import asyncio
import contextlib
import inspect

from kachaka_simple_control.kachaka.robot_status import (
    ERROR_NO_FURNITURE,
    ERROR_NOTHING_TO_DO,
    ERROR_PAUSED,
    ERROR_UNKNOWN_NAME,
)
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
from optional_libraries import MISSING, optional_imports
import pytest

kachaka_api = pb2 = MISSING
with optional_imports():
    import grpc
    from grpc_support import bench, FastClock
    import kachaka_api
    from kachaka_api.generated import kachaka_api_pb2 as pb2
    from kachaka_simple_control.kachaka.simulator.grpc_server import GrpcServer
    from kachaka_simple_control.kachaka.simulator.grpc_services import UNIMPLEMENTED

pytestmark = pytest.mark.needs('grpc', 'kachaka_api')
PLACE = {'x': 1.0, 'y': 0.0, 'theta': 0.5}
#: What the methods are called with that want something; FILE is one that can be read and written.
FILE = object()
ARGUMENTS = {
    'dock_any_shelf_with_registration': ('L01',), 'export_map': ('1', FILE), 'import_map': (FILE,),
    'load_map_preview': ('1',), 'lock': (1.0,), 'move_forward': (0.3,), 'move_shelf': ('S', 'L'),
    'move_to_location': ('home',), 'move_to_pose': (0.3, 0.2, 1.0), 'reset_shelf_pose': ('S01',),
    'return_shelf': ('S01',), 'rotate_in_place': (1.0,), 'set_auto_homing_enabled': (True,),
    'set_manual_control_enabled': (True,), 'set_robot_pose': (PLACE,),
    'set_robot_velocity': (0.1, 0.0), 'set_speaker_volume': (3,), 'speak': ('hello',),
    'start_command': (pb2.Command(localize_command=pb2.LocalizeCommand()),),
    'start_shortcut_command': ('1',), 'switch_map': ('1',)}
#: The code of the error of the methods whose result is one: there is no furniture here.
FAILURES = {
    'cancel_command': ERROR_NOTHING_TO_DO, 'proceed': ERROR_NOTHING_TO_DO,
    'dock_any_shelf_with_registration': ERROR_UNKNOWN_NAME, 'dock_shelf': ERROR_UNKNOWN_NAME,
    'move_shelf': ERROR_UNKNOWN_NAME, 'reset_shelf_pose': ERROR_UNKNOWN_NAME,
    'return_shelf': ERROR_UNKNOWN_NAME, 'start_shortcut_command': ERROR_UNKNOWN_NAME,
    'undock_shelf': ERROR_NO_FURNITURE}
#: What the methods return that have no result, of a robot in its initial state.
ANSWERS = {
    'get_auto_homing_enabled': False, 'get_battery_info': (100.0, 2),
    'get_command_state': (pb2.COMMAND_STATE_PENDING, pb2.Command()), 'get_current_map_id': '',
    'get_default_location_id': 'home', 'get_error': [], 'get_history_list': [],
    'get_last_command_result': (pb2.Result(), pb2.Command()), 'get_manual_control_enabled': False,
    'get_map_list': [], 'get_moving_shelf_id': '', 'get_robot_pose': pb2.Pose(),
    'get_robot_serial_number': 'SIMULATED', 'get_robot_version': '3.17.5',
    'get_running_command': None, 'get_shelves': [], 'get_shortcuts': {}, 'get_speaker_volume': 5,
    'is_command_running': False, 'set_emergency_stop': 0, 'set_robot_stop': None,
    'update_resolver': None}
#: What they answer that is looked at more closely.
CHECKS = {
    'get_png_map': lambda picture: picture.data.startswith(b'\x89PNG'),
    'get_ros_imu': lambda imu: imu.header.frame_id == 'imu_link',
    # The laser does not turn yet.
    'get_ros_laser_scan': lambda scan: len(scan.ranges) == 0,
    'get_locations': lambda locations: [place.id for place in locations] == ['home'],
    'get_robot_error_code': lambda errors: errors[ERROR_PAUSED].error_type == 'Warn',
    'get_ros_odometry': lambda odometry: odometry.header.frame_id == 'odom',
    'get_ros_wheel_odometry': lambda odometry: odometry.child_frame_id == 'base_footprint'}


def methods(kind):
    """Return the names of all public methods of a client."""
    return [name for name, _ in inspect.getmembers(kind, inspect.isfunction) if name[0] != '_']


def judge(name, answer):
    """Say whether the answer of a method is one that a user can go on with."""
    if name in CHECKS:
        assert CHECKS[name](answer)
    elif name in ANSWERS:
        assert (list(answer) if isinstance(ANSWERS[name], list) else answer) == ANSWERS[name]
    else:
        result = answer[0] if isinstance(answer, tuple) else answer
        code = FAILURES.get(name, 0)
        assert (result.success, result.error_code) == (code == 0, code)


@contextlib.contextmanager
def unimplemented():
    """Accept the error that docs/simulation.md names, and no other."""
    try:
        yield
    except grpc.RpcError as error:
        is_named = error.details().rpartition(' ')[2] in UNIMPLEMENTED
        if error.code() != grpc.StatusCode.UNIMPLEMENTED or not is_named:
            raise


def arguments(name, folder):
    """Return what to call a method with."""
    file = folder / 'map'
    file.write_bytes(b'map')
    return [str(file) if value is FILE else value for value in ARGUMENTS.get(name, ())]


@pytest.mark.parametrize('name', methods(kachaka_api.KachakaApiClient))
def test_every_method_of_the_client_works_or_says_what_there_is_not(name, tmp_path):
    with bench(FastClock()) as robot:
        client = kachaka_api.KachakaApiClient(robot.server.address)
        with unimplemented():
            judge(name, getattr(client, name)(*arguments(name, tmp_path)))


def test_the_clients_have_the_methods_that_we_know():
    """Another release of the SDK may have more, and they have to be looked at."""
    known = methods(kachaka_api.KachakaApiClient)
    assert known == methods(kachaka_api.aio.KachakaApiClient)
    assert set(known) >= set(ARGUMENTS) | set(FAILURES) | set(ANSWERS) | set(CHECKS)
    assert len(known) >= 68


@contextlib.asynccontextmanager
async def asynchronous(clock):
    """Serve a robot in this loop; yield the server and the SDK's other client."""
    server = GrpcServer(SimulatedKachaka(clock.now()), clock)
    address = await server.start(port=0)
    client = kachaka_api.aio.KachakaApiClient(address)
    try:
        yield server, client
    finally:
        await server.stop()


@pytest.mark.parametrize('name', methods(kachaka_api.aio.KachakaApiClient))
def test_every_method_of_the_asynchronous_client_does_the_same(name, tmp_path):
    async def call():
        async with asynchronous(FastClock()) as (_, client):
            with unimplemented():
                judge(name, await getattr(client, name)(*arguments(name, tmp_path)))
    asyncio.run(call())


def streams():
    """Return the names of all streams of the asynchronous client."""
    async def names():
        client = kachaka_api.aio.KachakaApiClient('127.0.0.1:9')
        return [name for name, value in vars(client).items() if hasattr(value, 'stream')]
    return asyncio.run(names())


@pytest.mark.parametrize('name', streams())
def test_every_stream_of_the_asynchronous_client_begins(name):
    """With the present value; its callback gets the same."""
    async def listen():
        async with asynchronous(FastClock()) as (_, client):
            handler = getattr(client, name)
            with unimplemented():
                first = await anext(handler.stream())
                received = asyncio.Queue()
                handler.set_callback(received.put)
                assert type(await asyncio.wait_for(received.get(), 10.0)) is type(first)
                handler.set_callback(None)
    asyncio.run(listen())
