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
"""The table that a person sees at the end of a drive."""

from __future__ import annotations

import math

from kachaka_simple_control.report.metrics import boundaries, Displacement, driven, requested, sent
from kachaka_simple_control.report.record import Movement, Record
from kachaka_simple_control.report.step_errors import step_in_words

HEAD = ('movement', 'requested', 'sent', 'odometry')


def table(record: Record, still_after: float | None) -> str:
    """
    Put a record as a table: each movement's displacement as asked, as sent and as driven.

    :param record: what happened
    :param still_after: how long after the stop began odometry saw the robot still [s]; None if
        it did not
    :returns: lines of text, the last two with the stop and the final pose
    """
    cuts = boundaries(record.movements, record.odometry) if record.movements else []
    rows = [HEAD, *(
        _row(movement, driven(record.odometry, begin, end))
        for movement, begin, end in zip(record.movements, cuts, cuts[1:]))]
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEAD))]
    lines = ['  '.join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip()
             for row in rows]
    lines.insert(1, '  '.join('-' * width for width in widths))
    return '\n'.join([*lines, _stop(still_after), _final_pose(record)])


def _row(movement: Movement, seen: Displacement | None) -> tuple[str, ...]:
    return (
        step_in_words(movement.step),
        _amount(requested(movement.step)),
        _amount(sent(movement.sent)),
        'none' if seen is None else _amount(seen))


def _amount(displacement: Displacement) -> str:
    # Adding 0.0 turns -0.0 into 0.0.
    return (f'{round(displacement.distance, 4) + 0.0:7.4f} m '
            f'{round(displacement.angle, 4) + 0.0:7.4f} rad')


def _stop(still_after: float | None) -> str:
    if still_after is None:
        return 'Stop: sent, not confirmed by odometry'
    return f'Stop: confirmed by odometry after {still_after:.2f} s'


def _final_pose(record: Record) -> str:
    if not record.odometry:
        return 'Final pose: unknown, no odometry arrived'
    pose = record.odometry[-1].pose
    return (f'Final pose by odometry: x {pose.x + 0.0:.4f} m, y {pose.y + 0.0:.4f} m, '
            f'heading {math.degrees(pose.theta) + 0.0:.2f} degrees')
