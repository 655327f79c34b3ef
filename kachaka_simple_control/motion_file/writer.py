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
"""Write motions as files that read back as the same motion."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
import re

from kachaka_simple_control.motion.steps import Motion, Repeat, Step
from kachaka_simple_control.motion_file.problems import MotionFileError, Problem
from kachaka_simple_control.motion_file.reader import loads
from kachaka_simple_control.motion_file.step_kinds import KINDS, REPEAT, Simple
from kachaka_simple_control.motion_file.units import Quantity

#: Words that need no quotes in any version of YAML, and mean nothing but text.
_PLAIN = re.compile('[A-Za-z][A-Za-z0-9_]*( [A-Za-z0-9_]+)*[.]?')
_RESERVED = frozenset(
    ['y', 'n', 'yes', 'no', 'on', 'off', 'true', 'false', 'null', 'nan', 'inf', 'infinity'])
_ESCAPED = re.compile('[^ !#-\\[\\]-~\xa1-\u2027\u202a-\ud7ff\ue000-\ufefe\uff00-\ufffd]')


def dump(motion: Motion) -> str:
    """
    Return the text of a file that a motion can be read from.

    Numbers have all their digits, so that nothing is lost.

    :param motion: the motion
    :returns: the text
    :raises MotionFileError: if no file can hold it: it has too many steps, for one
    """
    lines = [f'name: {_text(motion.name)}']
    if motion.description:
        lines.append(f'description: {_text(motion.description)}')
    lines += ['steps:' if motion.steps else 'steps: []', *_steps(motion.steps, '  ')]
    text = '\n'.join(lines) + '\n'
    if loads(text, motion.name).motion != motion:
        raise MotionFileError(motion.name, [Problem(
            'it has numbers that are no floats, which no file can hold; turn them into floats')])
    return text


def _steps(steps: Iterable[Step], indent: str) -> Iterator[str]:
    for step in steps:
        if isinstance(step, Repeat):
            yield f'{indent}- {REPEAT}:'
            yield f'{indent}    times: {step.times}'
            yield f'{indent}    steps:' + ('' if step.steps else ' []')
            yield from _steps(step.steps, indent + '      ')
        else:
            yield f'{indent}- {_simple(step)}'


def _simple(step: Simple) -> str:
    word, kind = next(
        (word, kind) for word, kind in KINDS.items() if isinstance(step, kind.make))
    values = {
        name: _number(getattr(step, name), quantity)
        for name, quantity in kind.quantities.items() if getattr(step, name) is not None}
    if kind.has_short_form and len(values) == 1:
        return f'{word}: {values[kind.first]}'
    return f'{word}: {{{", ".join(f"{name}: {value}" for name, value in values.items())}}}'


def _number(value: float, quantity: Quantity) -> str:
    # float: an int has no exponent, and numpy's own numbers print their type.
    return f'{float(value)!r} {quantity.unit}'


def _text(text: str) -> str:
    if _PLAIN.fullmatch(text) and text.lower() not in _RESERVED:
        return text
    return '"' + _ESCAPED.sub(lambda found: _escape(found[0]), text) + '"'


def _escape(character: str) -> str:
    short = {'"': '\\"', '\\': '\\\\', '\n': '\\n', '\t': '\\t'}
    code = ord(character)
    return short.get(character) or (f'\\u{code:04x}' if code < 0x10000 else f'\\U{code:08x}')
