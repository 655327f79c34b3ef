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
"""The rows of the matrix: what is promised, and how it is brought about."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING

from benchmarks.stop_matrix import faults, others, scripts
from benchmarks.stop_matrix.expectation import Promise, Zero

if TYPE_CHECKING:
    from benchmarks.stop_matrix.trial_setup import Scene

NODE, GUARDIAN, NOBODY = 'the node', 'the guardian', 'nothing to stop: it runs on'
HOLD = "nobody: only the robot's own hold helps"
#: Bars [s]: of a signal, of SIGKILL, of SIGSTOP (design: "Speed"); of what docs/safety.md says.
SIGNAL, KILLED, FROZEN = 0.02, 0.05, 0.15
ODOMETRY, GRAPH = 1.3, 23.0
#: Bars of what others send [s]: from somebody just found, and from somebody listened to already.
COMES, HEARD = 0.5, 0.05
#: Between two claims of a program 0.5 s pass.
TOLD = 1.0
LONG = 600.0


@dataclass(frozen=True)
class Row:
    """
    How to bring a row about.

    :param promise: the row
    :param cause: lets it happen; returns when it did [s, system clock]
    :param script: the program
    :param options: its parameters, ``name:=value``
    :param duration: how long its motion is to take [s]
    :param after: what follows while other trials go on
    :param check: what else is to be looked at, in sentences
    :param alone: whether no other trial's measured moment may come before this one's zero
    :param full: how often it is tried in the full form
    :param quick: how often in the quick form
    :param beside: what goes on beside it, from before its motion
    :param busy: how many busy processes run beside it
    :param outlet: what it prints to
    :param drives: whether it moves at all
    :param slow: whether its robot takes 250 ms a call
    :param harms: whether its robot is not to be used again
    :param tells_way: whether the robot's way says something
    :param together: how many programs are started at once
    """

    promise: Promise
    cause: Callable[[Scene], float]
    script: str = scripts.COMMAND
    options: tuple[str, ...] = ()
    duration: float = LONG
    after: Callable[[Scene], None] | None = None
    check: Callable[[Scene, float], list[str]] | None = None
    alone: bool = True
    full: int = 20
    quick: int = 1
    beside: Callable[[Scene], AbstractContextManager[None]] = nullcontext
    busy: int = 0
    outlet: str = 'file'
    drives: bool = True
    slow: bool = False
    harms: bool = False
    tells_way: bool = True
    together: int = 6


def _ends(what: str, bar: float | None, codes: tuple[int, ...], *names: str) -> Row:
    return Row(Promise(what, NODE, codes, bar=bar), faults.signals(*names), quick=2)


def _freeze(what: str, seconds: float, **more: int) -> Row:
    promise = Promise(what, GUARDIAN, (1,), bar=FROZEN)
    if seconds < 0.5:
        return Row(promise, faults.frozen(seconds), full=50, **more)
    return Row(
        promise, faults.signals('SIGSTOP'), after=faults.thawed(seconds),
        check=faults.silent_while_frozen, full=50, **more)


def _runs_on(what: str, cause: Callable[[Scene], float], **more: object) -> Row:
    row = {'duration': 1.0, **more}
    return Row(Promise(what, NOBODY, (0,), Zero.ON_TIME), cause, **row)  # type: ignore[arg-type]


def _user(what: str, script: str, code: int = 1) -> Row:
    return Row(Promise(what, NODE, (code,)), faults.by_itself, script)


ROWS = (
    Row(Promise('normal end', NODE, (0,), Zero.ON_TIME), faults.at_its_end, duration=0.6),
    _ends('SIGINT (Ctrl+C)', SIGNAL, (130,), 'SIGINT'),
    _ends('SIGINT twice', SIGNAL, (130,), 'SIGINT', 'SIGINT'),
    _ends('SIGTERM', SIGNAL, (143,), 'SIGTERM'),
    _ends('SIGHUP', SIGNAL, (129,), 'SIGHUP'),
    Row(Promise('SIGQUIT', GUARDIAN, (131,)), faults.signals('SIGQUIT')),
    Row(Promise('SIGKILL', GUARDIAN, (137,), bar=KILLED), faults.signals('SIGKILL'), quick=2),
    Row(Promise('SIGSTOP', GUARDIAN, (), bar=FROZEN), faults.signals('SIGSTOP'), quick=2),
    _runs_on('frozen for 50 ms, 50 times in one run', faults.frozen_often(50), duration=20.0,
             full=1, quick=0),
    _runs_on('frozen for 50 ms, 5 times in one run', faults.frozen_often(5), duration=2.6,
             full=0),
    _freeze('frozen for 120 ms', 0.12),
    _freeze('frozen for 150 ms', 0.15),
    _freeze('frozen for 200 ms', 0.2),
    _freeze('frozen for 280 ms', 0.28),
    _freeze('frozen for 320 ms', 0.32),
    _freeze('frozen for 1 s', 1.0),
    _freeze('frozen for 60 s', 60.0, quick=0, together=17),
    _user('exception in a callback', scripts.CALLBACK),
    _user('exception in the thread that drives', scripts.MOTION_THREAD),
    _user('`sys.exit(3)` while another thread drives', scripts.EXIT, 3),
    _runs_on('output closed (`head -1`)', faults.hung_up, outlet='pipe'),
    _runs_on('stdout and stderr full, normal end', faults.not_read(), outlet='full',
             check=faults.given_back),
    Row(Promise('stdout and stderr full, SIGINT', NODE, (130,), bar=SIGNAL),
        faults.not_read('SIGINT'), outlet='full', check=faults.given_back),
    Row(Promise('terminal stopped (Ctrl+S), SIGINT', NODE, (130,), bar=SIGNAL),
        faults.not_read('SIGINT'), outlet='terminal', check=faults.given_back),
    Row(Promise('terminal closed', NODE, (129,)), faults.hung_up_at_once, outlet='terminal'),
    Row(Promise('listener leaves', NODE, (1,)), faults.robot_gets('SIGTERM'), harms=True,
        tells_way=False),
    Row(Promise('listener killed: odometry falls silent', NODE, (1,), bar=ODOMETRY),
        faults.robot_gets('SIGKILL'), harms=True, tells_way=False, alone=False),
    Row(Promise('listener killed, without odometry', NODE, (1,), bar=GRAPH),
        faults.robot_gets('SIGKILL'), options=('odometry_timeout:=0.0',), harms=True,
        tells_way=False, alone=False, full=2, quick=0, after=faults.waited(20.0)),
    Row(Promise('listener frozen for 2 s', NODE, (1,), bar=ODOMETRY),
        faults.robot_gets('SIGSTOP'), after=faults.robot_thawed,
        check=faults.not_replayed, harms=True, alone=False),
    Row(Promise('listener leaves, and another comes', NODE, (143,)),
        faults.robot_gets('SIGTERM'), scripts.STAYING, after=faults.robot_back,
        check=faults.new_robot_stands_still, harms=True, alone=False, tells_way=False),
    Row(Promise('somebody else comes, and sends velocities', NODE, (1,), bar=COMES),
        others.comes_and_sends, after=others.goes_on, check=others.not_fought, alone=False,
        tells_way=False),
    Row(Promise('somebody else, silent so far, sends velocities', NODE, (1,), bar=HEARD),
        others.sends_after_silence, after=others.goes_on, check=others.not_fought, alone=False,
        tells_way=False),
    _runs_on('somebody else has a publisher, and never sends', others.never_sends),
    _runs_on('a second program wants the robot', others.wants_the_robot, duration=8.0,
             check=others.was_refused),
    # They take much of two processors' time: other trials would wait for them.
    _runs_on('20 other nodes, of which three a second are restarted', faults.at_its_end,
             beside=others.nodes_come_and_go, options=('rate:=50.0',), duration=12.0, harms=True,
             together=1, quick=0),
    Row(Promise('a second program on another machine, found late: both stop', NODE, (1,),
                bar=TOLD),
        # Without zeros before its motion, so that the first zero is one of a stop.
        others.drives_as_well, scripts.ELSEWHERE, options=('prime_time:=0.0',),
        check=others.both_stopped, alone=False, tells_way=False),
    Row(Promise('stopped before its first velocity', 'nothing moves', (0,), Zero.NONE),
        faults.by_its_stop, scripts.NOT_BEGUN, drives=False, tells_way=False),
    Row(Promise('odometry begins in mid-run, then its robot is killed', NODE, (1,),
                bar=ODOMETRY),
        faults.robot_gets('SIGKILL'), scripts.LATE_ODOMETRY, harms=True, tells_way=False,
        alone=False),
    Row(Promise('odometry never comes to rest', NODE, (1,), Zero.ON_TIME), faults.at_its_end,
        scripts.RESTLESS, duration=0.6, tells_way=False),
    _runs_on('manual control switched off from outside', faults.switched_off),
    _runs_on('`use_sim_time`, nobody publishes `/clock`', faults.at_its_end,
             options=('use_sim_time:=true',)),
    _runs_on('`use_sim_time`, one message on `/clock`', faults.clock_told_once,
             options=('use_sim_time:=true',)),
    _runs_on('system clock stepped by 1 h (faked)', faults.at_its_end, script=scripts.STEPPED),
    Row(Promise('suspended for 60 s (faked)', NODE, (1,)), faults.by_itself, scripts.SUSPENDED),
    Row(Promise('twelve busy processes, then SIGINT', NODE, (130, 1), Zero.EARLY_TOO),
        faults.starved, busy=12),
    Row(Promise('guardian killed', NODE, (1,)), faults.guardian_killed),
    Row(Promise('program and guardian killed', HOLD, (137,), Zero.NONE), faults.both_killed),
    Row(Promise('SIGKILL, `guardian:=false`', HOLD, (137,), Zero.NONE),
        faults.signals('SIGKILL'), options=('guardian:=false',)),
    Row(Promise("a user's script with `rclpy.init()`, SIGINT", NODE, (130,), bar=SIGNAL),
        faults.signals('SIGINT'), scripts.PLAIN),
    Row(Promise('idle in `rclpy.spin`, SIGTERM', 'nothing moves', (143,), Zero.NONE),
        faults.signals('SIGTERM'), scripts.IDLE, drives=False, tells_way=False),
    Row(Promise('a bridge that takes 250 ms a call, SIGINT', NODE, (130,), bar=SIGNAL),
        faults.signals('SIGINT'), check=faults.played_in_order, slow=True, harms=True),
)
#: What is tried with a robot over gRPC, too: nothing that its own bridge would answer otherwise.
CORE = ('normal end', 'SIGINT (Ctrl+C)', 'SIGTERM', 'SIGKILL', 'SIGSTOP', 'frozen for 1 s')
