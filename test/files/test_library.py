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
"""The motions that come with the package, and how they are found."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
import math
from pathlib import Path

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files import library as library_module
from kachaka_simple_control.files.document import MotionFileError
from kachaka_simple_control.files.library import find, library
from kachaka_simple_control.files.motion_reader import loads
from kachaka_simple_control.files.motion_writer import dump
from kachaka_simple_control.files.robot_profile import find_robot, KACHAKA
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.motion.geometry import relative_to
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Move
import pytest
from simulated_drive import SimulatedDrive

pytestmark = pytest.mark.needs('yaml', 'jsonschema')

#: How far ahead and to the left each ends, and how far it has turned [m, deg].
ENDS = {
    'calibration': (0, 0, 0), 'circle': (0, 0, 360), 'figure_eight': (0, 0, 0),
    'floor_straight': (1, 0, 0), 'floor_turn': (0, 0, 360), 'flowing_eight': (0, 0, 0),
    'lawn_mower': (0, 0, 0), 'lesson': (0.1, 0, 0), 'patrol': (0, 0, 4 * 360),
    'spin': (0, 0, 360), 'square': (0, 0, 360), 'square_cw': (0, 0, -360),
    'straight': (1, 0, 0), 'umbmark_ccw': (0, 0, 360), 'umbmark_cw': (0, 0, -360)}


@pytest.mark.parametrize('name', library())
def test_each_ends_where_its_name_says(name):
    x, y, degrees = ENDS[name]
    pose = plan(find(name).motion, KACHAKA.limits, 10.0).pose
    assert (pose.x, pose.y, pose.theta) == pytest.approx((x, y, math.radians(degrees)), abs=1e-9)


@pytest.mark.parametrize('name', sorted(ENDS))
def test_each_has_its_name_and_a_description(name):
    file = find(name)
    assert file.motion.name == name
    assert file.motion.description.endswith('.')
    assert (file.robot, dict(file.limits)) == (None, {})
    assert loads(dump(file.motion)).motion == file.motion


def at_bounds(name: str) -> Iterator[dict[str, str]]:
    """Yield the smallest or largest values of a motion's parameters, each with each other."""
    parameters = find(name).parameters.values()
    bounds = [(one.smallest, one.largest) for one in parameters]
    for values in product(*bounds):
        yield {one.name: value.text for one, value in zip(parameters, values)}


@pytest.mark.slow
@pytest.mark.parametrize('name', sorted(ENDS))
def test_each_is_planned_and_driven_at_the_bounds_of_its_parameters(name):
    cases = [*at_bounds(name)]
    for values in cases:
        if name == 'lawn_mower' and (values['width'], values['spacing']) == ('20 cm', '1 m'):
            with pytest.raises(MotionFileError, match=(
                    r'repeat.times: .* is 0.1 with width 0.2 m, spacing 1 m; .* whole number')):
                find(name, **values)
            continue
        file = find(name, **values)
        planned = plan(file.motion, file.check(KACHAKA.limits, 'kachaka'), 10.0)
        if values not in (cases[0], cases[-1]):
            continue
        drive = SimulatedDrive(
            lateness=lambda _: 0.0, parameters=SimulationParameters(), odometry_period=1.0)
        drive.drive(file.motion)
        odometry = drive.close(rest=2.0).odometry
        end = relative_to(odometry[0].pose, odometry[-1].pose)
        assert (end.x, end.y) == pytest.approx((planned.pose.x, planned.pose.y), abs=0.02)
        assert math.remainder(end.theta - planned.pose.theta, math.tau) == pytest.approx(
            0.0, abs=math.radians(2.0))


def test_the_lesson_has_the_steps_that_the_node_drives():
    pytest.importorskip('rclpy', reason='needs ROS 2')
    from kachaka_simple_control.kachaka_simple_control import play_lesson

    class Notes:
        steps: tuple[Move, ...] = ()

        def move_robot(self, *values: float) -> None:
            self.steps += (Move(*values),)

    notes = Notes()
    play_lesson(notes)
    assert len(notes.steps) == 7
    assert find('lesson').motion.steps == notes.steps


def test_edits_of_the_lesson_are_read(tmp_path, monkeypatch):
    edited = library_module.LESSON_FILE.read_text().replace(
        'robot_control.move_robot(0.1, 0.0, 1.0)',
        'for _ in range(3):\n        robot_control.move_robot(0.2, 0.0, 1.5)')
    file = tmp_path / 'kachaka_simple_control.py'
    file.write_text(edited)
    monkeypatch.setattr(library_module, 'LESSON_FILE', file)
    steps = find('lesson').motion.steps
    assert len(steps) == 9
    assert steps[1:4] == (Move(0.2, 0.0, 1.5),) * 3


def test_the_line_of_an_edited_lesson_that_no_robot_can_drive_is_named(tmp_path, monkeypatch):
    edited = tmp_path / 'edited.py'
    edited.write_text(
        'def play_lesson(robot):\n    robot.move_robot(0.1, 0.0, 1.0)\n\n'
        '    for speed in (0.1, 0.5):\n        robot.move_robot(speed, 0.0, 1.0)\n')
    monkeypatch.setattr(library_module, 'LESSON_FILE', edited)
    with pytest.raises(MotionFileError) as caught:
        find('lesson').check(find_robot('kachaka').limits)
    assert str(caught.value).startswith(f'{edited}:5: step 3: move.linear_x: 0.5 m/s, outside ')


def test_a_lesson_without_an_end_is_refused(tmp_path, monkeypatch):
    edited = tmp_path / 'edited.py'
    edited.write_text(
        'def play_lesson(robot):\n    while True:\n        robot.move_robot(0.1, 0.0, 1.0)\n')
    monkeypatch.setattr(library_module, 'LESSON_FILE', edited)
    with pytest.raises(InvalidMotionError, match='play_lesson has more than 10000 movements'):
        find('lesson')


def test_a_path_names_a_file_and_a_name_a_library_motion(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for path in ('square', 'square.yaml'):
        Path(path).write_text('name: mine\nsteps: []')
    assert find('square').motion.name == 'square'
    for path in ('./square', 'square.yaml', './square.yaml', str(tmp_path / 'square.yaml'),
                 Path('square')):
        assert find(path).motion.name == 'mine'
        assert find(path).source == str(path)


@pytest.mark.parametrize('robot, seen_from_here', [
    ('generic', 'generic'), ('./truck.yaml', 'motions/truck.yaml'),
    ('../robots/truck.yaml', 'motions/../robots/truck.yaml'), ('/etc/truck.yaml', None)])
def test_the_profile_that_a_file_names_is_seen_from_the_file(
        robot, seen_from_here, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path('motions').mkdir()
    Path('motions/patrol.yaml').write_text(f'robot: {robot}\nsteps: []')
    assert find('motions/patrol.yaml').robot == (seen_from_here or robot)
    assert loads('robot: ./truck\nsteps: []').robot == './truck'


@pytest.mark.parametrize('name, words', [
    ('squar', "squar: there is no motion of this name; did you mean 'square'?  Known are calibr"),
    ('dance', 'dance: there is no motion of this name; known are calibration, circle, '),
    ('', "'': there is no motion of this name; known are "),
    ('motion', 'motion: there is no motion of this name'),
    ('squar.yaml', 'squar.yaml: there is no such file'),
    ('motions/square', 'motions/square: there is no such file'),
    ('../motions/square', '../motions/square: there is no such file'),
])
def test_an_unknown_motion_is_refused_in_one_line(name, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(MotionFileError) as caught:
        find(name)
    assert str(caught.value).startswith(words)
    assert '\n' not in str(caught.value)
