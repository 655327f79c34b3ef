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
Compare several drives of the same motion by the poses at which they ended.

The comparison shows the accuracy and the repeatability of the end pose.

Tested by test/commands/test_compare.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, combinations
import math
from pathlib import Path
from statistics import fmean, stdev
from typing import Any, NamedTuple, TYPE_CHECKING

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.files.document import UnreadableFileError
from kachaka_simple_control.files.report_file import (
    FORMAT,
    read_json,
    recorded_motion,
    RecordedMotion,
)
from kachaka_simple_control.motion.geometry import Point
from kachaka_simple_control.report.map_plot import add_map, draw_legend, MAP_BOTTOM, MAP_LEFT
from kachaka_simple_control.report.output_file import save_figure
from kachaka_simple_control.report.plot_style import Colour, draw_figure, draw_line, LOOKS
from kachaka_simple_control.report.text_tables import Column, columns, Row
from kachaka_simple_control.text import escaped, format_fixed, pluralize

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: The largest difference between the planned ends of drives of the same motion [m, rad].
MAX_END_DIFFERENCE = 1e-6
#: The colours of the drives in the plot.  If there are more drives, all have one colour.
COLOURS = (Colour.ORANGE, Colour.BLUE, Colour.GREEN, Colour.PURPLE)
#: The height of a legend line [inch], and the number of lines that fit without extra height.
LEGEND_LINE, LEGEND_LINES = 0.19, 3
HEAD = (Column('drive'), Column('x', '[mm]'), Column('y', '[mm]'), Column('heading', '[deg]'),
        Column('away', '[mm]'), Column('late'))


class End(NamedTuple):
    """
    The pose of the robot at the end of a motion, or the difference of two such poses.

    :param heading: the heading relative to the start pose [rad], positive to the left
    """

    x: float
    y: float
    heading: float


@dataclass(frozen=True)
class DriveEnd:
    """
    How a drive ended, according to its report.

    :param name: the directory of the report, as text
    :param motions: the names of the motions that the robot drove, in order
    :param planned: the planned end pose
    :param error: the end pose from odometry minus the planned end pose
    :param paths: two paths as lists of points [m], with the keys ``planned`` and ``odometry``
    :param began: the time at which the drive began, as text; None if the report has none
    :param title: the title of the report; None if it has none
    :param motion_file: None if no file named the motion
    """

    name: str
    motions: tuple[str, ...]
    planned: End
    error: End
    late: int
    paths: dict[str, list[Point]]
    began: str | None
    title: str | None
    motion_file: RecordedMotion | None = None

    def is_copy_of(self, other: DriveEnd) -> bool:
        """Return whether two reports are of the same drive."""
        return self.began is not None and (
            self.began, self.title, self.error) == (other.began, other.title, other.error)


@dataclass(frozen=True)
class Spread:
    """
    The accuracy and the repeatability of the end poses of several drives of one motion.

    :param mean: the mean error; an error is an end pose from odometry minus the planned end pose
    :param worst_distance: the largest distance of an end position from the mean end position [m]
    :param worst_angle: the largest difference of an end heading from the mean end heading [rad]
    """

    mean: End
    deviation: End
    worst_distance: float
    worst_angle: float


def read_drive(directory: Path) -> DriveEnd:
    """
    Read from a report how a drive ended.

    :raises UsageError: if there is no valid report, if the drive was not completed, or if the
        report has no end pose from odometry
    """
    name = escaped(str(directory), 60)
    try:
        data = read_json(directory / 'run.json')
    except UnreadableFileError as error:
        raise UsageError(
            f'{name}: no report is here: run.json: {error.problems[0].text}') from None
    if isinstance(data, dict) and 'fleet' in data:
        raise UsageError(
            f'{name}: this is the report of a fleet, and only drives of one robot are compared')
    if not isinstance(data, dict) or data.get('format') != FORMAT or 'path' not in data:
        raise UsageError(
            f'{name}: run.json is not that of a report of this version; drive once more')
    try:
        return _drive_end(name, data)
    except (ArithmeticError, AttributeError, KeyError, TypeError, UnreadableFileError, ValueError):
        raise UsageError(f'{name}: run.json is not that of a report; it was edited') from None


def _drive_end(name: str, data: dict[str, Any]) -> DriveEnd:
    """
    Return the end pose and the paths of a drive from the data in its report.

    :raises UsageError: if the drive was not completed, or the report has no end pose from odometry
    """
    if data['verdict']['ending'] != 'done':
        raise UsageError(
            f"{name}: the drive was not completed: {escaped(str(data['verdict']['headline']))}")
    planned, seen = (_end(data['end'][which]) for which in ('planned', 'odometry'))
    if planned is None or seen is None:
        raise UsageError(f'{name}: odometry does not show where the drive ended')
    x, y, heading = (there - wanted for there, wanted in zip(seen, planned))
    error, timing = End(x, y, math.remainder(heading, math.tau)), data['timing']
    paths = {str(line): [(_finite(x), _finite(y)) for x, y in points]
             for line, points in data['path'].items()}
    if not (paths['planned'] and paths['odometry']):
        raise ValueError('a path is empty')
    return DriveEnd(name, tuple(str(motion['name']) for motion in data['motions']), planned,
                    error, int(timing['late']) + int(timing['lost']), paths, data.get('began'),
                    data.get('title'), recorded_motion(data))


def _finite(value: object) -> float:
    """
    Check a number that was read from a file, and return it as a float.

    :raises TypeError: if the value is not a number
    :raises ValueError: if the number is infinite or NaN
    """
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise TypeError(value)
    if not math.isfinite(value):
        raise ValueError(value)
    return float(value)


def _end(values: dict[str, Any] | None) -> End | None:
    if values is None or None in values.values():
        return None
    return End(*(_finite(values[key]) for key in ('x_m', 'y_m', 'heading_rad')))


def require_same(drives: Sequence[DriveEnd]) -> None:
    """
    Check that there are at least two drives, all different, and all of the same motion.

    :param drives: the ends of the drives
    :raises UsageError: if there are fewer than two drives, if two reports are of the same drive,
        or if the motions differ: their names, planned end poses, or what their files say
    """
    if len(drives) < 2:
        raise UsageError('two drives or more can be compared; name their reports')
    for one, other in combinations(drives, 2):
        if one.is_copy_of(other):
            raise UsageError(f'{one.name} and {other.name} are reports of the same drive, which '
                             'is always like itself')
    first = drives[0]
    for other in drives[1:]:
        difference = None if first.motion_file is None or other.motion_file is None else (
            first.motion_file.difference(other.motion_file))
        if other.motions != first.motions or difference is not None or any(
                abs(one - two) > MAX_END_DIFFERENCE
                for one, two in zip(first.planned, other.planned)):
            why = f': {escaped(difference)}' if difference else ''
            raise UsageError(f'{first.name} and {other.name} are drives of different motions{why}')


def spread(drives: Sequence[DriveEnd]) -> Spread:
    """
    Return the accuracy and the repeatability of the end poses of several drives.

    :param drives: the ends of two or more drives of the same motion
    """
    errors = [drive.error for drive in drives]
    mean, deviation = End(*map(fmean, zip(*errors))), End(*map(stdev, zip(*errors)))
    return Spread(
        mean, deviation,
        max(math.hypot(error.x - mean.x, error.y - mean.y) for error in errors),
        max(abs(error.heading - mean.heading) for error in errors))


def comparison_table(drives: Sequence[DriveEnd], widest: int) -> str:
    """
    Return a text table of the end pose errors of several drives.

    The table has a row for each drive, and rows for the mean and the standard deviation.  Two
    sentences below the table give the accuracy and the repeatability.

    :param drives: the ends of two or more drives of the same motion
    :param widest: the largest width of the table [columns]
    """
    found = spread(drives)
    rows = [*((drive.name, *_row(drive.error), str(drive.late)) for drive in drives),
            ('mean', *_row(found.mean), ''), ('standard deviation', *_row(found.deviation), '')]
    name, *others = drives[0].motions
    what = pluralize(len(others) + 1, 'motion') if others else escaped(name)
    return '\n'.join([
        f'{pluralize(len(drives), "drive")} of {what}: where they ended, from where they were to',
        '', *columns(HEAD, rows, widest, totals=2), '',
        (f'Accuracy: the mean end is {_length(math.hypot(*found.mean[:2]))} and '
         f'{_angle(abs(found.mean.heading))} away.'),
        (f'Repeatability: single ends are up to {_length(found.worst_distance)} and '
         f'{_angle(found.worst_angle)} from the mean.')])


def _row(error: End) -> Row:
    away = math.hypot(error.x, error.y)
    return (format_fixed(1e3 * error.x, 1), format_fixed(1e3 * error.y, 1),
            format_fixed(math.degrees(error.heading), 2), format_fixed(1e3 * away, 1))


def _length(value: float) -> str:
    return f'{format_fixed(1e3 * value, 1)} mm'


def _angle(value: float) -> str:
    return f'{format_fixed(math.degrees(value), 2)} degrees'


def save_comparison(drives: Sequence[DriveEnd], path: Path) -> None:
    """
    Save a plot of the odometry paths of several drives, with the planned path for comparison.

    :param drives: the ends and the paths of two or more drives of the same motion
    :param path: the path of the image file, as checked by ``check_plot_file``
    :raises UsageError: if matplotlib is missing, or the file cannot be written
    """
    save_figure(draw_figure(lambda figure: _draw(figure, drives)), path)


def _draw(figure: Figure, drives: Sequence[DriveEnd]) -> None:
    planned = drives[0].paths['planned']
    are_named = len(drives) <= len(COLOURS)
    colours = COLOURS if are_named else (Colour.ORANGE,) * len(drives)
    bottom = MAP_BOTTOM + LEGEND_LINE * max(0, 1 + len(drives) - LEGEND_LINES) * are_named
    axes, _ = add_map(
        figure, chain(planned, *(drive.paths['odometry'] for drive in drives)), bottom)
    draw_line(axes, planned, **LOOKS['planned'], label='planned', gid='planned')
    look = {**LOOKS['odometry'], 'linestyle': '-', 'linewidth': 1.2 if are_named else 0.8}
    for number, (drive, colour) in enumerate(zip(drives, colours)):
        points = drive.paths['odometry']
        name = drive.name if are_named else None if number else 'odometry'
        draw_line(axes, points, **{**look, 'color': colour}, label=name, gid='odometry')
        axes.plot(*points[-1], linestyle='', marker='o', markersize=3.0, color=colour, zorder=5.0)
    draw_legend(figure, MAP_LEFT, 1 if are_named else 2)
