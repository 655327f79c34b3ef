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
"""The reports of a remotely controlled drive: their states, and how often they are written."""

import contextlib
import os
from types import SimpleNamespace

from fake_time import FakeTime
from kachaka_simple_control.control.events import (
    DriveState,
    OdometryReceived,
    ScanReceived,
    SpeedFactorChanged,
    StateChanged,
    WatchChanged,
    WatchState,
)
from kachaka_simple_control.control.robot_drive import DriveProgress
from kachaka_simple_control.control.standstill import StandstillDetector
from kachaka_simple_control.files.protocol import Answer, read_report, Scan, Watch
from kachaka_simple_control.motion.floor import Floor, Person, Post
from kachaka_simple_control.motion.geometry import Pose, Velocity, ZERO
from optional_libraries import MISSING, optional_imports
import pytest

RemoteCommands = MISSING
with optional_imports():
    from kachaka_simple_control.commands import remote_pipe, remote_reports
    from kachaka_simple_control.commands.remote_commands import RemoteCommands

pytestmark = pytest.mark.needs('rclpy', 'std_msgs')

NEVER, OVER, MOVES = 'standing by', 'stopped', Velocity(0.1)


@pytest.mark.parametrize('state, is_taken, is_by_hand, velocity, reason, name', [
    (DriveState.READY, False, False, ZERO, None, NEVER),
    (DriveState.READY, True, False, ZERO, None, 'taking'),
    (DriveState.WAITING, True, True, ZERO, None, 'taking'),
    (DriveState.CONNECTING, True, True, ZERO, None, 'taking'),
    (DriveState.DRIVING, True, True, ZERO, None, 'ready'),
    (DriveState.DRIVING, True, True, MOVES, None, 'driving by hand'),
    (DriveState.DRIVING, True, False, ZERO, None, 'driving'),
    (DriveState.PAUSED, True, False, MOVES, None, 'paused'),
    # A stop was asked for, and its first zero is sent in a moment.
    (DriveState.DRIVING, False, False, MOVES, None, 'stopping'),
    *((DriveState.STOPPING, is_taken, False, ZERO, None, 'stopping') for is_taken in (0, 1)),
    (DriveState.STOPPED, False, False, ZERO, None, NEVER),
    (DriveState.CUT_SHORT, False, False, ZERO, 'by ~/stop', OVER),
    # It is taken again, and the next drive is not requested yet.
    (DriveState.CUT_SHORT, True, True, ZERO, None, 'taking')])
def test_each_state_has_the_name_of_the_protocol(
        state, is_taken, is_by_hand, velocity, reason, name):
    robot = SimpleNamespace(odometry=StandstillDetector(), pose=None)
    report = remote_reports.state_of(
        robot, DriveProgress(state=state), velocity, is_taken, is_by_hand, reason)
    assert report.state == name


def test_a_hold_is_told_in_words_and_numbers():
    robot = SimpleNamespace(odometry=StandstillDetector(), pose=None)
    watch = WatchChanged(1.0, WatchState.OBSTACLE, 0.31234, 0.0)
    for factors, held_by in (
            ({'obstacle': 0.0}, 'obstacle 0.31 m ahead, goes on by itself'),
            ({'obstacle': 0.0, 'pause': 0.0}, None)):
        report = remote_reports.state_of(
            robot, DriveProgress(state=DriveState.PAUSED, factors=factors, watch=watch), ZERO,
            is_taken=True, is_by_hand=False, reason=None)
        assert (report.state, report.held_by) == ('paused', held_by)
        assert report.watch == Watch('obstacle', 0.312, 0.0)


def test_a_floor_is_told_with_all_places_of_its_people():
    told = remote_reports.floor_map(Floor(
        (((0.0, 1.0), (2.0, 1.0)),), (Post((1.0, 0.3), 0.03),),
        (Person((0.9, 0.0), 0.2, 0.0, 14.0, (0.9, 2.0)),)))
    assert told.walls == (((0.0, 1.0), (2.0, 1.0)),)
    assert told.posts == ((1.0, 0.3, 0.03),)
    assert told.people == ((0.9, 0.0, 0.2), (0.9, 2.0, 0.2))


@pytest.fixture
def pipe():
    """Yield a writer of reports, and a function that returns what was written meanwhile."""
    reading, writing = os.pipe()
    os.set_blocking(reading, False)
    writer = remote_reports.ReportWriter(writing)

    def read():
        data = b''
        with contextlib.suppress(BlockingIOError):
            while True:
                data += os.read(reading, 65536)
        return [*map(read_report, data.splitlines())]
    yield writer, read
    writer.close()
    os.close(reading)


def scan(time, count=360):
    """Return a scan with points in a row ahead."""
    return ScanReceived(time, tuple((1.0, -10.12345 + 0.05 * number) for number in range(count)))


def test_a_scan_is_written_thinned_five_times_a_second_with_the_pose_at_which_it_was_taken(pipe):
    writer, read = pipe
    for time in (1.0, 1.1, 1.2):
        writer.on_event(OdometryReceived(time, Pose(time, 2.0, 0.5)))
    written = []
    for number in range(40):
        writer.on_event(scan(1.15))
        writer.write_scan(10.0 + 0.05 * number)
        written += read()
    assert 8 <= len(written) <= 10
    assert {report.pose for report in written} == {(1.1, 2.0, 0.5)}
    assert {report.points for report in written} == {
        tuple((1.0, round(-10.12345 + 0.1 * number, 2)) for number in range(180))}
    writer.write_scan(99.0)  # the last one, which had come too soon
    read()
    # Nothing new has come.
    writer.write_scan(199.0)
    assert read() == []


def test_a_reader_that_does_not_keep_up_gets_no_scans_but_every_state(pipe):
    writer, read = pipe
    for number in range(100):
        writer.on_event(scan(1.0))
        writer.write_scan(10.0 + number)
        writer.write(Answer(number, True))
    found = read()
    assert [report.id for report in found if isinstance(report, Answer)] == [*range(100)]
    assert 1 <= sum(isinstance(report, Scan) for report in found) <= 3


def test_a_scan_does_not_wait_for_a_line_that_is_being_written(pipe):
    writer, read = pipe
    writer.on_event(scan(1.0))
    with writer._lock:
        writer.write_scan(10.0)
    assert read() == []
    # What JSON cannot carry does not end the reports either.
    writer.on_event(ScanReceived(1.0, ((float('nan'), 0.0),)))
    writer.write_scan(11.0)
    writer.on_event(scan(1.0))
    writer.write_scan(12.0)
    assert len(read()) == 1


class Beside:
    """The reports beside a drive; ``at`` says what happens when [s]."""

    def __init__(self, monkeypatch, at):
        """Begin at rest."""
        self.time, self.at, self.began = FakeTime(), at, 0.0
        clock = SimpleNamespace(monotonic=self.time.clock, sleep=self.time.sleep)
        for module in (remote_pipe, remote_reports):
            monkeypatch.setattr(module, 'time', clock)
        self.progress, self.written, self.looks = DriveProgress(), [], []
        robot = SimpleNamespace(odometry=StandstillDetector(), pose=None)
        writer = SimpleNamespace(
            velocity=ZERO, on_event=lambda event: None, write=self.written.append,
            write_scan=lambda now: None)
        self.commands = RemoteCommands(SimpleNamespace(
            robot=robot, robots={'': robot}, commander=self,
            profile=SimpleNamespace(is_kachaka=False)), 0, writer)
        self.commands._has_changed = self
        self.began, self.time.on_sleep = self.time.now, self.go_on

    def states(self):
        """Return the progress of the only robot."""
        return [self.progress]

    def run(self, until):
        """Write reports; return when it looked for something to write [s]."""
        self.at[until] = lambda: setattr(self.commands, '_is_over', True)
        self.commands._write_more = lambda: self.looks.append(self.time.now - self.began)
        self.commands._write_reports()
        return self.looks

    def enter(self, state):
        """Change the state."""
        self.progress = DriveProgress(state=state)
        self.commands._on_event(StateChanged(self.time.now, state))

    def go_on(self):
        """Let happen what is due, and odometry come."""
        while self.at and min(self.at) <= self.time.now - self.began:
            self.at.pop(min(self.at))()
        self.commands._on_event(OdometryReceived(
            self.time.now, Pose(), ZERO, is_still=True))

    def set(self):  # noqa: A003
        """Do as an event of a thread does."""
        self.is_set = True

    def clear(self):
        """Do as an event of a thread does."""
        self.is_set = False

    def wait(self, timeout):
        """Do as an event of a thread does."""
        end = self.time.now + timeout
        while not self.is_set and self.time.now < end:
            self.time.sleep(0.01)


def test_at_rest_it_looks_for_something_to_report_once_a_second(monkeypatch):
    beside = Beside(monkeypatch, {})
    looks = beside.run(until=20.0)
    assert len(looks) <= 22
    assert len(beside.written) >= 20, 'its reader does not see that it is there'


def test_a_change_is_reported_at_once_and_figures_often(monkeypatch):
    beside = Beside(monkeypatch, {
        3.3: lambda: beside.enter(DriveState.DRIVING),
        5.3: lambda: beside.enter(DriveState.STOPPED),
        8.3: lambda: beside.commands._on_event(SpeedFactorChanged(0.0, {}))})
    looks = beside.run(until=10.0)
    for change in (3.3, 5.3, 8.3):
        assert any(change <= look <= change + 0.12 for look in looks)
    assert 35 <= sum(3.3 <= look <= 5.3 for look in looks) <= 42
    assert sum(look > 5.4 for look in looks) <= 7
    assert 'driving' in {state.state for state in beside.written}
