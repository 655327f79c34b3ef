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
"""What the package needs, and what it does not."""

import ast
import subprocess
import sys

from program import environment, program, ROOT, without
import pytest

ROS = ('rclpy', 'geometry_msgs', 'std_srvs', 'nav_msgs', 'rcl_interfaces')
#: What a person may have installed, and rclpy does without (it uses yaml and numpy itself).
OTHERS = (
    'nav_msgs', 'diagnostic_msgs', 'sensor_msgs', 'jsonschema', 'jinja2', 'rich', 'matplotlib',
    'scipy', 'mcap', 'kachaka_api', 'grpc', 'hypothesis', 'ruckig', 'rosbags', 'pytest')


def test_importing_the_package_and_planning_need_no_ros():
    command = without(ROS, """
import kachaka_simple_control as ksc
# Nothing before it is asked for: until a command's code runs, Ctrl+C prints a traceback.
assert not [name for name in sys.modules if name.startswith('kachaka_simple_control.')]
plan = ksc.plan(ksc.Motion('one', (ksc.Move(0.1, 0.0, 1.0),)), ksc.Limits(0.3, 1.57), 10.0)
assert abs(plan.path()[-1].x - 0.1) < 1e-12
assert 'rclpy' not in sys.modules
""")
    subprocess.run(command, check=True, env=environment())


def test_every_public_name_is_there():
    pytest.importorskip('rclpy', reason='needs ROS 2')
    import kachaka_simple_control
    for name in kachaka_simple_control.__all__:
        assert getattr(kachaka_simple_control, name) is not None
    # Public names alone: no module, and nothing that a module imports.
    assert dir(kachaka_simple_control) == sorted([*kachaka_simple_control.__all__, '__version__'])
    with pytest.raises(AttributeError, match='nonsense'):
        kachaka_simple_control.nonsense


def test_without_ros_the_command_says_what_is_missing():
    command = without(ROS, """
from kachaka_simple_control.commands.drive_or_preview import main
sys.exit(main([]))
""")
    ended = subprocess.run(
        command, check=False, env=environment(), capture_output=True, text=True)
    assert ended.returncode == 2
    (line,) = ended.stderr.splitlines()
    assert 'needs ROS 2' in line
    assert 'source' in line


@pytest.mark.needs('yaml', 'jsonschema')
@pytest.mark.parametrize('arguments', [
    ['--list'], ['square', '--plan', '--ros-args', '-p', 'rate:=20']])
def test_previews_need_no_ros(arguments):
    command = without(ROS, f"""
from kachaka_simple_control.commands.drive_or_preview import main
sys.exit(main({arguments!r}))
""")
    ended = subprocess.run(
        command, check=False, env=environment(), capture_output=True, text=True)
    assert (ended.returncode, ended.stderr) == (0, '')
    assert 'square' in ended.stdout


@pytest.mark.ros
def test_a_robot_is_moved_with_every_other_dependency_blocked(listener, tmp_path):
    command = without(OTHERS, """
import rclpy
from kachaka_simple_control import KachakaSimpleControl
rclpy.init()
node = KachakaSimpleControl()
node.move_robot(0.1, 0.0, 0.5)
node.move_robot(0.0, 0.5, 0.5)
node.stop_robot()
""")
    with program(command, tmp_path) as started:
        assert started.end() == 0, started.text
    assert len(listener.moves()) == 2


def test_the_pure_core_imports_only_the_standard_library():
    for file in (ROOT / 'kachaka_simple_control' / 'motion').glob('*.py'):
        for node in ast.walk(ast.parse(file.read_text())):
            names = [node.module or ''] if isinstance(node, ast.ImportFrom) else [
                alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            for name in names:
                own = name.startswith((
                    'kachaka_simple_control.motion', 'kachaka_simple_control.errors',
                    'kachaka_simple_control.text'))
                assert own or name.partition('.')[0] in sys.stdlib_module_names, (file, name)
