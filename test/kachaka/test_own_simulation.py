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
"""A script that starts a simulated robot."""

from __future__ import annotations

import re
import signal
import subprocess
import sys

from kachaka_simple_control.ros import dds_transport
import pytest
from ros_support import free_environment

pytestmark = pytest.mark.ros

BEGIN = """
import rclpy
from kachaka_simple_control import KachakaSimpleControl
"""
DRIVE = """
robot = KachakaSimpleControl(sim=True)
robot.move_robot(0.1, 0.0, 1.0)
"""


def run(code, tmp_path, **chosen):
    """Return exit code, standard output and standard error of a script."""
    pytest.importorskip('rclpy', reason='needs ROS 2')
    script = tmp_path / 'script.py'
    script.write_text(BEGIN + code)
    done = subprocess.run(
        [sys.executable, str(script)], env=free_environment(**chosen), timeout=60,
        capture_output=True, text=True, check=False)
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize('end', ['', 'robot.destroy_node()', 'rclpy.shutdown()'])
def test_one_script_drives_and_prints_the_table(end, tmp_path):
    pytest.importorskip('nav_msgs', reason='needs odometry')
    code, out, err = run(DRIVE + end, tmp_path)
    assert code == 0, err
    assert 'Movement completed: Forward=0.1' in err
    assert out.count('0.1 m/s, 0 rad/s for 1 s') == 1
    distance = re.search(r'x (\S+) m, y', out)[1]
    assert float(distance) == pytest.approx(0.1, abs=0.02)
    # The robot went with the script.
    assert 'Traceback' not in err


@pytest.mark.parametrize('before, chosen', [
    ('rclpy.init(); other = rclpy.create_node("other")\n', {}),
    ('rclpy.init()\n', {dds_transport.TRANSPORTS: 'UDPv4'}),
])
def test_too_late_is_refused_before_a_robot_is_started(before, chosen, tmp_path):
    code, out, err = run(before + DRIVE, tmp_path, **chosen)
    assert code == 2
    (line,) = err.splitlines()
    assert 'sim=True comes too late to keep the simulated robot on this machine' in line
    assert out == ''


def test_it_has_the_floor_that_the_script_names(tmp_path):
    """A wall that is touched after 6 cm."""
    (tmp_path / 'floor.yaml').write_text('walls: [[[0.3 m, -1 m], [0.3 m, 1 m]]]')
    code, _, err = run(
        f'from pathlib import Path\nimport os\nos.chdir({str(tmp_path)!r})\n'
        'robot = KachakaSimpleControl(sim=True, floor=Path("floor.yaml"))\n'
        'robot.move_robot(0.1, 0.0, 1.0)\n', tmp_path)
    assert code == 0, err
    assert 'contact with a wall at x 0.06' in err


@pytest.mark.parametrize('words, text', [
    ('sim=True, floor="./gone.yaml"', './gone.yaml: there is no such file'),
    ('floor="crossing"', 'floor= is about simulated robots: it needs sim=True')])
def test_a_floor_that_cannot_be_used_is_one_line(words, text, tmp_path):
    code, _, err = run(f'KachakaSimpleControl({words})', tmp_path)
    assert code == 2
    (line,) = err.splitlines()
    assert text in line


def test_it_brings_a_kachaka_along(tmp_path):
    code, out, err = run(
        'KachakaSimpleControl({"robot": "turtlebot3"}, sim=True).move_robot(0.1, 0.0, 1.0)',
        tmp_path)
    assert code == 2
    assert err.rstrip().endswith('sim=True starts a simulated kachaka, not a turtlebot3')
    assert out == ''


def test_an_earlier_node_of_the_program_has_the_robot_until_it_is_destroyed(tmp_path):
    code, _, err = run(
        'robot = KachakaSimpleControl(sim=True)\nKachakaSimpleControl(sim=True)', tmp_path)
    assert code == 2
    assert ('an earlier node of this program has the simulated robot /kachaka: call its '
            'destroy_node() first, or choose another robot_namespace\n') in err


def test_a_node_that_could_not_be_made_leaves_no_thread_and_no_guardian(tmp_path):
    """A thread in DDS could abort Python at its end."""
    code, out, err = run("""
import threading
for _ in range(2):
    try:
        KachakaSimpleControl({"robot": "turtlebot3"}, sim=True)
    except Exception as error:
        print(type(error).__name__)
print({thread.name for thread in threading.enumerate()} & {'odometry', 'executor', 'guardian'})
""", tmp_path)
    assert code == 0, err
    assert out == 'UsageError\nUsageError\nset()\n'


def test_ctrl_c_stops_and_prints_the_table(tmp_path):
    script = tmp_path / 'script.py'
    pytest.importorskip('rclpy', reason='needs ROS 2')
    script.write_text(f'{BEGIN}{DRIVE}robot.move_robot(0.1, 0.0, 30.0)')
    with subprocess.Popen(
            [sys.executable, str(script)], env=free_environment(), stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True) as started:
        for line in started.stderr:
            if 'Movement completed' in line:
                break
        started.send_signal(signal.SIGINT)
        out, err = started.communicate(timeout=30)
    assert started.returncode in (130, -signal.SIGINT)
    assert 'Traceback' not in err
    assert out.count('Final pose by odometry: ') == 1
