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
"""What happens to a program in mid-motion, or to its robot."""

from __future__ import annotations

from collections.abc import Callable
import os
import random
import signal
import time
from typing import TYPE_CHECKING

from benchmarks.stop_matrix.robot_process import RobotProcess

if TYPE_CHECKING:
    from benchmarks.stop_matrix.trial_setup import Scene

Cause = Callable[['Scene'], float]
#: A robot keeps its last velocity for this long [s].
HOLD = 0.3
#: A stop is over after this time [s]: the hold, 0.1 s, and as much for a busy machine.
STOP = 0.7
#: A robot that was told nothing moves less than this [m].
STILL = 0.001


def signals(*names: str) -> Cause:
    """
    Return what sends signals to the program, 0.1 s apart.

    :param names: the signals
    :returns: the cause; its time is that of the first signal
    """
    def cause(scene: Scene) -> float:
        sent = scene.program.send(signal.Signals[names[0]])
        for name in names[1:]:
            time.sleep(0.1)
            scene.program.send(signal.Signals[name])
        return sent
    return cause


def frozen(seconds: float) -> Cause:
    """
    Return what freezes the program, and thaws it.

    :param seconds: for how long [s]
    :returns: the cause
    """
    def cause(scene: Scene) -> float:
        sent = scene.program.send(signal.SIGSTOP)
        time.sleep(seconds)
        scene.program.send(signal.SIGCONT)
        return sent
    return cause


def frozen_often(count: int) -> Cause:
    """
    Return what freezes the program for 50 ms again and again: nothing is wrong with that.

    :param count: how often
    :returns: the cause; its time is when the motion should end
    """
    def cause(scene: Scene) -> float:
        for _ in range(count):
            frozen(0.05)(scene)
            time.sleep(random.uniform(0.2, 0.4))
        return at_its_end(scene)
    return cause


def thawed(seconds: float) -> Callable[[Scene], None]:
    """
    Return what thaws a frozen program later.

    :param seconds: after what time [s]
    :returns: what to do after the cause
    """
    def after(scene: Scene) -> None:
        time.sleep(seconds)
        scene.changed = scene.program.send(signal.SIGCONT)
    return after


def silent_while_frozen(scene: Scene, fault: float) -> list[str]:
    """
    See whether the guardian was silent between its stop and the thaw.

    :param scene: whose program
    :param fault: when it was frozen [s, system clock]
    :returns: a sentence if it was not
    """
    times = [heard.time for heard in scene.ears.since(fault) if heard.time < scene.changed]
    went_on = bool(times) and times[-1] - times[0] > STOP
    return ['the guardian went on while its program was frozen'] if went_on else []


def waited(seconds: float) -> Callable[[Scene], None]:
    """
    Return what waits for what takes long.

    :param seconds: how long [s]
    :returns: what to do after the cause
    """
    return lambda _scene: time.sleep(seconds)


def at_its_end(scene: Scene) -> float:
    """
    Let nothing happen.

    :param scene: whose program
    :returns: when its motion should end [s, system clock]
    """
    return scene.first + scene.row.duration


def by_itself(scene: Scene) -> float:
    """
    Wait for what the program does to itself.

    :param scene: whose program
    :returns: when it did [s, system clock]
    """
    end = time.monotonic() + 3.0
    while (fault := scene.program.fault) is None:
        if time.monotonic() > end:
            scene.broken.append('nothing happened')
            return time.time()
        time.sleep(0.005)
    return fault


def by_its_stop(_scene: Scene) -> float:
    """
    Let the program stop itself.

    :param _scene: whose program
    :returns: now [s, system clock]
    """
    return time.time()


def hung_up(scene: Scene) -> float:
    """
    Let the reader of its output end, which is no reason to stop.

    :param scene: whose program
    :returns: when its motion should end [s, system clock]
    """
    scene.program.hang_up()
    return at_its_end(scene)


def hung_up_at_once(scene: Scene) -> float:
    """
    Close its terminal.

    :param scene: whose program
    :returns: when [s, system clock]
    """
    return scene.program.hang_up()


def not_read(signum: str | None = None) -> Cause:
    """
    Return what leaves no room in the program's output, and lets it end all the same.

    :param signum: the signal that ends it; None for its own end
    :returns: the cause; its time is that of the signal, or when the motion should end
    """
    def cause(scene: Scene) -> float:
        scene.program.read_no_more()
        return signals(signum)(scene) if signum else at_its_end(scene)
    return cause


def given_back(scene: Scene, _fault: float) -> list[str]:
    """
    See whether the stop lasted longer than the hold, and the robot was given back after it.

    :param scene: whose robot
    :returns: sentences if it was not so
    """
    assert isinstance(scene.robot, RobotProcess)
    zeros = [one.time for one in scene.ears.since(scene.first + 0.01) if not one.moves]
    is_whole = bool(zeros) and zeros[-1] - zeros[0] > HOLD
    is_back = scene.robot.given_back_since(zeros[-1] if zeros else scene.first)
    return ([] if is_whole else ['the stop was not sent whole']) + (
        [] if is_back else ['manual control was not given back'])


def robot_gets(name: str) -> Cause:
    """
    Return what sends the robot's bridge a signal: SIGTERM lets it leave properly.

    :param name: the signal
    :returns: the cause
    """
    def cause(scene: Scene) -> float:
        now = time.time()
        scene.robot.send(signal.Signals[name])
        return now
    return cause


def robot_thawed(scene: Scene) -> None:
    """
    Thaw the robot's bridge after 2 s; what it then finds in its queue must not move it.

    :param scene: whose robot
    """
    time.sleep(2.0)
    scene.changed = time.time()
    scene.robot.send(signal.SIGCONT)


def not_replayed(scene: Scene, _fault: float) -> list[str]:
    """
    See whether a robot that was thawed was moved by what had been sent before.

    :param scene: whose robot
    :returns: a sentence if it was
    """
    driven = scene.ears.driven(scene.changed, alone=True)
    return [f'after the thaw it drove {driven:.3f} m'] if driven and driven > STILL else []


def robot_back(scene: Scene) -> None:
    """
    Let another robot come in place of the one that left, and the program end some time later.

    :param scene: whose robot
    """
    time.sleep(1.5)
    before, scene.changed = scene.ears.samples, time.time()
    scene.replace_robot()
    end = time.monotonic() + 8.0
    while scene.ears.samples <= before and time.monotonic() < end:
        time.sleep(0.05)
    time.sleep(1.5)
    if scene.ears.samples <= before:
        scene.broken.append('no other robot came')
    scene.program.send(signal.SIGTERM)


def new_robot_stands_still(scene: Scene, _fault: float) -> list[str]:
    """
    See whether the robot that came later was moved.

    :param scene: whose robot
    :returns: a sentence if it was
    """
    # The new one begins at the origin again: only its own samples count.
    driven = scene.ears.driven(scene.changed, alone=True)
    return [f'the new robot drove {driven:.3f} m'] if driven and driven > STILL else []


def switched_off(scene: Scene) -> float:
    """
    Switch manual control off; the bridge switches it on again with the next velocity.

    :param scene: whose robot
    :returns: when its motion should end [s, system clock]
    """
    scene.ears.switch_off()
    return at_its_end(scene)


def clock_told_once(scene: Scene) -> float:
    """
    Publish one message on ``/clock``, and then no more.

    :param scene: whose observer
    :returns: when its motion should end [s, system clock]
    """
    scene.observer.tell_time()
    return at_its_end(scene)


def starved(scene: Scene) -> float:
    """
    Let it drive for a second on a busy machine, if it can, and then end it.

    :param scene: whose program
    :returns: when the signal was sent [s, system clock]
    """
    time.sleep(1.0)
    return scene.program.send(signal.SIGINT)


def guardian_killed(scene: Scene) -> float:
    """
    Kill its guardian.

    :param scene: whose program
    :returns: when [s, system clock]
    """
    now = time.time()
    os.kill(scene.program.guardian, signal.SIGKILL)
    return now


def both_killed(scene: Scene) -> float:
    """
    Kill the program and its guardian, so that neither notices that of the other.

    :param scene: whose program
    :returns: when [s, system clock]
    """
    guardian = scene.program.guardian
    now = time.time()
    for pid in (guardian, scene.program.process.pid):
        os.kill(pid, signal.SIGKILL)
    return now


def played_in_order(scene: Scene, fault: float) -> list[str]:
    """
    See whether a slow robot played a velocity after the first zero that it played.

    :param scene: whose robot
    :param fault: when the stop was asked for [s, system clock]
    :returns: a sentence if it did, or played nothing
    """
    assert scene.played is not None
    # There is no file until something was played.
    text = scene.played.read_text() if scene.played.exists() else ''
    lines = [line.split() for line in text.splitlines()]
    after = [float(velocity) for at, velocity in lines if float(at) > fault]
    if 0.0 not in after:
        return ['the robot played no zero']
    return ['the robot played a velocity after its first zero'] * any(after[after.index(0.0):])
