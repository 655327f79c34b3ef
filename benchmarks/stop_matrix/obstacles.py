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
"""Inject faults while the obstacle watch holds a robot, and faults of its laser."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
import signal
import time
from typing import TYPE_CHECKING

from benchmarks.stop_matrix.expectation import END_TOLERANCE
from benchmarks.stop_matrix.faults import Injector
from benchmarks.stop_matrix.fleets import APART
from benchmarks.stop_matrix.lasers import Lasers, Mode, PERIOD
from benchmarks.stop_matrix.trial_setup import TrialContext
from kachaka_simple_control.control.timing import CLEAR_TIME
from waiting import poll

if TYPE_CHECKING:
    # This imports rclpy, which listing the rows must not do.
    from benchmarks.stop_matrix.observer import RobotRecorder
    from listener import SentVelocity

#: The longest time until a robot is at rest, or goes on, after a change [s].
CHANGE_TIMEOUT = 4.0
#: How long a robot is held, and the time in which a held robot would be seen to move [s].
HELD_TIME = 0.5
#: The time between two velocities [s].
SEND_PERIOD = 0.1
#: The longest time from the last scan to the first velocity of the brake [s]: SCAN_TIMEOUT, a
#: message, and 0.05 s for a loaded machine.
BRAKE_TIMEOUT = 0.5
#: The longest time from the first free scan until a robot goes on [s], likewise.
RELEASE_TIMEOUT = CLEAR_TIME + PERIOD + SEND_PERIOD + 0.1
#: The service that stops the robots of a program.
STOP_SERVICE = '/kachaka_simple_control/stop'


def come_and_go(context: TrialContext) -> float:
    """
    Put an obstacle before a driving robot, and remove it when all robots of the program are held.

    :returns: when the motion, which has a constant velocity, must end [s, system clock]
    """
    lasers = _lasers(context)
    lasers.switch(Mode.OBSTACLE)
    _wait_for_rest(context)
    time.sleep(HELD_TIME)
    context.changed = lasers.switch(Mode.CLEAR)
    moving = [recorder.wait_for(_moves, context.changed, CHANGE_TIMEOUT)
              for recorder in context.recorders]
    context.counted_from = max(one.time if one else context.changed for one in moving)
    if not all(moving):
        context.violations.append('it did not go on')
        return context.counted_from
    return max(map(_planned_end, [context] * len(moving), context.recorders))


def check_goes_on(context: TrialContext, _fault: float) -> list[str]:
    """Check that all robots went on together, in time after the first scan of a free way."""
    moving = [next((one.time for one in recorder.sent_since(context.changed) if one.moves), None)
              for recorder in context.recorders]
    times = [time for time in moving if time is not None]
    if len(times) < len(moving):
        return []  # known already: it did not go on
    first, last = min(times) - context.changed, max(times) - context.changed
    ends = [context.stop_zeros(recorder) for recorder in context.recorders]
    apart = max(map(min, ends)) - min(map(min, ends)) if all(ends) else 0.0
    return [
        *[f'it went on {first:.2f} s after the way was free'] * (first < CLEAR_TIME - PERIOD),
        *[f'it went on only {last:.2f} s after the way was free'] * (last > RELEASE_TIMEOUT),
        *[f'they went on {1e3 * (last - first):.0f} ms apart'] * (last - first > APART),
        *[f'they ended {1e3 * apart:.0f} ms apart'] * (apart > APART)]


def all_held(inject: Injector) -> Injector:
    """Return an injector that holds the robots of a fleet by one of them, and injects a fault."""
    def inject_then(context: TrialContext) -> float:
        _lasers(context).switch(Mode.OBSTACLE)
        _wait_for_rest(context)
        time.sleep(HELD_TIME)
        context.was_paused = True
        context.counted_from = time.time()
        fault = inject(context)
        context.counted_from = fault
        return fault
    return inject_then


def lose_scans(lose: Callable[[Lasers], object]) -> Injector:
    """Return an injector that lets scans end; it returns the time of the last that counts."""
    def inject(context: TrialContext) -> float:
        lasers = _lasers(context)
        lose(lasers)
        last = lasers.last_valid()
        if context.recorder.wait_for(lambda one: not one.moves, last, CHANGE_TIMEOUT) is None:
            context.violations.append('it was not held')
        return last
    return inject


def kill_laser(lasers: Lasers) -> None:
    """Kill the process of the laser."""
    lasers.send(signal.SIGKILL)
    lasers.code_within(1.0)


def fail_by(mode: Mode) -> Callable[[Lasers], float]:
    """Return a function that lets the laser fail."""
    return lambda lasers: lasers.switch(mode)


def interrupt_held(context: TrialContext) -> None:
    """Give a held robot time in which it must not go on, and then interrupt the program."""
    time.sleep(CLEAR_TIME + HELD_TIME)
    context.program.send(signal.SIGINT)


def check_braked(context: TrialContext, fault: float) -> list[str]:
    """Check that a robot began to brake in time after the last scan that counts."""
    sent = context.recorder.sent_since(context.first - 1e-6)
    slower = [two.time for one, two in pairwise(sent)
              if two.time > fault and two.linear_x < one.linear_x]
    late = slower[0] - fault if slower else 0.0
    return [f'it braked only {late:.2f} s after the last scan'] * (late > BRAKE_TIMEOUT)


def break_scans(context: TrialContext) -> float:
    """Publish a part of a scan, which the program cannot read."""
    return _lasers(context).switch(Mode.BROKEN)


def request_stop(context: TrialContext) -> float:
    """Request a stop by the service of the program."""
    return context.robot.observer.request(STOP_SERVICE)


def check_nothing_moved(context: TrialContext, _fault: float) -> list[str]:
    """Check that the robot was not moved, and that the program names the topic of the scans."""
    moved = any(map(_moves, context.recorder.sent_since(context.first)))
    return [*['the robot was moved'] * moved,
            *['it did not say what it needs'] * ('scan' not in context.program.text)]


def _lasers(context: TrialContext) -> Lasers:
    assert context.lasers is not None
    return context.lasers


def _moves(velocity: SentVelocity) -> bool:
    return velocity.moves


def _wait_for_rest(context: TrialContext) -> None:
    """Wait until all robots of the program are held."""
    now = time.time()
    at_rest = poll(lambda: all(
        (sent := recorder.sent_since(now)) and not sent[-1].moves
        for recorder in context.recorders), CHANGE_TIMEOUT)
    if not at_rest:
        context.violations.append('it was not held')


def _planned_end(context: TrialContext, recorder: RobotRecorder) -> float:
    """Return the end of a motion with a constant velocity that was held for some time."""
    sent = recorder.sent_since(context.first - END_TOLERANCE)
    planned = next(one.linear_x for one in sent if one.moves)
    cruise = recorder.wait_for(
        lambda one: one.linear_x >= planned, context.counted_from, CHANGE_TIMEOUT)
    if cruise is None:
        context.violations.append('it went on slower than planned')
        return context.counted_from
    sent = recorder.sent_since(context.first - END_TOLERANCE)
    driven = sum(one.linear_x * (two.time - one.time)
                 for one, two in pairwise(sent) if one.time < cruise.time)
    return cruise.time + context.row.duration - driven / planned
