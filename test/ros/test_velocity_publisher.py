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
"""Velocities are serialized to the same bytes as by ROS."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.files import cdr
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from optional_libraries import optional_imports
import pytest

with optional_imports():
    from geometry_msgs.msg import Twist, TwistStamped
    from kachaka_simple_control.ros.velocity_publisher import is_zero, VelocityPublisher
    import rclpy
    from rclpy.serialization import deserialize_message, serialize_message

pytestmark = [
    pytest.mark.ros, pytest.mark.distro,
    pytest.mark.needs('rclpy', 'geometry_msgs.msg')]
SECOND = 1_000_000_000
NUMBERS = st.floats()
TIMES = st.integers(0, 2 ** 31 * SECOND - 1)
FRAMES = st.text(st.characters(min_codepoint=1, blacklist_categories=['Cs']), max_size=20)


def twist(linear_x, angular_z):
    """Return a velocity as a message."""
    message = Twist()
    message.linear.x, message.angular.z = linear_x, angular_z
    return message


@given(NUMBERS, NUMBERS)
def test_a_twist_has_the_bytes_that_ros_gives_it(linear_x, angular_z):
    data = cdr.twist(Velocity(linear_x, angular_z))
    assert data == bytes(serialize_message(twist(linear_x, angular_z)))
    # Compared as text, because NaN differs from itself.
    assert repr(cdr.read_twist(data)) == repr(Velocity(linear_x, angular_z))


@given(NUMBERS, NUMBERS, TIMES, FRAMES)
def test_a_stamped_twist_has_the_bytes_that_ros_gives_it(linear_x, angular_z, time, frame):
    message = TwistStamped(twist=twist(linear_x, angular_z))
    message.header.frame_id = frame
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(time, SECOND)
    own = cdr.twist_stamped(Velocity(linear_x, angular_z), time, frame)
    theirs = bytes(serialize_message(message))
    assert len(own) == len(theirs)
    # Of the padding before the numbers ROS leaves what was there.
    text = slice(0, 4 + 8 + 4 + len(frame.encode()) + 1)
    assert (own[text], own[-48:]) == (theirs[text], theirs[-48:])


class Wire:
    """Keeps what an rclpy publisher is given."""

    def __init__(self):
        self.sent = []

    def publish(self, data):
        """Keep it."""
        self.sent.append(data)


@pytest.fixture
def publisher(request):
    """Yield a publisher of a type of messages, and what it publishes."""
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node('publishing', context=context)
    publisher = VelocityPublisher(node, 'velocity', request.param, 'base')
    node.destroy_publisher(publisher._publisher)
    publisher._publisher = Wire()
    yield publisher, publisher._publisher.sent
    node.destroy_node()
    rclpy.shutdown(context=context)


VELOCITIES = [ZERO, ZERO, Velocity(0.3, 0.0), Velocity(0.3, 0.0), Velocity(-0.1, 1.5), ZERO]


@pytest.mark.parametrize('publisher', ['Twist'], indirect=True)
def test_velocities_are_published_as_they_are_and_serialized_once(publisher):
    publisher, sent = publisher
    repeated = VELOCITIES[4]
    for velocity in (*VELOCITIES, repeated, repeated):
        publisher.transmit(velocity)
    assert sent == [bytes(serialize_message(twist(velocity.linear_x, velocity.angular_z)))
                    for velocity in (*VELOCITIES, repeated, repeated)]
    assert sent[-1] is sent[-2]
    assert sent[0] is sent[1]
    assert [*map(is_zero, sent)] == [
        velocity.is_zero for velocity in (*VELOCITIES, repeated, repeated)]
    assert all(publisher.sent.consume(data, False, 0.0) for data in sent)
    assert not publisher.sent.consume(sent[0], False, 0.0)


@pytest.mark.parametrize('publisher', ['TwistStamped'], indirect=True)
def test_a_stamped_velocity_gets_the_time_of_its_message(publisher):
    publisher, sent = publisher
    for velocity in VELOCITIES:
        publisher.transmit(velocity)
    messages = [deserialize_message(data, TwistStamped) for data in sent]
    assert [message.twist for message in messages] == [
        twist(velocity.linear_x, velocity.angular_z) for velocity in VELOCITIES]
    assert {message.header.frame_id for message in messages} == {'base'}
    stamps = [message.header.stamp.sec * SECOND + message.header.stamp.nanosec
              for message in messages]
    assert stamps == sorted(set(stamps))
    now = publisher._clock.now().nanoseconds
    assert 0 <= now - stamps[-1] < 60 * SECOND
    assert [*map(is_zero, sent)] == [velocity.is_zero for velocity in VELOCITIES]
