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
A drive process for tests: it speaks the lines of the console, and imagines the robot.

The robot follows each velocity at once.  A motion is a straight line of 0.2 m/s that takes
``--duration``; the text of the motion is only checked for the word ``steps``.  A motion with the
word ``watched`` has an obstacle watch, which holds it once.  The rules of the hand are those of
the real process.  Every line that the process gets is appended to ``--record``.
"""

from __future__ import annotations

import argparse
from collections import deque
from collections.abc import Mapping
from dataclasses import replace
import json
import math
import os
from pathlib import Path
import select
import signal
import sys
import time

from kachaka_simple_control.console.reports import PAGE
from kachaka_simple_control.files import protocol
from kachaka_simple_control.files.messages import MessageError
from kachaka_simple_control.files.protocol import (
    Alive,
    Answer,
    Command,
    FloorMap,
    Hand,
    Log,
    Pause,
    read_command,
    Release,
    Report,
    Request,
    Resume,
    Robot,
    Run,
    Scan,
    Sent,
    Speed,
    Stamp,
    State,
    Stop,
    Take,
    Watch,
    write_line,
)

PERIOD = 0.05
LEASE = 0.25
SPEED = 0.2
HALF_LENGTH, HALF_WIDTH = 0.19, 0.12
#: How long a watched motion is driven before its hold, and how long it is held [s].
HELD_FROM, HELD_FOR = 0.5, 4.0
#: What the laser sees, in the frame of the robot [m].
SEEN = ((0.6, -0.1), (0.6, 0.1))
FLOOR = FloorMap((((1.0, -1.0), (1.0, 1.0)),), ((0.5, 0.5, 0.05),), ((0.5, -0.5, 0.2),))


def boottime() -> float:
    return time.clock_gettime(time.CLOCK_BOOTTIME)


class ScriptedDrive:
    """The drive process; its options are those of the command line."""

    COMMANDS: Mapping[str, type[Command]] = protocol.COMMANDS

    def __init__(self, options: argparse.Namespace) -> None:
        self.options = options
        self.state = State('standing by')
        self.pose = (0.0, 0.0, 0.0)
        self.velocity = (0.0, 0.0)
        self.velocity_since = 0.0
        self.stamps: deque[float] = deque(maxlen=20)
        self.last_sequence = -1
        self.last_stamp = 0.0
        self.is_neutral = False
        self.is_taken = False
        self.elapsed = 0.0
        self.factor = 1.0
        self.stop_ids: list[int] = []
        self.last_state: State | None = None
        self.end_code: int | None = None
        self.is_recorded = options.record is not None
        #: how long the watch still holds a motion [s]; None without a watch
        self.hold: float | None = None
        self.is_paused = False

    def _write(self, report: Report) -> None:
        os.write(1, write_line(report))

    def _set(self, **changes: object) -> None:
        self.state = replace(self.state, **changes)  # type: ignore[arg-type]

    def _handle(self, command: Command) -> None:
        if isinstance(command, Hand):
            self._take_hand(command)
        elif isinstance(command, Stop):
            self._hold(0.0, 0.0)
            self.stop_ids.append(command.id)
            self.hold, self.is_paused = None, False
            self._set(state='stopping', reason='stopped from the page', watch=None, held_by=None)
        elif isinstance(command, Request):
            refusal = self._refusal(command)
            self._write(Answer(command.id, not refusal, refusal or 'done'))
            if not refusal:
                self._obey(command)

    def _refusal(self, command: Request) -> str:
        if isinstance(command, Take) and self.options.refuse:
            return 'another program drives the robot'
        if isinstance(command, Run):
            if 'steps' not in command.text:
                return f"{command.name}:1: 'steps' is missing: a list of steps"
            return '' if self.is_taken else 'take the robot first'
        if isinstance(command, Pause):
            is_driven = self.state.state == 'driving' or self.state.held_by
            return '' if is_driven else 'no motion is driven'
        if isinstance(command, Resume):
            return '' if self.state.state == 'paused' else 'no motion is paused'
        return ''

    def _obey(self, command: Request) -> None:
        if isinstance(command, Take):
            self.is_taken, self.is_neutral = True, False
            self._set(state='ready', reason=None)
        elif isinstance(command, Release):
            self.end_code = 0
        elif isinstance(command, Run):
            self.elapsed = 0.0
            is_watched = 'watched' in command.text
            self.hold = HELD_FOR if is_watched else None
            self._set(watch=Watch('clear') if is_watched else None)
            self._set(state='driving', motion=command.name, step=1, steps=4, reason=None,
                      start=self.state.driven)
        elif isinstance(command, Pause):
            self._hold(0.0, 0.0)
            self.is_paused = True
            self._set(state='paused', held_by=None)
        elif isinstance(command, Resume):
            self.is_paused = False
            self._set(state='driving')
        elif isinstance(command, Speed):
            self.factor = command.factor
            self._set(factors={'override': command.factor})

    def _take_hand(self, hand: Hand) -> None:
        is_zero = hand.linear_x == hand.angular_z == 0.0
        if (self.state.state not in ('ready', 'driving by hand')
                or hand.sequence <= self.last_sequence or hand.stamp not in self.stamps
                or hand.stamp < self.last_stamp or boottime() - hand.stamp >= LEASE):
            return
        self.last_sequence, self.last_stamp = hand.sequence, hand.stamp
        self.is_neutral = self.is_neutral or is_zero
        if self.is_neutral:
            self._hold(hand.linear_x, hand.angular_z)
            self._set(state='ready' if is_zero else 'driving by hand')

    def _hold(self, linear_x: float, angular_z: float) -> None:
        """Send another velocity, and report how long the last one was held."""
        if (linear_x, angular_z) == self.velocity:
            return
        held = time.monotonic() - self.velocity_since
        if self.state.state == 'driving by hand':
            self._write(Sent(((*self.velocity, held),)))
        self.velocity, self.velocity_since = (linear_x, angular_z), time.monotonic()

    def _tick(self) -> None:
        now = boottime()
        if self.is_taken:
            self.stamps.append(now)
            self._write(Stamp(now))
        if self.state.state == 'driving by hand' and now > self.last_stamp + LEASE:
            self._hold(0.0, 0.0)
            self.is_neutral = False
            self._set(state='ready')
        if self.state.watch is not None:
            self._watch()
        if self.state.state == 'driving':
            self._advance_motion()
        if self.stop_ids:
            is_confirmed = None if self.options.no_odometry else True
            for stop_id in self.stop_ids:
                self._write(Answer(stop_id, True, 'the robot stands still', is_confirmed))
            self.stop_ids.clear()
            if self.options.stopped is None:
                self._set(state='ready' if self.is_taken else 'standing by')
            else:
                self._set(state='stopped', is_still=json.loads(self.options.stopped))
        x, y, theta = self.pose
        linear_x, angular_z = self.velocity
        self.pose = (x + linear_x * math.cos(theta) * PERIOD,
                     y + linear_x * math.sin(theta) * PERIOD, theta + angular_z * PERIOD)
        self._set(
            battery=self.options.battery, robot_errors=self.options.errors or None,
            velocity=self.velocity, odometry_age=None if self.options.no_odometry else 0.02,
            driven=None if self.options.no_odometry else self.pose)
        if self.state != self.last_state:
            self.last_state = self.state
            self._write(self.state)

    def _watch(self) -> None:
        """Hold a motion for a while, and go on; a person may pause meanwhile."""
        self._write(Scan(self.state.driven, SEEN))
        if self.hold is None or self.elapsed < HELD_FROM:
            return
        self.hold -= PERIOD
        is_held = self.hold > 0.0
        if not is_held:
            self.hold = None
        if self.state.state in ('driving', 'paused') and not self.is_paused:
            self._hold(0.0, 0.0)
            self._set(state='paused' if is_held else 'driving')
        self._set(
            watch=Watch('obstacle', 0.31, 0.0) if is_held else Watch('clear'),
            held_by='obstacle 0.31 m ahead, goes on by itself' if is_held and not self.is_paused
            else None)

    def _advance_motion(self) -> None:
        duration: float = self.options.duration
        self.elapsed += PERIOD * self.factor
        progress = min(1.0, self.elapsed / duration)
        x, y, theta = self.state.start or (0.0, 0.0, 0.0)
        self._hold(SPEED * self.factor, 0.0)
        self._set(
            progress=progress, step=min(4, 1 + int(4 * progress)),
            remaining=max(0.0, duration - self.elapsed) / self.factor,
            planned=(x + SPEED * self.elapsed * math.cos(theta),
                     y + SPEED * self.elapsed * math.sin(theta), theta))
        if progress >= 1.0:
            self._hold(0.0, 0.0)
            self._set(state='ready', progress=1.0, remaining=0.0, reason='done')

    def _record(self, line: bytes) -> None:
        if self.is_recorded:
            with Path(self.options.record).open('ab') as stream:
                entry = {'time': time.monotonic(), 'line': json.loads(line)}
                stream.write(json.dumps(entry).encode() + b'\n')

    def _hello(self) -> None:
        footprint = ((HALF_LENGTH, HALF_WIDTH), (-HALF_LENGTH, HALF_WIDTH),
                     (-HALF_LENGTH, -HALF_WIDTH), (HALF_LENGTH, -HALF_WIDTH))
        self._write(Robot(
            'scripted', '/cmd_vel', not self.options.no_odometry, 0.3, 0.3, 1.57, footprint,
            floor=FLOOR if self.options.floor else None))

    def end_state(self, reason: str) -> Report:
        """Return the state of a process that ends."""
        return replace(self.state, state='ended', reason=reason)

    def run(self) -> int:
        """Exchange lines until the input is closed or the robot is released; return the code."""
        print('[INFO] [scripted]: started', file=sys.stderr, flush=True)
        time.sleep(self.options.start_delay)
        self._hello()
        self._write(Log('info', f'process {os.getpid()}'))
        due, rest = time.monotonic(), b''
        while self.end_code is None:
            wait = max(0.0, due - time.monotonic())
            if select.select([0], [], [], wait)[0] and not self.options.deaf:
                data = os.read(0, 65536)
                if not data:
                    self.end_code = 0
                    break
                *lines, rest = (rest + data).split(b'\n')
                for line in lines:
                    self._record(line)
                    try:
                        command = read_command(line, self.COMMANDS)
                    except MessageError as error:
                        self._write(Log('error', str(error)))
                    else:
                        if not isinstance(command, Alive):
                            self._handle(command)
            elif self.options.deaf:
                time.sleep(wait)
            if time.monotonic() >= due:
                due = max(due + PERIOD, time.monotonic())
                self._tick()
        return self.end_code


def parser_of_all() -> argparse.ArgumentParser:
    """Return a parser of the options that each scripted process has."""
    parser = argparse.ArgumentParser()
    parser.add_argument('--record', help='append each line that comes in to this file')
    parser.add_argument('--no-odometry', action='store_true')
    parser.add_argument('--battery', type=float, default=0.8, help='its charge')
    parser.add_argument('--stopped', help='what odometry shows after a stop: true, false, null')
    parser.add_argument('--errors', default='', help='the errors that the robot reports')
    parser.add_argument('--report', help='write a report to this folder at the end')
    parser.add_argument('--refuse', action='store_true', help='refuse to take the robot')
    parser.add_argument('--floor', action='store_true', help='tell what stands on it')
    parser.add_argument('--deaf', action='store_true', help='never read a line')
    parser.add_argument('--start-delay', type=float, default=0.0, help='before the first line [s]')
    return parser


def serve(drive: ScriptedDrive) -> int:
    """Run a process until its standard input is closed, or a signal ends it."""

    def interrupted(signum: int, _: object) -> None:
        print('[ERROR] [scripted]: stopped by a signal', file=sys.stderr, flush=True)
        os.write(1, write_line(drive.end_state('stopped by a signal')))
        os._exit(128 + signum)

    signal.signal(signal.SIGINT, interrupted)
    signal.signal(signal.SIGTERM, interrupted)
    code = drive.run()
    if drive.options.report is not None:
        folder = Path(drive.options.report)
        folder.mkdir(parents=True)
        (folder / PAGE).write_text('<title>of the drive</title>')
    return code


def main(arguments: list[str] | None = None) -> int:
    """Imagine one robot."""
    parser = parser_of_all()
    parser.add_argument('--duration', type=float, default=4.0, help='of a motion [s]')
    options, _ = parser.parse_known_args(arguments)
    return serve(ScriptedDrive(options))


if __name__ == '__main__':
    sys.exit(main())
