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
"""Readings and their cursors: what a client has is not sent again, and what is newer comes."""

from __future__ import annotations

import math

from optional_libraries import MISSING, optional_imports
import pytest

CALLS = UNIMPLEMENTED = MISSING
with optional_imports():
    import grpc
    from grpc_support import bench, DEADLINE
    from kachaka_api.generated import kachaka_api_pb2 as pb2
    from kachaka_simple_control.kachaka.simulator.grpc_services import CALLS, UNIMPLEMENTED

pytestmark = [pytest.mark.real_time, pytest.mark.needs('grpc', 'kachaka_api')]

#: All that is read with a cursor.
READINGS = [name for name in CALLS if name.startswith('Get') and name not in UNIMPLEMENTED
            and name not in ('GetRobotErrorCodeJson', 'GetDynamicTransform')]


@pytest.fixture(scope='module')
def resting():
    """Yield a robot at rest."""
    with bench() as started:
        yield started


@pytest.fixture
def robot():
    """Yield a robot that takes velocities."""
    with bench() as started:
        started.enable()
        yield started


@pytest.mark.parametrize('name', READINGS)
def test_cursor_0_returns_at_once_and_the_newest_waits(resting, name):
    """Any other cursor returns at once, too."""
    first = resting.get(name)
    assert first.metadata.cursor > 0
    assert resting.get(name) == first
    assert resting.get(name, first.metadata.cursor + 1) == first
    assert resting.is_silent(name, first.metadata.cursor)


def test_odometry_is_new_every_20_ms(robot):
    """Not earlier; then a long poll returns it, with its time stamp."""
    robot.velocity(1.0)
    robot.pass_time(0.02)
    first = robot.get('GetRosOdometry')
    later = robot.later('GetRosOdometry', first.metadata.cursor)
    robot.pass_time(0.019)
    assert robot.get('GetRosOdometry') == first
    assert not later.done()
    robot.pass_time(0.002)
    second = later.result()
    assert second.metadata.cursor > first.metadata.cursor
    assert second.odometry.pose.pose.position.x == pytest.approx(0.3 * 0.041)
    assert second.odometry.twist.twist.linear.x == 0.3
    assert second.odometry.header.stamp_nsec == robot.clock.stamp()


def test_odometry_has_the_form_of_ros(robot):
    """Frames, heading, and covariances of 36 figures."""
    robot.velocity(0.0, 1.0)
    robot.pass_time(1.0)
    for name in ('GetRosOdometry', 'GetRosWheelOdometry'):
        odometry = robot.get(name).odometry
        assert odometry.header.frame_id == 'odom'
        assert odometry.child_frame_id == 'base_footprint'
        assert odometry.pose.pose.orientation.z == pytest.approx(math.sin(0.5 * 1.57 * 0.3))
        assert odometry.pose.pose.orientation.w == pytest.approx(math.cos(0.5 * 1.57 * 0.3))
        assert len(odometry.pose.covariance) == len(odometry.twist.covariance) == 36


def test_the_pose_on_the_map_can_be_set(robot):
    """On its map; odometry stays as it is."""
    robot.velocity(1.0)
    robot.pass_time(1.0)
    pose = pb2.Pose(x=2.0, y=1.0, theta=math.pi / 2.0)
    assert robot.call('SetRobotPose', pb2.SetRobotPoseRequest(pose=pose)).result.success
    robot.velocity(1.0)
    robot.pass_time(1.0)
    pose = robot.get('GetRobotPose').pose
    assert (pose.x, pose.y, pose.theta) == pytest.approx((2.0, 1.09, math.pi / 2.0))
    assert robot.x() == pytest.approx(0.18)


@pytest.mark.parametrize('name', UNIMPLEMENTED)
def test_calls_without_implementation_are_refused(resting, name):
    """With a sentence and the status code."""
    method = getattr(resting.stub, name)
    request = pb2.DESCRIPTOR.services_by_name['KachakaApi'].methods_by_name[name].input_type
    message = getattr(pb2, request.name)()
    is_upload = name in ('ImportMap', 'ImportImageAsMap')
    with pytest.raises(grpc.RpcError) as error:
        list(method(iter([message]) if is_upload else message, timeout=DEADLINE))
    assert error.value.code() == grpc.StatusCode.UNIMPLEMENTED
    assert error.value.details() == f'the simulated Kachaka has no {name}'
