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
"""The table of pauses and speed factor changes in a report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, TYPE_CHECKING

from kachaka_simple_control.analysis.speed_history import SpeedInterval
from kachaka_simple_control.analysis.summary import Summary
from kachaka_simple_control.control.speed_factor import describe_factors

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: The style of the times at which a robot was paused.
SHADE: dict[str, Any] = {
    'color': '#9a8f7a', 'alpha': 0.22, 'linewidth': 0.0, 'zorder': 0.5, 'gid': 'pause'}


class SpeedRow(NamedTuple):
    """
    A part of a drive with one speed factor.

    :param interval: the part of the drive
    :param number: the number of its step among the steps that began; None if its step did not
    :param begin: the time at which the part began [s after t = 0]
    :param reason: the sources that asked for less speed; empty at full speed
    """

    interval: SpeedInterval
    number: int | None
    begin: float
    reason: str

    @property
    def end(self) -> float:
        """Return the time at which this part ended [s after t = 0]."""
        return self.begin + self.interval.end - self.interval.begin


def speed_rows(summary: Summary) -> Iterator[SpeedRow]:
    """Yield the parts of a drive by speed factor, in order; none if all was at full speed."""
    numbers = {id(step.log.planned): number for number, step in enumerate(summary.steps, 1)}
    for interval in summary.speed:
        yield SpeedRow(
            interval, numbers.get(id(interval.step)), interval.begin - summary.aligned.start_time,
            describe_factors(interval.factors))


def shade_pauses(
        axes: Axes, pauses: Sequence[SpeedInterval], start_time: float, unit: float) -> None:
    """
    Shade the times at which a robot was paused in a plot over time.

    :param start_time: t = 0 of the drive [s on the steady clock]
    :param unit: the unit of the time axis [s]
    """
    for pause in pauses:
        axes.axvspan((pause.begin - start_time) / unit, (pause.end - start_time) / unit, **SHADE)
