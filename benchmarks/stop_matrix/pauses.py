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
"""Faults that come while a program is paused, brakes for that, or speeds up again after it."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
import random
import signal
import time
from typing import TYPE_CHECKING

from benchmarks.stop_matrix.faults import check_guardian_silent, Injector
from benchmarks.stop_matrix.trial_setup import OTHER_VELOCITY, TrialContext

if TYPE_CHECKING:
    # This loads rclpy, which is too early while rows are only listed.
    from listener import SentVelocity

#: The velocity of the program before the pause [m/s].
CRUISE = 0.3
#: How long a change may take [s]: 0.1 s until the next message, 0.85 s to brake, the rest for a
#: loaded machine.
CHANGE_TIMEOUT = 3.0
#: From the first message of a change to the fault [s]; braking and speeding up take 0.85 s.
TIME_TO_FAULT = (0.1, 0.3)

#: How long odometry shows a robot that is held at rest, and then where it was pushed to; and how
#: long a robot that goes on would need to be seen [s].
REST_TIME, PUSH_TIME, ASK_TIME = 1.0, 0.3, 1.0


class State(Enum):
    """What a program does when the fault comes."""

    BRAKING = 'braking for a pause'
    PAUSED = 'paused'
    RESUMING = 'speeding up after a pause'

    def shows(self, velocity: SentVelocity) -> bool:
        """Return whether a velocity is one of this state."""
        if self is State.PAUSED:
            return not velocity.moves
        return 0.0 < velocity.linear_x < CRUISE


def at(state: State, inject: Injector) -> Injector:
    """Return an injector that brings a program in cruise to a state first."""
    def inject_then(context: TrialContext) -> float:
        _reach(context, 'pause', State.BRAKING)
        if state is not State.BRAKING:
            _reach(context, None, State.PAUSED)
        if state is State.RESUMING:
            time.sleep(random.uniform(*TIME_TO_FAULT))
            _reach(context, 'resume', state)
        time.sleep(random.uniform(*TIME_TO_FAULT))
        before = context.recorder.sent_since(context.first)[-1]
        if not state.shows(before):
            context.violations.append(f'it sent {before.linear_x:g} m/s before the fault')
        context.was_paused = state is State.PAUSED
        context.counted_from = time.time()
        fault = inject(context)
        context.counted_from = fault
        return fault
    return inject_then


def resume_continued(seconds: float) -> Callable[[TrialContext], None]:
    """Return what continues a frozen program after a time [s]; it is asked to resume by then."""
    def after(context: TrialContext) -> None:
        time.sleep(seconds)
        context.program.write_line('resume')
        context.changed = context.program.send(signal.SIGCONT)
    return after


def push_and_ask(hold: str, ask: str) -> Injector:
    """
    Return an injector that lets a robot that is held be pushed away, and asks to go on.

    After that it ends the program by SIGINT.

    :param hold: the word that makes the program hold its robot
    :param ask: the word that makes it ask to go on
    """
    def inject(context: TrialContext) -> float:
        _reach(context, hold, State.BRAKING)
        _reach(context, None, State.PAUSED)
        time.sleep(REST_TIME)
        context.program.write_line('push')
        time.sleep(PUSH_TIME)
        context.changed = time.time()
        context.program.write_line(ask)
        time.sleep(ASK_TIME)
        context.was_paused = True
        context.counted_from = time.time()
        return context.program.send(signal.SIGINT)
    return inject


def check_still_held(context: TrialContext, _fault: float) -> list[str]:
    """Check that a robot that was pushed did not move when it was asked to go on."""
    return check_no_velocity(context, context.changed)


def check_no_velocity(context: TrialContext, fault: float) -> list[str]:
    """Check that a program that was paused sent no velocity from the fault on."""
    moving = [velocity for velocity in context.recorder.sent_since(fault)
              if velocity.moves and velocity.linear_x != OTHER_VELOCITY]
    return ['it moved on'] if moving else []


def check_not_resumed(context: TrialContext, fault: float) -> list[str]:
    """Check that a continued program did not resume, and its guardian was silent before."""
    return check_guardian_silent(context, fault) + check_no_velocity(context, fault)


def _reach(context: TrialContext, command: str | None, state: State) -> None:
    """Ask the program for a change, and wait for the first message of a state."""
    now = time.time()
    if command is not None:
        context.program.write_line(command)
    if context.recorder.wait_for(state.shows, now, CHANGE_TIMEOUT) is None:
        context.violations.append(f'it was never {state.value}')
