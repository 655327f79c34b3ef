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
"""Whatever is in a file, it is read, or refused with the one type of error."""

from __future__ import annotations

import contextlib
import json

from hypothesis import example, given, settings
from hypothesis import strategies as st
from kachaka_simple_control.files.document import MotionFileError
from kachaka_simple_control.files.motion_reader import load, loads
from kachaka_simple_control.files.robot_profile import find_robot, RobotFileError
from kachaka_simple_control.motion.limits import Limits
from motion_texts import EVERYTHING
import pytest

pytestmark = pytest.mark.needs('yaml', 'jsonschema')

ROBOT = """\
name: robot
namespace: /robot
velocity_topic: cmd_vel
message_type: TwistStamped
frame: base_link
odometry_topic: odom
manual_control: {service: enable, timeout: 60 s}
command_timeout: 0.3 s
limits: {max_linear_velocity: 0.3 m/s, max_angular_velocity: 90 deg/s}
footprint: {length: 0.4 m, width: 0.3 m, ahead: 0 m}
"""
#: The first of them loads jsonschema, which takes longer than an example may.
SETTINGS = settings(max_examples=200)
#: Values for the places where motions and robots may be wrong.
PIECES = st.sampled_from([
    '', ' ', '\n', '\t', '  ', '- ', ': ', '{', '}', '[', ']', ',', '"', "'", '#', '&a ', '*a',
    '!', '!!int ', '|', '>', '%', '@', '---', '...', '? ', '-', '~', 'null', 'yes', '.inf', '.nan',
    '1e999', '0', '-1', '010', '1:30', '\x00', '\x85', '\u2028', '\ufeff', '\ud800', '\U0001f600',
    'steps:', 'repeat', 'forward: ', 'times: 1000000', 'm', ' deg', ' m/s^2', '9' * 400])
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
    | st.sampled_from(['0.5 m', '90 deg', '2 s', 'inf', '-1 m/s', '1e999 s', '0 Hz']),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(
        st.text(max_size=3) | st.sampled_from(
            ['steps', 'repeat', 'times', 'wait', 'forward', 'distance', 'speed', 'angle', 'turn',
             'arc', 'radius', 'goto', 'point', 'waypoints', 'points', 'corners', 'limits',
             'name', 'rate', 'command_timeout', 'footprint', 'move']),
        inner, max_size=4),
    max_leaves=12)


def accept_or_refuse(text: str) -> None:
    """Read a text as a motion; anything but a motion or the error of motion files is raised."""
    refused = None
    try:
        loads(text, 'fuzz.yaml').check(Limits(0.3, 1.57, 0.5, 2.0), 'kachaka')
    except MotionFileError as error:
        refused = error
    if refused is not None:
        lines = str(refused).splitlines()
        assert len(lines) >= 1
        assert all(line.startswith('fuzz.yaml:') and line.isprintable() for line in lines)
        assert all(problem.line is None or problem.line > 0 for problem in refused.problems)


def accept_or_refuse_robot(text: str, path) -> None:
    """Read a text as a robot; anything but a robot or the error of robot files is raised."""
    path.write_bytes(text.encode(errors='surrogatepass'))
    with contextlib.suppress(RobotFileError):
        assert find_robot(path).command_timeout > 0.0


@st.composite
def mutated(draw, text: str) -> str:
    """Return a good text with some places cut out, doubled or replaced."""
    for _ in range(draw(st.integers(1, 4))):
        begin = draw(st.integers(0, len(text)))
        end = draw(st.integers(begin, min(len(text), begin + 20)))
        piece = draw(PIECES | st.just(text[begin:end] * 2))
        text = text[:begin] + piece + text[end:]
    return text


@given(mutated(EVERYTHING))
@SETTINGS
def test_a_motion_with_mistakes_is_read_or_refused(text):
    accept_or_refuse(text)


@given(st.text(max_size=200))
@example('\ufeff')
@example('%YAML 9.9\n---\n')
@SETTINGS
def test_any_text_is_read_or_refused(text):
    accept_or_refuse(text)


@given(st.dictionaries(st.sampled_from(['name', 'limits', 'rate', 'robot', 'steps']), JSON))
@SETTINGS
def test_any_values_in_the_places_of_a_motion_are_read_or_refused(data):
    accept_or_refuse(json.dumps(data))


@given(data=st.binary(max_size=200))
@example(data=b'\xff\xfe')
@SETTINGS
def test_any_bytes_are_read_or_refused(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / 'fuzz.yaml'
    path.write_bytes(data)
    with contextlib.suppress(MotionFileError):
        load(path)


@given(text=mutated(ROBOT) | st.dictionaries(st.sampled_from(
    ['velocity_topic', 'command_timeout', 'limits', 'footprint', 'manual_control', 'namespace',
     'frame']), JSON).map(json.dumps))
@SETTINGS
def test_a_robot_with_mistakes_is_read_or_refused(tmp_path_factory, text):
    accept_or_refuse_robot(text, tmp_path_factory.getbasetemp() / 'robot.yaml')
