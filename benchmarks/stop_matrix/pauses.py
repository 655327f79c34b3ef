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
"""Inject faults in a corner, or while a program is held, brakes for a pause, or resumes."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
import random
import signal
import time
from typing import TYPE_CHECKING

from benchmarks.stop_matrix.faults import check_guardian_silent, Injector
from benchmarks.stop_matrix.lasers import Mode
from benchmarks.stop_matrix.trial_setup import OTHER_VELOCITY, TrialContext

if TYPE_CHECKING:
    # This imports rclpy, which listing the rows must not do.
    from listener import SentVelocity

#: The velocity of the program before the pause [m/s].
CRUISE = 0.3
#: The longest change of the state [s]: 0.1 s until the next message, 0.85 s to brake, and a
#: margin for a loaded machine.
CHANGE_TIMEOUT = 3.0
#: The time from the first message of a change to the fault [s]; braking and speeding up take
#: 0.85 s.
TIME_TO_FAULT = (0.1, 0.3)

#: The time from the first message in a corner to the fault, or to the pause [s].  A corner of the
#: script takes 1.9 s, so that a pause also ends in it.
TIME_IN_CORNER = (0.2, 1.2)
#: The time on hold before the push, the time after the push, and the time in which a resumed
#: motion would be seen [s].
REST_TIME, PUSH_TIME, ASK_TIME = 1.0, 0.3, 1.0


class State(Enum):
    """The state of a program at the fault."""

    BRAKING = 'braking for a pause'
    PAUSED = 'paused'
    RESUMING = 'speeding up after a pause'
    HELD = 'held by an obstacle'

    def shows(self, velocity: SentVelocity) -> bool:
        """Return whether a velocity belongs to this state."""
        if self in AT_REST:
            return not velocity.moves
        return 0.0 < velocity.linear_x < CRUISE


#: The states in which the robot does not move.
AT_REST = (State.PAUSED, State.HELD)


def at(state: State, inject: Injector) -> Injector:
    """Return an injector that brings a driving program to a state, and then injects a fault."""
    def inject_then(context: TrialContext) -> float:
        if state is State.HELD:
            assert context.lasers is not None
            context.lasers.switch(Mode.OBSTACLE)
        _reach(context, None if state is State.HELD else 'pause', State.BRAKING)
        if state is not State.BRAKING:
            _reach(context, None, state if state in AT_REST else State.PAUSED)
        if state is State.RESUMING:
            time.sleep(random.uniform(*TIME_TO_FAULT))
            _reach(context, 'resume', state)
        time.sleep(random.uniform(*TIME_TO_FAULT))
        before = context.recorder.sent_since(context.first)[-1]
        if not state.shows(before):
            context.violations.append(f'it sent {before.linear_x:g} m/s before the fault')
        context.was_paused = state in AT_REST
        context.counted_from = time.time()
        fault = inject(context)
        context.counted_from = fault
        return fault
    return inject_then


def in_corner(inject: Injector) -> Injector:
    """Return an injector that waits until a program is in a corner, and then injects a fault."""
    def inject_then(context: TrialContext) -> float:
        context.recorder.wait_for(_is_in_corner, context.first, CHANGE_TIMEOUT)
        time.sleep(random.uniform(*TIME_IN_CORNER))
        before = context.recorder.sent_since(context.first)[-1]
        if not _is_in_corner(before):
            context.violations.append(
                f'it was in no corner: {before.linear_x:g} m/s, {before.angular_z:g} rad/s')
        return inject(context)
    return inject_then


def _is_in_corner(velocity: SentVelocity) -> bool:
    return velocity.linear_x != 0.0 and velocity.angular_z != 0.0


def resume_continued(seconds: float) -> Callable[[TrialContext], None]:
    """Return a function that waits for a time [s], requests a resume, and ends the freeze."""
    def after(context: TrialContext) -> None:
        time.sleep(seconds)
        context.program.write_line('resume')
        context.changed = context.program.send(signal.SIGCONT)
    return after


def push_and_ask(hold: str, ask: str) -> Injector:
    """
    Return an injector that pushes a robot on hold, and then requests to resume the motion.

    At the end, the injector ends the program with SIGINT.
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
    """Check that a pushed robot did not move after the request to resume."""
    return check_no_velocity(context, context.changed)


def check_no_velocity(context: TrialContext, fault: float) -> list[str]:
    """Check that a paused program sent no velocity after the fault."""
    moving = [velocity for velocity in context.recorder.sent_since(fault)
              if velocity.moves and velocity.linear_x != OTHER_VELOCITY]
    return ['it moved on'] if moving else []


def check_not_resumed(context: TrialContext, fault: float) -> list[str]:
    """Check that a continued program did not resume, and that its guardian was silent before."""
    return check_guardian_silent(context, fault) + check_no_velocity(context, fault)


def _reach(context: TrialContext, command: str | None, state: State) -> None:
    """Send the program a command, if any, and wait for the first message of a state."""
    now = time.time()
    if command is not None:
        context.program.write_line(command)
    if context.recorder.wait_for(state.shows, now, CHANGE_TIMEOUT) is None:
        context.violations.append(f'it was never {state.value}')
