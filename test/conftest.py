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
"""What all tests share: a ROS domain of their own, and fixtures for robot and nodes."""

from __future__ import annotations

import os
from pathlib import Path
import sys

from example_counts import examples, PROFILE, SCALES
from optional_libraries import lack, optional_imports
from program import restore_signals
import pytest
from real_time_trials import RealTimeTrials
from ros_domain import claim_domain, isolate_ros

with optional_imports():
    from hypothesis import HealthCheck, settings
    # No test of pure code fails because a machine is busy.
    busy_machine = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
    # The same examples each time: a test says the same of the same code.  Others are searched for
    # at random by `make test-all`.
    for profile in SCALES:
        settings.register_profile(
            profile, busy_machine, max_examples=examples(30), derandomize=profile != 'thorough')
    settings.load_profile(PROFILE)

# The benchmarks are not installed.
sys.path.append(str(Path(__file__).resolve().parent.parent))
# Before anything loads rclpy.
isolate_ros()
if 'PYTEST_XDIST_WORKER' in os.environ:
    # The processes that share the tests have a domain each.
    os.environ['ROS_DOMAIN_ID'] = str(claim_domain())
restore_signals()


#: The real-time tests that are quick enough to be run one after the other: how a robot is found,
#: driven and stopped.
CORE = ('test_lesson', 'test_parameters', 'test_robot', 'test_stop', 'test_guardian')


@pytest.fixture
def listener():
    """Yield a robot that subscribes and responds as the official bridge does."""
    pytest.importorskip('rclpy', reason='needs ROS 2')
    from listener import Listener
    with Listener() as listener:
        yield listener


@pytest.fixture
def observer():
    """Yield a subscriber to the topics of a node."""
    pytest.importorskip('rclpy', reason='needs ROS 2')
    from topic_observer import TopicObserver
    with TopicObserver() as observer:
        yield observer


@pytest.fixture(scope='module')
def probe():
    """Yield a node that sends velocities and receives odometry, for all tests of a module."""
    from ros_support import Probe
    probe = Probe()
    yield probe
    probe.close()


@pytest.fixture(scope='module')
def browser(tmp_path_factory):
    """Yield a browser, for all tests of a module with pages of the console."""
    pytest.importorskip('tornado', reason='needs tornado')
    import chromium
    with chromium.browser(tmp_path_factory.mktemp('profile')) as driver:
        yield driver


@pytest.fixture
def namespace(request):
    """Return a namespace of this test, so that no other test's robot is received."""
    return '/' + ''.join(c if c.isalnum() else '_' for c in request.node.name)


@pytest.fixture
def make():
    """
    Yield a function that makes nodes, with ROS arguments; they are destroyed in the end.

    They are quick to start: without a guardian, and with a short prime time, unless a test wants
    them.
    """
    rclpy = pytest.importorskip('rclpy', reason='needs ROS 2')
    from kachaka_simple_control import KachakaSimpleControl
    rclpy.init(args=[])
    nodes = []

    def make_node(*arguments, **parameters):
        parameters = {'guardian': False, 'prime_time': 0.2, **parameters}
        nodes.append(KachakaSimpleControl(
            cli_args=['--ros-args', *arguments] if arguments else None,
            parameter_overrides=[
                rclpy.parameter.Parameter(name, value=value)
                for name, value in parameters.items()]))
        return nodes[-1]

    yield make_node
    for node in nodes:
        node.destroy_node()
    rclpy.try_shutdown()


def is_left_to_make(item):
    """Return whether a test is left to make test and make docs, where nothing was chosen."""
    marks = {mark.name for mark in item.iter_markers()}
    return 'document' in marks or bool(
        marks & {'ros', 'real_time'} and item.module.__name__ not in CORE)


def pytest_configure(config):
    """Watch the machine during the real-time tests."""
    config.pluginmanager.register(RealTimeTrials())


def pytest_collection_modifyitems(config, items):
    """
    Leave the long tests to make, and skip tests whose libraries are not there.

    A skip that a module raises while it is imported could end the collection of all others, with
    plug-ins that import modules in their own way; so a module only says what its tests need.
    """
    if not config.option.markexpr and config.args == config.getini('testpaths'):
        # As colcon test calls it, one test after the other.
        config.hook.pytest_deselected(items=[*filter(is_left_to_make, items)])
        items[:] = [item for item in items if not is_left_to_make(item)]
    for item in items:
        needed = [name for mark in item.iter_markers('needs') for name in mark.args]
        if (reason := next(filter(None, map(lack, needed)), None)) is not None:
            # First of all: tests with parameters that are missing have a skip of their own.
            item.add_marker(pytest.mark.skip(reason=reason), append=False)
