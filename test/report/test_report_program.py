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
"""The reporter receives all events, delays no program, and keeps what it received."""

import json
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import time

from fleet_drive import driven, events_of
from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.control.events import (
    MotionEnded,
    MotionPlanned,
    MotionStarted,
    OdometryReceived,
    RobotEvent,
    SessionEnded,
    SessionStarted,
    VelocitySent,
)
from kachaka_simple_control.control.guardian_memory import GuardianMemory
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.motion.geometry import Pose, Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.steps import Motion, Move
from kachaka_simple_control.process import processes
from kachaka_simple_control.report import report_program
from kachaka_simple_control.report.output_file import prepare_report_dir, REPORT_MODULE
from kachaka_simple_control.telemetry.event_bus import EventBus
from kachaka_simple_control.telemetry.subscriber_process import (
    SubscriberProcess,
    SubscriberProcesses,
)
from messages import of_plan
import pytest
from recordings import READERS, sent_velocities, stamp_of, velocities
from waiting import wait_for_file

pytestmark = [pytest.mark.real_time, pytest.mark.needs('mcap')]

LIMITS = Limits(0.3, 1.5)
OPENED = SessionStarted('test', 'kachaka', LIMITS, 0.3, 1.7e9, '/cmd_vel', '/odom')
PLANNED = MotionPlanned(Motion('ahead', (Move(0.1, 0.0, 5.0),)), LIMITS, 10.0)
BEGINNING = (OPENED, PLANNED, MotionStarted(10.0), of_plan(10.0, Velocity(0.1), 10.0))
EXIT_TIMEOUT = 30.0


def reporter_of(folder, *before):
    """Return the subscriber process of a reporter, started by another command if one is given."""
    return SubscriberProcess([*before, *processes.python_command(REPORT_MODULE), str(folder)])


def drive(count, first=10.0):
    """Return the events of a drive at 50 Hz."""
    return [event for number in range(count) for event in (
        of_plan(first + number / 50.0, Velocity(0.1, number / 1000.0)),
        OdometryReceived(first + number / 50.0 + 0.003, Pose(number / 500.0)))]


def assert_recorded(folder, events):
    """Assert that both readers find each velocity that was published, and nothing else."""
    sent = sent_velocities([event for event in events if isinstance(event, VelocitySent)], OPENED)
    for read in READERS:
        assert velocities(read(folder / 'run.mcap'), OPENED) == sent


def test_a_line_about_a_report_is_printed_escaped(capsys):
    report_program.print_line('a\x1b[31m\n\u202e\udcff/report.html')
    assert capsys.readouterr().err == (
        'report: a\\x1b[31m\\n\\u202e\\udcff/report.html\n')


@pytest.mark.needs('jinja2', 'matplotlib')
def test_all_published_events_are_recorded(tmp_path, capfd):
    events = [
        *BEGINNING, *drive(1000, 10.1), MotionEnded(30.0),
        SessionEnded(31.0, stop_confirmed_after=0.1)]
    process = reporter_of(tmp_path)
    for event in events:
        process.send(event)
    code = process.close(EXIT_TIMEOUT)
    assert process.failure is None
    assert_recorded(tmp_path, events)
    assert code == 0
    assert capfd.readouterr().err == f'report: {tmp_path}/report.html\n'
    assert {'report.html', 'path.png', 'run.json'} <= {file.name for file in tmp_path.iterdir()}


SEND_EVENTS = """
import os, signal, sys
from kachaka_simple_control.telemetry.event_bus import EventBus
from kachaka_simple_control.telemetry.subscriber_process import SubscriberProcess
from kachaka_simple_control.process import processes
from test_report_program import BEGINNING, drive, reporter_of
process = reporter_of(sys.argv[1])
for event in [*BEGINNING, *drive(200, 10.1)]:
    process.send(event)
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.needs('jinja2')
def test_it_continues_when_the_program_is_killed(tmp_path):
    environment = processes.child_environment()
    environment['PYTHONPATH'] += os.pathsep + str(Path(__file__).parent) + os.pathsep + str(
        Path(__file__).parents[1])
    # The reporter keeps the pipe open; so this returns when it has ended.
    ended = subprocess.run(
        [sys.executable, '-c', SEND_EVENTS, str(tmp_path)], env=environment, timeout=EXIT_TIMEOUT,
        capture_output=True, text=True, check=False)
    assert ended.returncode == -signal.SIGKILL, ended.stderr
    assert_recorded(tmp_path, [*BEGINNING, *drive(200, 10.1)])
    assert ended.stderr == f'report: {tmp_path}/report.html\n'


def test_a_killed_reporter_leaves_all_but_the_last_second(tmp_path):
    """So does a machine that kills both at once."""
    process = reporter_of(tmp_path)
    for event in (OPENED, PLANNED):
        process.send(event)
    wait_for_file(tmp_path / 'run.mcap')
    sent = []
    end = time.monotonic() + 2.5
    while time.monotonic() < end:
        sent.append(of_plan(time.monotonic(), Velocity(0.1, len(sent) / 1000.0)))
        process.send(sent[-1])
        time.sleep(0.01)
    killed = time.monotonic()
    process._process.kill()
    assert process.close(EXIT_TIMEOUT) == -signal.SIGKILL
    due = [velocity for velocity in sent_velocities(sent, OPENED)
           if velocity[0] < stamp_of(OPENED, killed - 1.0)]
    assert len(due) > 50
    for read in READERS:
        found = velocities(read(tmp_path / 'run.mcap'), OPENED)
        assert found == sent_velocities(sent, OPENED)[:len(found)]
        assert found[:len(due)] == due


@pytest.mark.parametrize('signum', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_to_all_programs_does_not_end_it(signum, tmp_path):
    events = [*BEGINNING, *drive(100, 10.1)]
    process = reporter_of(tmp_path)
    for event in events[:50]:
        process.send(event)
    wait_for_file(tmp_path / 'run.mcap')
    process._process.send_signal(signum)
    for event in events[50:]:
        process.send(event)
    assert process.close(EXIT_TIMEOUT) in (0, 1)
    assert_recorded(tmp_path, events)


def test_a_full_disk_ends_the_recording_and_nothing_else(tmp_path, capfd):
    """Here a file may have 20 KiB; what is published before fits in."""
    folder = tmp_path / 'report'
    folder.mkdir()
    process = reporter_of(folder, 'bash', '-c', 'ulimit -f 20; exec "$@"', 'bash')
    process.send(OPENED)
    wait_for_file(folder / 'run.mcap')
    size = (folder / 'run.mcap').stat().st_size
    for event in BEGINNING[1:]:
        process.send(event)
    wait_for_file(folder / 'run.mcap', size)
    for number in range(40):
        for event in drive(100, 11.0 + 2.0 * number):
            process.send(event)
        time.sleep(0.05)
    assert process.failure is None, 'it goes on hearing'
    assert process.close(EXIT_TIMEOUT) == 1
    assert 'report: run.mcap ends early: File too large\n' in capfd.readouterr().err
    assert 0 < (folder / 'run.mcap').stat().st_size <= 20 * 1024
    one, other = (velocities(read(folder / 'run.mcap'), OPENED) for read in READERS)
    assert one == other
    assert one[0] == (stamp_of(OPENED, 10.0), 0.1, 0.0)


def test_one_that_does_not_keep_up_gets_no_more_and_records_what_it_received(tmp_path, capfd):
    event_bus = EventBus()
    with SubscriberProcesses(event_bus) as subscribers:
        subscribers.start(REPORT_MODULE, str(tmp_path))
        (process,) = subscribers._subscribers
        for event in BEGINNING:
            event_bus.publish(event)
        wait_for_file(tmp_path / 'run.mcap')
        process._process.send_signal(signal.SIGSTOP)
        start = time.monotonic()
        for number, event in enumerate(drive(20_000, 11.0)):
            event_bus.publish(event)
            if number % 1000 == 0:
                assert event_bus.flush(10.0)
        assert event_bus.flush(10.0)
        assert time.monotonic() - start < 10.0
        assert process.failure == 'it did not keep up'
        process._process.send_signal(signal.SIGCONT)
    printed = capfd.readouterr().err
    assert ('kachaka_simple_control: what was shown or reported ends early: it did not keep up\n'
            in printed)
    for read in READERS:
        found = velocities(read(tmp_path / 'run.mcap'), OPENED)
        assert 1000 < len(found) < 20_000


@pytest.mark.parametrize('error, text', [
    (ValueError('odd'), "there is none: ValueError('odd')"),
    (OSError(28, 'No space left on device'), 'there is none: No space left on device')])
def test_a_report_that_fails_is_a_one_line_message(error, text, monkeypatch, tmp_path):
    def write_report(record, folder, recording):
        raise error

    monkeypatch.setattr(report_program, 'write_report', write_report)
    record = DriveLog()
    record.on_event(OPENED)
    assert report_program.try_write_report(record, tmp_path, None) == text


def test_a_folder_is_made_and_kept(tmp_path):
    folder = tmp_path / 'runs' / 'first'
    with prepare_report_dir(str(folder)):
        assert list(folder.iterdir()) == []
    assert folder.is_dir()
    with prepare_report_dir(str(folder)):
        pass
    with pytest.raises(KeyboardInterrupt), prepare_report_dir(str(folder)):
        raise KeyboardInterrupt
    assert folder.is_dir()


def test_bad_usage_leaves_only_folders_that_were_there(tmp_path):
    there = tmp_path / 'there'
    there.mkdir()
    for folder in (there, there / 'runs' / 'first'):
        with pytest.raises(UsageError, match='rate'), prepare_report_dir(str(folder)):
            raise UsageError('rate is 0')
    assert list(there.iterdir()) == []


def refused_because(folder):
    """Return why a folder is refused."""
    with pytest.raises(UsageError) as caught, prepare_report_dir(str(folder)):
        pytest.fail('it was not')
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)


def test_a_folder_that_holds_something_is_refused(tmp_path):
    (tmp_path / 'run.mcap').touch()
    assert refused_because(tmp_path) == (
        f'--report {tmp_path} is not empty, it holds run.mcap: name a folder that is new or empty')
    assert list(tmp_path.iterdir()) == [tmp_path / 'run.mcap']


@pytest.mark.needs('jinja2', 'matplotlib')
def test_a_fleet_has_one_page_and_one_recording(tmp_path, capfd):
    drives = driven()
    process, events = reporter_of(tmp_path), events_of(drives)
    for start in range(0, len(events), 40):
        process.send_all(events[start:start + 40])
    assert process.close(EXIT_TIMEOUT) == 0
    assert process.failure is None
    assert capfd.readouterr().err == f'report: {tmp_path}/report.html\n'
    page = (tmp_path / 'report.html').read_text()
    assert '<title>Done: trio, 3 robots</title>' in page
    assert {'path.png', 'run.json'} <= {file.name for file in tmp_path.iterdir()}
    for read in READERS:
        found = read(tmp_path / 'run.mcap')
        # All robots of this drive have the same topic.
        sent = [event for drive in drives.values() for event in drive.drive_log.sent]
        opened = drives['r1'].drive_log.session_started
        assert sorted(velocities(found, opened)) == sent_velocities(sent, opened)


@pytest.mark.needs('jinja2')
def test_a_killed_fleet_leaves_a_page_and_when_its_guardian_stopped_each_robot(tmp_path):
    with tempfile.TemporaryFile() as file:
        file.truncate(GuardianMemory.SIZE)
        memory = GuardianMemory(file.fileno())
        process = SubscriberProcess(
            [*processes.python_command(REPORT_MODULE), str(tmp_path), str(file.fileno()),
             '4', '2', '7'], pass_fds=(file.fileno(),))
        drives = driven()
        cut = max(drive.now for drive in drives.values()) - 3.0
        events = [event for event in events_of(drives, ended=None)
                  if not isinstance(event, RobotEvent)
                  or getattr(event.event, 'time', None) is None or event.event.time < cut]
        process.send_all(events)
        for slot in (4, 2):
            memory.slot(slot).latch.trip(cut + 0.1 * slot)
        assert process.close(EXIT_TIMEOUT) == 0
    assert '<title>Killed: trio, 3 robots</title>' in (tmp_path / 'report.html').read_text()
    robots = json.loads((tmp_path / 'run.json').read_text())['robots']
    opened = drives['r1'].drive_log.session_started
    for read in READERS:
        stamps = {stamp for stamp, *_ in velocities(read(tmp_path / 'run.mcap'), opened)}
        assert {stamp_of(opened, cut + 0.4), stamp_of(opened, cut + 0.2)} <= stamps
    # Nobody stopped the third one.
    began = drives['r1'].drive_log.motions[0].began
    driven_for = [robot['duration']['driven_s'] for robot in robots.values()]
    assert driven_for[0] == pytest.approx(cut + 0.4 - began, abs=0.01)
    assert driven_for[1] == pytest.approx(cut + 0.2 - began, abs=0.01)
    assert driven_for[2] < cut - began
