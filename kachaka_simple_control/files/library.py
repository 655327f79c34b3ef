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
"""
Find and read the motions that come with the package; each of them has a name.

The motion ``lesson`` is read from the function ``play_lesson``.  All other motions are YAML files.
"""

from __future__ import annotations
import __future__  # noqa: I100

import ast
from collections.abc import Mapping
from importlib.resources import files
import inspect
import os

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.document import MotionFileError, Node, Problem
from kachaka_simple_control.files.motion_file import MotionFile
from kachaka_simple_control.files.motion_reader import loads
from kachaka_simple_control.files.parameters import Given
from kachaka_simple_control.files.report_file import (
    motion_of_report,
    read_json,
    RecordedMotion,
    SUFFIX,
)
from kachaka_simple_control.files.yaml_document import look_up, names_in
from kachaka_simple_control.motion.steps import Motion, Move


def library() -> list[str]:
    """Return the names of the motions that come with the package, in alphabetical order."""
    return sorted([*names_in('motions'), LESSON])


def find(name_or_path: str | os.PathLike[str], /, **values: Given) -> MotionFile:
    """
    Read a motion by its name or by the path of its file.

    For example, ``find('square', side='1 m')`` reads a square of 1 m.  Only the motions that come
    with the package have a name.

    :param name_or_path: a text without dots and slashes is a name; any other value is a path,
        also of the file ``run.json`` of a report, whose motion is read as it was driven
    :param values: the values of its parameters, as text or in SI units
    :raises MotionFileError: if there is no such motion, the file cannot be read, or a value is
        wrong
    """
    if name_or_path == LESSON:
        if values:
            raise MotionFileError(LESSON, [Problem('the lesson has no parameters')])
        return _read_lesson()
    with MotionFileError.naming(os.fspath(name_or_path)):
        motion = _recorded(os.fspath(name_or_path))
        if motion is not None:
            return motion.read(values)
        source, text = look_up(name_or_path, 'motions', library())
    return loads(text, source, values)


def text_of(name_or_path: str) -> tuple[str, str, Mapping[str, str]]:
    """
    Return the source and the text of a motion, and the values that a report keeps with it.

    :raises UnreadableFileError: if there is no such motion, or the file cannot be read
    """
    motion = _recorded(name_or_path)
    return (*look_up(name_or_path, 'motions', library()), {}) if motion is None else (
        motion.source, motion.text, motion.values)


def _recorded(path: str) -> RecordedMotion | None:
    """Return the motion of a report; None if this is no JSON file, or a motion written as JSON."""
    if not path.endswith(SUFFIX):
        return None
    data = read_json(path)
    is_motion = isinstance(data, dict) and 'steps' in data and 'format' not in data
    return None if is_motion else motion_of_report(data)


LESSON = 'lesson'
LESSON_FUNCTION = 'play_lesson'
#: The largest number of movements in the lesson.
MAX_MOVEMENTS = 10_000
#: The file of the lesson's node.  It cannot be imported without ROS.
LESSON_FILE = files('kachaka_simple_control').joinpath('kachaka_simple_control.py')


class _MotionRecorder:
    """
    Records the movements of the lesson without driving a robot.

    The function ``play_lesson`` gets this object instead of the node that drives the robot.
    """

    def __init__(self) -> None:
        self.steps: list[Move] = []
        #: the line of the lesson in which each step was recorded
        self.lines: list[int] = []

    def move_robot(self, linear_x: float, angular_z: float, duration: float) -> None:
        """
        Record a movement as a step of the motion.

        :raises InvalidMotionError: if a value is invalid, or if there are more than MAX_MOVEMENTS
            movements, for example because of an endless loop
        """
        if len(self.steps) == MAX_MOVEMENTS:
            raise InvalidMotionError(f'{LESSON_FUNCTION} has more than {MAX_MOVEMENTS} movements')
        self.steps.append(Move(linear_x, angular_z, duration))
        self.lines.append(_line_of_caller())

    # Python shows this name if an argument is missing; the name of this class says nothing.
    move_robot.__qualname__ = 'move_robot'


def _line_of_caller() -> int:
    frame = inspect.currentframe()
    caller = frame and frame.f_back and frame.f_back.f_back
    assert caller
    return caller.f_lineno


def lesson_motion() -> Motion:
    """
    Return the motion that the function ``play_lesson`` drives.

    The function is called with an object that records the movements, instead of the node that
    drives the robot.  No other code of the function's file is run, so ROS is not needed.  The
    description of the motion is the first line of the function's docstring.

    :raises InvalidMotionError: if a movement is invalid, or if there are more than MAX_MOVEMENTS
        movements
    :raises SyntaxError: if the function's file is not Python
    """
    return _read_lesson().motion


def _read_lesson() -> MotionFile:
    function = next(
        node for node in ast.parse(LESSON_FILE.read_text('utf-8'), str(LESSON_FILE)).body
        if isinstance(node, ast.FunctionDef) and node.name == LESSON_FUNCTION)
    # Keep annotations as text, because the class that they name is not defined here.
    code = compile(
        ast.Module([function], []), str(LESSON_FILE), 'exec',
        flags=__future__.annotations.compiler_flag)
    namespace: dict[str, object] = {}
    exec(code, namespace)
    play, recorder = namespace[LESSON_FUNCTION], _MotionRecorder()
    assert callable(play)
    play(recorder)
    description = (ast.get_docstring(function) or '').partition('\n')[0]
    motion = Motion(LESSON, tuple(recorder.steps), description)
    lines: dict[str | int, Node] = {
        index: Node(line, None) for index, line in enumerate(recorder.lines)}
    root = Node(function.lineno, None, {'steps': Node(function.lineno, None, lines)})
    return MotionFile(motion, str(LESSON_FILE), root=root)
