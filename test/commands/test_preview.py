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
"""``--plan`` shows a motion with the corners that are chosen for it."""

from __future__ import annotations

from kachaka_simple_control.commands.cli import parse
from kachaka_simple_control.commands.drive_or_preview import main
from kachaka_simple_control.commands.preview import plan_view
from kachaka_simple_control.files.robot_profile import robots
from program import call
import pytest

pytestmark = pytest.mark.needs('jsonschema', 'yaml')

CUT = """\
corners: 5 cm
steps:
  - forward: 0.5 m
  - turn: 90 deg
  - forward: 0.5 m
"""


@pytest.fixture
def cut(tmp_path, monkeypatch):
    """Return the path of a motion with a corner."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'cut.yaml').write_text(CUT)
    return './cut.yaml'


def planned(*words):
    """Return the plan of a command line."""
    options = parse([*words, '--plan'])
    return plan_view(options.motions[0], options).plan


def test_a_file_with_corners_is_planned_with_them(cut):
    plan = planned(cut)
    assert plan.saved_time > 1.0
    assert 0.0 < plan.steps[1].cut.deviation <= 0.05 * (1.0 + 1e-6)
    assert plan.pose.x == pytest.approx(0.5, abs=1e-9)


def test_an_option_gives_any_motion_corners():
    stops, cut = planned('square'), planned('square', '--corners', '5cm')
    assert cut.saved_time == pytest.approx(stops.duration - cut.duration)
    assert cut.saved_time > 5.0
    assert planned('square', '--corners', '0').segments == stops.segments


def test_what_wins_is_told_and_planned(cut, capsys):
    code, output, errors = call(main, [cut, '--plan', '--corners', '2cm'], capsys)
    assert code == 0
    assert errors == 'corners is 0.02 m by --corners, not 0.05 m as in ./cut.yaml\n'
    assert 'forward 0.5 m' in output


def test_bad_corners_of_a_file_are_refused_with_their_line(tmp_path, capsys):
    file = tmp_path / 'bad.yaml'
    file.write_text(CUT.replace('5 cm', '-5 cm'))
    code, output, errors = call(main, [str(file), '--plan'], capsys)
    assert (code, output) == (2, '')
    assert errors.endswith(f"{file}:1: corners: '-5 cm'; it must not be negative\n")


def test_the_list_names_each_robot_with_its_limits(capsys):
    assert main(['--list']) == 0
    text = capsys.readouterr().out
    assert all(f'\n{name} ' in text for name in robots())
    assert '0.306 m/s, 1.9 rad/s\n' in text
    assert '0.3 m/s, 1.57 rad/s, a laser\n' in text


def test_a_plan_has_the_values_of_parameters_in_it_and_in_its_title(capsys):
    plan = planned('square', '--with', 'side=57cm', '--with', 'laps=2')
    assert [step.step.distance for step in plan.steps[::2]] == 8 * [0.57]
    code, output, _ = call(main, ['square', 'square_cw', '--plan', '--with', 'side=1 m'], capsys)
    assert code == 0
    assert 'square (side 1 m) on kachaka' in output
    assert 'square_cw (side 1 m) on kachaka' in output
    assert output.count('forward 1 m') == 8


def test_a_value_that_a_motion_cannot_have_is_refused_with_its_line(tmp_path, capsys):
    (tmp_path / 'mine.yaml').write_text(
        'parameters: {side: {max: 4 m}, laps: 2}\nsteps: [forward: $side]')
    mine = f'{tmp_path}/mine.yaml'
    for words, lines in (
            ([], [f'{mine}:1: parameters.side: it must be given: a length, at most 4 m']),
            (['side=5m'], [f'{mine}:1: parameters.side: 5m is above its largest, 4 m']),
            (['sid=1m', 'side=5m', 'lap=1'], [
                f"{mine}: there is no parameter 'sid'; did you mean 'side'?",
                f"{mine}: there is no parameter 'lap'; did you mean 'laps'?",
                f'{mine}:1: parameters.side: 5m is above its largest, 4 m'])):
        code, output, errors = call(
            main, [mine, '--plan', *(f'--with={word}' for word in words)], capsys)
        assert (code, output, errors.splitlines()) == (2, '', lines)
    code, _, errors = call(main, ['square', 'lesson', '--plan', '--with', 'side=1m'], capsys)
    assert (code, errors) == (2, 'kachaka_simple_control: lesson: the lesson has no parameters\n')


def test_the_list_has_the_parameters_below_each_motion_in_99_columns(capsys):
    assert main(['--list', '--plan', 'square', '--with', 'side=1m']) == 0
    listed, _, planned_text = capsys.readouterr().out.partition('Robots, for --robot:')
    lines = listed.splitlines()
    assert max(map(len, lines)) <= 99
    place = next(place for place, line in enumerate(lines) if line.startswith('square '))
    assert lines[place].split()[1:3] == ['17.6', 's'], 'the value is for the plan alone'
    assert 'side 0.5 m (20 cm to 4 m): of the square' in lines[place + 1]
    assert '\nsquare (side 1m) on kachaka' in planned_text


def test_a_plan_with_a_watch_says_so_once_and_refuses_what_is_not_seen(cut, tmp_path, capsys):
    said = 'Watched: the laser sees 270 deg around ahead; holds before what is nearer than 5 cm to'
    for words in ([cut, '--watch'], [cut, 'square', '--ros-args', '-p', 'watch:=true']):
        assert call(main, ['--plan', *words], capsys)[1].count(said) == 1
    assert said not in call(main, ['--plan', cut], capsys)[1]
    (tmp_path / 'back.yaml').write_text('steps:\n  - turn: 90 deg\n  - forward: -0.5 m\n')
    code, output, errors = call(main, ['./back.yaml', '--plan', '--watch'], capsys)
    assert (code, output) == (2, '')
    assert errors.startswith('./back.yaml:3: step 2: forward: driven backwards, where the laser')


@pytest.mark.needs('matplotlib')
def test_a_plot_shows_a_floor_without_a_simulation(tmp_path, capsys):
    plots = [tmp_path / 'empty.svg', tmp_path / 'floor.svg']
    assert main(['straight', '--plot', str(plots[0])]) == 0
    assert main(['straight', '--plot', str(plots[1]), '--floor', 'crossing']) == 0
    assert ['id="wall"' in plot.read_text() for plot in plots] == [False, True]
    (tmp_path / 'bad.yaml').write_text('walls: [[[0 m, 0 m]]]\n')
    code, _, errors = call(
        main, ['straight', '--plot', str(plots[0]), '--floor', str(tmp_path / 'bad.yaml')], capsys)
    assert code == 2
    assert 'bad.yaml:1: ' in errors
    code, _, errors = call(main, ['straight', '--plan', '--floor', 'crossing'], capsys)
    assert code == 2
    assert '--floor is about the simulated robot of --sim' in errors
