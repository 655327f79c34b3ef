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
"""Inject faults into a driving program or its robot, and check the results."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from itertools import pairwise
import math
import os
import random
import signal
import time

from benchmarks.machine import busy
from benchmarks.stop_matrix.trial_setup import TrialContext
from waiting import poll

Injector = Callable[[TrialContext], float]
#: The time for which the robot keeps its last velocity [s].
COMMAND_TIMEOUT = 0.3
#: The longest stop [s]: the command timeout plus 0.1 s, and a margin for a loaded machine.
MAX_STOP_DURATION = 0.7
#: The largest movement of a robot that receives no velocity [m].
MAX_REST_DISTANCE = 0.001
#: The largest turn of a robot whose odometry drifts [rad]: 45 degrees, and one more message.
MAX_TURN = math.radians(50.0)


def no_fault(context: TrialContext) -> float:
    """Inject no fault; return the planned end of the motion [s, system clock]."""
    return context.first + context.row.duration


def fault_now(_context: TrialContext) -> float:
    """Inject no fault, because the program stops itself; return the time [s, system clock]."""
    return time.time()


def own_fault(context: TrialContext) -> float:
    """Wait for a fault that the program causes; return the time of the fault [s, system clock]."""
    fault = poll(lambda: context.program.fault, 3.0)
    if fault is None:
        context.violations.append('nothing happened')
        return time.time()
    return fault


def check_corrected(context: TrialContext, fault: float) -> list[str]:
    """Check that odometry corrected the program's velocities before the fault."""
    before = {velocity.linear_x for velocity in context.recorder.sent_since(context.first)
              if velocity.moves and velocity.time < fault}
    return [] if len(before) > 1 else ['it corrected nothing before the fault']


def send_signals(*names: str) -> Injector:
    """Return an injector that sends signals, 0.1 s apart; the first signal is the fault."""
    def inject(context: TrialContext) -> float:
        sent = context.program.send(signal.Signals[names[0]])
        for name in names[1:]:
            time.sleep(0.1)
            context.program.send(signal.Signals[name])
        return sent
    return inject


def interrupt_later(context: TrialContext) -> float:
    """Send the program SIGINT after 1 s on a loaded machine."""
    time.sleep(1.0)
    return context.program.send(signal.SIGINT)


def kill_guardian(context: TrialContext) -> float:
    """Kill the guardian of the program."""
    now = time.time()
    os.kill(context.program.guardian, signal.SIGKILL)
    return now


def freeze_guardian(context: TrialContext) -> float:
    """Freeze the guardian of the program."""
    now = time.time()
    os.kill(context.program.guardian, signal.SIGSTOP)
    return now


def kill_both(context: TrialContext) -> float:
    """Kill the guardian and the program, so that neither can react to the other's end."""
    guardian = context.program.guardian
    now = time.time()
    for pid in (guardian, context.program.process.pid):
        os.kill(pid, signal.SIGKILL)
    return now


def freeze(seconds: float) -> Injector:
    """Return an injector that freezes the program for a time [s]."""
    def inject(context: TrialContext) -> float:
        sent = context.program.send(signal.SIGSTOP)
        time.sleep(seconds)
        context.program.send(signal.SIGCONT)
        return sent
    return inject


def freeze_repeatedly(count: int) -> Injector:
    """Return an injector that freezes the program ``count`` times for 50 ms, which is no fault."""
    def inject(context: TrialContext) -> float:
        for _ in range(count):
            freeze(0.05)(context)
            time.sleep(random.uniform(0.2, 0.4))
        return no_fault(context)
    return inject


def continue_after(seconds: float) -> Callable[[TrialContext], None]:
    """Return a function that continues a frozen program after a time [s]."""
    def after(context: TrialContext) -> None:
        time.sleep(seconds)
        context.changed = context.program.send(signal.SIGCONT)
    return after


def check_guardian_silent(context: TrialContext, fault: float) -> list[str]:
    """Check that the guardian sent nothing after its stop until the end of the freeze."""
    times = [velocity.time for velocity in context.recorder.sent_since(fault)
             if velocity.time < context.changed]
    went_on = bool(times) and times[-1] - times[0] > MAX_STOP_DURATION
    return ['the guardian went on while its program was frozen'] if went_on else []


def close_output(context: TrialContext) -> float:
    """Close the pipe that the program prints to; the program must not stop."""
    context.program.close_output()
    return no_fault(context)


def close_terminal(context: TrialContext) -> float:
    """Close the terminal of the program."""
    return context.program.close_output()


def block_output(signum: str | None = None) -> Injector:
    """Return an injector that blocks the program's output, and then sends a signal, if any."""
    def inject(context: TrialContext) -> float:
        context.program.block_output()
        return send_signals(signum)(context) if signum else no_fault(context)
    return inject


def check_released(context: TrialContext, _fault: float) -> list[str]:
    """Check that zeros were sent longer than the command timeout before control was released."""
    # This imports rclpy, which listing the rows must not do.
    from benchmarks.stop_matrix.robot_pool import RobotProcess
    assert isinstance(context.robot.process, RobotProcess)
    zeros = [velocity.time for velocity in context.recorder.sent_since(context.first + 0.01)
             if not velocity.moves]
    is_complete = bool(zeros) and zeros[-1] - zeros[0] > COMMAND_TIMEOUT
    released = context.robot.process.released_since(zeros[-1] if zeros else context.first)
    return ([] if is_complete else ['the stop was not sent whole']) + (
        [] if released else ['manual control was not released'])


def signal_robot(name: str) -> Injector:
    """Return an injector that sends the robot's bridge a signal; SIGTERM ends it normally."""
    def inject(context: TrialContext) -> float:
        now = time.time()
        context.robot.process.send(signal.Signals[name])
        return now
    return inject


def continue_robot(context: TrialContext) -> None:
    """Continue the robot's bridge after 2 s; its queued velocities must not move the robot."""
    time.sleep(2.0)
    context.changed = time.time()
    context.robot.process.send(signal.SIGCONT)


def check_no_replay(context: TrialContext, _fault: float) -> list[str]:
    """Check that old velocities did not move the robot after its bridge continued."""
    return _check_at_rest(context, 'after it was continued it drove')


def replace_robot(context: TrialContext) -> None:
    """Replace the robot that has left with a new one, and end the program 1.5 s later."""
    time.sleep(1.5)
    before, context.changed = context.recorder.odometry_count, time.time()
    context.robot.replace()
    poll(lambda: context.recorder.odometry_count > before, 8.0)
    time.sleep(1.5)
    if context.recorder.odometry_count <= before:
        context.violations.append('no other robot came')
    context.program.send(signal.SIGTERM)


def check_new_robot_at_rest(context: TrialContext, _fault: float) -> list[str]:
    """Check that the new robot was not moved."""
    return _check_at_rest(context, 'the new robot drove')


def wait_for_drift(context: TrialContext) -> float:
    """Wait until odometry starts to drift; return the time of the start [s, system clock]."""
    context.was_paused = True  # the program sends zeros meanwhile
    return own_fault(context)


def check_turned_little(context: TrialContext, fault: float) -> list[str]:
    """Check that a robot whose odometry drifts did not turn too far."""
    sent = context.recorder.sent_since(fault)
    turned = abs(sum(
        one.angular_z * (two.time - one.time) for one, two in pairwise(sent)))
    return [] if turned < MAX_TURN else [f'it turned by {math.degrees(turned):.0f} degrees']


def disable_manual_control(context: TrialContext) -> float:
    """Disable manual control; the bridge enables it again with the next velocity."""
    context.recorder.disable_manual_control()
    return no_fault(context)


def publish_clock_once(context: TrialContext) -> float:
    """Publish only one message on ``/clock``."""
    context.robot.observer.publish_clock()
    return no_fault(context)


def executed_after(context: TrialContext, since: float) -> list[float]:
    """Return the velocities that the robot executed after a time [s, system clock]."""
    return [velocity for _, velocity in timed_after(context, since)]


def timed_after(context: TrialContext, since: float) -> list[tuple[float, float]]:
    """Return such velocities, each with the time [s] that had passed."""
    executed = context.robot.executed
    assert executed is not None
    # The first velocity creates the file.
    text = executed.read_text() if executed.exists() else ''
    lines = [line.split() for line in text.splitlines()]
    return [(float(at) - since, float(velocity)) for at, velocity in lines if float(at) > since]


def check_execution_order(context: TrialContext, fault: float) -> list[str]:
    """Check that the robot executed a zero, and no velocity after it."""
    after = executed_after(context, fault)
    if 0.0 not in after:
        return ['the robot played no zero']
    return ['the robot played a velocity after its first zero'] * any(after[after.index(0.0):])


def lossy(percent: int, inject: Injector) -> Injector:
    """
    Return an injector that sets the packet loss, waits 1 s, and then injects a fault.

    :param percent: the part of the packets that are lost, in both directions [%]
    """
    def inject_lossy(context: TrialContext) -> float:
        assert context.robot.network is not None
        context.robot.network.set_loss(percent)
        time.sleep(1.0)
        return inject(context)
    return inject_lossy


def cut_link(context: TrialContext) -> float:
    """Pull the cable between program and robot."""
    assert context.robot.network is not None
    now = time.time()
    context.robot.network.disconnect()
    return now


def cut_link_briefly(context: TrialContext) -> float:
    """Pull the cable for 0.6 s, which is no fault."""
    cut_link(context)
    time.sleep(0.6)
    reconnect(0.0)(context)
    return no_fault(context)


def reconnect(seconds: float, after_end: bool = False) -> Callable[[TrialContext], None]:
    """Return a function that plugs the cable in again after a time [s], or after the end."""
    def after(context: TrialContext) -> None:
        assert context.robot.network is not None
        if after_end:
            context.program.code_within(10.0)
        time.sleep(seconds)
        context.changed = time.time()
        context.robot.network.connect()
        time.sleep(2.0 if context.program.is_over else 0.0)
    return after


def check_nothing_old(context: TrialContext, _fault: float) -> list[str]:
    """Check that nothing moved the robot when the cable was back."""
    executed = timed_after(context, context.changed)
    moved = any(velocity for _, velocity in executed)
    return [f'old velocities moved the robot when the cable was back: {executed}'] * moved


def check_zeros_follow(context: TrialContext, _fault: float) -> list[str]:
    """Check that zeros directly followed what was old when the cable was back."""
    executed = timed_after(context, context.changed)
    follows = [after - at for (at, velocity), (after, zero) in pairwise(executed)
               if velocity and not zero]
    ended = bool(executed) and not executed[-1][1] and all(one < 0.05 for one in follows)
    return [] if ended else [f'old velocities, and no zero after them: {executed}']


def wait(seconds: float) -> Callable[[TrialContext], None]:
    """Return a function that waits for a time [s]."""
    return lambda _context: time.sleep(seconds)


def busy_processes(count: int) -> Callable[[TrialContext], AbstractContextManager[None]]:
    """Return a function that runs a number of busy processes in the background."""
    return lambda _context: busy(count)


def _check_at_rest(context: TrialContext, text: str) -> list[str]:
    # A new robot starts at the origin, so only samples after the change count.
    driven = context.recorder.distance_since(context.changed, new_robot=True)
    return [f'{text} {driven:.3f} m'] if driven and driven > MAX_REST_DISTANCE else []
