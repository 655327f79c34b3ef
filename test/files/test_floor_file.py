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
"""Floors as files: what is read, and what is refused, with file and line."""

from __future__ import annotations

from dataclasses import fields
import math

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.files.document import read_schema
from kachaka_simple_control.files.floor_file import (
    find_floor,
    FloorFileError,
    floors,
    LaserParameters,
    read_floor,
    SCHEMA,
)
from kachaka_simple_control.motion.floor import Floor, Person, Post
from kachaka_simple_control.text import location
import pytest

pytestmark = pytest.mark.needs('yaml', 'jsonschema')

#: Wrong floors: for each problem its line, None for an empty file, and words of it.
BROKEN: dict[str, tuple[str, list[tuple[int | None, str]]]] = {
    'empty': ('', [(None, 'the file is empty')]),
    'a list': ('- walls\n', [(1, 'it must be a floor')]),
    'an unknown key': ('wall: []\n', [(1, "wall: there is no such key; did you mean 'walls'?")]),
    'walls of nothing': ('walls:\n', [(1, 'walls: nothing; it must be a list of walls')]),
    'a wall of one point': ('walls:\n  - [[1 m, 0 m]]\n',
                            [(2, 'walls[0]: a list of 1; it must be a wall: two points or more')]),
    'a wall that is a point': ('walls: [[1 m, 0 m]]\n',
                               [(1, "walls[0][0]: '1 m'; it must be a point"),
                                (1, "walls[0][1]: '0 m'; it must be a point")]),
    'a point of three': ('walls: [[[1 m, 0 m], [1 m, 0 m, 1 m]]]\n',
                         [(1, 'walls[0][1]: a list of 3; it must be a point: x and y')]),
    'a point without units': ('walls:\n  - [[1, 0 m], [1 m, 1 m]]\n',
                              [(2, 'walls[0][0][0]: 1 has no unit; a length needs one')]),
    'a point twice': ('walls:\n  - [[1 m, 0 m],\n     [100 cm, 0 m]]\n',
                      [(3, 'walls[0][1]: the point before it once more; leave it out')]),
    'a point too far': ('walls: [[[1 m, 0 m], [1 km, 0 m]]]\n',
                        [(1, "walls[0][1][0]: '1 km'; write '1000 m'")]),
    'a wall too long': ('walls: [[[1 m, 0 m], [1000 m, 0 m]]]\n',
                        [(1, 'walls[0][1]: at 1000 m; a floor reaches 100 m from its origin')]),
    'a post without a radius': ('posts: [{at: [1 m, 0 m]}]\n',
                                [(1, "posts[0]: 'radius' is missing: a size, as in 0.4 m")]),
    'a post of no size': ('posts: [{at: [1 m, 0 m], radius: 0 cm}]\n',
                          [(1, "posts[0].radius: '0 cm'; it must be above 0 m")]),
    'a post with an unknown key': ('posts: [{at: [1 m, 0 m], radius: 1 cm, until: 1 s}]\n',
                                   [(1, 'posts[0].until: there is no such key')]),
    'a person nowhere': ('people: [{from: 1 s}]\n', [(1, "'at' is missing: a point")]),
    'a person who goes first': ('people:\n  - at: [1 m, 0 m]\n    from: 5 s\n    until: 4 s\n',
                                [(4, 'people[0].until: 4 s; it must be after 5 s')]),
    'a walk without an end': ('people:\n  - at: [1 m, 0 m]\n    to: [1 m, 1 m]\n',
                              [(2, 'people[0].until: without an end; a walk needs one')]),
    'a time before': ('people: [{at: [1 m, 0 m], from: -1 s}]\n',
                      [(1, "from: '-1 s'; it must not be negative")]),
    'a time of day': ('people: [{at: [1 m, 0 m], from: "1:30"}]\n', [(1, 'write 1:30 as 90 s')]),
    'a laser with an unknown key': (
        'laser: {reach: 8 m}\n', [(1, 'laser.reach: there is no such')]),
    'a laser too quick': ('laser:\n  rate: 100 Hz\n',
                          [(2, 'laser.rate: 100.0 Hz; it must be from 0.1 to 50 Hz')]),
    'a laser of half a point': ('laser: {points: 9.5}\n',
                                [(1, 'laser.points: 9.5; it must be a whole number')]),
    'a laser of three points': ('laser: {points: 3}\n', [(1, 'points: 3; it must be at least 4')]),
    'a laser that sees too much': ('laser: {view: 400 deg}\n',
                                   [(1, 'laser.view: 400 deg; it must be above 0 deg, and 360')]),
    'a laser of holes': ('laser: {holes: 1.5}\n', [(1, 'laser.holes: 1.5; it must be at most 1')]),
    'holes in percent': ('laser: {holes: 3 %}\n', [(1, "'3 %'; it must be a part of 1")]),
    'noise without a unit': ('laser: {noise: 1}\n', [(1, 'laser.noise: 1 has no unit')]),
    'too much': ('posts:\n' + '  - {at: [1 m, 0 m], radius: 1 cm}\n' * 1001,
                 [(1, 'a floor with 1001 lines, posts and people; it has 1000 at most')]),
    'several at once': (
        ('walls: [[[1 m, 0 m], [1 m, 0 m]]]\nposts: [{at: [1 m], radius: 1 cm}, {at: [1 m, 300 m]'
         ', radius: 1 cm}]\npeople:\n  - {at: [1 m, 0 m], until: 0 s}\nlaser: {rate: 60 Hz}\n'),
        [(1, 'walls[0][1]'), (2, 'posts[0].at'), (2, 'posts[1].at'), (4, 'until'), (5, 'rate')]),
}


@pytest.mark.parametrize('text, problems', BROKEN.values(), ids=BROKEN)
def test_a_broken_floor_has_a_line_with_file_and_line_for_each_problem(text, problems, tmp_path):
    file = tmp_path / 'floor.yaml'
    file.write_text(text)
    with pytest.raises(FloorFileError) as refusal:
        find_floor(file)
    lines = str(refusal.value).split('\n')
    assert len(lines) == len(problems), lines
    for line, (number, words) in zip(lines, problems):
        assert line.startswith(location(str(file), number) + ': '), line
        assert words in line, line


def test_all_that_a_file_can_say_is_read():
    file = read_floor("""
name: lab
description: Has everything.
walls: [[[0.8 m, -1 m], [80 cm, 1 m], [0 m, 1 m]]]
posts: [{at: [1 m, 0.3 m], radius: 3 cm}]
people:
  - {at: [0.9 m, 0 m], radius: 25 cm, from: 2 s, until: 14 s, to: [0.9 m, 500 mm]}
  - at: [0 m, 0 m]
laser: {rate: 5 Hz, noise: 2 cm, holes: 0.1, view: 180 deg, off_after: 1 min, points: 720,
        range: 4 m}
""", 'here/floor.yaml')
    assert (file.name, file.description, file.source) == (
        'lab', 'Has everything.', 'here/floor.yaml')
    assert file.floor == Floor(
        (((0.8, -1.0), (0.8, 1.0), (0.0, 1.0)),), (Post((1.0, 0.3), 0.03),),
        (Person((0.9, 0.0), 0.25, 2.0, 14.0, (0.9, 0.5)), Person((0.0, 0.0))))
    assert file.laser == LaserParameters(5.0, 720, math.pi, 4.0, 0.02, 0.1, 60.0)


def test_what_is_left_out_has_the_default_that_the_schema_says():
    file = read_floor('{}', 'bare.yaml')
    assert (file.name, file.floor, file.laser) == ('bare', Floor(), LaserParameters())
    said = read_schema(SCHEMA)['properties']['laser']['properties']
    assert set(said) == {part.name for part in fields(LaserParameters)}
    text = '\n'.join(
        f'  {name}: {part["description"].rpartition("Left out: ")[2]}'
        for name, part in said.items())
    assert read_floor(f'laser:\n{text}\n', 'said.yaml').laser == LaserParameters()


@pytest.mark.parametrize('name', floors())
def test_the_floors_of_the_package_are_read_by_their_names(name):
    file = find_floor(name)
    assert file.name == name
    assert file.description
    assert file.floor != Floor()


def test_an_unknown_name_is_a_mistake_of_the_user():
    with pytest.raises(UsageError, match="no floor of this name; did you mean 'crossing'?"):
        find_floor('crosing')
