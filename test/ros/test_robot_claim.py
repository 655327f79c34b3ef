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
"""A program that drives keeps the robot; newcomers on this machine and others are refused."""

import os
import signal
import time

from kachaka_simple_control.process.processes import is_running
from program import COMMAND, program, script
import pytest
from ros_support import bridge
from waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.distro, pytest.mark.needs('rclpy', 'nav_msgs')]

#: A movement whose speed tells which program sent it.
DRIVE = """
import rclpy
from kachaka_simple_control import KachakaSimpleControl
rclpy.init()
node = KachakaSimpleControl()
node.move_robot({speed}, 0.0, {duration})
"""
#: A script as on another machine: no kernel decides, and the topic is used.
ELSEWHERE = """
from kachaka_simple_control.control.claims import MachineClaim
from kachaka_simple_control.ros import robot_claim
MachineClaim.take = lambda self, *_: (yield from ())
robot_claim.is_localhost_only = lambda: False
"""
#: A program that discovers others only when it is too late.
UNAWARE = """
from kachaka_simple_control.control.claims import Claims
from kachaka_simple_control.ros.foreign_messages import ForeignMessages
robot_claim.CLAIM_DISCOVERY_TIME = robot_claim.CLAIM_SETTLE_TIME = 0.0
Claims.blocking_claim = lambda self, now: None
ForeignMessages.detect = lambda self, *_: (yield from ())
"""


def folders(tmp_path, *names):
    """Return a folder for each program."""
    made = [tmp_path / name for name in names]
    for folder in made:
        folder.mkdir()
    return made


def speeds(listener):
    """Return the forward velocities that were received, without zeros."""
    return {velocity.linear_x for velocity in listener.received if velocity.linear_x}


def test_a_newcomer_is_refused_and_the_one_that_drives_finishes(listener, tmp_path):
    one, two = folders(tmp_path, 'one', 'two')
    with script(DRIVE.format(speed=0.1, duration=5.0), one) as first:
        listener.wait_for(lambda velocity: velocity.moves)
        with program(COMMAND, two) as second:
            assert second.end() == 3
        assert first.process.poll() is None, 'the newcomer is refused at once'
        assert first.end() == 0
    line = second.text.splitlines()[-1]
    assert f'/kachaka_simple_control (process {first.process.pid}, since ' in line
    assert 'drives the robot on /kachaka/manual_control/cmd_vel, so nothing was sent' in line
    assert [(move.linear_x, move.count) for move in listener.moves()] == [(0.1, 50)]
    # No message of the second between those of the first, no zero either; manual control was
    # switched on once, and released once.
    assert not [velocity for velocity in listener.received
                if not velocity.moves and moved(listener)[0] < velocity.time < moved(listener)[-1]]
    assert [enabled for _, enabled in listener.answered] == [True, False]


def moved(listener):
    """Return when velocities other than zero were received."""
    return [velocity.time for velocity in listener.received if velocity.moves]


def test_of_two_that_start_in_the_same_moment_one_drives(listener, tmp_path):
    one, two = folders(tmp_path, 'one', 'two')
    with script(DRIVE.format(speed=0.1, duration=2.0), one) as first, \
            script(DRIVE.format(speed=0.2, duration=2.0), two) as second:
        ends = sorted((first.end(), second.end()))
    assert len(speeds(listener)) == 1
    assert [move.count for move in listener.moves()] == [20]
    assert ends == [0, 3]


def test_a_program_that_is_frozen_keeps_the_robot(listener, tmp_path):
    one, two = folders(tmp_path, 'one', 'two')
    with script(DRIVE.format(speed=0.1, duration=20.0), one) as first:
        listener.wait_for(lambda velocity: velocity.moves)
        first.send(signal.SIGSTOP)
        with program(COMMAND, two) as second:
            assert second.end() == 3
        first.send(signal.SIGCONT)
    assert f'process {first.process.pid}, which does not answer' in second.text
    assert speeds(listener) == {0.1}


def test_after_a_kill_the_robot_is_free_as_soon_as_the_guardian_is_gone(listener, tmp_path):
    one, two = folders(tmp_path, 'one', 'two')
    with script(DRIVE.format(speed=0.1, duration=20.0), one) as first:
        listener.wait_for(lambda velocity: velocity.moves)
        first.send(signal.SIGKILL)
        killed = time.time()
        with script(DRIVE.format(speed=0.2, duration=0.5), two) as second:
            assert second.end() == 0
    assert [(move.linear_x, move.count) for move in listener.moves()][-1] == (0.2, 5)
    # The stop of the first was over by then.
    zeros = [velocity.time for velocity in listener.received
             if not velocity.moves and velocity.time > killed]
    begun = next(velocity.time for velocity in listener.received if velocity.linear_x == 0.2)
    assert len([at for at in zeros if at < begun]) >= 20


def test_a_program_that_stands_by_takes_nothing_until_it_drives(listener, tmp_path):
    one, two = folders(tmp_path, 'one', 'two')
    with program([*COMMAND, 'straight', '--wait'], one) as standing_by:
        standing_by.wait_for_text('Standing by')
        with script(DRIVE.format(speed=0.1, duration=0.5), two) as other:
            assert other.end() == 0
        listener.received.clear()
        assert listener.call('run').success
        listener.wait_for(lambda velocity: velocity.moves)


def test_a_second_bridge_under_the_same_name_is_refused():
    with bridge() as first:
        assert wait_until(lambda: 'ready: ' in first.text)
        with bridge() as second:
            assert second.end() == 3
        (line,) = second.lines
        assert is_running(first.process.pid)
    assert f'/kachaka/kachaka_bridge (process {first.process.pid}, since ' in line
    assert 'shows a robot on /kachaka/manual_control/cmd_vel' in line
    with bridge() as again:
        assert wait_until(lambda: 'ready: ' in again.text)


def test_from_another_machine_a_newcomer_yields(listener, tmp_path):
    one, two = folders(tmp_path, 'one', 'two')
    with script(ELSEWHERE + DRIVE.format(speed=0.1, duration=6.0), one) as first:
        listener.wait_for(lambda velocity: velocity.moves)
        with script(ELSEWHERE + DRIVE.format(speed=0.2, duration=1.0), two) as second:
            assert second.end() == 3
        assert first.end() == 0
    assert f'(process {first.process.pid} on {os.uname().nodename}, since ' in second.text
    assert [(move.linear_x, move.count) for move in listener.moves()] == [(0.1, 60)]


def test_of_two_newcomers_on_two_machines_one_drives(listener, tmp_path):
    one, two = folders(tmp_path, 'one', 'two')
    with script(ELSEWHERE + DRIVE.format(speed=0.1, duration=2.0), one) as first, \
            script(ELSEWHERE + DRIVE.format(speed=0.2, duration=2.0), two) as second:
        ends = sorted((first.end(), second.end()))
    assert len(speeds(listener)) == 1
    assert ends == [0, 3]


def test_two_programs_that_discover_each_other_too_late_both_stop(listener, tmp_path):
    one, two = folders(tmp_path, 'one', 'two')
    text = ELSEWHERE + UNAWARE
    with script(text + DRIVE.format(speed=0.1, duration=30.0), one) as first:
        listener.wait_for(lambda velocity: velocity.moves)
        with script(text + DRIVE.format(speed=0.2, duration=30.0), two) as second:
            assert (first.end(), second.end()) == (1, 1)
    for text in (first.text, second.text):
        assert 'another program drives the robot as well' in text or (
            'another program (node kachaka_simple_control) sends velocities' in text)
    assert not listener.received[-1].moves
