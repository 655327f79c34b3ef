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
Only what Humble, Jazzy and Kilted all have is used.

The tests run on the later two; Humble is not on PyPI.  So each name of ROS that the package takes
stands in a list that was held against Humble's own sources.  A name that is missing here has to
be looked up there first.
"""

import ast

from program import ROOT
import pytest

COMMON = {
    'builtin_interfaces.msg': {'Time'},
    'diagnostic_msgs.msg': {'DiagnosticArray', 'DiagnosticStatus', 'KeyValue'},
    'geometry_msgs.msg': {'Quaternion', 'Twist', 'TwistStamped'},
    'nav_msgs.msg': {'Odometry', 'Path'},
    'sensor_msgs.msg': {'LaserScan'},
    'rcl_interfaces.msg': {
        'FloatingPointRange', 'ParameterDescriptor', 'SetParametersResult'},
    'rclpy': {'init', 'ok', 'shutdown', 'signals', 'spin', 'try_shutdown'},
    'rclpy.callback_groups': {'CallbackGroup', 'MutuallyExclusiveCallbackGroup'},
    'rclpy.clock': {'Clock', 'ClockType'},
    'rclpy.context': {'Context'},
    'rclpy.expand_topic_name': {'expand_topic_name'},
    'rclpy.exceptions': {'NameValidationException', 'ParameterException'},
    'rclpy.executors': {
        'Executor', 'ExternalShutdownException', 'MultiThreadedExecutor',
        'SingleThreadedExecutor'},
    'rclpy.impl.implementation_singleton': {'rclpy_implementation'},
    'rclpy.impl.rcutils_logger': {'RcutilsLogger'},
    'rclpy.node': {'Node'},
    'rclpy.parameter': {'Parameter'},
    'rclpy.publisher': {'Publisher'},
    'rclpy.qos': {
        'DurabilityPolicy', 'HistoryPolicy', 'qos_check_compatible', 'qos_profile_sensor_data',
        'QoSCompatibility',
        'QoSProfile', 'ReliabilityPolicy'},
    'rclpy.qos_overriding_options': {'InvalidQosOverridesError', 'QoSOverridingOptions'},
    'rclpy.serialization': {'serialize_message'},
    'rclpy.signals': {'SignalHandlerOptions', 'uninstall_signal_handlers'},
    'rclpy.subscription': {'Subscription'},
    'rclpy.task': {'Future'},
    'rclpy.topic_endpoint_info': {'TopicEndpointInfo'},
    'rclpy.utilities': {'get_rmw_implementation_identifier', 'remove_ros_args'},
    'rclpy.validate_namespace': {'validate_namespace'},
    'std_msgs.msg': {'Float64', 'String'},
    'std_srvs.srv': {'SetBool', 'Trigger'},
}
#: What came after Humble, by the name it is used under; nothing may depend on any of them.
LATER = {
    'autostart', 'create_event_handler', 'EventsExecutor', 'get_logger_level', 'matched',
    'PublisherMatchedInfo', 'count_clients', 'count_services', 'wait_for_node',
    'source_timestamp', 'LoggingServiceWorker', 'TypeDescriptionService', 'publisher_matched'}
FILES = sorted((ROOT / 'kachaka_simple_control').rglob('*.py')) + sorted(
    (ROOT / 'examples').glob('*.py'))


def names_of_ros(tree):
    """Return what a file takes from ROS, as (module, name)."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or '').split('.')[0] in ROS:
            yield from ((node.module, alias.name) for alias in node.names)
        elif isinstance(node, ast.Attribute):
            owner = ast.unparse(node.value)
            if owner in COMMON:
                yield owner, node.attr


ROS = {module.split('.')[0] for module in COMMON}


@pytest.mark.parametrize('file', FILES, ids=lambda file: str(file.relative_to(ROOT)))
def test_every_name_of_ros_is_in_all_distros(file):
    tree = ast.parse(file.read_text())
    for module, name in names_of_ros(tree):
        assert name in COMMON.get(module, set()), f'{module}.{name}: does Humble have it?'
    used = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    used |= {node.arg for node in ast.walk(tree) if isinstance(node, ast.keyword)}
    assert not used & LATER


def test_the_syntax_is_that_of_python_3_10():
    for file in FILES:
        ast.parse(file.read_text(), feature_version=(3, 10))
