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
Write motions as YAML files.

Tested by test/files/test_motion_file.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
import re
from typing import Any

from kachaka_simple_control.files.document import MotionFileError, Problem
from kachaka_simple_control.files.motion_reader import loads
from kachaka_simple_control.files.motion_schema import POINT
from kachaka_simple_control.motion.step_base import (
    FieldKind,
    PointField,
    PointList,
    Step,
    StepList,
    Text,
)
from kachaka_simple_control.motion.steps import Motion
from kachaka_simple_control.motion.units import LENGTH, Quantity, TOLERANCE

#: A pattern for texts that need no quotes in any version of YAML, except the words in _RESERVED.
_PLAIN = re.compile('[A-Za-z][A-Za-z0-9_]*( [A-Za-z0-9_]+)*[.]?')
_RESERVED = frozenset(
    ['y', 'n', 'yes', 'no', 'on', 'off', 'true', 'false', 'null', 'nan', 'inf', 'infinity'])
_ESCAPED = re.compile('[^ !#-\\[\\]-~\xa1-\u2027\u202a-\ud7ff\ue000-\ufefe\uff00-\ufffd]')


def dump(motion: Motion) -> str:
    """
    Return the text of a YAML file for a motion, with all numbers in full precision.

    If the text is read again, the result is equal to the motion.

    :raises MotionFileError: if the motion cannot be written, for example because it has too many
        steps
    """
    lines = [f'name: {_text(motion.name)}']
    if motion.description:
        lines.append(f'description: {_text(motion.description)}')
    if motion.corners:
        lines.append(f'corners: {_number(motion.corners, TOLERANCE)}')
    lines += ['steps:' if motion.steps else 'steps: []', *_steps(motion.steps, '  ')]
    text = '\n'.join(lines) + '\n'
    if loads(text, motion.name).motion != motion:
        raise MotionFileError(motion.name, [Problem(
            'it has numbers that are no floats, which no file can hold; turn them into floats')])
    return text


def _steps(steps: Iterable[Step], indent: str) -> Iterator[str]:
    for step in steps:
        parts = step.file_fields()
        values = {name: getattr(step, name) for name in parts if getattr(step, name) is not None}
        lists = {name for name in values if isinstance(parts[name].kind, StepList)}
        texts = {name: _number(value, parts[name].kind)
                 for name, value in values.items() if name not in lists}
        if lists:
            yield f'{indent}- {step.keyword}:'
            yield from (f'{indent}    {name}: {text}' for name, text in texts.items())
            for name in lists:
                yield f'{indent}    {name}:' + ('' if values[name] else ' []')
                yield from _steps(values[name], indent + '      ')
        elif len(texts) == 1 and not step.form:
            yield f'{indent}- {step.keyword}: {next(iter(texts.values()))}'
        else:
            inner = ', '.join(f'{name}: {text}' for name, text in texts.items())
            yield f'{indent}- {step.keyword}: {{{inner}}}'


def _number(value: Any, kind: FieldKind) -> str:
    match kind:
        case Quantity():
            # float(): an int is printed without an exponent, and repr() of a numpy number has its
            # type.
            return f'{float(value)!r} {kind.unit}'
        case PointField():
            return f'[{", ".join(_number(number, LENGTH) for number in value)}]'
        case PointList():
            return f'[{", ".join(_number(point, POINT) for point in value)}]'
        case Text():
            return _text(value)
        case _:
            return str(value)


def _text(text: str) -> str:
    if _PLAIN.fullmatch(text) and text.lower() not in _RESERVED:
        return text
    return '"' + _ESCAPED.sub(lambda found: _escape(found[0]), text) + '"'


def _escape(character: str) -> str:
    short = {'"': '\\"', '\\': '\\\\', '\n': '\\n', '\t': '\\t'}
    code = ord(character)
    return short.get(character) or (f'\\u{code:04x}' if code < 0x10000 else f'\\U{code:08x}')
