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
"""The lines and messages of the console: exact both ways, and strict."""

from __future__ import annotations

from dataclasses import fields
import json
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
import kachaka_simple_control
from kachaka_simple_control.console import page_protocol
from kachaka_simple_control.console.fleet_page_protocol import (
    FleetPageState,
    read_fleet_page_message,
)
from kachaka_simple_control.console.page_protocol import (
    read_page_message,
)
from kachaka_simple_control.files import protocol
from kachaka_simple_control.files.messages import (
    from_json,
    MAX_INTEGER,
    Message,
    MessageError,
    to_json,
)
from kachaka_simple_control.files.protocol import (
    COMMANDS,
    Fleet,
    FLEET_COMMANDS,
    FleetState,
    FloorMap,
    FloorRobot,
    Hand,
    MAX_SIZE,
    protocol_schema,
    read_command,
    read_report,
    Report,
    Run,
    RunFleet,
    SCHEMA,
    State,
    Watch,
    write_line,
)
from optional_libraries import optional_imports
import pytest

with optional_imports():
    from jsonschema import Draft7Validator

FLOATS = st.floats(allow_nan=False, allow_infinity=False)
TEXTS = st.text(st.characters(blacklist_categories=['Cs']), max_size=40)
NAMED_TEXTS = st.dictionaries(TEXTS, TEXTS, max_size=2)
IDS = st.integers(0, MAX_INTEGER)
POSES = st.tuples(FLOATS, FLOATS, FLOATS)
FACTORS = st.floats(0.01, 1.0)
WATCHES = st.builds(
    Watch, st.sampled_from(['clear', 'obstacle', 'no scan', 'blind']), st.none() | FLOATS,
    st.none() | FLOATS)
STATES = st.builds(
    State, state=st.sampled_from(['ready', 'driving', 'stopped']), motion=st.none() | TEXTS,
    step=st.none() | st.integers(0, 99), steps=st.none() | st.integers(0, 99),
    progress=st.none() | st.floats(0.0, 1.0), remaining=st.none() | FLOATS,
    factors=st.dictionaries(TEXTS, FLOATS, max_size=3), planned=st.none() | POSES,
    driven=st.none() | POSES, velocity=st.tuples(FLOATS, FLOATS),
    odometry_age=st.none() | FLOATS, reason=st.none() | TEXTS, watch=st.none() | WATCHES,
    held_by=st.none() | TEXTS)
POINTS = st.lists(st.tuples(FLOATS, FLOATS), max_size=3).map(tuple)
MAPS = st.none() | st.builds(
    FloorMap, st.lists(POINTS, max_size=2).map(tuple), st.lists(POSES, max_size=2).map(tuple),
    st.lists(POSES, max_size=2).map(tuple))
FLOOR_ROBOTS = st.builds(
    FloorRobot, TEXTS, TEXTS, POSES, FLOATS, POINTS, st.none() | st.integers(0, 3))
FLEETS = st.builds(
    Fleet, TEXTS, TEXTS, FLOATS, st.integers(1, 9), FLOATS,
    st.lists(POINTS, max_size=2).map(tuple), st.lists(FLOOR_ROBOTS, max_size=3).map(tuple), MAPS)
FLEET_STATES = st.builds(
    FleetState, state=st.sampled_from(['taking', 'driving', 'ended']),
    round=st.none() | st.integers(1, 9), plan_time=st.none() | FLOATS, speed=FACTORS,
    apart=st.none() | FLOATS, reason=st.none() | TEXTS, is_still=st.none() | st.booleans(),
    states=st.lists(st.sampled_from(['done', 'stopped']), max_size=3).map(tuple),
    poses=st.lists(st.none() | POSES, max_size=3).map(tuple),
    troubles=st.dictionaries(TEXTS, TEXTS, max_size=2), watch=st.none() | WATCHES)
LINES = st.one_of(
    st.builds(Hand, sequence=IDS, stamp=FLOATS, linear_x=FLOATS, angular_z=FLOATS),
    st.builds(Run, IDS, TEXTS, TEXTS, NAMED_TEXTS, st.none() | NAMED_TEXTS),
    st.builds(protocol.MotionText, TEXTS, TEXTS, NAMED_TEXTS, NAMED_TEXTS),
    st.builds(protocol.Speed, IDS, FACTORS),
    st.builds(protocol.Stop, IDS), st.just(protocol.Alive()), STATES,
    st.builds(protocol.Answer, IDS, st.booleans(), TEXTS, st.none() | st.booleans()),
    st.builds(protocol.Sent, st.lists(POSES, max_size=4).map(tuple)),
    st.builds(protocol.Scan, st.none() | POSES, POINTS),
    st.builds(protocol.Stamp, FLOATS), st.builds(protocol.Log, st.just('info'), TEXTS),
    st.builds(RunFleet, IDS), FLEETS, FLEET_STATES)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | TEXTS,
    lambda parts: st.lists(parts, max_size=3) | st.dictionaries(TEXTS, parts, max_size=3),
    max_leaves=8)
HAND = {'v': 1, 'type': 'hand', 'sequence': 1, 'stamp': 2.0, 'linear_x': 0.1, 'angular_z': 0.0}


@given(LINES)
def test_a_line_is_read_as_it_was_written(message: Message):
    line = write_line(message)
    assert line.endswith(b'\n')
    assert line.count(b'\n') == 1
    if isinstance(message, Report):
        assert message == read_report(line)
    else:
        kinds = FLEET_COMMANDS if isinstance(message, RunFleet) else COMMANDS
        assert message == read_command(line, kinds)


@given(st.binary(max_size=200) | st.text(max_size=200) | JSON.map(json.dumps))
def test_anything_else_is_refused_in_one_sentence(text: str | bytes):
    for read in (read_command, read_report, read_page_message, read_fleet_page_message):
        with pytest.raises(MessageError) as caught:
            read(text)
        assert '\n' not in str(caught.value)


@pytest.mark.parametrize('changes, reason', [
    ({'v': 2}, "'v' is 2; it must be 1"),
    ({'v': True}, "'v' is true"),
    ({'type': 'fly'}, "'fly', which is unknown"),
    ({'type': ['hand']}, 'a list, which is unknown'),
    ({'sequence': 1.0}, "'sequence' is 1.0; it must be a whole number"),
    ({'sequence': True}, "'sequence' is true; it must be a whole number"),
    ({'sequence': -1}, 'a number from 0'),
    ({'sequence': 10**30}, "'sequence' is too large"),
    ({'stamp': '2'}, "'stamp' is '2'; it must be a number"),
    ({'stamp': None}, "'stamp' is null; it must be a number"),
    ({'linear_x': 10**400}, "'linear_x' is too large; it must be a finite number"),
    ({'extra': 1}, "there is no key 'extra'"),
])
def test_a_wrong_value_is_named(changes: dict[str, object], reason: str):
    with pytest.raises(MessageError) as caught:
        read_command(json.dumps({**HAND, **changes}))
    assert reason in str(caught.value)


@pytest.mark.parametrize('text, reason', [
    ('{"v":1,"type":"hand","sequence":1,"stamp":NaN,"linear_x":0,"angular_z":0}', 'NaN'),
    ('{"v":1,"type":"hand","sequence":1,"stamp":1e999,"linear_x":0,"angular_z":0}', 'finite'),
    ('{"v":1,"type":"stop"}', "'stop': 'id' is missing"),
    ('{"v":1,"type":"stop","id":1,"id":2}', 'twice'),
    ('{"v":1,"type":"run","id":1,"name":"","text":"\\ud800"}', 'half a character'),
    ('{"v":1,"type":"run","id":1,"name":"","text":"","values":{"side":1}}',
     "'values.side' is 1; it must be a text"),
    ('[' * 60_000, 'no JSON text'),
    ('[]', 'no JSON object'),
    ('', 'no JSON text'),
    (' ' * MAX_SIZE + '{}', 'more than 64000 bytes'),
    ('"' + '\u20ac' * 22_000 + '"', 'more than 64000 bytes'),
])
def test_a_text_that_is_no_line_is_refused(text: str, reason: str):
    with pytest.raises(MessageError) as caught:
        from_json(text, COMMANDS)
    assert reason in str(caught.value)


@pytest.mark.parametrize('line, is_for_fleet', [
    ('{"v":1,"type":"run","id":1}', True),
    ('{"v":1,"type":"run","id":1,"text":"steps: []","name":"a.yaml"}', False),
    ('{"v":1,"type":"take","id":1}', False),
    ('{"v":1,"type":"hand","sequence":1,"stamp":0,"linear_x":0,"angular_z":0}', False),
    ('{"v":1,"type":"speed","id":1,"factor":0.5}', False)])
def test_a_fleet_is_run_without_a_text_and_not_driven_by_hand(line: str, is_for_fleet: bool):
    right, wrong = (FLEET_COMMANDS, COMMANDS) if is_for_fleet else (COMMANDS, FLEET_COMMANDS)
    read_command(line, right)
    with pytest.raises(MessageError):
        read_command(line, wrong)


def test_a_state_of_50_robots_is_short():
    state = FleetState(
        'driving', 1, 12.34, states=50 * ('driving',), poses=50 * ((-12.345, 12.345, -3.142),))
    assert len(write_line(state)) < 2_500


def test_the_state_of_a_page_has_all_of_the_drive():
    for state, of_page in ((State, page_protocol.PageState), (FleetState, FleetPageState)):
        assert {part.name for part in fields(state)} < {
            part.name for part in fields(of_page)}


def test_the_schema_file_is_that_of_the_classes():
    path = Path(kachaka_simple_control.__file__).parent / SCHEMA
    assert protocol_schema() == json.loads(path.read_text()), 'run tools/write_schemas.py'


@pytest.mark.needs('jsonschema')
@given(LINES)
def test_the_schema_allows_each_line(message: Message):
    Draft7Validator(protocol_schema()).validate(json.loads(to_json(message)))
