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
"""The lesson on the simulated robot, as ``make run`` runs it."""

import re
import signal
import time

from program import COMMAND, program
import pytest

pytestmark = [pytest.mark.ros, pytest.mark.needs('rclpy', 'nav_msgs')]


def test_it_ends_where_the_lesson_says(tmp_path):
    with program([*COMMAND, '--sim'], tmp_path) as started:
        assert started.end(40.0) == 0, started.text
    pose = re.search(r'x (\S+) m, y (\S+) m, heading (\S+) degrees', started.text)
    x, y, heading = (float(number) for number in pose.groups())
    assert x == pytest.approx(0.1, abs=0.003)
    assert y == pytest.approx(0.0, abs=0.003)
    assert heading == pytest.approx(0.0, abs=1.5)
    row = next(line for line in started.text.splitlines() if line.startswith('0.1 m/s'))
    # Asked, sent and driven; 3 %, for a busy machine.
    distances = [float(number) for number in re.findall(r'(\S+) m ', row)]
    assert distances == pytest.approx([0.1, 0.1, 0.1], rel=0.03)


def test_ctrl_c_ends_the_simulated_robot_too(tmp_path):
    with program([*COMMAND, '--sim'], tmp_path) as started:
        started.wait_for_text('Time=1.0 seconds')
        time.sleep(0.3)
        started.send(signal.SIGINT)
        assert started.end(5.0) == 130
    assert 'Program was interrupted' in started.text
    # It was still running when it was released.
    assert 'manual control disabled' in started.text
    assert 'Final pose by odometry' in started.text
    assert 'Traceback' not in started.text
