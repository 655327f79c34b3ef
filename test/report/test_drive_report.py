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
"""A drive with a report: what was sent is what its recording holds, however it ended."""

import contextlib
import json
import os
from pathlib import Path
import signal
import time

from kachaka_simple_control.process.processes import is_running
from kachaka_simple_control.report.mcap_recorder import FIELDS
from program import children_of, COMMAND, find_process, program
import pytest
from recordings import READERS
from waiting import wait_for_file, wait_until

pytestmark = [pytest.mark.ros, pytest.mark.needs('rclpy', 'mcap', 'jinja2', 'jsonschema')]

TOPIC = '/kachaka/manual_control/cmd_vel'
MOTION = """\
name: hook
rate: 50
steps:
  - move: {linear_x: 0.1, angular_z: 0.0, duration: DURATION}
  - move: {linear_x: 0.05, angular_z: 0.4, duration: 0.5}
"""
#: So many zeros are sent to a robot just met, and some more.
PRIMING = 30


def command(folder, duration, *options):
    """Return a command that drives a short way, and leaves a report in a folder."""
    motion = folder / 'hook.yaml'
    motion.write_text(MOTION.replace('DURATION', str(duration)))
    return [*COMMAND, str(motion), '--report', str(folder / 'report'), *options]


def recorded(folder):
    """Return the velocities that both readers find, in order, and assert that they agree."""
    file = folder / 'report' / 'run.mcap'
    one, other = ([
        (found.stamp, found.message.linear.x, found.message.angular.z)
        for found in read(file) if found.topic == TOPIC] for read in READERS)
    assert one == other
    return one


def headline(folder):
    """Return the headline of the report, the same on its page and in ``run.json``."""
    told = json.loads((folder / 'report' / 'run.json').read_text())['verdict']['headline']
    assert f'<span>{told}' in (folder / 'report' / 'report.html').read_text()
    return told


def timing(folder):
    """Return how exactly the messages came, from ``run.json``."""
    return json.loads((folder / 'report' / 'run.json').read_text())['timing']


def assert_same(sent, heard):
    """Assert that what is recorded is what a robot received, and when."""
    assert [velocity[1:] for velocity in sent] == [(one.linear_x, one.angular_z) for one in heard]
    for velocity, one in zip(sent, heard):
        assert velocity[0] / 1e9 == pytest.approx(one.time, abs=0.1)


def from_motion_on(velocities, moves):
    """Return velocities from the first that moves on: zeros before it are the guardian's, too."""
    return velocities[[*map(moves, velocities)].index(True):]


def is_motion(velocity):
    """Return whether a recorded velocity asks for motion."""
    return velocity[1:] != (0.0, 0.0)


def wait_for_end(folder, started):
    """Return when the reporter, which outlives its program, has printed its last line."""
    wait_until(lambda: 'report: ' in started.text.rpartition('run.mcap')[2], 20.0)


def test_as_many_velocities_are_recorded_as_a_robot_received(listener, tmp_path):
    """Without a guardian, which sends zeros of its own to a robot just met."""
    options = ['--ros-args', '-p', 'guardian:=false']
    with program(command(tmp_path, 0.5, *options), tmp_path) as started:
        assert started.end() == 0
    assert headline(tmp_path) == 'Done'
    sent = recorded(tmp_path)
    # A robot may be met later than its publisher meets it: zeros alone may be lost by that.
    unheard = len(sent) - len(listener.received)
    assert 0 <= unheard <= PRIMING
    assert not any(map(is_motion, sent[:unheard]))
    assert_same(sent[unheard:], listener.received)
    # A tick that the machine holds up until the next one is due is skipped; the report counts it.
    assert 0 <= 50 - sum(map(is_motion, sent)) <= timing(tmp_path)['lost']
    assert [velocity[1:] for velocity in sent[-10:]] == [(0.0, 0.0)] * 10


@pytest.mark.parametrize('name', ['SIGINT', 'SIGTERM'])
def test_a_signal_in_mid_motion_is_recorded_to_the_last_zero(listener, tmp_path, name):
    """Without a guardian: of a stop of its own only the first zero is recorded."""
    signum = signal.Signals[name]
    options = ['--ros-args', '-p', 'guardian:=false']
    with program(command(tmp_path, 8.0, *options), tmp_path) as started:
        listener.wait_for(lambda heard: heard.moves)
        time.sleep(0.5)
        started.send(signum)
        assert started.end(5.0) == 128 + signum
        wait_for_end(tmp_path, started)
    assert 'Traceback' not in started.text
    assert headline(tmp_path) == f'Stopped by {name}'
    sent = recorded(tmp_path)
    assert_same(from_motion_on(sent, is_motion),
                from_motion_on(listener.received, lambda heard: heard.moves))
    assert 15 < sum(map(is_motion, sent)) < 100
    assert [velocity[1:] for velocity in sent[-10:]] == [(0.0, 0.0)] * 10


@pytest.mark.parametrize('name', ['SIGKILL', 'SIGQUIT'])
def test_a_program_that_is_killed_leaves_all_that_it_sent(listener, tmp_path, name):
    """And the first zero of its guardian, with which the robot stops."""
    with program(command(tmp_path, 8.0), tmp_path) as started:
        listener.wait_for(lambda heard: heard.moves)
        time.sleep(0.5)
        started.send(signal.Signals[name])
        started.end(5.0)
        wait_for_end(tmp_path, started)
        assert headline(tmp_path) == 'Killed'
        sent = recorded(tmp_path)
        last = max(place for place, velocity in enumerate(listener.received) if velocity.moves)
        assert [velocity[1:] for velocity in sent[-2:]] == [(0.1, 0.0), (0.0, 0.0)]
        # When the zero was sent, not when the report was written.
        assert sent[-1][0] - sent[-2][0] < 0.25e9
        # It loses what its thread for events had not passed on yet: mostly nothing, and two
        # velocities beside six other tests.
        heard = sum(heard.moves for heard in listener.received)
        assert 0 <= heard - sum(map(is_motion, sent)) <= 10
        listener.wait_for(lambda heard: not heard.moves, after=last)


def test_a_folder_that_is_replaced_by_a_link_gets_the_report(listener, tmp_path):
    with program(command(tmp_path, 1.0), tmp_path) as started:
        listener.wait_for(lambda heard: heard.moves)
        (tmp_path / 'report').rename(tmp_path / 'first')
        (tmp_path / 'other').mkdir()
        (tmp_path / 'report').symlink_to('other')
        assert started.end() == 0
    assert not [*(tmp_path / 'other').iterdir()]
    assert {'report.html', 'run.json', 'run.mcap', 'metadata.yaml'} <= {
        file.name for file in (tmp_path / 'first').iterdir()}


def test_a_robot_that_is_not_found_is_reported_too(tmp_path):
    options = ['--ros-args', '-p', 'robot_timeout:=0.5', '-p', 'robot_namespace:=/nobody']
    with program(command(tmp_path, 0.5, *options), tmp_path) as started:
        assert started.end() == 3
    assert headline(tmp_path) == 'Never began'
    for read in READERS:
        assert read(tmp_path / 'report' / 'run.mcap') == []


@pytest.mark.skipif(os.geteuid() != 0, reason='needs root for a disk of its own')
def test_a_full_disk_ends_the_recording_and_the_robot_is_stopped(listener, tmp_path):
    disk = tmp_path / 'disk'
    disk.mkdir()
    line = command(tmp_path, 2.0)
    line[line.index('--report') + 1] = str(disk / 'report')
    with small_disk(disk):
        with program(line, tmp_path) as started:
            wait_for_file(disk / 'report' / 'run.mcap')
            # What is left is the rest of the page that the recording has begun.
            with contextlib.suppress(OSError), (disk / 'other').open('wb', 0) as other:
                while True:
                    other.write(bytes(1024))
            assert started.end() == 1
        assert 'report: run.mcap ends early: No space left on device' in started.text
        assert started.text.endswith(
            f'kachaka_simple_control: the report in {disk / "report"} is incomplete\n')
        assert not [file for file in (disk / 'report').iterdir() if file.suffix == '.new']
        one, other = (len(read(disk / 'report' / 'run.mcap')) for read in READERS)
    assert one == other > 0
    assert not listener.received[-1].moves
    assert sum(heard.moves for heard in listener.received) > 100, 'the drive went on'


@contextlib.contextmanager
def small_disk(folder: Path):
    """Have a disk of little room."""
    if os.system(f'mount -t tmpfs -o size=96k none {folder} 2>/dev/null'):
        pytest.skip('needs a disk of its own')
    try:
        yield
    finally:
        os.system(f'umount {folder}')


@pytest.mark.parametrize('name', sorted(FIELDS))
def test_definitions_have_the_fields_of_the_messages_here(name):
    import importlib
    package, _, kind = name.partition('/')
    module = pytest.importorskip(f'{package}.msg')
    assert importlib.import_module(f'{package}.msg') is module
    fields = getattr(module, kind).get_fields_and_field_types()
    theirs = [f'{spelled(type_)} {field}' for field, type_ in fields.items()]
    assert list(FIELDS[name]) == theirs


def spelled(field_type: str) -> str:
    """Return a type as a definition spells it."""
    base, _, rest = field_type.partition('<')
    if base == 'sequence':
        return f'{rest[:-1]}[]'
    return {'double': 'float64', 'double[36]': 'float64[36]'}.get(field_type, field_type)


def test_a_reporter_that_is_suspended_is_ended_with_one_line(listener, tmp_path):
    with program(command(tmp_path, 0.5), tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        reporter = find_process(children_of(started.process.pid), 'report_program')
        os.kill(reporter, signal.SIGSTOP)
        listener.wait_for(lambda velocity: not velocity.moves, after=len(listener.received))
        stopped = time.monotonic()
        assert started.end() == 1
        assert time.monotonic() - stopped < 5.0
    assert not is_running(reporter)
    assert started.text.count('its process is suspended, and was killed') == 1
    assert 'ends early' not in started.text
    assert started.text.endswith(
        f"kachaka_simple_control: the report in {tmp_path / 'report'} is incomplete: its process "
        'is suspended, and was killed\n')
