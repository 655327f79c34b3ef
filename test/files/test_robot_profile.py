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
"""Robot profiles as files: what is read, what is refused, what is known without a file."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files
import math
import re

from golden import answers, compare
from kachaka_simple_control.control.timing import MAX_LATENESS, MAX_RATE
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.files.robot_profile import (
    calibrated_text,
    find_robot,
    KACHAKA,
    Laser,
    MIN_COMMAND_TIMEOUT,
    RobotFileError,
    RobotProfile,
    robots,
)
from kachaka_simple_control.motion.calibration import Calibration, OdometryCalibration
from kachaka_simple_control.motion.geometry import Box, Velocity
from kachaka_simple_control.motion.limits import Limits
import pytest

pytestmark = pytest.mark.needs('yaml', 'jsonschema')

ROBOTS = files('kachaka_simple_control') / 'robots'
LEAST = """\
velocity_topic: cmd_vel
command_timeout: 500 ms
limits: {max_linear_velocity: 0.2, max_angular_velocity: 1}
"""


@pytest.fixture
def robot(tmp_path):
    """Return a function that reads a robot from a text."""
    path = tmp_path / 'robot.yaml'

    def read(text: str) -> RobotProfile:
        path.write_text(text)
        return find_robot(path)

    return read


@pytest.mark.parametrize('text', ['{extends: kachaka}\n', '---\nextends: kachaka\n...\n'])
def test_a_file_to_which_nothing_can_be_added_is_refused(text, tmp_path):
    file = tmp_path / 'own.yaml'
    file.write_text(text)
    assert find_robot(file).limits == KACHAKA.limits
    with pytest.raises(RobotFileError, match='calibration cannot be added below it'):
        calibrated_text(str(file), Calibration())


def test_kachaka_has_its_makers_figures_and_chosen_accelerations():
    assert KACHAKA == RobotProfile(
        'kachaka', '/kachaka', 'manual_control/cmd_vel', 'odometry/odometry',
        'manual_control/set_enabled', 60.0, 0.3, Limits(0.3, 1.57, 0.5, 2.5, 2.0, 10.0), 'Twist',
        'base_link', Box(0.387, 0.24, 0.0435),
        laser=Laser('lidar/scan', 0.156, 0.0, math.pi / 2.0, 0.05, math.radians(270.0)))


@pytest.mark.parametrize('name', [name for name in robots() if name != KACHAKA.name])
def test_each_figure_has_its_source_or_is_chosen(name):
    """It has a comment beside it, or shares one with its neighbours."""
    text = (ROBOTS / f'{name}.yaml').read_text()
    commented = everywhere = 'All figures are chosen' in text
    figures = 0
    for line in text.splitlines():
        is_figure = re.search(': [0-9.]+ (m|s|rad)', line) is not None
        if is_figure:
            figures += 1
            assert commented or '#' in line, line
        else:
            commented = '#' in line or everywhere
    assert figures > 5


def test_a_custom_robot_may_set_every_key(robot):
    assert robot("""\
name: own
description: One that has everything.
namespace: /a/b
velocity_topic: base/cmd_vel
message_type: TwistStamped
frame: base
odometry_topic: odom
odometry_required: false
manual_control: {service: enable, timeout: 1 min}
command_timeout: 0.3
limits:
  max_linear_velocity: 30 cm/s
  max_angular_velocity: 90 deg/s
  max_linear_acceleration: 0.5 m/s^2
  max_linear_deceleration: 1 m/s^2
  max_angular_acceleration: 180 deg/s^2
  max_angular_deceleration: 360 deg/s^2
  max_linear_jerk: 2 m/s^3
  max_angular_jerk: 720 deg/s^3
  max_backward_velocity: 10 cm/s
footprint: {length: 40 cm, width: 300 mm, ahead: -5 cm}
laser: {topic: front/scan, ahead: 10 cm, left: -2 cm, yaw: 180 deg, margin: 0 cm, view: 360 deg}
""") == RobotProfile(
        'own', '/a/b', 'base/cmd_vel', 'odom', 'enable', 60.0, 0.3,
        Limits(0.3, math.pi / 2, 0.5, math.pi, 2.0, 4 * math.pi, 1.0, 2 * math.pi, 0.1),
        'TwistStamped', 'base', Box(0.4, 0.3, -0.05), odometry_required=False,
        laser=Laser('front/scan', 0.1, -0.02, math.pi, 0.0, math.tau))


def test_a_robot_may_extend_one_that_is_known(robot):
    own = robot('extends: kachaka\ncommand_timeout: 0.4 s\n')
    assert own == replace(KACHAKA, name='robot', command_timeout=0.4)
    limited = robot('extends: turtlebot3\nlimits: {max_linear_velocity: 0.1 m/s, '
                    'max_angular_velocity: 1 rad/s}\nmanual_control: null\n')
    assert limited.limits == Limits(0.1, 1.0)
    assert limited.velocity_topic == find_robot('turtlebot3').velocity_topic


def test_a_laser_is_taken_from_the_robot_that_is_extended_replaced_or_removed(robot):
    assert robot('extends: kachaka').laser == KACHAKA.laser
    assert robot('extends: kachaka\nlaser: null').laser is None
    assert robot('extends: kachaka\nlaser: {topic: scan}').laser == Laser('scan')
    assert Laser('scan').sees_behind
    assert not KACHAKA.laser.sees_behind
    assert find_robot('turtlebot3').watching_laser().topic == 'scan'
    assert robot(LEAST).laser is None


def test_a_calibration_is_read_and_lowers_the_limits_to_plan_with(robot):
    own = robot('extends: kachaka\ncalibration: {forward_gain: 0.95, left_gain: 0.97, '
                'veer: 2 deg/m, date: 2026-11-23, floor: carpet}\n')
    assert own.calibration == Calibration(
        0.95, left_gain=0.97, veer=math.radians(2.0), date='2026-11-23', floor='carpet')
    assert own.calibration.describe() == (
        'forward 0.95, backward 1, left 0.97, right 1, veer 2 deg/m, 2026-11-23, carpet')
    assert own.limits == KACHAKA.limits
    assert own.planning_limits == own.calibration.reduce(KACHAKA.limits)
    assert own.command(Velocity(0.095, 0.0)).linear_x == pytest.approx(0.1)
    assert KACHAKA.planning_limits is KACHAKA.limits
    velocity = Velocity(0.1, 0.2)
    assert KACHAKA.command(velocity) is velocity


def test_both_calibrations_are_read_and_applied_one_after_the_other(robot):
    own = robot('extends: kachaka\ncalibration: {forward_gain: 0.95}\n'
                'odometry_calibration: {scale: 0.98, wheel_ratio: 1.002, track_ratio: 1.01, '
                'track: 20 cm, floor: carpet}\n')
    calibration, odometry = own.calibration, own.odometry_calibration
    assert odometry == OdometryCalibration(0.98, 1.002, 1.01, 0.2, floor='carpet')
    assert own.planning_limits == odometry.reduce(calibration.reduce(KACHAKA.limits))
    velocity = Velocity(0.1, 0.2)
    assert own.command(velocity) == calibration.command(odometry.to_odometry(velocity))
    assert own.expected(velocity) == odometry.to_floor(calibration.response(velocity))
    assert (own.is_calibrated, KACHAKA.is_calibrated) == (True, False)
    assert KACHAKA.expected(velocity) is velocity


@pytest.mark.parametrize('before', [
    'odometry_calibration:\n  scale: 0.9  # old\n\n  # indented\n  floor: oak\n',
    'odometry_calibration: {scale: 0.9}\n',
    "'odometry_calibration' : {\n  scale: 0.9\n}\n", ''])
def test_a_calibration_replaces_one_of_its_kind_and_keeps_all_else(robot, tmp_path, before):
    laser = 'laser:\n  topic: scan\n  margin: 7 cm\n'
    robot(f'extends: kachaka\n{laser}{before}# mine\ncalibration: {{left_gain: 0.9}}\n')
    own = robot(calibrated_text(str(tmp_path / 'robot.yaml'), OdometryCalibration(
        1.02, 0.999, 1.03, 0.2, '2026-11-23')))
    assert own.calibration == Calibration(left_gain=0.9)
    assert own.odometry_calibration == OdometryCalibration(1.02, 0.999, 1.03, 0.2, '2026-11-23')
    text = calibrated_text(str(tmp_path / 'robot.yaml'), Calibration(1.1))
    assert '# mine' in text
    again = robot(text)
    assert again.calibration == Calibration(1.1)
    assert again.odometry_calibration == own.odometry_calibration
    assert again.laser == own.laser == Laser('scan', margin=0.07)


#: Calibrations that are refused, each in one line.
CALIBRATIONS = (
    'extends: kachka',
    'extends: [kachaka]',
    'extends: kachaka\ncalibration: {forward_gain: 0.4}',
    'extends: kachaka\ncalibration: {veer: 2}',
    'extends: kachaka\ncalibration: {veer: 2 rad/m}',
    ('extends: kachaka\nlimits: {max_linear_velocity: 1 m/s, max_angular_velocity: 0.1 rad/s}\n'
     'calibration: {veer: 1 rad/m}'),
    'extends: kachaka\ncalibration: {}',
    'extends: kachaka\ncalibration: {left: 1}',
    'extends: kachaka\nodometry_calibration: {scale: 0.4}',
    'extends: kachaka\nodometry_calibration: {wheel_ratio: 1.01}',
    'extends: kachaka\nodometry_calibration: {track: 0.2}',
    'extends: kachaka\nodometry_calibration: {track: 20 m}',
    ('extends: kachaka\nlimits: {max_linear_velocity: 1 m/s, max_angular_velocity: 0.1 rad/s}\n'
     'odometry_calibration: {wheel_ratio: 1.1, track: 0.2 m}'),
)
#: What is refused below the least that a robot needs, each in one line.
MORE = (
    'footprint: {length: 1 m}',
    'footprint: {length: 1 m, width: 1 m, radius: 1 m}',
    'footprint: {radius: 1 m, ahead: 1 m}',
    'footprint: {}',
    'footprint: {radius: 0 m}',
    'manual_control: {service: a}',
    'manual_control: enable',
    'message_type: Twst',
    'namespace: own',
    'namespace: "/kachaka\\n"',
    'odometry_topic: /odom',
    'max_speed: 1',
    'command_timeout: 1',
    'laser: {}',
    'laser: scan',
    'laser: {topic: /scan}',
    'laser: {topic: scan, yaw: 90}',
    'laser: {topic: scan, margin: 1.5 m}',
    'laser: {topic: scan, margin: -5 cm}',
    'laser: {topic: scan, view: 0 deg}',
    'laser: {topic: scan, view: 400 deg}',
    'laser: {topic: scan, hight: 10 cm}',
)


def test_a_wrong_robot_is_refused_in_one_line(robot, tmp_path):
    def refusal(text: str) -> str:
        with pytest.raises(RobotFileError) as caught:
            robot(text)
        return str(caught.value).removeprefix(f'{tmp_path}/')

    compare('robot_files', answers(CALIBRATIONS, refusal) + answers(
        MORE, lambda more: refusal(LEAST + more)))


def test_all_errors_of_a_robot_are_reported_at_once(robot):
    with pytest.raises(RobotFileError) as caught:
        robot('velocity_topic: cmd vel\ncommand_timeout: 0 s\n'
              'limits: {max_linear_velocity: 1 rad/s}')
    assert [problem.line for problem in caught.value.problems] == [1, 2, 3, 3]
    assert isinstance(caught.value, UsageError)


@pytest.mark.parametrize('name, words', [
    ('kachka', "kachka: there is no robot of this name; did you mean 'kachaka'?  Known are cre"),
    ('pr2', 'pr2: there is no robot of this name; known are create3, generic, kachaka, '),
    ('./kachaka.yaml', './kachaka.yaml: there is no such file'),
])
def test_an_unknown_robot_is_refused(name, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RobotFileError) as caught:
        find_robot(name)
    assert str(caught.value).startswith(words)


@pytest.mark.parametrize('timeout', ['0.1 s', '50 ms', '0.001', '0.1005 s'])
def test_a_robot_that_keeps_a_velocity_too_briefly_is_refused(tmp_path, timeout):
    """No rate would do."""
    assert MIN_COMMAND_TIMEOUT == MAX_LATENESS + 1.0 / MAX_RATE
    file = tmp_path / 'hasty.yaml'
    file.write_text(f'extends: kachaka\ncommand_timeout: {timeout}\n')
    with pytest.raises(RobotFileError, match=(
            r'hasty.yaml:2: command_timeout: 0\.\d+ s is too short: .*at least 0.101 s')):
        find_robot(file)
