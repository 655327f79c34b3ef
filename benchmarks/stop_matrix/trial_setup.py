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
"""The rows of the matrix; set up and run one trial, and find the last message of its program."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from itertools import pairwise
import re
import time
from typing import TYPE_CHECKING

from benchmarks.stop_matrix import scripts
from benchmarks.stop_matrix.expectation import Expectation, Trial, Zero
from benchmarks.stop_matrix.program import ScriptProgram

if TYPE_CHECKING:
    # These import rclpy, which listing the rows must not do.
    from benchmarks.stop_matrix.lasers import Lasers
    from benchmarks.stop_matrix.observer import OtherPublisher, RobotRecorder
    from benchmarks.stop_matrix.robot_pool import PooledRobot

#: The velocity of other publishers [m/s].
OTHER_VELOCITY = 0.05
#: The velocity of a second program that drives the same robot [m/s].
SECOND_VELOCITY = 0.08
#: The longest time from the fault and its later actions to the end of a program [s].
EXIT_TIMEOUT = 6.0
#: The time after which a killed program sends nothing [s].
SEND_LATENCY = 0.02
#: The time of recording after the end of a program [s].
SETTLING_TIME = 0.5
#: The tolerance that excludes the first velocity from the messages after the start [s].
START_TOLERANCE = 0.01
#: The largest interval between the zeros of a burst, which starts a stop; zeros of a pause have
#: longer intervals [s].
BURST_GAP = 0.005
#: Match the text before a message, in a line of a log and of the program.
LOG_PREFIX = re.compile(r'^\[\w+\] \[[\d.]+\] \[[\w./]+\]: ')
PROGRAM_PREFIX = re.compile(
    r'^(kachaka_simple_control: |kachaka_fleet: |kachaka_simple_control\.[\w.]+: )')
#: Matches a change of the colour.
COLOUR = re.compile(r'\x1b\[[\d;]*m')
#: Matches the path of a trial's script.
SCRIPT = re.compile(r'/\S*/script\.py')
#: The longest message that is returned whole [characters].
MAX_LENGTH = 100
#: Lines that each program logs.
ROUTINE = (
    'Robot control node has started', 'Robot has stopped', 'The robots have stopped',
    'Each robot is trusted to stand', 'Movement completed', 'Paused: ',
    'Resumed', 'Held: ', 'Goes on: ', 'Calibrated: ', 'The robot did not confirm')


@dataclass(frozen=True)
class Row:
    """A row of the matrix: a fault, its injector, and the expected result."""

    expectation: Expectation
    inject: Callable[[TrialContext], float]
    script: str = scripts.COMMAND
    options: tuple[str, ...] = ()
    duration: float = 600.0
    after: Callable[[TrialContext], None] | None = None
    check: Callable[[TrialContext, float], list[str]] | None = None
    exclusive: bool = True
    full: int = 20
    quick: int = 1
    background: Callable[[TrialContext], AbstractContextManager[None]] = nullcontext
    output: str = 'file'
    moves: bool = True
    slow_robot: bool = False
    over_link: bool = False
    robot_reusable: bool = True
    measures_distance: bool = True
    batch_size: int = 6
    robots: int = 1
    has_lasers: bool = False


class TrialContext:
    """Processes and times of a trial; the constructor starts the program, ``end`` ends it."""

    def __init__(self, row: Row, robot: PooledRobot) -> None:
        self.row, self.robot, self.recorder = row, robot, robot.recorder
        #: one for each robot that the program drives
        self.recorders = [robot.recorder, *robot.others(row.robots - 1)]
        #: the lasers of these robots; None if the row has none
        self.lasers: Lasers | None = robot.lasers(row.robots if row.has_lasers else 0)
        self.program = self.start_program()
        #: the violations of this trial, as sentences
        self.violations: list[str] = []
        #: the time of the first velocity [s, system clock]
        self.first = 0.0
        #: the time after which all messages belong to the stop [s, system clock]
        self.counted_from = 0.0
        #: whether the program sends zeros before the fault, because of a pause
        self.was_paused = False
        #: the time of a later change of the robot or the program [s, system clock]
        self.changed = 0.0
        #: another publisher of velocities
        self.other: OtherPublisher | None = None
        #: a second program of this package for the same robot
        self.second: ScriptProgram | None = None

    def start_program(self, **variables: str) -> ScriptProgram:
        """Start the row's script for the robot; ``variables`` are added to its environment."""
        options = ['--ros-args']
        for option in (f'robot_namespace:={self.recorder.namespace}', 'robot_timeout:=30.0',
                       *self.row.options):
            options += ['-p', option]
        environment = {
            'DURATION': str(self.row.duration), 'ROS_DOMAIN_ID': str(self.robot.domain),
            'ROBOTS': ' '.join(recorder.namespace for recorder in self.recorders),
            **variables}
        return ScriptProgram(
            self.row.script, options, environment, self.row.output, self.robot.network)

    def wait_until_ready(self) -> None:
        """Wait until the program is connected to its robot; restart a failed program once."""
        if self.lasers is not None:
            self.lasers.wait_until_there()
        try:
            self.program.wait_until_ready()
        except RuntimeError as error:
            print(f'\nStarted again: {error}')
            self.program.close()
            self.program = self.start_program()
            self.program.wait_until_ready()

    def start_motion(self) -> None:
        """Start the program's motion, and wait for its first velocities, if its row has some."""
        began = self.first = time.time()
        self.program.go()
        for recorder in self.recorders if self.row.moves else ():
            first = recorder.wait_for(lambda velocity: velocity.moves, began, EXIT_TIMEOUT)
            if first is None:
                self.violations.append('it never moved')
            else:
                self.first = max(self.first, first.time)
        self.counted_from = self.first + START_TOLERANCE

    def stop_zeros(self, recorder: RobotRecorder | None = None) -> list[float]:
        """
        Return the times of the zeros of the stop [s, system clock].

        :param recorder: the recorder of the robot; None for the first robot
        """
        recorder = recorder or self.recorder
        zeros = [one.time for one in recorder.sent_since(self.counted_from) if not one.moves]
        return from_burst_on(zeros) if self.was_paused else zeros

    def end(self) -> None:
        """End the running programs, and remove their files."""
        for program in filter(None, (self.program, self.second)):
            program.close()


def inject_fault(context: TrialContext, pause: Callable[[], float]) -> float:
    """Start the motion, inject the fault, and wait for the first zero if the row is exclusive."""
    context.start_motion()
    time.sleep(pause())
    row = context.row
    fault = row.inject(context)
    if row.exclusive and row.expectation.zero is not Zero.NONE:
        context.recorder.wait_for(
            lambda velocity: not velocity.moves, context.counted_from,
            fault - time.time() + 0.5)
    return fault


def finish_trial(context: TrialContext, fault: float) -> Trial:
    """Run the later actions of the row, wait for the end of the program, and return the result."""
    row, recorder = context.row, context.recorder
    if row.after is not None:
        row.after(context)
    code = context.program.code_within(EXIT_TIMEOUT if row.expectation.codes else 0.0)
    time.sleep(SETTLING_TIME)
    if row.check is not None:
        context.violations += row.check(context, fault)
    text = context.program.text
    if not context.program.close():
        context.violations.append('its guardian outlived it')
    zeros = [context.stop_zeros(recorder) for recorder in context.recorders]
    distance = row.measures_distance and row.expectation.zero is not Zero.AT_END
    return Trial(
        # With several robots, the robot that is stopped last counts.
        zero=max(times[0] for times in zeros) - fault if all(zeros) else None,
        zeros=min(map(len, zeros)),
        late=sum(_late(context, *sent, fault) for sent in zip(context.recorders, zeros)),
        metres=recorder.distance_since(fault) if distance else None,
        code=code,
        message=last_message(text, recorder.namespace, 'rclpy.init()' in row.script),
        broken=tuple(context.violations))


def from_burst_on(zeros: list[float]) -> list[float]:
    """Return the zeros of a stop, which begins with a burst, without those of a pause before."""
    begin = (number for number, (one, two) in enumerate(pairwise(zeros)) if two - one < BURST_GAP)
    return zeros[next(begin, len(zeros)):]


def _late(
        context: TrialContext, recorder: RobotRecorder, zeros: list[float], fault: float) -> int:
    """Return the number of the program's velocities to a robot after the first zero."""
    # A program may be sending a velocity at the moment of its kill.
    stopped = zeros[0] if zeros else fault + SEND_LATENCY
    return sum(
        one.moves and one.linear_x not in (OTHER_VELOCITY, SECOND_VELOCITY) and one.time > stopped
        for one in recorder.sent_since(context.counted_from))


def last_message(text: str, namespace: str, traceback_expected: bool) -> str:
    """Return the last printed line of a program, without routine log lines."""
    plain = COLOUR.sub('', text)
    lines = [PROGRAM_PREFIX.sub('', LOG_PREFIX.sub('', line)).strip()
             for line in plain.splitlines() if not line.startswith((' ', 'Traceback'))]
    messages = [line for line in lines if line and not line.startswith(ROUTINE)]
    last = (messages[-1] if messages else '').replace(namespace, 'kachaka')
    last = SCRIPT.sub('script.py', last)
    last = last if len(last) <= MAX_LENGTH else last[:MAX_LENGTH].rsplit(' ', 1)[0] + ' ...'
    return f'Traceback: {last}' if 'Traceback' in text and not traceback_expected else last
