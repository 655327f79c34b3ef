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
"""Read and write motions as YAML."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
import math
import os
from pathlib import PurePath
import re
from types import MappingProxyType

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.diagnostics import (
    KeyPath,
    location,
    MotionFileError,
    parse_path,
    Problem,
    UnreadableFileError,
)
from kachaka_simple_control.files.quantities import (
    add_error,
    LIMITS,
    read_quantities,
    read_quantity,
)
from kachaka_simple_control.files.schema import check
from kachaka_simple_control.files.yaml_document import (
    Document,
    Node,
    parse_yaml,
    read_text,
    require_text,
)
from kachaka_simple_control.motion.limits import Limits, UNITS
from kachaka_simple_control.motion.planner import find_errors, MAX_STEPS
from kachaka_simple_control.motion.steps import (
    Arc,
    Forward,
    Motion,
    Move,
    Repeat,
    Step,
    Turn,
    Wait,
)
from kachaka_simple_control.motion.units import (
    ANGLE,
    ANGULAR_VELOCITY,
    FREQUENCY,
    LENGTH,
    LINEAR_VELOCITY,
    POSITIVE_ANGULAR_VELOCITY,
    POSITIVE_LINEAR_VELOCITY,
    Quantity,
    TIME,
)


@dataclass(frozen=True)
class MotionFile:
    """
    A motion, and what else its file says.

    :param motion: what to do
    :param source: the file it is from
    :param robot: the robot it is made for, a name or the path of a profile; None if for any
    :param limits: limits to plan it with, in SI units, by the names that
        :class:`~kachaka_simple_control.motion.limits.Limits` has for them
    :param rate: how often to send a velocity [Hz]; None if the file leaves it open
    :param root: what is in the file, with its lines
    """

    motion: Motion
    source: str
    robot: str | None = None
    limits: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}), hash=False)
    rate: float | None = None
    root: Node | None = field(default=None, repr=False, compare=False)

    def where(self, path: str) -> str:
        """
        Return where something in the motion is written down.

        :param path: which, as in ``steps[2].turn.speed``
        :returns: file and line, as in ``square.yaml:7``
        """
        return location(self.source, self._line(path))

    def check(self, limits: Limits, robot: str = 'the robot') -> Limits:
        """
        Hold the motion against a robot.

        :param limits: what the robot can do
        :param robot: what errors call it
        :returns: the limits to plan with: the file's own where it has some, else the robot's
        :raises MotionFileError: if the robot cannot do it, with a line for each step in the way
        """
        tightened = self.tighten(limits, robot)
        errors = find_errors(self.motion, tightened)
        if errors:
            raise self.located(errors, robot)
        return tightened

    def tighten(self, limits: Limits, robot: str = 'the robot') -> Limits:
        """
        Return a robot's limits with those of the file, which are lower, in their places.

        :param limits: what the robot can do
        :param robot: what errors call it
        :returns: the limits to plan with
        :raises MotionFileError: if the file allows more than the robot can do
        """
        bounds = {name: _bound(limits, name) for name in self.limits}
        errors = [
            InvalidMotionError(
                f'{self.limits[name]} {UNITS[name]} is above the limit of {bound} {UNITS[name]}',
                f'limits.{name}')
            for name, bound in bounds.items() if self.limits[name] > bound]
        if errors:
            raise MotionFileError(self.source, [self._problem(e, f"{robot}'s") for e in errors])
        tightened = replace(limits, **self.limits)
        if limits.max_backward_velocity is None or 'max_backward_velocity' in self.limits:
            return tightened
        # Whoever slows the robot down does not expect it to be faster backwards.
        return replace(tightened, max_backward_velocity=min(
            limits.max_backward_velocity, self.limits.get('max_linear_velocity', math.inf)))

    def located(
            self, errors: Iterable[InvalidMotionError], robot: str = 'the robot'
            ) -> MotionFileError:
        """
        Return errors of planning as errors of the file.

        :param errors: what ``find_errors()`` found, with paths such as ``steps[2].turn.speed``
        :param robot: what the line calls the robot whose limits are meant
        :returns: an error with a line for each
        """
        # With limits in the file it may be one of these that is meant.
        whose = 'the' if self.limits else f"{robot}'s"
        return MotionFileError(self.source, [self._problem(error, whose) for error in errors])

    def _problem(self, error: InvalidMotionError, whose: str) -> Problem:
        path = error.path or ''
        text = error.message.removeprefix(f'{path.rpartition(".")[2]} is ')
        text = text.replace('the limit of', f'{whose} limit of')
        text = text.replace("the robot's limit", f'{whose} limit')
        return Problem(text, self._line(path), path)

    def _line(self, path: str) -> int | None:
        return self.root.at(parse_path(path)).line if self.root and path else None


def _bound(limits: Limits, name: str) -> float:
    # Limits has properties without max_ for those that may be None: what stands for them.
    bound: float = getattr(limits, name.removeprefix('max_'), getattr(limits, name))
    return bound


#: A step that has no steps in it.
Simple = Move | Forward | Turn | Arc | Wait


@dataclass(frozen=True)
class Kind:
    """
    A kind of step.

    :param make: its class
    :param quantities: its fields, in the order of the class, and what each is
    :param has_short_form: whether its first field alone may stand for it, as in ``wait: 2 s``
    """

    make: type[Simple]
    quantities: dict[str, Quantity]
    has_short_form: bool = False

    @property
    def first(self) -> str:
        """Return the name of the first field."""
        return next(iter(self.quantities))


#: By the word that stands for them in a file; ``repeat``, which has steps in it, is apart.
KINDS = {
    'move': Kind(Move, {
        'linear_x': LINEAR_VELOCITY, 'angular_z': ANGULAR_VELOCITY, 'duration': TIME}),
    'forward': Kind(Forward, {'distance': LENGTH, 'speed': POSITIVE_LINEAR_VELOCITY},
    has_short_form=True),
    'turn': Kind(Turn, {'angle': ANGLE, 'speed': POSITIVE_ANGULAR_VELOCITY}, has_short_form=True),
    'arc': Kind(Arc, {'radius': LENGTH, 'angle': ANGLE, 'speed': POSITIVE_LINEAR_VELOCITY}),
    'wait': Kind(Wait, {'duration': TIME}, has_short_form=True),
}
REPEAT = 'repeat'


def read_steps(document: Document, way: KeyPath) -> tuple[Step, ...]:
    """
    Return the steps of a list; object to those that are none, and leave them out.

    :param document: what is in the file, held against the schema already
    :param way: the way to the list
    :returns: the steps
    """
    nodes = document.root.on_the_way(way)
    if len(nodes) <= len(way) or not isinstance(nodes[-1].data, list):
        return ()
    steps = (_read_step(document, [*way, index]) for index in range(len(nodes[-1].data)))
    return tuple(step for step in steps if step is not None)


def count(steps: Iterable[Step]) -> int:
    """
    Return how many steps there are to do, each repeat counted as one more.

    :param steps: the steps
    :returns: the number, without doing any
    """
    return sum(
        1 + step.times * count(step.steps) if isinstance(step, Repeat) else 1 for step in steps)


def _read_step(document: Document, way: KeyPath) -> Step | None:
    node = document.root.at(way)
    word = next(iter(node.children), None) if isinstance(node.data, dict) else None
    way = [*way, str(word)]
    if word == REPEAT:
        return _read_repeat(document, way)
    return None if node.has_problem else _read_simple(document, way, KINDS[str(word)])


def _read_simple(document: Document, way: KeyPath, kind: Kind) -> Step | None:
    node = document.root.at(way)
    if isinstance(node.data, dict):
        numbers = read_quantities(document, way, kind.quantities)
    else:
        number = read_quantity(document, way, kind.quantities[kind.first])
        numbers = {} if number is None else {kind.first: number}
    return None if node.has_problem else _make(document, way, kind, numbers)


def _make(
        document: Document, way: KeyPath, kind: Kind, numbers: dict[str, float]) -> Step | None:
    try:
        return kind.make(**numbers)
    except InvalidMotionError as error:
        add_error(document, way, error)
        return None


def _read_repeat(document: Document, way: KeyPath) -> Step | None:
    node = document.root.at(way)
    steps = read_steps(document, [*way, 'steps'])
    if node.has_problem:
        return None
    try:
        return Repeat(int(node.data['times']), steps)
    except InvalidMotionError as error:
        add_error(document, way, error)
        return None


SCHEMA = 'motions/motion.schema.json'


def load(path: str | os.PathLike[str]) -> MotionFile:
    """
    Read a motion from a file.

    :param path: where the file is
    :returns: what is in it
    :raises MotionFileError: if it cannot be read, with a line for each thing that is wrong
    """
    source = os.fspath(path)
    try:
        text = read_text(source)
    except UnreadableFileError as error:
        raise MotionFileError(source, error.problems) from None
    return loads(text, source)


def loads(text: str, name: str = 'motion') -> MotionFile:
    """
    Read a motion from a text.

    :param text: what is in a file
    :param name: what errors call the file; a motion without a name of its own has its last part
    :returns: what is in it
    :raises MotionFileError: if it is no motion, with a line for each thing that is wrong
    """
    try:
        document = read_document(text, SCHEMA)
        file = _read(document, name)
    except UnreadableFileError as error:
        raise MotionFileError(name, error.problems) from None
    return file


def read_document(text: str, schema: str) -> Document:
    """
    Read YAML, and hold it against a schema.

    :param text: what is in a file
    :param schema: the schema's path in this package
    :returns: what is in the file, and what is wrong with it
    :raises UnreadableFileError: if it cannot be read at all
    """
    document = parse_yaml(require_text(text))
    check(document, schema)
    return document


def _read(document: Document, source: str) -> MotionFile:
    data = document.root.data if isinstance(document.root.data, dict) else {}
    steps = read_steps(document, ['steps'])
    limits = read_quantities(document, ['limits'], LIMITS)
    rate = read_quantities(document, [], {'rate': FREQUENCY}).get('rate')
    if count(steps) > MAX_STEPS:
        document.add_problem(
            ['steps'], f'{count(steps)} steps, with all repeats; at most {MAX_STEPS} are read')
    if document.problems:
        raise UnreadableFileError(*document.problems)
    return MotionFile(
        motion=Motion(
            data.get('name', PurePath(source).stem), steps, data.get('description', '')),
        source=source, robot=data.get('robot'), limits=MappingProxyType(limits), rate=rate,
        root=document.root)


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
