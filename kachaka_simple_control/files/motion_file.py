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
"""Read and write motions as YAML files, and make the JSON Schema of these files."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
import inspect
import math
import os
from pathlib import PurePath
import re
from types import MappingProxyType
from typing import Any

from kachaka_simple_control.errors import InvalidMotionError, LimitError
from kachaka_simple_control.files.document import (
    Document,
    is_path,
    KeyPath,
    MotionFileError,
    Node,
    parse_path,
    Problem,
    read_schema,
    Schema,
    UnreadableFileError,
)
from kachaka_simple_control.files.robot_profile import Laser, RobotProfile
from kachaka_simple_control.files.watch_check import watch_errors
from kachaka_simple_control.files.yaml_document import read_document, read_text
from kachaka_simple_control.motion.drive_order import DriveOrder
from kachaka_simple_control.motion.limits import CLOSED_LOOP_SHARE, LIMIT_QUANTITIES, Limits
from kachaka_simple_control.motion.plan import find_errors, MAX_STEPS
from kachaka_simple_control.motion.step_base import (
    Count,
    FieldKind,
    FileField,
    KINDS,
    PointField,
    PointList,
    Step,
    StepList,
)
from kachaka_simple_control.motion.steps import Motion
from kachaka_simple_control.motion.time_scale import slowed
from kachaka_simple_control.motion.units import (
    FREQUENCY,
    LENGTH,
    Quantity,
    SignRule,
    TOLERANCE,
)

# Imported so that the steps are known.
import kachaka_simple_control.motion.waypoints  # noqa: F401
from kachaka_simple_control.text import location

POINT = PointField()


@dataclass(frozen=True)
class MotionFile:
    """
    A motion and the other contents of the file from which it was read.

    :param robot: the robot that the motion is made for, as a name or as the path of a robot
        profile; None for any robot
    :param limits: the limits given in the file, in SI units; the keys are names of fields of
        :class:`~kachaka_simple_control.motion.limits.Limits`
    :param closed_loop: whether to use odometry to correct the velocities; None if the file does
        not say
    :param watch: whether to hold before obstacles that the laser of the robot sees; None if the
        file does not say
    :param corners: how far the robot may pass the corners between steps [m], as in ``motion``;
        None if the file does not say
    :param root: the values of the file, with their line numbers; None if the motion was not read
        from a YAML text
    :param text: the text of the file; None if the motion was not read from a YAML text
    """

    motion: Motion
    source: str
    robot: str | None = None
    limits: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}), hash=False)
    rate: float | None = None
    closed_loop: bool | None = None
    watch: bool | None = None
    corners: float | None = None
    root: Node | None = field(default=None, repr=False, compare=False)
    text: str | None = field(default=None, repr=False, compare=False)

    def where(self, path: str) -> str:
        """
        Return the place of a value in the file as file name and line, as in ``square.yaml:7``.

        :param path: the keys and list indices that lead to the value, as in
            ``steps[2].turn.speed``
        """
        return location(self.source, self._line(path))

    def check(
            self, limits: Limits, robot: str = 'the robot', closed_loop: bool = False,
            laser: Laser | None = None) -> Limits:
        """
        Check that a robot can drive the motion.

        :param closed_loop: whether odometry will correct the velocities; then the plan can use
            only a part of each limit, because the rest is reserved for the corrections
        :param laser: the laser of the obstacle watch; None without a watch
        :returns: for each limit, the smaller of the robot's value and the value in the file
        :raises MotionFileError: if the robot cannot drive the motion, the file gives a limit above
            that of the robot, or a step cannot be watched; the message has a line for each problem
        """
        tightened = self._tighten(limits)
        # A step may exceed a limit of the file instead of a limit of the robot.
        whose = 'the' if self.limits else f"{robot}'s"
        planned = tightened
        if closed_loop:
            whose, planned = "the closed loop's", tightened.scaled(CLOSED_LOOP_SHARE)
        errors: list[InvalidMotionError] = []
        for name, value in self.limits.items():
            bound, unit = limits.bound(name), LIMIT_QUANTITIES[name].unit
            if value > bound:
                excess = LimitError(value, unit, bound, whose=f"{robot}'s")
                errors.append(excess.at(f'limits.{name}'))
        errors += [error.by(whose) for error in find_errors(self.motion, planned)]
        if laser is not None:
            errors += watch_errors(self.motion, laser, robot)
        if errors:
            raise MotionFileError(self.source, map(self._problem, errors))
        return tightened

    def order(
            self, robot: RobotProfile, rate: float, closed_loop: bool,
            speed: float = 1.0, watch: bool = False) -> DriveOrder:
        """
        Return how a robot drives the motion.

        :param speed: the speed relative to that of the file, from 0.01 to 1: a time scale
        :param watch: whether it is held before obstacles
        :raises MotionFileError: as ``check``
        :raises InvalidMotionError: if the speed is out of range
        :raises UsageError: if the robot has no laser for a watch
        """
        limits = self.check(
            robot.planning_limits, robot.name, closed_loop,
            robot.watching_laser() if watch else None)
        # What a closed loop adds at the end is slowed, too: all robots of a fleet have one scale.
        motion = self.motion.settled() if closed_loop else self.motion
        return DriveOrder.of(
            slowed(motion, speed), robot.planning_limits, rate, limits.slowed(speed), closed_loop)

    def error_at(self, path: str, message: str) -> MotionFileError:
        """Return an error about one value of the file, with the line number of the value."""
        return MotionFileError(self.source, [self._problem(InvalidMotionError(message, path))])

    def _tighten(self, limits: Limits) -> Limits:
        """
        Return for each limit the smaller of the robot's value and the value in the file.

        If the file limits the forward velocity and gives no backward velocity, the file's value
        for the forward velocity also limits the backward velocity.
        """
        own = {name: min(value, limits.bound(name)) for name, value in self.limits.items()}
        if limits.max_backward_velocity is not None:
            # A lower forward limit also limits the backward velocity.
            own.setdefault('max_backward_velocity', min(
                limits.max_backward_velocity, own.get('max_linear_velocity', math.inf)))
        return replace(limits, **own)

    def _problem(self, error: InvalidMotionError) -> Problem:
        path = error.path or ''
        return Problem(error.message, self._line(path), path)

    def _line(self, path: str) -> int | None:
        return self.root.at(parse_path(path)).line if self.root and path else None


def read_steps(document: Document, path: KeyPath) -> tuple[Step, ...]:
    """
    Read a list of steps from a file, and return the valid steps.

    Invalid steps are left out, and their problems are recorded in ``document``.

    :param document: the values of the file, already checked against the JSON Schema of a motion
    """
    nodes = document.root.along(path)
    if len(nodes) <= len(path) or not isinstance(nodes[-1].data, list):
        return ()
    steps = (_read_step(document, [*path, index]) for index in range(len(nodes[-1].data)))
    return tuple(step for step in steps if step is not None)


def _read_step(document: Document, path: KeyPath) -> Step | None:
    word = str(next(iter(document.root.at(path).children), ''))
    return _read_fields(document, [*path, word], KINDS[word]) if word in KINDS else None


def _read_fields(document: Document, path: KeyPath, kind: type[Step]) -> Step | None:
    step, node = document.root.at(path[:-1]), document.root.at(path)
    parts, is_short = kind.file_fields(), not isinstance(node.data, dict)
    is_good = not step.has_problem
    values: dict[str, Any] = {}
    for name in ([next(iter(parts))] if is_short else parts):
        place = path if is_short else [*path, name]
        if isinstance(parts[name].kind, StepList):
            # Read nested steps even if this step is invalid, to report all their errors.
            values[name] = read_steps(document, place)
        elif is_good and (is_short or name in node.children):
            values[name] = _read_value(document, place, parts[name].kind)
    if step.has_problem:
        return None
    try:
        return kind(**values)
    except InvalidMotionError as error:
        document.add_error(path, error)
        return None


def _read_value(document: Document, path: KeyPath, kind: FieldKind) -> Any:
    """
    Read a value of a step, and return it: a number, a point or a list of points.

    If the value is invalid, record a problem; the returned value is then of no use.
    """
    match kind:
        case Quantity():
            return document.read_quantity(path, kind)
        case PointField():
            return tuple(document.read_quantity([*path, index], LENGTH) for index in range(2))
        case PointList():
            points = range(len(document.root.at(path).data))
            return tuple(_read_value(document, [*path, index], POINT) for index in points)
        case _:
            return int(document.root.at(path).data)


def count(steps: Iterable[Step]) -> int:
    """
    Count the steps of a motion; a step in a loop counts as often as it is driven.

    The loop, a step of the class ``Repeat``, also counts as one step.  For example, a loop that
    drives two steps three times counts as 1 + 3 * 2 = 7 steps.
    """
    blocks = (step.block() for step in steps)
    return sum(1 if block is None else 1 + block[0] * count(block[1]) for block in blocks)


def load(path: str | os.PathLike[str]) -> MotionFile:
    """
    Read a motion from a file.

    :raises MotionFileError: if the file cannot be read or contains no valid motion; the message
        has a line for each problem
    """
    source = os.fspath(path)
    with MotionFileError.naming(source):
        text = read_text(source)
    return loads(text, source)


def loads(text: str, name: str = 'motion') -> MotionFile:
    """
    Read a motion from the text of a YAML file.

    :param name: the file name for error messages.  If the text does not name the motion, the file
        name without its suffix is also the name of the motion
    :raises MotionFileError: if the text is no valid motion; the message has a line for each
        problem
    """
    with MotionFileError.naming(name):
        file = _read(read_document(text, motion_schema()), name)
    return replace(file, text=text)


def _read(document: Document, source: str) -> MotionFile:
    data = document.root.data if isinstance(document.root.data, dict) else {}
    steps = read_steps(document, ['steps'])
    limits = document.read_quantities(['limits'], LIMIT_QUANTITIES)
    numbers = document.read_quantities([], {'rate': FREQUENCY, 'corners': TOLERANCE})
    corners = numbers.get('corners')
    if count(steps) > MAX_STEPS:
        document.add_problem(
            ['steps'], f'{count(steps)} steps, with all repeats; at most {MAX_STEPS} are read')
    if document.problems:
        raise UnreadableFileError(*document.problems)
    motion = Motion(
        data.get('name', PurePath(source).stem), steps, data.get('description', ''),
        0.0 if corners is None else corners)
    return MotionFile(
        motion=motion, source=source, robot=_robot(data.get('robot'), source),
        limits=MappingProxyType(limits), rate=numbers.get('rate'),
        closed_loop=data.get('closed_loop'), watch=data.get('watch'), corners=corners,
        root=document.root)


def _robot(name_or_path: str | None, source: str) -> str | None:
    """
    Return the name of a motion file's robot, or the path of the robot's profile.

    A relative path in the file starts at the folder of the motion file, so the path of this folder
    is put before it.

    :param name_or_path: the robot as written in the motion file; None if it names no robot
    """
    if not name_or_path or not is_path(name_or_path) or PurePath(name_or_path).is_absolute():
        return name_or_path
    # Join as text: PurePath removes a leading ./, and without it the text is a name.
    return f'{PurePath(source).parent}/{PurePath(name_or_path)}'


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


#: The path of the motion schema in the package, for editors; ``tools/write_schemas.py`` writes it.
SCHEMA = 'motions/motion.schema.json'


def motion_schema() -> Schema:
    """Return the JSON Schema of a motion file, with a schema for each kind of step."""
    schema = read_schema(SCHEMA)
    definitions = schema['definitions']
    steps = {word: _step_schema(kind) for word, kind in KINDS.items()}
    return {**schema, 'definitions': {
        **definitions, 'step': {**definitions['step'], 'properties': steps}}}


def _step_schema(kind: type[Step]) -> Schema:
    parts = kind.file_fields()
    first = next(iter(parts.values()))
    example = {name: part.examples[0] for name, part in parts.items()}
    mapping = {
        'required': [item.name for item in fields(kind)  # type: ignore[arg-type]
                     if item.default is not None],
        'additionalProperties': False,
        'properties': {name: _field_schema(part) for name, part in parts.items()}}
    # Under python -OO there are no docstrings, so the schema has no descriptions.
    head: Schema = {'description': (inspect.getdoc(kind) or '').partition('\n')[0]}
    if kind.synonyms:
        head['synonyms'] = list(kind.synonyms)
    if kind.form:
        return {**head, 'expected': kind.form, 'type': 'object', **mapping, 'examples': [example]}
    short = _field_schema(first)
    return {
        **short, **head, 'type': [*short['type'], 'object'],
        'examples': [first.examples[0], example], **mapping}


def _field_schema(part: FileField) -> Schema:
    return {'description': part.description, **_kind_schema(part.kind),
            'examples': list(part.examples)}


def _kind_schema(kind: object) -> Schema:
    match kind:
        case Quantity():
            return quantity_schema(kind)
        case Count():
            return {'expected': 'a whole number', 'type': 'integer', 'minimum': 0,
                    'maximum': kind.largest}
        case PointField():
            return {'expected': 'a point: x and y, as in [1 m, 0.5 m]', 'type': ['array'],
                    'minItems': 2, 'maxItems': 2,
                    'items': {'description': 'x, then y.', **quantity_schema(LENGTH)}}
        case PointList():
            return {'expected': 'a list of points, as in [[1 m, 0 m], [1 m, 1 m]]',
                    'type': ['array'], 'minItems': 1,
                    'items': {'description': 'A point.', **_kind_schema(POINT)}}
        case _:
            return {'expected': "a list of steps, each beginning with '- '", 'type': 'array',
                    'items': {'$ref': '#/definitions/step'}}


def quantity_schema(quantity: Quantity) -> Schema:
    """Return the JSON Schema of a value with a unit, such as ``0.2 m/s``, in a file."""
    bounds: Schema = {
        SignRule.ANY: {}, SignRule.NOT_NEGATIVE: {'minimum': 0},
        SignRule.POSITIVE: {'exclusiveMinimum': 0}}[quantity.sign]
    if math.isfinite(quantity.largest):
        bounds['maximum'] = int(quantity.largest)
    types = ['string'] if quantity.needs_unit else ['number', 'string']
    return {'quantity': quantity.keyword, 'type': types, 'pattern': quantity.pattern, **bounds}
