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
"""Over a lossy link stops arrive, and a disconnect stops both ends; and the computations."""

import contextlib
import json
import math
import os
import sys

from benchmarks.lossy_link import disconnects, network, stops
from benchmarks.lossy_link.__main__ import BEGIN, joined, main, PAGE
from benchmarks.lossy_link.fixture import fixture
from benchmarks.lossy_link.observed import evaluate_stop, RobotLog
from benchmarks.lossy_link.tables import BRIEF, find_violations, QUIET, tables
from benchmarks.run import updated
from hypothesis import given
from hypothesis import strategies as st
from program import Program, ROOT
import pytest
from waiting import wait_until

TIMES = st.floats(0.0, 10.0)


@pytest.fixture
def lossy_link():
    """Yield a network with a robot, where this machine can have one."""
    pytest.importorskip('rclpy', reason='needs ROS 2')
    skip_where_impossible()
    with fixture() as made:
        yield made


def skip_where_impossible():
    """Skip the test, with the reason, where no network can be made."""
    if (reason := network.unavailable_reason()) is not None:
        pytest.skip(reason)


def namespaces(pid):
    """Return the namespaces that a process has made."""
    return sorted(network.NAMESPACES.glob(f'{network.PREFIX}-{pid}-*'))


@pytest.mark.ros
@pytest.mark.slow
def test_every_stop_arrives_at_30_percent_loss(lossy_link):
    series = stops.measure_stops(lossy_link, 30, 5)
    assert series['faults'] == []
    assert 0.2 < series['lost'] / (series['lost'] + series['arrived']) < 0.4
    for stop in series['stops']:
        # Of about twenty; fewer than five arrive once in a hundred million stops.
        assert stop['zeros'] >= 5
        assert stop['motions'] == 0
        assert stop['driven'] < 0.03  # the command timeout: 0.3 s at 0.1 m/s


@pytest.mark.ros
@pytest.mark.slow
@pytest.mark.parametrize('case', disconnects.CASES)
def test_a_disconnect_stops_both_ends(lossy_link, case):
    found = disconnects.disconnect_once(lossy_link, case)
    assert found['still'] < 0.35  # the robot's command timeout
    if case == BRIEF:
        assert found['code'] == 0
        return
    assert found['code'] == 1
    (line,) = found['said']
    assert line.startswith('kachaka_simple_control: odometry has been silent for 1.0 s')
    # Silence 1 s, stop and release 2.7 s; what a busy machine needs to end a program is no fault.
    assert found['ended'] < 10.0
    assert found['motions'] == 0
    assert found['moved'] == pytest.approx(0.0, abs=1e-6)
    if case == QUIET:
        assert found['taken'] == 0


def test_a_network_is_removed_after_its_block():
    skip_where_impossible()
    with contextlib.suppress(KeyError), network.Network() as made:
        made.set_loss(30)
        assert made.packet_counts() == (0, 0)
        assert len(namespaces(os.getpid())) == 2
        raise KeyError
    assert namespaces(os.getpid()) == []


def test_leftovers_of_a_killed_run_are_removed_by_the_next():
    skip_where_impossible()
    text = ('import time\nfrom benchmarks.lossy_link.network import Network\n'
            'Network().__enter__()\ntime.sleep(60)\n')
    with Program([sys.executable, '-c', text], cwd=ROOT) as run:
        pid = run.process.pid
        wait_until(lambda: len(namespaces(pid)) == 2 and run, 20.0)
        network.remove_leftovers()
        assert len(namespaces(pid)) == 2  # the process that made them runs
    network.remove_leftovers()
    assert namespaces(pid) == []


def test_a_missing_command_is_named_with_its_package(monkeypatch, capsys):
    monkeypatch.setattr(network, '_path', lambda: '/nowhere')
    assert network.unavailable_reason() == (
        'the command ip is missing: install the package iproute2')
    assert main(['--quick']) == 0
    assert capsys.readouterr().out.startswith('skipped: the command ip is missing')


def test_the_error_says_why_a_network_cannot_be_made(monkeypatch):
    monkeypatch.setattr(network, '_tool', lambda name: '/nowhere/ip')
    with pytest.raises(network.NetworkError, match=r'/nowhere/ip netns add .*No such file'):
        network.Network().__enter__()


def a_log(*velocities, x=0.0):
    """Return the log of a robot that received these at 0, 1, 2 ... s and ended at x."""
    log = RobotLog()
    log.add(['pose', 0.0, 0.0, 0.0, 0.0])
    for sent, velocity in enumerate(velocities):
        log.add(['velocity', float(sent), velocity, 0.0, True])
    log.add(['pose', float(len(velocities)), x, 0.0, 0.0])
    return log


def test_a_stop_is_evaluated_by_what_arrived_after_it():
    found = evaluate_stop(a_log(0.1, 0.1, 0.0, 0.0, x=0.4), 1.5)
    assert found == {
        'zeros': 2, 'first': 0.5, 'motions': 0, 'driven': pytest.approx(0.25)}


@pytest.mark.parametrize('velocities, zeros, motions', [
    ((0.1, 0.1, 0.1), 0, 0),  # no zero came: nothing came after it
    ((0.1, 0.0, 0.1, 0.1), 1, 2),
    ((0.0, 0.1, 0.1, 0.0), 1, 0),  # a zero before the stop does not count
])
def test_motion_counts_after_the_first_zero(velocities, zeros, motions):
    found = evaluate_stop(a_log(*velocities), 0.5)
    assert (found['zeros'], found['motions']) == (zeros, motions)
    assert (found['first'] is None) == (zeros == 0)


@given(TIMES, TIMES, st.floats(-5.0, 5.0))
def test_the_distance_driven_is_the_sum_of_its_parts(one, two, x):
    log = a_log(0.1, 0.1, x=x)
    begin, end = sorted((one, two))
    parts = log.driven(0.0, begin)[0] + log.driven(begin, end)[0] + log.driven(end)[0]
    assert parts == pytest.approx(abs(x), abs=1e-9)


def test_a_robot_without_reports_has_not_moved():
    log = RobotLog()
    assert log.driven(1.0, 2.0) == (0.0, 0.0)
    assert log.at_rest_since(3.0, 4.0) == 3.0
    assert evaluate_stop(log, 0.0)['first'] is None


def test_a_robot_is_at_rest_from_its_last_new_pose_on():
    log = a_log(0.1, 0.1, x=0.2)
    assert log.at_rest_since(1.0, 5.0) == 2.0
    assert log.at_rest_since(1.0, 1.5) == 1.0  # what it did later does not count


def a_stop(**changes):
    return {'zeros': 10, 'first': 0.001, 'motions': 0, 'driven': 1e-4, **changes}


def a_disconnect(**changes):
    return {'case': QUIET, 'still': 0.3, 'turned': 0.1, 'ended': 3.7, 'code': 1, 'motions': 0,
            'moved': 0.0, 'taken': 0, **changes}


def a_run(**changes):
    """Return the data of a small run without violations."""
    run = {'date': '2026-01-01', 'machine': {'cores': '2'}, 'moves': [], 'answers': [],
           'cable': [a_disconnect()], 'stops': [
               {'percent': 30, 'lost': 30, 'arrived': 70, 'stops': [a_stop()], 'faults': []}]}
    return {**run, **changes}


def of_stops(*found):
    return a_run(stops=[{**a_run()['stops'][0], 'stops': [*found]}])


@pytest.mark.parametrize('run, words', [
    (a_run(), []),
    (of_stops(a_stop(), a_stop(zeros=0, first=None)), ['a stop without a zero at 30 % loss']),
    (of_stops(a_stop(motions=1)), ['motion after the first zero of a stop at 30 % loss']),
])
def test_a_violation_is_named(run, words):
    assert find_violations(run) == words


@pytest.mark.parametrize('case, changes, is_violation', [
    (QUIET, {}, False), (QUIET, {'motions': 1}, True), (QUIET, {'taken': 1}, True),
    (QUIET, {'code': 0}, True), ('at once', {'motions': 1}, True),
    ('at once', {'taken': 1}, False), (BRIEF, {'motions': 9, 'code': 0}, False)])
def test_forbidden_consequences_of_a_disconnect_are_violations(case, changes, is_violation):
    assert len(find_violations(a_run(cable=[a_disconnect(case=case, **changes)]))) == is_violation


def test_tables_show_what_never_came():
    run = of_stops(a_stop(zeros=0, first=None))
    run['answers'] = [{'percent': 50, 'once': [None, 0.1], 'repeatedly': [0.3, 0.1]}]
    run['moves'] = [{'percent': 10, 'rate': 50, 'driven': [0.9, 1.02], 'faults': ['x']}]
    text = {table.title: table.rows for table in tables(run)}
    assert text['Stops in mid-motion, all from one process'][0][:6] == (
        '30 %', '30 %', '1', '1', '0 / 0', 'never / never')
    assert text['Until manual control is granted'][0][-3:] == ('never', '1', '1')
    moved = next(rows for title, rows in text.items() if title.startswith('Driven'))
    assert moved[0] == ('10 %', '50', '2', '-4.00', '6.00', '-10.00', '2.00', '1')


def test_parts_are_joined_in_order_of_loss():
    lossy, clean = a_run(), a_run(cable=[])
    clean['stops'] = [{**clean['stops'][0], 'percent': 0}]
    run = joined([lossy, clean])
    assert [one['percent'] for one in run['stops']] == [0, 30]
    assert len(run['cable']) == 1
    assert json.loads(json.dumps(run)) == run
    assert not math.isinf(run['stops'][0]['stops'][0]['first'])


def test_the_page_has_a_measured_part():
    assert 'new' in updated(PAGE.read_text(), 'new', begin=BEGIN)
