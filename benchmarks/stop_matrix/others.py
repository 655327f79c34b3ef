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
"""Faults from other nodes during a drive: other publishers, a second program, restarts."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import threading
import time

from benchmarks.stop_matrix.faults import MAX_STOP_DURATION, no_fault
from benchmarks.stop_matrix.trial_setup import OTHER_VELOCITY, TrialContext

#: The time until the graph lists a new publisher [s].
DISCOVERY_TIME = 0.6
#: The duration and the period of sending by another publisher [s].
SEND_DURATION, SEND_PERIOD = 4.5, 0.1
#: The period of a publisher that already drives the robot [s].
DRIVE_PERIOD = 0.05
#: The longest time from the start of a second program to its first velocity, or to its end [s].
START_TIMEOUT = 20.0
#: The time after which a program that must stop sends no velocity [s].
STOP_TIMEOUT = 1.0
#: The exit code of a program that may not drive the robot.
REFUSED = 3
#: The number of other nodes during a drive, and their restarts per second.  Two processors can
#: run these; with 28 nodes they were fully loaded, and half of the runs were ended.
NODES, RESTARTS = 20, 3.0
#: The time for discovery before the drive, and the longest duration of a trial beyond its motion
#: [s].
SETTLING_TIME, MAX_OVERHEAD = 10.0, 20.0


@contextlib.contextmanager
def driving(context: TrialContext) -> Iterator[None]:
    """Let another publisher drive the robot during the ``with`` block."""
    other, end = context.recorder.add_publisher(), threading.Event()

    def drive() -> None:
        while not end.wait(DRIVE_PERIOD):
            other.send(OTHER_VELOCITY)

    thread = threading.Thread(target=drive)
    thread.start()
    try:
        # Odometry then shows the motion.
        time.sleep(DISCOVERY_TIME)
        yield
    finally:
        end.set()
        thread.join()
        other.close()


def check_nothing_sent(context: TrialContext, _fault: float) -> list[str]:
    """Check that a program sent nothing, not even a zero, to a robot that is already driven."""
    ours = [velocity for velocity in context.recorder.sent_since(context.first)
            if velocity.linear_x != OTHER_VELOCITY]
    return ['it sent something'] if ours else []


def publish_at_once(context: TrialContext) -> float:
    """Add a publisher that sends at once; return the time of sending [s, system clock]."""
    context.other = context.recorder.add_publisher()
    return context.other.send(OTHER_VELOCITY)


def publish_after_discovery(context: TrialContext) -> float:
    """Add a publisher that sends after its discovery; return the time [s, system clock]."""
    context.other = context.recorder.add_publisher()
    time.sleep(DISCOVERY_TIME)
    return context.other.send(OTHER_VELOCITY)


def keep_publishing(context: TrialContext) -> None:
    """Let the other publisher send for SEND_DURATION, and then remove it."""
    assert context.other is not None
    end = time.monotonic() + SEND_DURATION
    while time.monotonic() < end:
        time.sleep(SEND_PERIOD)
        context.other.send(OTHER_VELOCITY)
    context.other.close()


def never_publish(context: TrialContext) -> float:
    """Add a publisher that never sends, which is no fault."""
    context.other = context.recorder.add_publisher()
    return no_fault(context)


def check_zeros_ended(context: TrialContext, _fault: float) -> list[str]:
    """Check that the program's zeros ended, so that the other publisher could drive."""
    zeros = context.stop_zeros()
    fought = bool(zeros) and zeros[-1] - zeros[0] > MAX_STOP_DURATION
    return ['it fought the other with zeros'] if fought else []


def start_second_program(context: TrialContext) -> float:
    """Start the same program a second time, which is no fault for the first."""
    context.second = context.start_program()
    return no_fault(context)


def check_refused(context: TrialContext, _fault: float) -> list[str]:
    """Check that the second program was refused with a message that names the first program."""
    assert context.second is not None
    code = context.second.code_within(START_TIMEOUT)
    named = f'(process {context.program.process.pid}' in context.second.text
    return [*([f'the newcomer ended with {code}'] if code != REFUSED else []),
            *([] if named else ['the newcomer was not told who drives'])]


def discover_second_program(context: TrialContext) -> float:
    """Start a second program; both receive the claim of the other while both drive."""
    connected = context.program.folder / 'connected'
    context.second = context.start_program(
        SPEED=str(OTHER_VELOCITY), CONNECTED=str(connected))
    context.second.go()
    if context.recorder.wait_for(lambda velocity: velocity.linear_x == OTHER_VELOCITY,
                                 context.first, START_TIMEOUT) is None:
        context.violations.append('the second program never moved')
    time.sleep(DISCOVERY_TIME)
    now = time.time()
    connected.touch()
    return now


def check_both_stopped(context: TrialContext, fault: float) -> list[str]:
    """Check that the second program also stopped."""
    assert context.second is not None
    code = context.second.code_within(START_TIMEOUT)
    after = [velocity for velocity in context.recorder.sent_since(fault + STOP_TIMEOUT)
             if velocity.moves]
    return [*([f'the second program ended with {code}'] if code != 1 else []),
            *(['the second program drove on'] if after else [])]


@contextlib.contextmanager
def restarting_nodes(context: TrialContext) -> Iterator[None]:
    """Run many other nodes during the ``with`` block, and restart them one after the other."""
    # Imported here, because it imports rclpy, which listing the rows must not do.
    from benchmarks.stop_matrix.restarting_nodes import others
    longest = SETTLING_TIME + MAX_OVERHEAD + context.row.duration
    with others(NODES, RESTARTS, longest, context.robot.domain):
        time.sleep(SETTLING_TIME)
        yield
