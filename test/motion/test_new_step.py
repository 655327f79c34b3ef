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
A kind of step that only these tests know is planned, read, drawn, listed, driven and reported.

It is one class; nothing else in the package is changed for it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
import json
import math

from kachaka_simple_control.analysis.plan_view import PlanView
from kachaka_simple_control.analysis.summary import Summary
from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.document import MotionFileError
from kachaka_simple_control.files.motion_reader import loads
from kachaka_simple_control.files.motion_schema import motion_schema
from kachaka_simple_control.files.motion_writer import dump
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.motion.geometry import Displacement
from kachaka_simple_control.motion.path_segment import PathSegment
from kachaka_simple_control.motion.plan import find_errors, plan
from kachaka_simple_control.motion.step_base import in_file, KINDS
from kachaka_simple_control.motion.steps import Forward, Motion, Repeat, Step, Wait
from kachaka_simple_control.motion.units import format_number, LENGTH, POSITIVE_LINEAR_VELOCITY
from kachaka_simple_control.report.report_program import write_report
from kachaka_simple_control.report.text_tables import drive_table
import pytest
from simulated_drive import SimulatedDrive


@dataclass(frozen=True)
class LaneChange(Step):
    """
    Change the lane by two arcs, each from rest to rest.

    :param offset: how far to the left it ends [m], not zero, negative to the right
    :param length: how far ahead it ends [m], above zero
    :param speed: the largest velocity along the path [m/s]
    """

    form = 'offset and length, as in {offset: 0.3 m, length: 1 m}'
    offset: float = field(metadata=in_file(
        LENGTH, 'How far to the left it ends; negative is to the right.', '0.3 m', '-30 cm'))
    length: float = field(metadata=in_file(LENGTH, 'How far ahead it ends.', '1 m'))
    speed: float | None = field(default=None, metadata=in_file(
        POSITIVE_LINEAR_VELOCITY, 'Drive no faster than this.', '0.1 m/s'))

    def path(self) -> tuple[PathSegment, ...]:
        """Return the arc out of the lane and the arc into the other one."""
        radius = (self.length ** 2 + self.offset ** 2) / (4.0 * self.offset)
        arc = abs(radius) * 2.0 * math.atan2(abs(self.offset), self.length)
        return PathSegment(arc, 1.0, 1.0 / radius), PathSegment(arc, 1.0, -1.0 / radius)

    def describe(self) -> str:
        """Return where it ends."""
        return f'lane {format_number(self.offset)} m, {format_number(self.length)} m'


# It must not exist in other tests.
del KINDS[LaneChange.keyword]


@pytest.fixture(autouse=True)
def known(monkeypatch):
    """Make it a kind of step, as defining it does, for one test."""
    monkeypatch.setitem(KINDS, LaneChange.keyword, LaneChange)


STEP = LaneChange(0.3, 1.0)
MOTION = Motion('overtake', (Forward(0.2), STEP, Wait(0.5), Repeat(2, (LaneChange(-0.15, 0.8),))))
PLAN = plan(MOTION, KACHAKA.limits, 20.0)
TEXT = """\
name: overtake
steps:
  - forward: 0.2 m
  - lanechange: {offset: 0.3 m, length: 1.0 m}
  - wait: 0.5 s
  - repeat:
      times: 2
      steps:
        - lanechange: {offset: -0.15 m, length: 0.8 m}
"""


def test_it_is_planned_to_end_in_the_other_lane():
    lane, end = PLAN.steps[1], PLAN.pose
    assert (lane.pose.x, lane.pose.y, lane.pose.theta) == pytest.approx((1.2, 0.3, 0.0))
    assert (end.x, end.y, end.theta) == pytest.approx((2.8, 0.0, 0.0), abs=1e-12)
    assert [step.path for step in PLAN.steps] == [
        'steps[0]', 'steps[1]', 'steps[2]', *['steps[3].repeat.steps[0]'] * 2]
    assert lane.length == pytest.approx(STEP.displacement.distance)
    predicted = PLAN.path()[-1]
    assert (predicted.x, predicted.y) == pytest.approx((end.x, end.y), abs=1e-9)


def test_what_a_robot_cannot_do_names_its_fields():
    errors = find_errors(
        Motion('bad', (LaneChange(0.3, 1.0, 5.0), LaneChange(1.0, 1e6))), KACHAKA.limits)
    assert [str(error) for error in errors] == [
        'steps[0].lanechange.speed: 5.0 m/s is above the limit of 0.3 m/s',
        ('steps[1].lanechange.length: 1000000.0 m takes 3333333.333 s; a motion may take 86400 s '
         'at most')]
    with pytest.raises(InvalidMotionError, match='offset is nan m; it must be a finite number'):
        LaneChange(math.nan, 1.0)


def test_a_plot_shows_it():
    pytest.importorskip('matplotlib', reason='needs matplotlib')
    from kachaka_simple_control.report.plan_plot import draw_plans
    figure = draw_plans([PlanView('overtake', 'kachaka', PLAN, KACHAKA.limits, KACHAKA.footprint)])
    line, = figure.findobj(lambda artist: artist.get_gid() == 'path')
    points = list(zip(*line.get_data()))
    assert min(math.dist(point, (0.7, 0.15)) for point in points) < 1e-9
    assert max(y for _, y in points) == pytest.approx(0.3)


def test_it_is_read_from_a_file_and_written_to_one():
    pytest.importorskip('yaml', reason='needs PyYAML')
    pytest.importorskip('jsonschema', reason='needs jsonschema')
    assert loads(TEXT).motion == MOTION
    assert dump(MOTION) == TEXT
    assert loads(TEXT).where('steps[1].lanechange.offset').endswith(':4')


@pytest.mark.parametrize('step, line', [
    ('lanechagne: {offset: 1 m, length: 1 m}',
     "step 1: lanechagne: there is no such step; did you mean 'lanechange'?"),
    ('lanechange: {offset: 1 m}',
     ("step 1: lanechange: 'length' is missing: a length, as in 0.5 m (in m, cm or mm)")),
    ('lanechange: 1 m',
     ("step 1: lanechange: '1 m'; it must be offset and length, as in "
      '{offset: 0.3 m, length: 1 m}')),
    ('lanechange: {offset: 1 s, length: 1 m}',
     "step 1: lanechange.offset: '1 s'; it must be a length, as in 0.5 m (in m, cm or mm)"),
])
def test_errors_of_a_file_name_its_fields(step, line):
    pytest.importorskip('yaml', reason='needs PyYAML')
    pytest.importorskip('jsonschema', reason='needs jsonschema')
    with pytest.raises(MotionFileError) as caught:
        loads(f'steps:\n  - {step}\n', 'bad.yaml')
    assert str(caught.value) == f'bad.yaml:2: {line}'


def test_it_is_in_the_schema_for_editors():
    part = motion_schema()['definitions']['step']['properties']['lanechange']
    assert part['description'] == 'Change the lane by two arcs, each from rest to rest.'
    assert part['required'] == ['offset', 'length']
    assert part['examples'] == [{'offset': '0.3 m', 'length': '1 m', 'speed': '0.1 m/s'}]


@pytest.mark.slow
@pytest.mark.needs('jinja2')
def test_it_is_driven_and_reported(tmp_path):
    drive = SimulatedDrive(20.0)
    drive.drive(MOTION)
    record = drive.close()
    summary = Summary(record)
    step = summary.steps[1]
    assert step.requested == STEP.displacement
    assert step.requested == Displacement(pytest.approx(1.0303, abs=0.03), pytest.approx(0.0))
    assert step.sent.distance == pytest.approx(step.requested.distance, abs=0.002)
    # The simulated robot drives 1.5 % too slow.
    assert step.odometry.distance == pytest.approx(0.985 * step.requested.distance, abs=0.005)
    assert 'lane 0.3 m, 1 m' in drive_table(record, 0.1)
    write_report(record, tmp_path, None)
    page = (tmp_path / 'report.html').read_text().replace('\N{NO-BREAK SPACE}', ' ')
    assert 'lane 0.3 m, 1 m' in page
    data = json.loads((tmp_path / 'run.json').read_text())
    assert [entry['step'] for entry in data['steps']] == [step.describe_fully() for step in (
        MOTION.steps[0], STEP, MOTION.steps[2], *MOTION.steps[3].steps * 2)]
