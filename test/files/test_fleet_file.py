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
"""Fleets as files: what is read, and what is refused, with file and line."""

from __future__ import annotations

from dataclasses import fields
import math

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.files.document import read_schema
from kachaka_simple_control.files.fleet_file import (
    DEFAULT_MARGIN,
    find_fleet,
    FleetFileError,
    fleets,
    MAX_ROBOTS,
    read_fleet,
    SCHEMA,
)
from kachaka_simple_control.files.motion_schema import AMOUNT
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.fleet.fleet_plan import plan_fleet
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.motion.geometry import Pose
from kachaka_simple_control.text import location
import pytest

pytestmark = pytest.mark.needs('yaml', 'jsonschema')

#: The files beside each fleet file.
BESIDE = {
    'mirror.yaml': 'rate: 25 Hz\nsteps:\n  - forward: 0.5 m\n  - turn: -90 deg\n',
    'fast.yaml': 'steps:\n  - forward: {distance: 1 m, speed: 0.2 m/s}\n'
                 '  - forward: {distance: 1 m, speed: 5 m/s}\n  - turn: {angle: 1 rad, '
                 'speed: 9 rad/s}\n',
    'broken.yaml': 'steps:\n  - forwards: 1 m\n  - turn: 90\n',
    'closed.yaml': 'closed_loop: true\nsteps:\n  - forward: 0.5 m\n',
    'slow_rate.yaml': 'rate: 1 Hz\nsteps:\n  - forward: 0.5 m\n',
    'long.yaml': 'steps:\n  - wait: 10 s\n  - wait: 100000 s\n',
    'gone_robot.yaml': 'robot: ./gone.yaml\nsteps: []\n',
    'fast_limits.yaml': 'limits: {max_linear_velocity: 2 m/s}\nsteps:\n  - forward: 1 m\n',
    'side.yaml': 'parameters:\n  side: {default: 0.5 m, max: 4 m}\n  laps:\n'
                 'steps:\n  - repeat: {times: $laps, steps: [forward: $side]}\n',
    'bad_side.yaml': 'parameters:\n  side: {default: 0.5 parsec, max: 4 m}\nsteps: []\n',
    'robot2.yaml': 'extends: kachaka\nlimits: {max_linear_velocity: 0.2, '
                   'max_angular_velocity: 1}\ncalibration: {delay: 0.2 s}\n',
    'bad_robot.yaml': 'extends: kachaka\nlimits: {max_linear_velocity: fast, '
                      'max_angular_velocity: 1}\n',
}

#: Wrong fleets: for each problem its line, None for an empty file, and words of it.
BROKEN: dict[str, tuple[str, list[tuple[int | None, str]]]] = {
    'empty': ('', [(None, 'the file is empty')]),
    'a list': ('- r1\n- r2\n', [(1, 'it must be a fleet')]),
    'no robots': ('name: none\n', [(1, "'robots' is missing: robots by name")]),
    'empty robots': ('robots: {}\n', [(1, 'nothing; it must be robots by name')]),
    'robots that are a list': ('robots:\n  - r1\n', [(1, 'robots: a list; it must be robots')]),
    'a robot of nothing': ('robots:\n  r1:\n', [(2, 'robots.r1: nothing; it must be a robot')]),
    'a robot that is a text': ('robots:\n  r1: square\n', [(2, "'square'; it must be a robot")]),
    'no motion': ('robots:\n  r1: {start: {x: 1 m}}\n', [(2, "'motion' is missing: the name")]),
    'an unknown key': ('robots:\n  r1: {motion: square}\nrepeats: 2\n',
                       [(3, "repeats: there is no such key; did you mean 'repeat'?")]),
    'an unknown key of a robot': ('robots:\n  r1: {motion: square, strat: {x: 1 m}}\n',
                                  [(2, 'robots.r1.strat: there is no such key; did you mean ')]),
    'an unknown motion': (
        'robots:\n  r1: {motion: sqare}\n',
        [(2, "motion: sqare: there is no motion of this name; did you mean 'square'?")]),
    'a motion that is gone': ('robots:\n  r1: {motion: ./gone.yaml}\n',
                              [(2, 'gone.yaml: there is no such file')]),
    'a motion that is a number': ('robots:\n  r1: {motion: 1}\n',
                                  [(2, '1; it must be the name of a motion')]),
    'a motion with errors': ('robots:\n  r1: {motion: ./broken.yaml}\n',
                             [(2, 'broken.yaml:2: step 1: forwards: there is no such step'),
                              (2, 'broken.yaml:3: step 2: turn: 90 has no unit')]),
    'a motion too fast': ('robots:\n  r1:\n    motion: ./fast.yaml\n',
                          [(3, 'fast.yaml:3: step 2: forward.speed: 5.0 m/s is above'),
                           (3, 'fast.yaml:4: step 3: turn.speed: 9.0 rad/s is above')]),
    'a motion too long': ('robots:\n  r1: {motion: ./long.yaml}\n',
                          [(2, 'long.yaml:3: step 2: wait.duration: 100000.0 s is too long')]),
    'limits above those of the robot': (
        'robots:\n  r1: {motion: ./fast_limits.yaml}\n',
        [(2, 'fast_limits.yaml:1: limits.max_linear_velocity: 2.0 m/s is above')]),
    'an unknown robot': ('robots:\n  r1: {motion: square, robot: kachakka}\n',
                         [(2, 'robots.r1.robot: kachakka: there is no robot of this name')]),
    'a profile that is gone': ('robots:\n  r1:\n    motion: square\n    robot: ./gone.yaml\n',
                               [(4, 'gone.yaml: there is no such file')]),
    'a profile with an error': (
        'robots:\n  r1:\n    motion: square\n    robot: ./bad_robot.yaml\n',
        [(4, 'bad_robot.yaml:2: limits.max_linear_velocity')]),
    'a robot of a motion that is gone': ('robots:\n  r1: {motion: ./gone_robot.yaml}\n',
                                         [(2, 'robots.r1.motion: '), ]),
    'a value above its largest': (
        'robots:\n  r1:\n    motion: ./side.yaml\n    with:\n      laps: 2\n      side: 5 m\n',
        [(6, 'robots.r1.with.side: 5 m is above its largest, 4 m (')]),
    'a value without its unit': (
        'robots:\n  r1: {motion: ./side.yaml, with: {side: 1, laps: 2}}\n',
        [(2, 'robots.r1.with.side: 1 has no unit; a length needs one: write 1 cm or 1 m (')]),
    'a value that is computed': (
        'robots:\n  r1: {motion: ./side.yaml, with: {side: 2 * 1 m, laps: 2}}\n',
        [(2, "robots.r1.with.side: '2 * 1 m'; it must be a number, or a number with a unit")]),
    'a value that cannot be a count': (
        'robots:\n  r1: {motion: ./side.yaml, with: {laps: 1.5}}\n',
        [(2, 'robots.r1.motion: ')]),
    'a parameter that a motion does not have, and one that is missing': (
        'robots:\n  r1:\n    motion: ./side.yaml\n    with:\n      sid: 1 m\n',
        [(4, "robots.r1.with: 'laps' is missing: it must be given: a value ("),
         (5, "robots.r1.with.sid: there is no parameter 'sid'; did you mean 'side'?")]),
    'a missing value where none is given': (
        'robots:\n  r1:\n    motion: ./side.yaml\n',
        [(2, "robots.r1.with: 'laps' is missing: it must be given: a value (")]),
    'a value of a motion with errors': (
        'robots:\n  r1: {motion: ./bad_side.yaml, with: {side: 1 deg}}\n',
        [(2, 'with.side: 1 deg is an angle; it must be a length'),
         (2, "bad_side.yaml:2: parameters.side.default: '0.5 parsec'; it must be")]),
    'a value of the lesson': ('robots:\n  r1: {motion: lesson, with: {side: 1 m}}\n',
                              [(2, 'robots.r1.motion: lesson: the lesson has no parameters')]),
    'a value for a motion that is gone': (
        'robots:\n  r1: {motion: ./gone.yaml, with: {side: 1 m}}\n', [(2, 'no such file')]),
    'values that are none': ('robots:\n  r1: {motion: square, with: 1 m}\n',
                             [(2, "with: '1 m'; it must be values by name, as in {side: 1 m}")]),
    'a name with a hyphen': ('robots:\n  r-1: {motion: square}\n', [(2, 'no ROS namespace')]),
    'a name with a digit first': ('robots:\n  1: {motion: square}\n', [(2, 'no ROS namespace')]),
    'a name with two underscores': ('robots:\n  r__1: {motion: square}\n',
                                    [(2, 'no ROS namespace')]),
    'a name with a slash': ('robots:\n  lab/r1: {motion: square}\n', [(2, 'no ROS namespace')]),
    'a name twice': ('robots:\n  r1: {motion: square}\n  r1: {motion: spin}\n',
                     [(3, 'this key is here twice, first in line 2')]),
    'a start without a unit': ('robots:\n  r1:\n    motion: square\n    start: {x: 1}\n',
                               [(4, 'robots.r1.start.x: 1 has no unit; a length needs one')]),
    'a heading without a unit': (('robots:\n  r1:\n    motion: square\n    start:\n'
                                 '      heading: 90\n'),
                                 [(5, 'heading: 90 has no unit; an angle needs one')]),
    'a start that is a list': ('robots:\n  r1: {motion: square, start: [1 m, 2 m]}\n',
                               [(2, 'a list; it must be a pose')]),
    'a start with an unknown key': ('robots:\n  r1: {motion: square, start: {z: 1 m}}\n',
                                    [(2, 'robots.r1.start.z: there is no such key')]),
    'a length that is an angle': ('robots:\n  r1: {motion: square, start: {y: 90 deg}}\n',
                                  [(2, "'90 deg'; it must be a length")]),
    'a rate too high': ('robots:\n  r1: {motion: square, rate: 2000}\n', [(2, 'at most 1000')]),
    'a rate too low for the robot': ('robots:\n  r1:\n    motion: square\n    rate: 2 Hz\n',
                                     [(4, 'robots.r1.rate: 2 Hz; for kachaka it must be from')]),
    'a rate of the motion that is too low': (
        'robots:\n  r1: {motion: ./slow_rate.yaml}\n',
        [(2, 'slow_rate.yaml:1: rate: 1 Hz; for kachaka it must be from')]),
    'a rate of zero': ('robots:\n  r1: {motion: square, rate: 0 Hz}\n', [(2, 'above 0 Hz')]),
    'a repeat of zero': ('robots:\n  r1: {motion: square}\nrepeat: 0\n',
                         [(3, 'repeat: 0; it must be at least 1')]),
    'a repeat and a half': ('robots:\n  r1: {motion: square}\nrepeat: 1.5\n',
                            [(3, 'repeat: 1.5; it must be a whole number')]),
    'a wrong fault': ('robots:\n  r1: {motion: square}\non_fault: stop\n',
                      [(3, "'stop'; it must be stop_all or go_on")]),
    'a margin without a unit': ('robots:\n  r1: {motion: square}\nmargin: 10\n',
                                [(3, 'margin: 10 has no unit')]),
    'a negative margin': ('robots:\n  r1: {motion: square}\nmargin: -1 cm\n',
                          [(3, 'it must not be negative')]),
    'a margin too large': ('robots:\n  r1: {motion: square}\nmargin: 2 m\n',
                           [(3, "'2 m'; it must be at most 1 m")]),
    'an unknown error of the simulation': (
        'robots:\n  r1: {motion: square, simulation: {leg: 0.1 s}}\n',
        [(2, "robots.r1.simulation.leg: there is no such key; did you mean 'lag'?")]),
    'a simulation out of range': (
        'robots:\n  r1: {motion: square, simulation: {undock_velocity: -1 m/s}}\n',
        [(2, 'robots.r1.simulation.undock_velocity: -1.0 m/s; it must be above 0')]),
    'another simulation out of range': (
        'robots:\n  r1:\n    motion: square\n    simulation: {wheel_ratio: 9}\n',
        [(4, 'robots.r1.simulation.wheel_ratio: ')]),
    'noise of the heading that is negative': (
        'robots:\n  r1: {motion: square, simulation: {heading_noise: -3 deg}}\n',
        [(2, 'simulation.heading_noise: -0.05')]),
    'a gain that is a text': ('robots:\n  r1: {motion: square, simulation: {linear_gain: 95 %}}\n',
                              [(2, "'95 %'; it must be a number")]),
    'a closed loop without a delay': (
        'robots:\n  r1: {motion: ./closed.yaml}\n',
        [(2, 'closed.yaml:1: closed_loop: a closed loop needs to know the delay')]),
    'too many robots': (
        'robots:\n' + ''.join(f'  r{number}: {{motion: spin}}\n' for number in range(256)),
        [(1, '256 robots; a fleet has from 1 to 255')]),
    'no YAML': ('robots: {r1: {motion: square}\n', [(2, '')]),
    'several at once': (
        'name: 1\nrobots:\n  a: {motion: sqare}\n  b: {motion: spin, start: 1}\nmargin: 3 m\n',
        [(1, 'name: 1; it must be a text'), (3, 'no motion of this name'), (4, 'start'),
         (5, 'at most 1 m')]),
}


@pytest.fixture
def fleet(tmp_path):
    """Return a function that reads and plans a fleet from a text, with files beside it."""
    for name, text in BESIDE.items():
        (tmp_path / name).write_text(text)

    def read(text):
        file = tmp_path / 'fleet.yaml'
        file.write_text(text)
        found = find_fleet(file)
        plan_fleet(found)
        return found

    return read


@pytest.mark.parametrize('text, problems', BROKEN.values(), ids=BROKEN)
def test_a_broken_fleet_has_a_line_with_file_and_line_for_each_problem(
        fleet, tmp_path, text, problems):
    with pytest.raises(FleetFileError) as refusal:
        fleet(text)
    lines = str(refusal.value).split('\n')
    assert len(lines) == len(problems), lines
    for line, (number, words) in zip(lines, problems):
        assert line.startswith(location(f'{tmp_path}/fleet.yaml', number) + ': '), line
        assert words in line, line
        assert line.isprintable()


def test_more_than_forty_ways_to_break_a_fleet_are_tried():
    assert len(BROKEN) >= 40


def test_what_is_left_out_has_a_default(fleet, tmp_path):
    found = fleet('robots:\n  r1: {motion: square}\n')
    assert (found.name, found.description, found.repeat, found.goes_on, found.margin) == (
        'fleet', '', 1, False, DEFAULT_MARGIN)
    [robot] = found.robots
    assert (robot.name, robot.robot, robot.profile, robot.start, robot.rate, robot.simulation) == (
        'r1', 'kachaka', KACHAKA, Pose(), None, {})
    assert robot.motion_file.motion.name == 'square'
    assert found.where('robots.r1') == f'{tmp_path}/fleet.yaml:2'


def test_everything_is_read_in_si_units(fleet):
    found = fleet(
        'name: minuet\ndescription: A dance.\nrepeat: 3\non_fault: go_on\nmargin: 25 cm\n'
        'robots:\n'
        '  a: {motion: ./mirror.yaml, robot: ./robot2.yaml,\n'
        '      start: {x: -50 cm, y: 1.5 m, heading: 180 deg}, rate: 20 Hz,\n'
        '      simulation: {dead_time: 200 ms, veer: 2 deg/m, linear_gain: 0.95,\n'
        '                   odometry_noise: 5 mm, heading_noise: 1 deg}}\n'
        '  b: {motion: ./mirror.yaml}\n')
    assert (found.name, found.description, found.repeat, found.goes_on, found.margin) == (
        'minuet', 'A dance.', 3, True, 0.25)
    one, two = found.robots
    assert one.start == Pose(-0.5, 1.5, math.pi)
    assert (one.rate, two.rate) == (20.0, 25.0)
    assert one.profile.limits.max_linear_velocity == 0.2
    assert one.simulation == pytest.approx({
        'dead_time': 0.2, 'veer': math.radians(2.0), 'linear_gain': 0.95,
        'odometry_noise': 0.005, 'heading_noise': math.radians(1.0)})


def test_a_motion_has_the_values_of_its_robot(fleet, tmp_path):
    found = fleet('robots:\n  a: {motion: ./side.yaml, with: {side: 57 cm, laps: 2}}\n'
                  '  b: {motion: square}\n')
    one, two = (robot.motion_file for robot in found.robots)
    [loop] = one.motion.steps
    assert (loop.times, loop.steps[0].distance) == (2, 0.57)
    assert (one.title, two.title) == ('side (side 57 cm, laps 2)', 'square')
    with pytest.raises(FleetFileError) as refusal:
        fleet('robots:\n  a: {motion: ./side.yaml, with: {side: 5 m, laps: 2}}\n')
    assert str(refusal.value).endswith(f'4 m ({tmp_path}/side.yaml:2)')


def test_the_robot_of_a_motion_is_that_of_the_fleet_unless_it_says_another(fleet, tmp_path):
    (tmp_path / 'sub').mkdir()
    (tmp_path / 'sub' / 'motion.yaml').write_text('robot: ../robot2.yaml\nsteps: []\n')
    found = fleet('robots:\n  a: {motion: ./sub/motion.yaml}\n'
                  '  b: {motion: ./sub/motion.yaml, robot: turtlesim}\n')
    assert [robot.profile.limits.max_linear_velocity for robot in found.robots] == [0.2, 2.0]


def test_paths_begin_at_the_folder_of_the_file(fleet, tmp_path, monkeypatch):
    """Wherever the program runs, and however the fleet is named."""
    fleet('robots:\n  a: {motion: ./mirror.yaml, robot: ./robot2.yaml}\n')
    (tmp_path / 'elsewhere').mkdir()
    for folder, path in ((tmp_path / 'elsewhere', '../fleet.yaml'), (tmp_path, './fleet.yaml'),
                         (tmp_path.parent, f'./{tmp_path.name}/fleet.yaml')):
        monkeypatch.chdir(folder)
        assert find_fleet(path).robots[0].motion_file.rate == 25.0


def test_an_absolute_path_stays(fleet, tmp_path):
    assert fleet(f'robots:\n  a: {{motion: {tmp_path}/mirror.yaml}}\n').robots[0].rate == 25.0


@pytest.mark.parametrize('name', fleets())
def test_the_fleets_of_the_package_can_be_driven(name):
    found = find_fleet(name)
    assert found.name == name
    assert found.description.endswith('.')
    assert plan_fleet(found).nearest == ()


@pytest.mark.parametrize('name, words', [
    ('minuett', "minuett: there is no fleet of this name; did you mean 'minuet'?"),
    ('./gone.yaml', './gone.yaml: there is no such file'),
])
def test_a_fleet_that_is_not_there_is_refused_in_one_line(name, words):
    with pytest.raises(UsageError) as refusal:
        find_fleet(name)
    assert str(refusal.value).startswith(words)
    assert '\n' not in str(refusal.value)


def test_as_many_robots_as_a_guardian_stops_are_read():
    text = 'robots:\n' + ''.join(
        f'  r{number}: {{motion: spin, start: {{x: {number} m}}}}\n'
        for number in range(MAX_ROBOTS))
    assert len(read_fleet(text, 'many.yaml').robots) == MAX_ROBOTS


def test_the_schema_has_the_form_of_a_value():
    values = read_schema(SCHEMA)['definitions']['robot']['properties']['with']
    assert values['additionalProperties'].items() >= AMOUNT.items()


def test_the_schema_has_every_error_of_the_simulated_robot():
    simulation = read_schema(SCHEMA)['definitions']['robot']['properties']['simulation']
    assert list(simulation['properties']) == [
        figure.name for figure in fields(SimulationParameters)]
    for figure in fields(SimulationParameters):
        part = simulation['properties'][figure.name]
        assert ('quantity' in part) == bool(figure.metadata['unit']), figure.name
