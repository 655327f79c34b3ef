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
"""The lesson, as a robot receives it."""

from program import COMMAND, program
import pytest

pytestmark = [pytest.mark.ros, pytest.mark.distro]

WANTED = [(0.1, 0.0, 1.0), (0.0, 0.5, 2.0), (0.0, -0.5, 2.0)]
ALL_SEVEN = [
    (0.0, 0.0, 1.0), (0.1, 0.0, 1.0), (0.0, 0.0, 1.0), (0.0, 0.5, 2.0), (0.0, 0.0, 1.0),
    (0.0, -0.5, 2.0), (0.0, 0.0, 1.0)]


@pytest.fixture(scope='module')
def lesson(tmp_path_factory):
    """Run the lesson once; return what was received and printed."""
    pytest.importorskip('rclpy', reason='needs ROS 2')
    from listener import Listener
    folder = tmp_path_factory.mktemp('lesson')
    with Listener() as listener, program(COMMAND, folder) as started:
        assert started.end(60.0) == 0, started.text
        return listener, started.text


def test_every_movement_arrives_whole(lesson):
    """
    Not a message of the first movement is lost, and each lasts as long as it should.

    The bound is 3 %, for a busy machine; ``benchmarks/`` looks closer.
    """
    moves = lesson[0].moves()
    assert WANTED == [(m.linear_x, m.angular_z, pytest.approx(m.duration, rel=0.03))
                      for m in moves]
    assert [10, 20, 20] == [m.count for m in moves]


def test_it_takes_nine_seconds(lesson):
    """From the first velocity, 1 s into the lesson, to the end of the last turn at 8 s."""
    received = lesson[0].received
    moving = [index for index, velocity in enumerate(received) if velocity.moves]
    assert received[moving[-1] + 1].time - received[moving[0]].time == pytest.approx(7.0, abs=0.1)
    # The last second of rest is part of it.
    assert received[-1].time - received[moving[-1] + 1].time >= 1.0


def test_it_logs_the_lines_of_the_lesson_in_order(lesson):
    # A warning says that this robot has no odometry.
    lines = [line.rpartition(': ')[2] for line in lesson[1].splitlines() if '[INFO]' in line]
    wanted = ['Robot control node has started']
    for x, z, duration in ALL_SEVEN:
        wanted += ['Robot has stopped', f'Forward={x}, Rotation={z}, Time={duration} seconds']
    assert [*wanted, 'Robot has stopped'] == lines
    assert lesson[1].count('Movement completed: Forward=') == 7


def test_one_zero_ends_a_movement_and_ten_end_the_lesson(lesson):
    received = lesson[0].received
    last = max(index for index, velocity in enumerate(received) if velocity.moves)
    ends = [velocity.time for velocity in received[last + 1:]]
    assert any(ends[k + 9] - ends[k] < 0.2 for k in range(len(ends) - 9))
    assert not any(velocity.moves for velocity in received[last + 1:])


def test_manual_control_is_on_before_the_first_message_and_off_after_the_last(lesson):
    listener = lesson[0]
    assert len(listener.enabled) == 1
    assert len(listener.released) == 1
    assert listener.enabled[0] < listener.received[0].time
    assert listener.received[-1].time < listener.released[0]
