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
"""One trial: a program, its robot, and the fault that is injected."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from itertools import pairwise
import time
from typing import TYPE_CHECKING

from benchmarks.stop_matrix import scripts
from benchmarks.stop_matrix.expectation import Expectation, Zero
from benchmarks.stop_matrix.message import last_message
from benchmarks.stop_matrix.program import ScriptProgram
from benchmarks.stop_matrix.trial import Trial

if TYPE_CHECKING:
    # These load rclpy, which is too early while rows are only listed.
    from benchmarks.stop_matrix.observer import OtherPublisher
    from benchmarks.stop_matrix.robot_pool import PooledRobot

#: Velocity of other publishers [m/s].
OTHER_VELOCITY = 0.05
#: Velocity of a program beside another one that drives the same robot [m/s].
SECOND_VELOCITY = 0.08
#: How long a program may take from its fault, and what followed, to its end [s].
EXIT_TIMEOUT = 6.0
#: A killed program sends nothing later than this [s].
SEND_LATENCY = 0.02
#: How long recording goes on after the end [s].
SETTLING_TIME = 0.5
#: The first velocity is not counted as sent after the start, nor rounded to before it [s].
START_TOLERANCE = 0.01
#: The zeros with which a stop begins follow each other sooner than this; those of a pause do not
#: [s].
BURST_GAP = 0.005


@dataclass(frozen=True)
class Row:
    """
    A row of the matrix: a fault, how to inject it, and what is expected.

    :param expectation: what is expected; names the row
    :param inject: injects the fault; returns when it happened [s, system clock]
    :param script: the program
    :param options: its node parameters, ``name:=value``
    :param duration: of its motion [s]
    :param after: what follows the fault while other trials go on
    :param check: further checks after the end, given the time of the fault; returns sentences
    :param exclusive: whether no other trial is measured before this one's first zero
    :param full: number of trials in the full form
    :param quick: number of trials in the quick form
    :param background: what runs beside a batch of trials, from before their motions; is given the
        first trial of the batch
    :param output: what the program prints to, see ``ScriptProgram``
    :param moves: whether it moves at all
    :param slow_robot: whether each call to its robot takes 250 ms
    :param robot_reusable: whether its robot can be used for another trial
    :param measures_distance: whether the distance that the robot drove is meaningful
    :param batch_size: number of programs that are prepared at once
    """

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
    robot_reusable: bool = True
    measures_distance: bool = True
    batch_size: int = 6


class TrialContext:
    """
    The processes and times of one trial; starts the program, ``end`` ends it.

    :param row: the fault
    :param robot: the robot that the program drives
    """

    def __init__(self, row: Row, robot: PooledRobot) -> None:
        self.row, self.robot, self.recorder = row, robot, robot.recorder
        self.program = self.start_program()
        #: what did not go as expected for this row alone
        self.violations: list[str] = []
        #: when the first velocity was sent [s, system clock]
        self.first = 0.0
        #: from when on what is sent belongs to the stop [s, system clock]
        self.counted_from = 0.0
        #: whether the program sends zeros by itself when the fault comes
        self.was_paused = False
        #: when something else happened to the robot [s, system clock]
        self.changed = 0.0
        #: another publisher of velocities
        self.other: OtherPublisher | None = None
        #: another program of ours for the same robot
        self.second: ScriptProgram | None = None

    def start_program(self, **variables: str) -> ScriptProgram:
        """Start the row's script for the robot; ``variables`` are added to its environment."""
        options = ['--ros-args']
        for option in (f'robot_namespace:={self.recorder.namespace}', 'robot_timeout:=30.0',
                       *self.row.options):
            options += ['-p', option]
        environment = {
            'DURATION': str(self.row.duration), 'ROS_DOMAIN_ID': str(self.robot.domain),
            **variables}
        return ScriptProgram(self.row.script, options, environment, self.row.output)

    def wait_until_ready(self) -> None:
        """Wait until the program is connected to its robot; if it fails, start it again, once."""
        try:
            self.program.wait_until_ready()
        except RuntimeError as error:
            print(f'\nStarted again: {error}')
            self.program.close()
            self.program = self.start_program()
            self.program.wait_until_ready()

    def start_motion(self) -> None:
        """Start the program's motion, and wait for its first velocity, if its row has one."""
        self.first = time.time()
        self.program.go()
        if self.row.moves:
            first = self.recorder.wait_for(
                lambda velocity: velocity.moves, self.first, EXIT_TIMEOUT)
            if first is None:
                self.violations.append('it never moved')
            else:
                self.first = first.time
        self.counted_from = self.first + START_TOLERANCE

    def stop_zeros(self) -> list[float]:
        """Return when the zeros of the stop were sent [s, system clock]."""
        zeros = [one.time for one in self.recorder.sent_since(self.counted_from)
                 if not one.moves]
        return from_burst_on(zeros) if self.was_paused else zeros

    def end(self) -> None:
        """End the programs that still run, and remove their files."""
        for program in filter(None, (self.program, self.second)):
            program.close()


def inject_fault(context: TrialContext, pause: Callable[[], float]) -> float:
    """
    Start the motion, inject the fault, and wait for the first zero if the row is exclusive.

    :param context: the trial
    :param pause: returns the time from the first velocity to the fault [s]
    :returns: when the fault happened [s, system clock]
    """
    context.start_motion()
    time.sleep(pause())
    row = context.row
    fault = row.inject(context)
    if row.exclusive and row.expectation.zero is not Zero.NONE:
        context.recorder.wait_for(
            lambda velocity: not velocity.moves, context.counted_from,
            fault - time.time() + 0.5)
    return fault


def from_burst_on(zeros: list[float]) -> list[float]:
    """
    Return the zeros of a stop, which begins with several at once, without those of a pause.

    :param zeros: when they were sent [s]
    """
    begin = (number for number, (one, two) in enumerate(pairwise(zeros)) if two - one < BURST_GAP)
    return zeros[next(begin, len(zeros)):]


def finish_trial(context: TrialContext, fault: float) -> Trial:
    """
    Let the rest of the row happen, wait for the end of the program, and return the result.

    :param context: the trial
    :param fault: when the fault happened [s, system clock]
    """
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
    velocities, zeros = recorder.sent_since(context.counted_from), context.stop_zeros()
    # A program that is killed may be sending a velocity at that moment.
    stopped = zeros[0] if zeros else fault + SEND_LATENCY
    distance = row.measures_distance and row.expectation.zero is not Zero.AT_END
    return Trial(
        zero=zeros[0] - fault if zeros else None,
        zeros=len(zeros),
        late=sum(
            one.moves and one.linear_x not in (OTHER_VELOCITY, SECOND_VELOCITY)
            and one.time > stopped for one in velocities),
        metres=recorder.distance_since(fault) if distance else None,
        code=code,
        message=last_message(text, recorder.namespace, 'rclpy.init()' in row.script),
        broken=tuple(context.violations))
