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
"""The parameters of the node, the qualities of service of its topics, and its names."""

from __future__ import annotations

from dataclasses import fields
import threading

from kachaka_simple_control.errors import UsageError
from optional_libraries import MISSING, optional_imports
import pytest
from waiting import wait_until

SHOWN = VELOCITY = MISSING
with optional_imports():
    from rcl_interfaces.msg import Parameter as ParameterMessage
    from rcl_interfaces.msg import ParameterValue
    from rcl_interfaces.srv import DescribeParameters, SetParameters
    import rclpy
    from rclpy.qos import QoSProfile, ReliabilityPolicy
    from std_srvs.srv import Trigger
    from topic_observer import SHOWN, VELOCITY

pytestmark = [
    pytest.mark.ros, pytest.mark.distro,
    pytest.mark.needs('rclpy', 'nav_msgs', 'diagnostic_msgs')]


@pytest.mark.parametrize('topic', SHOWN)
@pytest.mark.parametrize('target', [VELOCITY, 'kachaka/manual_control/cmd_vel'])
def test_no_debug_topic_may_be_remapped_to_one_that_moves_the_robot(make, topic, target):
    with pytest.raises(UsageError, match=f'^{topic} is remapped to {VELOCITY}, which moves'):
        make('-r', f'{topic}:={target}')


def test_the_quality_of_service_can_be_changed(make, observer):
    name = '/kachaka_simple_control/commanded_velocity'
    make(**{f'qos_overrides.{name}.publisher.reliability': 'reliable'})
    # A node of the test before may be seen a little longer.
    assert wait_until(lambda: [
        info.qos_profile.reliability for info in observer.node.get_publishers_info_by_topic(name)
    ] == [ReliabilityPolicy.RELIABLE])


@pytest.mark.parametrize('policy, value, text', [
    ('history', 'keep_all', 'a slow reader hold up the drive'),
    ('reliability', 'sometimes', 'sometimes'),
    ('depth', 'deep', 'depth'),
])
def test_an_impossible_quality_of_service_is_refused(make, policy, value, text):
    name = '/kachaka_simple_control/commanded_velocity'
    with pytest.raises(UsageError, match=text):
        make(**{f'qos_overrides.{name}.publisher.{policy}': value})


def test_parameters_cannot_be_changed_while_driving(listener, observer, make):
    node = make(rate=20.0)
    thread = threading.Thread(target=node.move_robot, args=(0.1, 0.0, 2.0))
    thread.start()
    listener.wait_for(lambda velocity: velocity.moves)
    for name, value in (('rate', ParameterValue(type=3, double_value=5.0)),
                        ('guardian', ParameterValue(type=1, bool_value=False)),
                        ('robot_namespace', ParameterValue(type=4, string_value='/other'))):
        answer = observer.call(
            SetParameters, '/kachaka_simple_control/set_parameters',
            SetParameters.Request(parameters=[ParameterMessage(name=name, value=value)]))
        (result,) = answer.results
        assert not result.successful
        assert 'read-only' in result.reason
        assert name in result.reason
    thread.join()
    assert [(move.linear_x, move.count) for move in listener.moves()] == [(0.1, 40)]


def test_parameters_are_described_with_their_ranges(observer, make):
    from kachaka_simple_control.ros.node_parameters import NodeParameters
    node = make()
    executor = rclpy.executors.SingleThreadedExecutor()
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    names = [parameter.name for parameter in fields(NodeParameters)]
    answer = observer.call(
        DescribeParameters, '/kachaka_simple_control/describe_parameters',
        DescribeParameters.Request(names=names))
    executor.shutdown()
    thread.join()
    for parameter, descriptor in zip(fields(NodeParameters), answer.descriptors, strict=True):
        assert descriptor.description == parameter.metadata['description']
        assert descriptor.read_only == (parameter.name != 'speed_factor')
        ranges = [(limits.from_value, limits.to_value)
                  for limits in descriptor.floating_point_range]
        expected = parameter.metadata['range']
        assert ranges == ([pytest.approx(expected)] if expected else [])


@pytest.mark.parametrize('name, hint', [
    ('raet', '; did you mean rate?'), ('colour', ', so it has no effect')])
def test_an_unknown_parameter_is_one_warning(make, capfd, name, hint):
    make('-p', f'{name}:=20.0', '-p', 'use_sim_time:=false')
    printed = capfd.readouterr().err
    assert printed.count('[WARN]') == 1
    assert f'there is no parameter {name}{hint}' in printed


def test_an_invalid_name_is_an_error_and_no_node(make, observer):
    for arguments in (('-r', '__ns:=/' + 'a' * 230), ('-r', '__node:=' + 'a' * 300),
                      ('-r', f'/rosout:={VELOCITY}')):
        with pytest.raises(UsageError, match='^[^\n]{1,300}$'):
            make(*arguments)
    assert observer.node.count_publishers(VELOCITY) == 0
    assert wait_until(lambda: observer.node.get_node_names() == ['observer'])


@pytest.mark.parametrize('clients', [1, 6])
def test_each_of_many_calls_at_once_is_answered(make, observer, clients):
    """The default queue keeps ten requests: most of these were never answered."""
    node = make()
    executor = rclpy.executors.SingleThreadedExecutor()
    executor.add_node(node)
    each = [observer.node.create_client(
        Trigger, '/kachaka_simple_control/stop', qos_profile=QoSProfile(depth=600))
        for _ in range(clients)]
    for client in each:
        assert client.wait_for_service(10.0)
    calls = [client.call_async(Trigger.Request()) for _ in range(600 // clients)
             for client in each]
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    try:
        assert wait_until(lambda: all(call.done() for call in calls))
    finally:
        executor.shutdown()
        thread.join()


def test_a_node_that_was_refused_leaves_nothing_behind(make, observer):
    """Its publisher would be taken for that of another program."""
    for _ in range(3):
        with pytest.raises(UsageError):
            make('-r', f'{SHOWN[0]}:={VELOCITY}')
    assert wait_until(lambda: observer.node.count_publishers(VELOCITY) == 0)
