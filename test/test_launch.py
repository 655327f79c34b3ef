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
"""Launch files and the view for RViz: installed, documented, and in agreement with the node."""

from __future__ import annotations

import ast
import importlib.util
from pathlib import Path
import re
import sys
import types

from program import ROOT
import pytest

LAUNCH = sorted(ROOT.glob('launch/*.launch.py'))
RVIZ = ROOT / 'config' / 'kachaka.rviz'
SHARE = 'share/kachaka_simple_control'

needs_source = pytest.mark.skipif(
    not (ROOT / '.ci').is_dir(), reason='the whole source is not here')
each = pytest.mark.parametrize('path', LAUNCH, ids=lambda path: path.name)


def calls(path, name):
    """Return the calls of a function in a file."""
    return [node for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.Call) and getattr(node.func, 'id', '') == name]


def declared(path):
    """Return the arguments that a launch file declares, with their defaults; unread."""
    found = {}
    for call in calls(path, 'DeclareLaunchArgument'):
        given = {keyword.arg: ast.literal_eval(keyword.value) for keyword in call.keywords}
        assert given['description'], path
        found[ast.literal_eval(call.args[0])] = given.get('default_value')
    return found


def documented(path):
    """Return the arguments that the table of a launch file names, with their defaults."""
    text = ROOT.joinpath('docs', 'reference', 'commands.md').read_text()
    section = text.partition(f'#### {path.name}\n')[2].partition('\n#')[0]
    rows = re.findall(r'^\| `(\w+)` \| (.*?) \|', section, re.MULTILINE)
    return {name: None if default == 'must be given' else default.strip('`')
            for name, default in rows}


@needs_source
def test_all_of_them_are_installed_where_ros2_launch_looks():
    (call,) = calls(ROOT / 'setup.py', 'setup')
    text = next(keyword.value for keyword in call.keywords if keyword.arg == 'data_files')
    files = eval(
        compile(ast.Expression(text), 'setup.py', 'eval'),
        {'package_name': 'kachaka_simple_control'})
    installed = {f'{folder}/{Path(name).name}' for folder, names in files for name in names}
    assert all((ROOT / name).is_file() for _, names in files for name in names)
    assert {f'{SHARE}/launch/{path.name}' for path in LAUNCH} <= installed
    assert f'{SHARE}/config/{RVIZ.name}' in installed


@needs_source
@each
def test_the_documentation_has_every_argument_and_its_default(path):
    assert documented(path) == declared(path)


@each
def test_arguments_for_an_included_file_are_declared_there(path):
    """An argument under a name that is not declared there is silently ignored."""
    lesson = declared(ROOT / 'launch' / 'lesson.launch.py')
    used = {ast.literal_eval(call.args[0]) for call in calls(path, 'LaunchConfiguration')
            if isinstance(call.args[0], ast.Constant)}
    assert used <= declared(path).keys()
    given = {ast.literal_eval(key) for call in calls(path, 'IncludeLaunchDescription')
             for node in ast.walk(call) if isinstance(node, ast.Dict) for key in node.keys}
    assert given <= lesson.keys()
    assert bool(given) == (path.name != 'lesson.launch.py')


def test_options_of_the_command_exist():
    from kachaka_simple_control.commands.cli import parse
    text = (ROOT / 'launch' / 'lesson.launch.py').read_text()
    options, switches = (ast.literal_eval(re.search(
        rf'^{name} = (\(.*?\))$', text, re.MULTILINE).group(1)) for name in (
            'OPTIONS', 'SWITCHES'))
    said = vars(parse([*(f'--{name}=1' for name in options),
                       *(f'--{name}' for name in switches)]))
    assert all(str(said[name]) in ('1', '1.0') for name in options)
    assert all(said[name] is True for name in switches)


def loaded(path):
    """Return a launch file as a module."""
    spec = importlib.util.spec_from_file_location(path.name.replace('.', '_'), path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@each
def test_launch_can_load_them(path):
    """As far as it goes without starting anything."""
    pytest.importorskip('launch_ros', reason='needs launch_ros, which PyPI does not have')
    from launch.actions import DeclareLaunchArgument
    entities = loaded(path).generate_launch_description().entities
    assert {entity.name for entity in entities
            if isinstance(entity, DeclareLaunchArgument)} == declared(path).keys()


class Said:
    """In place of LaunchConfiguration: the context is a dictionary of what was said."""

    def __init__(self, name):
        """Be that argument."""
        self.name = name

    def perform(self, context):
        """Return what was said."""
        return context[self.name]


@pytest.fixture
def node(monkeypatch):
    """Return a function that returns what the lesson's launch file starts with arguments."""
    for name in ('launch', 'launch.actions', 'launch.conditions', 'launch.substitutions',
                 'launch_ros', 'launch_ros.actions'):
        stand_in = types.ModuleType(name)
        for what in (
                'DeclareLaunchArgument', 'IfCondition', 'LaunchDescription', 'OpaqueFunction'):
            setattr(stand_in, what, None)
        stand_in.LaunchConfiguration, stand_in.Node = Said, dict
        monkeypatch.setitem(sys.modules, name, stand_in)
    path = ROOT / 'launch' / 'lesson.launch.py'
    module, defaults = loaded(path), declared(path)

    def start(**said):
        return module.start({**defaults, **said})[0]
    start.view = module.VIEW
    return start


@pytest.mark.parametrize('said, words', [
    ({}, []),
    ({'motion': 'square', 'rate': '20', 'wait': 'True'}, ['square', '--rate=20', '--wait']),
    ({'options': "--sim --ros-args -p 'robot:=my robot'", 'quiet': '1'},
     ['--quiet', '--sim', '--ros-args', '-p', 'robot:=my robot']),
    ({'report': '/a b', 'robot': 'generic', 'wait': '0'}, ['--robot=generic', '--report=/a b']),
])
def test_arguments_become_options(node, said, words):
    assert node(**said)['arguments'] == words


def test_the_namespace_of_the_robot_becomes_a_parameter(node):
    assert node()['parameters'] == []
    assert node(robot_namespace='/lab/one')['parameters'] == [{'robot_namespace': '/lab/one'}]


def test_a_switch_that_is_neither_on_nor_off_is_refused(node):
    with pytest.raises(ValueError, match="wait is 'maybe'"):
        node(wait='maybe')


@pytest.fixture(scope='module')
def view():
    """Return what RViz reads."""
    yaml = pytest.importorskip('yaml', reason='needs PyYAML')
    return yaml.safe_load(RVIZ.read_text())


def test_the_view_is_built_as_rviz_builds_its_own(view):
    assert set(view) == {'Panels', 'Visualization Manager', 'Window Geometry'}
    manager = view['Visualization Manager']
    assert manager['Global Options']['Fixed Frame'] == 'odom'
    assert manager['Enabled'] is manager['Value'] is True
    for part in (*manager['Displays'], *manager['Tools'], manager['Views']['Current']):
        assert part['Class'].startswith('rviz_default_plugins/')
    for display in manager['Displays']:
        assert display['Enabled'] is display['Value'] is True
        assert display['Name']
    assert all(panel['Class'].startswith('rviz_common/') for panel in view['Panels'])


@pytest.mark.ros
def test_the_view_shows_topics_that_are_there_with_a_quality_that_fits(view):
    """Held against those of a real node and of a simulated robot."""
    rclpy = pytest.importorskip('rclpy', reason='needs ROS 2')
    pytest.importorskip('nav_msgs', reason='needs nav_msgs')
    from kachaka_simple_control import KachakaSimpleControl
    from rclpy.qos import (
        DurabilityPolicy,
        qos_check_compatible,
        QoSCompatibility,
        QoSProfile,
        ReliabilityPolicy,
    )
    from ros_support import bridge
    from waiting import wait_until
    topics = {
        display['Topic']['Value']: (display['Class'], display['Topic'])
        for display in view['Visualization Manager']['Displays'] if 'Topic' in display}
    assert len(topics) == 4
    rclpy.init(args=[])
    node = KachakaSimpleControl()
    try:
        with bridge():
            assert wait_until(lambda: all(map(node.count_publishers, topics)))
            for topic, (kind, quality) in topics.items():
                (info,) = node.get_publishers_info_by_topic(topic)
                assert info.topic_type.rpartition('/')[2] == kind.rpartition('/')[2]
                wanted = QoSProfile(
                    depth=quality['Depth'],
                    reliability=ReliabilityPolicy[_key(quality['Reliability Policy'])],
                    durability=DurabilityPolicy[_key(quality['Durability Policy'])])
                fits, why = qos_check_compatible(info.qos_profile, wanted)
                assert fits != QoSCompatibility.ERROR, (topic, why)
                # Late, RViz sees a plan only if it asks for what was kept.
                assert wanted.durability == info.qos_profile.durability
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def _key(policy):
    return policy.upper().replace(' ', '_')
