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
"""The lesson as a motion, taken from the node's file, where its seven lines stand."""

from __future__ import annotations
import __future__

import ast
from importlib.resources import files

from kachaka_simple_control.motion.steps import Motion, Move

NAME = 'lesson'
FUNCTION = 'play_lesson'
#: The node's file; it cannot be imported without ROS.
SOURCE = files('kachaka_simple_control').joinpath('kachaka_simple_control.py')


class _Recorder:
    """Takes the place of the node, and keeps what it is asked to do."""

    def __init__(self) -> None:
        self.steps: list[Move] = []

    def move_robot(self, linear_x: float, angular_z: float, duration: float) -> None:
        """Keep a movement as a step."""
        self.steps.append(Move(linear_x, angular_z, duration))


def lesson() -> Motion:
    """
    Return the motion that ``play_lesson`` drives; the first line of its docstring describes it.

    Only that function is compiled, and called with a recorder: nothing else of the node's file
    runs, and ROS is not needed.

    :raises InvalidMotionError: if one of its movements is not valid
    """
    function = next(
        node for node in ast.parse(SOURCE.read_text('utf-8')).body
        if isinstance(node, ast.FunctionDef) and node.name == FUNCTION)
    # Annotations stay text: the class that they name is not there.
    code = compile(
        ast.Module([function], []), str(SOURCE), 'exec',
        flags=__future__.annotations.compiler_flag)
    namespace: dict[str, object] = {}
    exec(code, namespace)
    play, recorder = namespace[FUNCTION], _Recorder()
    assert callable(play)
    play(recorder)
    description = (ast.get_docstring(function) or '').partition('\n')[0]
    return Motion(NAME, tuple(recorder.steps), description)
