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
"""The executors of a node, of subscriptions of velocities, and of what is done periodically."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
import threading
import time

from optional_libraries import optional_imports
import pytest
from waiting import wait_until

with optional_imports():
    from geometry_msgs.msg import Twist
    from kachaka_simple_control.ros import executors
    from kachaka_simple_control.ros.executors import (
        NodeExecutor,
        PeriodicLoop,
        running,
        SubscriptionExecutor,
    )
    import rclpy
    from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
    from rclpy.qos import qos_profile_sensor_data

pytestmark = [
    pytest.mark.ros, pytest.mark.distro,
    pytest.mark.needs('rclpy', 'geometry_msgs.msg')]
TOPIC = 'velocity'
#: How long what should be at once may take on a busy machine [s].
AT_ONCE = 5.0


@pytest.fixture
def node():
    """Return a node of a context of its own."""
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node('spun', context=context)
    yield node
    node.destroy_node()
    rclpy.shutdown(context=context)


class Running:
    """An executor in a thread of its own."""

    def __init__(self, executor):
        """Run it."""
        self._executor = executor
        self.busy = 0.0
        self._threads = ThreadPoolExecutor(max_workers=1)
        self.end = self._threads.submit(self._run)

    def stop(self):
        """Stop it, and wait for its end."""
        self._executor.stop()
        self.end.result(AT_ONCE)
        self._threads.shutdown()

    def _run(self):
        self._executor.run()
        self.busy = time.thread_time()


def subscription(node, callback=lambda _: None):
    """Return a subscription in a group of its own."""
    return node.create_subscription(
        Twist, TOPIC, callback, qos_profile_sensor_data,
        callback_group=MutuallyExclusiveCallbackGroup())


def velocities(node):
    """Return a function that publishes a velocity; its publisher is matched."""
    publisher = node.create_publisher(Twist, TOPIC, 10)
    assert wait_until(lambda: publisher.get_subscription_count() == 1)

    def publish(linear):
        message = Twist()
        message.linear.x = linear
        publisher.publish(message)

    return publish


def is_reached(publish, received):
    """Publish until something is received: the reader may match later than the writer."""
    def is_received():
        publish(0.0)
        return bool(received)
    return wait_until(is_received)


def test_subscription_executor_delivers_all_the_oldest_first(node):
    received = []
    running = Running(
        SubscriptionExecutor(
            node, subscription(node), lambda twist: received.append(twist.linear.x)))
    publish = velocities(node)
    assert is_reached(publish, received)
    for number in range(1, 21):
        publish(float(number))
        assert wait_until(lambda number=number: received[-1] == number)
    running.stop()
    assert [number for number in received if number] == [*range(1, 21)]


def test_subscription_executor_without_messages_costs_nothing_and_ends_at_once(node):
    running = Running(SubscriptionExecutor(node, subscription(node), lambda _: None))
    time.sleep(1.0)
    assert not running.end.done()
    begun = time.monotonic()
    running.stop()
    assert time.monotonic() - begun < 1.0
    assert running.busy < 0.1


def test_subscription_executor_ends_in_the_midst_of_a_flood(node):
    """Each message brings the next, so there is always one more to take."""
    flood = threading.Event()
    flood.set()
    received = []

    def on_twist(twist):
        received.append(twist)
        if flood.is_set():
            publish(1.0)

    running = Running(SubscriptionExecutor(node, subscription(node), on_twist))
    publish = velocities(node)
    assert is_reached(publish, received)
    assert wait_until(lambda: len(received) > 100)
    try:
        running.stop()
    finally:
        flood.clear()


def test_an_error_of_the_subscription_callback_is_raised(node):
    received = []

    def on_twist(twist):
        received.append(twist)
        raise ValueError('not that one')

    running = Running(SubscriptionExecutor(node, subscription(node), on_twist))
    assert is_reached(velocities(node), received)
    assert wait_until(running.end.done)
    with pytest.raises(ValueError, match='not that one'):
        running.stop()


def test_node_executor_leaves_the_subscription_to_its_own(node):
    by_node, received, ticks = [], [], []
    subscribed = Running(
        SubscriptionExecutor(node, subscription(node, by_node.append), received.append))
    node.create_timer(0.01, lambda: ticks.append(1))
    rest = Running(NodeExecutor(node))
    publish = velocities(node)
    assert is_reached(publish, received)
    assert wait_until(lambda: len(ticks) > 10)
    for _ in range(50):
        publish(1.0)
        time.sleep(0.002)
    rest.stop()
    subscribed.stop()
    assert not by_node
    assert len(received) > 10


class Ends:
    """Records a shutdown request."""

    def __init__(self):
        """Begin without a request."""
        self.requested = threading.Event()

    def end(self):
        """Record it."""
        self.requested.set()


class Endless:
    """An executor that only ``stop`` ends."""

    def __init__(self):
        """Serve nothing yet."""
        self._over = threading.Event()

    def run(self):
        """Wait."""
        self._over.wait(30.0)

    def stop(self):
        """End."""
        self._over.set()


def test_end_of_an_executor_ends_the_program():
    ends = Ends()
    with running(Endless(), ends.end):
        assert not ends.requested.is_set()
    assert ends.requested.is_set()


def test_an_error_of_a_loop_is_raised_at_the_end_of_the_block():
    ends = Ends()
    with pytest.raises(ZeroDivisionError), running(PeriodicLoop(0.01, lambda: 1 / 0), ends.end):
        assert ends.requested.wait(AT_ONCE)


def test_a_periodic_loop_calls_at_once_and_then_in_each_period_of_the_steady_clock():
    called = []
    with running(PeriodicLoop(0.02, lambda: called.append(time.monotonic()))):
        assert wait_until(lambda: len(called) >= 11)
    passed = called[10] - called[0]
    # It cannot be early; late calls are allowed for, on a busy machine.
    assert 0.19 < passed < 0.6


def test_a_periodic_loop_leaves_missed_calls_out_and_ends_at_once():
    called = []

    def slow():
        called.append(time.monotonic())
        time.sleep(0.1 if len(called) == 1 else 0.0)

    loop = PeriodicLoop(0.01, slow)
    with running(loop):
        assert wait_until(lambda: len(called) >= 4)
    # Without the ten that were missed; a call that was delayed comes at once.
    assert called[1] - called[0] >= 0.1
    assert called[3] - called[1] >= 0.015
    loop = PeriodicLoop(60.0, lambda: called.append(0.0))
    begun = time.monotonic()
    with running(loop):
        assert wait_until(lambda: called[-1] == 0.0)
    assert time.monotonic() - begun < AT_ONCE


def test_a_message_that_waits_for_its_thread_has_the_time_of_its_arrival(node):
    """Also after a clock was set, which would make its age absurd."""
    received = []

    def on_twist(_, arrival):
        received.append((arrival, time.monotonic()))
        time.sleep(0.3)

    running = Running(SubscriptionExecutor(node, subscription(node), on_twist, timed=True))
    publish = velocities(node)
    assert is_reached(publish, received)
    assert wait_until(lambda: time.monotonic() - received[-1][1] > 0.5)
    del received[:]
    begun = time.monotonic()
    publish(1.0)
    publish(2.0)
    sent = time.monotonic()
    assert wait_until(lambda: len(received) == 2)
    running.stop()
    (_, first), (arrival, handled) = received
    assert first + 0.29 < handled
    # DDS stamps by the system clock, which may be corrected meanwhile.
    assert begun - 0.01 < arrival < sent + 0.2


@pytest.mark.parametrize('age', [-5.0, 3600.0, 1.8e9])
def test_an_age_that_a_clock_made_is_none(age):
    now = time.monotonic()
    arrival = executors._arrival({'received_timestamp': time.time_ns() - int(age * 1e9)})
    assert now <= arrival <= time.monotonic()
