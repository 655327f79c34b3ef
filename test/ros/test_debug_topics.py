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
"""Debug topics of a node, over real DDS, and that none of them delays a drive."""

from __future__ import annotations

import math
import threading
import time

from kachaka_simple_control.motion.steps import Arc, Motion
from optional_libraries import MISSING, optional_imports
import pytest
from waiting import wait_until

SHOWN = MISSING
with optional_imports():
    from rclpy.impl.rcutils_logger import RcutilsLogger
    from topic_observer import figures, ODOMETRY, positions, SHOWN, VELOCITY

pytestmark = [
    pytest.mark.ros, pytest.mark.distro,
    pytest.mark.needs('rclpy', 'nav_msgs', 'diagnostic_msgs')]


def drive(node, *arguments):
    """Start a drive in another thread, and return that."""
    thread = threading.Thread(target=node.move_robot, args=arguments)
    thread.start()
    return thread


def test_the_plan_is_shown_before_the_robot_moves_from_where_it_is(listener, observer, make):
    observer.publish_odometry(
        ODOMETRY, 1.0, 2.0, math.sin(math.pi / 4), math.cos(math.pi / 4), 'lab')
    node = make()
    planned = observer.planned()
    thread = threading.Thread(target=node.run, args=[Motion('bow', [Arc(0.2, math.pi / 2)])])
    thread.start()
    assert wait_until(lambda: planned and planned[-1].header.frame_id == 'lab')
    assert not listener.moves()
    thread.join()
    # To the left, for the robot faces along y: from (1, 2) by (-0.2, 0.2).
    assert positions(planned[-1])[0] == pytest.approx((1.0, 2.0))
    assert positions(planned[-1])[-1] == pytest.approx((0.8, 2.2))
    assert len(planned[-1].poses) > 20
    assert {pose.header.frame_id for pose in planned[-1].poses} == {'lab'}
    # A late subscriber receives it, too.
    late = observer.planned()
    assert wait_until(lambda: late)
    assert positions(late[-1]) == positions(planned[-1])


def test_each_velocity_is_shown_with_its_time(listener, observer, make):
    node = make(rate=20.0)
    seen = observer.velocities()
    assert wait_until(lambda: node.count_subscribers(node.get_name() + '/commanded_velocity'))
    node.move_robot(0.1, -0.2, 0.5)
    assert wait_until(lambda: seen and seen[-1].twist.linear.x == 0.0)
    moving = [message for message in seen if message.twist.linear.x]
    assert len(moving) == 10
    assert {(m.twist.linear.x, m.twist.angular.z) for m in moving} == {(0.1, -0.2)}
    assert {message.header.frame_id for message in seen} == {'base_link'}
    stamps = [message.header.stamp.sec + message.header.stamp.nanosec * 1e-9 for message in moving]
    sent = [velocity.time for velocity in listener.received if velocity.moves]
    # Stamped by the same machine, right after it was sent.
    assert stamps == pytest.approx(sent, abs=0.05)


def test_the_driven_path_follows_odometry(listener, observer, make):
    pose = observer.publish_odometry(ODOMETRY, 0.0, 0.0, 0.0, 1.0, 'odom')
    node = make()
    seen = observer.driven()
    thread = drive(node, 0.1, 0.0, 1.0)
    assert wait_until(lambda: seen)
    for number in range(1, 11):
        pose.position.x = 0.1 * number
        time.sleep(0.1)
    assert wait_until(lambda: positions(seen[-1])[-1][0] == pytest.approx(1.0))
    assert positions(seen[-1])[0] == (0.0, 0.0)
    assert 8 <= len(seen[-1].poses) <= 11
    assert all(pose.header.stamp.sec > 1e9 for pose in seen[-1].poses)
    count, since = len(seen), time.monotonic()
    time.sleep(1.2)
    assert len(seen) - count <= (time.monotonic() - since) * 2.0 + 1.0
    thread.join()


def test_a_diagnosis_is_made_even_while_the_clock_of_ros_stands_still(listener, observer, make):
    node = make(use_sim_time=True, guardian=True)
    seen = observer.diagnostics()
    thread = drive(node, 0.1, 0.0, 2.5)
    assert wait_until(lambda: any(figures(one)['state'] == 'driving' for one in seen))
    driving = next(one for one in seen if figures(one)['state'] == 'driving')
    assert driving.status[0].name == 'kachaka_simple_control: drive'
    assert driving.status[0].hardware_id == f'kachaka on {VELOCITY}'
    values = figures(driving)
    assert list(values) == [
        'state', 'motion', 'step', 'late ticks', 'skipped ticks', 'subscribers',
        'other publishers', 'guardian', 'odometry age', 'manual control', 'speed',
        'obstacle watch']
    assert values['motion'] == 'move_robot'
    assert values['step'] == '1 of 1'
    assert values['subscribers'] == '1'
    assert values['other publishers'] == 'none'
    assert values['guardian'] == 'matched'
    assert values['odometry age'] == 'none received'
    assert values['manual control'].startswith('requested')
    thread.join()
    assert wait_until(lambda: figures(seen[-1])['state'] == 'at rest')
    assert [move.count for move in listener.moves()] == [25]


def test_a_topic_that_fails_is_logged_once_and_ends_nothing(listener, observer, make, monkeypatch):
    from kachaka_simple_control.ros import debug_topics, robot_status

    def fail(*what):
        raise RuntimeError('cannot show')

    monkeypatch.setattr(debug_topics.CommandedVelocityPublisher, 'on_sent', fail)
    monkeypatch.setattr(debug_topics.PathSerializer, 'pose', fail)
    monkeypatch.setattr(robot_status.StatusReader, 'read', fail)
    warnings = []
    # Before there is a node: the first event may come at once.
    monkeypatch.setattr(RcutilsLogger, 'warning', lambda self, text: warnings.append(text))
    observer.publish_odometry(ODOMETRY, 0.0, 0.0, 0.0, 1.0, 'odom')
    node = make()
    observer.diagnostics(), observer.driven(), observer.planned(), observer.velocities()
    # A path that is planned before the first pose would be published twice.
    wait_until(lambda: node.robot.pose)
    node.move_robot(0.1, 0.0, 1.5)
    assert [move.count for move in listener.moves()] == [15]
    shown = [text for text in warnings if 'cannot show' in text]
    assert sorted(text.split()[0] for text in shown) == sorted(SHOWN)


def test_slow_dds_of_debug_topics_delays_no_velocity(
        listener, observer, make, monkeypatch):
    """As observed, for a third of a second, while a participant joins."""
    observer.publish_odometry(ODOMETRY, 0.0, 0.0, 0.0, 1.0, 'odom')
    node = make(rate=20.0)
    thread, sent = node._introspection._thread, []
    monkeypatch.setattr(
        thread, '_publish', lambda *what: sent.append(what) or time.sleep(0.4))
    observer.diagnostics(), observer.driven(), observer.planned(), observer.velocities()
    node.move_robot(0.1, 0.0, 2.0)
    assert sent
    (move,) = listener.moves()
    assert move.count == 40
    assert move.duration == pytest.approx(2.0, abs=0.2)  # half of one call
    began = time.monotonic()
    node.stop_robot()
    node.destroy_node()
    assert time.monotonic() - began < 3.0
    count = len(sent)
    time.sleep(0.5)
    assert len(sent) == count
