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
"""The display of a drive at a real terminal: visible, harmless, and removed at the end."""

import os
import signal
import statistics
import sys
import threading
import time
import types

from kachaka_simple_control.control.events import DriveState
from kachaka_simple_control.display.display_program import (
    LineRenderer,
    PanelRenderer,
    renderer_for,
    TerminalDisplay,
)
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.telemetry.subscriber_process import encode
from messages import of_plan
from program import COMMAND, program
import pytest
from terminals import at_terminal

pytestmark = [pytest.mark.real_time, pytest.mark.needs('rich')]

#: Publishes a drive in real time, and writes log lines meanwhile, each of them in two halves.
PUBLISHER = """
import os, sys, time
from kachaka_simple_control.telemetry.event_bus import EventBus
from kachaka_simple_control.telemetry.subscriber_process import SubscriberProcesses
from kachaka_simple_control.display.terminal import DisplayProcess
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.steps import Forward, Motion
from kachaka_simple_control.control.events import MotionEnded, MotionPlanned, MotionStarted
from kachaka_simple_control.control.events import SessionStarted, VelocityKind, VelocitySent
from kachaka_simple_control.control.events import DriveState, StateChanged

limits = Limits(0.25, 1.0)
event_bus, slowest = EventBus(), 0.0
with SubscriberProcesses(event_bus) as subscribers:
    subscribers.add(DisplayProcess())
    event_bus.publish(SessionStarted(
        'there', 'kachaka', limits, 0.3, 0.0, 'cmd_vel', None, settings={'guardian': True}))
    event_bus.publish(MotionPlanned(Motion('there', (Forward(DISTANCE),)), limits, 50.0))
    event_bus.publish(StateChanged(time.monotonic(), DriveState.WAITING))
    sys.stdin.readline()  # until there is somebody to see it
    began = time.monotonic()
    event_bus.publish(MotionStarted(began))
    event_bus.publish(StateChanged(began, DriveState.DRIVING))
    for tick in range(round(200 * DISTANCE)):
        before = time.monotonic()
        event_bus.publish(VelocitySent(
            before, Velocity(0.25), VelocityKind.PLAN, before - began, before - began))
        if tick % 10 == 0:
            os.write(2, b'[INFO] line %d ' % tick)
            time.sleep(0.001)
            os.write(2, b'is whole\\n')
        slowest = max(slowest, time.monotonic() - before)
        time.sleep(0.02)
    event_bus.publish(VelocitySent(time.monotonic(), ZERO, VelocityKind.STOP))
    event_bus.publish(MotionEnded(time.monotonic()))
    ended = time.monotonic()
print(f'slowest {slowest:.3f} closed {time.monotonic() - ended:.3f}')
"""


#: Publishes a fleet whose third robot is late, and waits for its end.
FLEET_PUBLISHER = """
import sys, time
from kachaka_simple_control.telemetry.event_bus import EventBus
from kachaka_simple_control.telemetry.subscriber_process import SubscriberProcesses
from kachaka_simple_control.display.terminal import DisplayProcess
from kachaka_simple_control.motion.geometry import ORIGIN, Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.steps import Forward, Motion
from kachaka_simple_control.control.events import *

limits, event_bus = Limits(0.25, 1.0), EventBus()
names = tuple(f'r{number}' for number in range(1, 31))
with SubscriberProcesses(event_bus) as subscribers:
    subscribers.add(DisplayProcess(), OVERVIEW)
    event_bus.publish(FleetStarted('many', tuple(
        FleetMember(name, ORIGIN, 'there') for name in names), 2))
    for name in names:
        event_bus.publish(SessionStarted(
            'there', 'kachaka', limits, 0.3, 0.0, 'cmd_vel', None,
            settings={'guardian': True}), name)
        event_bus.publish(MotionPlanned(Motion('there', (Forward(9.0),)), limits, 20.0), name)
        event_bus.publish(StateChanged(time.monotonic(), DriveState.WAITING), name)
    sys.stdin.readline()
    began = time.monotonic()
    for name in names:
        event_bus.publish(MotionStarted(began), name)
        event_bus.publish(StateChanged(began, DriveState.DRIVING), name)
    print('log line', flush=True)
    while True:
        now = time.monotonic()
        for name in names:
            event_bus.publish(VelocitySent(now, Velocity(0.25), VelocityKind.PLAN), name)
            event_bus.publish(ProgressMade(
                now, now - began, Velocity(0.25), 0.02 if name == 'r3' else 0.0), name)
        time.sleep(0.2)
"""


def publisher(distance):
    """Return a program that publishes a drive of some length, at 0.25 m/s."""
    return [sys.executable, '-c', PUBLISHER.replace('DISTANCE', str(distance))]


def begin(shown):
    """Let a drive begin once the panel is drawn."""
    shown.wait_for_text('WAITING')
    shown.press(b'\n')
    shown.wait_for_text('DRIVING')


def is_clean(screen):
    """Return whether a terminal is as it was before."""
    return screen.cursor_is_shown and screen.bottom == screen.rows and not any(
        'Ctrl+C' in line or 'commanded' in line for line in screen.lines)


def all_lines(text, count):
    """Return whether all log lines are there, whole and in order."""
    return [line for line in text if line.startswith('[INFO]')] == [
        f'[INFO] line {10 * number} is whole' for number in range(count)]


@pytest.mark.parametrize('columns, rows', [(60, 14), (100, 24), (200, 50)])
def test_a_panel_stays_below_log_lines_that_scroll(columns, rows):
    with at_terminal(publisher(0.5), columns, rows) as shown:
        begin(shown)
        lines = shown.screen.lines[-6:]
        assert lines[0].startswith('there on kachaka')
        assert lines[0].endswith('Ctrl+C stops the robot')
        assert 'step 1 of 1: forward 0.5 m' in lines[1]
        assert max(map(len, lines)) < columns
        assert shown.screen.bottom == rows - 6
        assert shown.end() == 0
        assert all_lines(shown.screen.above, 10)
        assert is_clean(shown.screen)


def test_a_fleet_has_a_row_a_robot_and_is_gone_when_its_program_is_killed():
    with at_terminal([sys.executable, '-c', FLEET_PUBLISHER]) as shown:
        shown.wait_for_text('and 14 more: waiting')
        shown.press(b'\n')
        shown.wait_for_text('late by 20.0 ms')
        lines = shown.screen.lines[-18:]
        assert lines[0].startswith('many  ')
        assert lines[0].endswith('Ctrl+C stops all robots')
        assert ' of 36.0 s  round 1 of 2 ' in lines[0]
        assert [line.split()[:2] for line in lines[1:-1]] == [
            [name, 'DRIVING'] for name in ('r3', 'r1', 'r2', *(
                f'r{number}' for number in range(4, 17)))]
        assert lines[-1] == 'and 14 more: driving'
        shown.wait_for_text('log line')
        shown.process.send_signal(signal.SIGKILL)
        shown.process.wait()
        shown.wait_for_text(
            'kachaka_fleet was killed in mid-motion: its guardian stops all robots')
        shown.read_for(0.3)
        assert is_clean(shown.screen)


def test_a_terminal_too_small_for_a_panel_gets_lines():
    # Long enough for the display to be there before the end.
    with at_terminal(publisher(1.0), 40, 10) as shown:
        shown.press(b'\n')
        assert shown.end() == 0
        # Without a panel, a line may come between the two halves of a log line.
        text = '\n'.join(shown.screen.above)
        assert text.count('step 1 of 1: forward 1 m (4 s)\n') == 1
        assert text.count('Ctrl+C stops the robot\n') == 1
        assert shown.screen.bottom == 10


def test_when_the_program_is_killed_the_terminal_is_left_as_it_was():
    with at_terminal(publisher(5.0)) as shown:
        begin(shown)
        shown.process.send_signal(signal.SIGKILL)
        shown.process.wait()
        shown.wait_for_text(
            'kachaka_simple_control was killed in mid-motion: its guardian stops the')
        shown.read_for(0.3)
        assert is_clean(shown.screen)


def test_a_display_that_hangs_does_not_delay_the_program():
    with at_terminal(publisher(1.0)) as shown:
        begin(shown)
        display = shown.display()
        os.kill(display, signal.SIGSTOP)
        assert shown.end(15.0) == 0
        assert all_lines(shown.screen.above, 20)
        assert is_clean(shown.screen)
        words = shown.screen.above[-1].split()
        assert words[0] == 'slowest'
        assert float(words[1]) < 0.3
        assert float(words[3]) < 3.0
        with pytest.raises(ProcessLookupError):
            os.kill(display, 0)


def test_a_suspended_program_releases_the_terminal():
    with at_terminal(publisher(1.0)) as shown:
        begin(shown)
        shown.process.send_signal(signal.SIGSTOP)
        shown.read_for(1.0)
        assert is_clean(shown.screen)
        shown.process.send_signal(signal.SIGCONT)
        shown.wait_for_text('DRIVING')
        assert shown.end() == 0


def test_frames_are_drawn_while_the_robot_s_thread_sleeps(monkeypatch):
    """Right after a velocity: at any other time they might slow down the next one."""
    reader, writer = os.pipe()
    sent, drawn = [0.0], []
    renderer = types.SimpleNamespace(
        period=0.03, close=lambda: None, on_event=lambda *_: None,
        show=lambda *_: drawn.append(time.monotonic() - sent[-1]))
    with os.fdopen(reader) as stdin:
        monkeypatch.setattr(sys, 'stdin', stdin)
        display = threading.Thread(target=TerminalDisplay(renderer, os.getppid()).run)
        display.start()
        for _ in range(25):
            sent.append(time.monotonic())
            os.write(writer, encode(of_plan(sent[-1], Velocity(0.1)))[0])
            time.sleep(0.08)
        os.close(writer)
        display.join()
    assert len(drawn) >= 20
    # At any time it would be 40 ms.
    assert statistics.median(drawn) < 0.02


def test_without_rich_it_warns_once_and_writes_lines(monkeypatch):
    leader, follower = os.openpty()
    monkeypatch.setenv('TERM', 'xterm')
    assert isinstance(renderer_for(follower), PanelRenderer)
    for name in [name for name in sys.modules if name.partition('.')[0] == 'rich']:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delitem(sys.modules, 'kachaka_simple_control.display.panel')
    renderer = renderer_for(follower)
    assert type(renderer) is LineRenderer
    assert b'install rich' in os.read(leader, 1000)
    connecting = types.SimpleNamespace(state=DriveState.CONNECTING, step=None)
    renderer.show(connecting, 0.0, 'space pauses')
    assert os.read(leader, 1000) == b'space pauses\r\n'
    monkeypatch.setenv('TERM', 'dumb')
    assert type(renderer_for(follower)) is LineRenderer
    for descriptor in (leader, follower):
        os.close(descriptor)


MOTION = """
name: short
rate: 20 Hz
steps:
  - forward: 0.2 m
  - wait: 1 s
  - turn: 45 deg
"""
LOG = '[kachaka_simple_control]: '


@pytest.fixture
def motion(tmp_path):
    """Return the path of a short motion."""
    pytest.importorskip('rclpy', reason='needs ROS 2')
    pytest.importorskip('nav_msgs', reason='needs nav_msgs')
    pytest.importorskip('jsonschema', reason='needs jsonschema')
    file = tmp_path / 'short.yaml'
    file.write_text(MOTION)
    return str(file)


@pytest.mark.ros
def test_ctrl_c_ends_the_drive_and_the_display(motion):
    with at_terminal([*COMMAND, motion, '--sim'], 130, 30) as shown:
        shown.wait_for_text('DRIVING')
        for _ in range(2):
            shown.press(b'\x03')
            shown.read_for(0.1)
        began = time.monotonic()
        assert shown.end() == 130
        assert time.monotonic() - began < 6.0
        text = '\n'.join(shown.screen.above)
        for line in ('Program was interrupted', 'Robot has stopped'):
            assert text.count(f'{LOG}{line}') == 1
        assert is_clean(shown.screen)


@pytest.mark.ros
def test_output_that_is_no_terminal_gets_a_line_for_each_step(motion, tmp_path):
    with program([*COMMAND, motion, '--sim'], tmp_path) as started:
        assert started.end(40.0) == 0
    assert '\x1b' not in started.text
    steps = [line for line in started.text.splitlines() if line.startswith('step ')]
    assert [step.partition(' (')[0] for step in steps] == [
        'step 1 of 3: forward 0.2 m', 'step 2 of 3: wait 1 s', 'step 3 of 3: turn 45 deg']
