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
"""Make the HTML page of a fleet's report from the template ``templates/fleet.html.j2``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import math
from typing import NamedTuple

from kachaka_simple_control.analysis.fleet_summary import FleetSummary, RobotSummary
from kachaka_simple_control.analysis.summary import OutcomeKind
from kachaka_simple_control.motion.geometry import Displacement
from kachaka_simple_control.motion.units import format_number
from kachaka_simple_control.report.html_page import (
    ends_of,
    render_template,
    SIGNS,
    UNKNOWN,
)
from kachaka_simple_control.report.json_export import start_datetime
from kachaka_simple_control.text import format_fixed

#: The texts of the two ways to react to a fault.
STOP_ALL, GO_ON = 'all are stopped', 'the others go on'


class RobotRow(NamedTuple):
    """
    A robot in the table of the page.

    :param result: how its drive ended, in a word or two
    :param why: why it ended early; empty if it did not
    :param error: of its end pose by odometry, from the planned one; None if unknown, or cut short
    :param late: the 99th percentile of its lateness [ms], as text
    :param pause: its longest pause [s], as text
    """

    name: str
    motion: str
    result: str
    why: str
    is_done: bool
    error: Displacement | None
    late: str
    pause: str


def render_fleet_page(
        fleet: FleetSummary, plots: Mapping[str, str], no_plots: str | None,
        recording: str | None) -> str:
    """
    Return the report of a fleet's drive as the text of an HTML page.

    :param plots: the plots as SVG elements, by name
    :param no_plots: why there are none; None if there are
    :param recording: why the recording is missing or incomplete; None if it is complete
    :raises UsageError: if Jinja2 is missing
    """
    outcome, robots = fleet.outcome, fleet.robots
    begun = min((robot for robot in robots if not math.isnan(robot.aligned.start_time)),
                default=None, key=lambda robot: robot.aligned.start_time)
    began = None if begun is None else start_datetime(begun)
    sessions = [robot.log.session_started for robot in robots]
    return render_template(
        'fleet.html.j2', fleet=fleet, started=fleet.started, outcome=outcome,
        kind=outcome.kind.value.replace(' ', '-'), sign=SIGNS[outcome.kind],
        began=began and began.astimezone().isoformat(' ', 'seconds'), is_driven=begun is not None,
        rows=[_row(robot) for robot in robots], places=[*_places(robots)],
        done=sum(robot.outcome.kind is OutcomeKind.DONE for robot in robots),
        command=next((session.command for session in sessions if session is not None), ''),
        settings=_common([{} if session is None else session.settings for session in sessions]),
        versions=_common([{} if session is None else session.versions for session in sessions]),
        on_fault=GO_ON if fleet.started.goes_on else STOP_ALL, worst=fleet.worst_lateness,
        holds=ends_of(sorted(
            ((robot.member.name, hold) for robot in robots for hold in robot.holds),
            key=lambda held: held[1].begin)),
        plots=plots, no_plots=no_plots, recording=recording)


def _row(robot: RobotSummary) -> RobotRow:
    outcome, late = robot.outcome, robot.lateness
    is_done = outcome.kind is OutcomeKind.DONE
    return RobotRow(
        robot.member.name, robot.member.motion, outcome.headline,
        '' if is_done else outcome.reason, is_done, robot.error_from_plan,
        UNKNOWN if late is None else format_fixed(1e3 * late.p99, 2),
        format_fixed(robot.longest_pause, 2) if robot.aligned.sent else UNKNOWN)


def _places(robots: list[RobotSummary]) -> Iterator[tuple[str, ...]]:
    """Yield for each robot: name, start x, y [m] and heading [deg], kind, topics."""
    for robot in robots:
        start, session = robot.member.start, robot.log.session_started
        topics = (UNKNOWN,) * 3 if session is None else (
            session.robot, session.velocity_topic, session.odometry_topic or 'no odometry')
        yield (robot.member.name, format_fixed(start.x, 3), format_fixed(start.y, 3),
               format_number(round(math.degrees(start.theta), 2)), *topics)


def _common(values: list[Mapping[str, object]]) -> dict[str, object]:
    """Return the values that all robots share."""
    return {name: value for name, value in values[0].items()
            if all(name in other and other[name] == value for other in values)
            } if values else {}
