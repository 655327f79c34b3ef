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
"""The rows of the matrix: each fault, its injector, and the expected result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from benchmarks.stop_matrix import faults, fleets, others, pauses, scripts
from benchmarks.stop_matrix.expectation import Expectation, Zero
from benchmarks.stop_matrix.limits import (
    CLAIM,
    COMMAND_TIMEOUT,
    EXIT,
    FROZEN,
    GRAPH,
    GUARDIAN,
    GUARDIAN_FROZEN,
    KILLED,
    KNOWN_PUBLISHER,
    NEW_PUBLISHER,
    NODE,
    NOTHING,
    ODOMETRY,
    SIGNAL,
)
from benchmarks.stop_matrix.obstacle_rows import obstacle_rows
from benchmarks.stop_matrix.pauses import State
from benchmarks.stop_matrix.trial_setup import Row, TrialContext


def _ends(what: str, limit: float | None, codes: tuple[int, ...], *names: str) -> Row:
    return Row(Expectation(what, NODE, codes, limit=limit), faults.send_signals(*names))


def _freeze(what: str, seconds: float, **more: int) -> Row:
    expectation = Expectation(what, GUARDIAN, (1,), limit=FROZEN)
    if seconds < 0.5:
        return Row(expectation, faults.freeze(seconds), full=50, **more)
    return Row(
        expectation, faults.send_signals('SIGSTOP'), after=faults.continue_after(seconds),
        check=faults.check_guardian_silent, full=50, **more)


def _two(
        what: str, who: str, codes: tuple[int, ...], limit: float,
        inject: Callable[[TrialContext], float], script: str = scripts.TWO_ROBOTS) -> Row:
    drive = 'drive' if script is scripts.IN_STEP else 'program'
    return Row(
        Expectation(f'{what}, two robots in one {drive}', who, codes, limit=limit), inject,
        script, robots=2, batch_size=2, quick=int(script is scripts.IN_STEP))


def _runs_on(what: str, inject: Callable[[TrialContext], float], **more: object) -> Row:
    row = {'duration': 1.0, **more}
    expectation = Expectation(what, NOTHING, (0,), Zero.AT_END)
    return Row(expectation, inject, **row)  # type: ignore[arg-type]


def _user(what: str, script: str, code: int = 1) -> Row:
    return Row(Expectation(what, NODE, (code,)), faults.own_fault, script)


IN_MOTION = (
    Row(Expectation('normal end', NODE, (0,), Zero.AT_END), faults.no_fault, duration=0.6),
    _ends('SIGINT (Ctrl+C)', SIGNAL, (130,), 'SIGINT'),
    _ends('SIGINT twice', SIGNAL, (130,), 'SIGINT', 'SIGINT'),
    _ends('SIGTERM', SIGNAL, (143,), 'SIGTERM'),
    _ends('SIGHUP', SIGNAL, (129,), 'SIGHUP'),
    Row(Expectation('SIGQUIT', GUARDIAN, (131,)), faults.send_signals('SIGQUIT')),
    Row(Expectation('SIGKILL', GUARDIAN, (137,), limit=KILLED), faults.send_signals('SIGKILL')),
    Row(Expectation('SIGSTOP', GUARDIAN, (), limit=FROZEN), faults.send_signals('SIGSTOP')),
    _runs_on('frozen for 50 ms, 50 times in one run', faults.freeze_repeatedly(50), duration=20.0,
             full=1, quick=0),
    _runs_on('frozen for 50 ms, 5 times in one run', faults.freeze_repeatedly(5), duration=2.6,
             full=0),
    _freeze('frozen for 120 ms', 0.12),
    _freeze('frozen for 150 ms', 0.15),
    _freeze('frozen for 200 ms', 0.2),
    _freeze('frozen for 280 ms', 0.28),
    _freeze('frozen for 320 ms', 0.32),
    _freeze('frozen for 1 s', 1.0),
    _freeze('frozen for 60 s', 60.0, quick=0, batch_size=17),
    _user('exception in a callback', scripts.CALLBACK),
    _user('exception in the thread that drives', scripts.MOTION_THREAD),
    _user('`sys.exit(3)` while another thread drives', scripts.EXIT, 3),
    _runs_on('output closed (`head -1`)', faults.close_output, output='pipe'),
    _runs_on('stdout and stderr full, normal end', faults.block_output(), output='full',
             check=faults.check_released),
    Row(Expectation('stdout and stderr full, SIGINT', NODE, (130,), limit=SIGNAL),
        faults.block_output('SIGINT'), output='full', check=faults.check_released),
    Row(Expectation('terminal stopped (Ctrl+S), SIGINT', NODE, (130,), limit=SIGNAL),
        faults.block_output('SIGINT'), output='terminal', check=faults.check_released),
    Row(Expectation('terminal closed', NODE, (129,)), faults.close_terminal, output='terminal'),
    Row(Expectation('listener leaves', NODE, (1,)),
        faults.signal_robot('SIGTERM'), robot_reusable=False, measures_distance=False),
    Row(Expectation('listener killed: odometry falls silent', NODE, (1,), limit=ODOMETRY),
        faults.signal_robot('SIGKILL'), robot_reusable=False, measures_distance=False,
        exclusive=False),
    Row(Expectation('listener killed, without odometry', NODE, (1,), limit=GRAPH),
        faults.signal_robot('SIGKILL'), options=('odometry_timeout:=0.0',), robot_reusable=False,
        measures_distance=False, exclusive=False, full=2, quick=0, after=faults.wait(20.0)),
    Row(Expectation('listener frozen for 2 s', NODE, (1,), limit=ODOMETRY),
        faults.signal_robot('SIGSTOP'), after=faults.continue_robot, check=faults.check_no_replay,
        robot_reusable=False, exclusive=False),
    Row(Expectation('listener leaves, and another comes', NODE, (143,)),
        faults.signal_robot('SIGTERM'), scripts.STAYS_AFTER_FAULT, after=faults.replace_robot,
        check=faults.check_new_robot_at_rest, robot_reusable=False, exclusive=False,
        measures_distance=False),
    Row(Expectation('somebody else comes, and sends velocities', NODE, (1,), limit=NEW_PUBLISHER),
        others.publish_at_once, after=others.keep_publishing, check=others.check_zeros_ended,
        exclusive=False, measures_distance=False),
    Row(Expectation('somebody else, silent so far, sends velocities', NODE, (1,),
                    limit=KNOWN_PUBLISHER),
        others.publish_after_discovery, after=others.keep_publishing,
        check=others.check_zeros_ended, exclusive=False, measures_distance=False),
    _runs_on('somebody else has a publisher, and never sends', others.never_publish),
    Row(Expectation('somebody else drives already, and is found late', 'nothing moves', (3,),
                    Zero.NONE),
        faults.fault_now, scripts.TAKEN, background=others.driving,
        check=others.check_nothing_sent, robot_reusable=False, batch_size=1, moves=False,
        measures_distance=False),
    _runs_on('a second program wants the robot', others.start_second_program, duration=8.0,
             check=others.check_refused),
    # One trial at a time, because these nodes use most of the time of two processors.
    _runs_on('20 other nodes, of which three a second are restarted', faults.no_fault,
             background=others.restarting_nodes, options=('rate:=50.0',), duration=12.0,
             robot_reusable=False, batch_size=1, quick=0),
    Row(Expectation('a second program on another machine, found late: both stop', NODE, (1,),
                    limit=CLAIM),
        # No zeros before the motion, so that the first zero belongs to a stop.
        others.discover_second_program, scripts.OTHER_MACHINE, options=('prime_time:=0.0',),
        check=others.check_both_stopped, exclusive=False, measures_distance=False),
    Row(Expectation('stopped before its first velocity', 'nothing moves', (0,), Zero.NONE),
        faults.fault_now, scripts.STOPPED_EARLY, moves=False, measures_distance=False),
    Row(Expectation('odometry begins in mid-run, then its robot is killed', NODE, (1,),
                    limit=ODOMETRY),
        faults.signal_robot('SIGKILL'), scripts.LATE_ODOMETRY, robot_reusable=False,
        measures_distance=False, exclusive=False),
    Row(Expectation('odometry never comes to rest', NODE, (1,), Zero.AT_END), faults.no_fault,
        scripts.NEVER_AT_REST, duration=0.6, measures_distance=False),
    _runs_on('manual control switched off from outside', faults.disable_manual_control),
    _runs_on('`use_sim_time`, nobody publishes `/clock`', faults.no_fault,
             options=('use_sim_time:=true',)),
    _runs_on('`use_sim_time`, one message on `/clock`', faults.publish_clock_once,
             options=('use_sim_time:=true',)),
    _runs_on('system clock stepped by 1 h (faked)', faults.no_fault, script=scripts.CLOCK_STEPPED),
    Row(Expectation('suspended for 60 s (faked)', NODE, (1,)), faults.own_fault,
        scripts.SUSPENDED),
    Row(Expectation('twelve busy processes, then SIGINT', NODE, (130, 1), Zero.ANY_TIME),
        faults.interrupt_later, background=faults.busy_processes(12)),
    _runs_on('twelve busy processes, nothing else', faults.no_fault, full=50,
             background=faults.busy_processes(12)),
    Row(Expectation('guardian killed', NODE, (1,)), faults.kill_guardian),
    Row(Expectation('guardian frozen', NODE, (1,), limit=GUARDIAN_FROZEN),
        faults.freeze_guardian),
    Row(Expectation('program and guardian killed', COMMAND_TIMEOUT, (137,), Zero.NONE),
        faults.kill_both),
    Row(Expectation('SIGKILL, `guardian:=false`', COMMAND_TIMEOUT, (137,), Zero.NONE),
        faults.send_signals('SIGKILL'), options=('guardian:=false',)),
    Row(Expectation("a user's script with `rclpy.init()`, SIGINT", NODE, (130,), limit=SIGNAL),
        faults.send_signals('SIGINT'), scripts.USER_MOTION),
    Row(Expectation('idle in `rclpy.spin`, SIGTERM', 'nothing moves', (143,), Zero.NONE),
        faults.send_signals('SIGTERM'), scripts.IDLE, moves=False, measures_distance=False),
    Row(Expectation('a bridge that takes 250 ms a call, SIGINT', NODE, (130,), limit=SIGNAL),
        faults.send_signals('SIGINT'), check=faults.check_execution_order, slow_robot=True,
        robot_reusable=False),
)


def _link(
        what: str, who: str, codes: tuple[int, ...], limit: float | None,
        inject: Callable[[TrialContext], float], **more: object) -> Row:
    row = {'check': faults.check_execution_order, 'full': 20, **more}
    return Row(
        Expectation(f'{what}: needs root', who, codes, limit=limit), inject, over_link=True,
        options=('manual_control:=false',), robot_reusable=False, measures_distance=False,
        batch_size=2, **row)  # type: ignore[arg-type]


#: The robot is on another machine, which takes network namespaces.
OVER_LINK = (
    *(_link(f'SIGINT, {loss} % of the packets lost', NODE, (130,), SIGNAL,
            faults.lossy(loss, faults.send_signals('SIGINT')), quick=int(loss == 30))
      for loss in (10, 30, 50)),
    _link('SIGKILL, 30 % of the packets lost', GUARDIAN, (137,), KILLED,
          faults.lossy(30, faults.send_signals('SIGKILL')), quick=0),
    replace(_link('cable pulled for 0.6 s', NOTHING, (0,), None, faults.cut_link_briefly,
                  check=None, duration=3.0, full=5, quick=0),
            expectation=Expectation(
                'cable pulled for 0.6 s: needs root', NOTHING, (0,), Zero.AT_END)),
    _link('cable pulled, back after 1.2 s', NODE, (1,), ODOMETRY, faults.cut_link,
          after=faults.reconnect(1.2), check=faults.check_zeros_follow, full=5),
    _link('cable pulled, back when the program has ended', NODE, (1,), ODOMETRY, faults.cut_link,
          after=faults.reconnect(0.0, after_end=True), check=faults.check_nothing_old, full=5,
          quick=0),
    _link('cable pulled, back 5 s after the program has ended', NODE, (1,), ODOMETRY,
          faults.cut_link, after=faults.reconnect(5.0, after_end=True),
          check=faults.check_nothing_old, full=5, quick=0),
)
#: The faults that are also tested around a pause, with the same limits.
AROUND_PAUSE = (
    'SIGINT (Ctrl+C)', 'SIGKILL', 'SIGSTOP', 'listener leaves',
    'somebody else comes, and sends velocities')
#: The faults around a pause in the quick form.
QUICK_AROUND_PAUSE = {
    State.BRAKING: AROUND_PAUSE[1:2], State.PAUSED: AROUND_PAUSE[1:2], State.RESUMING: ()}


def _at(state: State, row: Row) -> Row:
    what = row.expectation.what
    checks = [check for check in (
        row.check, pauses.check_no_velocity if state is State.PAUSED else None) if check]
    return replace(
        row, expectation=replace(row.expectation, what=f'{what}, while {state.value}'),
        inject=pauses.at(state, row.inject), script=scripts.PAUSED, full=10,
        check=lambda context, fault: [
            text for check in checks for text in check(context, fault)],
        quick=int(what in QUICK_AROUND_PAUSE[state]))


#: The faults that are also tested in a closed loop, with the same limits; quick form first.
IN_CLOSED_LOOP = (
    'SIGINT (Ctrl+C)', 'SIGKILL', 'SIGSTOP', 'listener killed: odometry falls silent',
    'SIGTERM', 'SIGHUP', 'frozen for 320 ms', 'listener leaves', 'guardian killed',
    'somebody else comes, and sends velocities')
QUICK_IN_CLOSED_LOOP = 2
#: The time limit for a robot that stands instead of driving at 0.1 m/s: an error of 0.2 m [s].
HELD = 3.0
#: The time limit for odometry that drifts by 0.25 rad/s: a turn of 45 degrees [s].
DRIFTED = 5.0


def _closed(row: Row) -> Row:
    what = row.expectation.what
    checks = [check for check in (row.check, faults.check_corrected) if check]
    return replace(
        row, expectation=replace(row.expectation, what=f'{what}, in a closed loop'),
        script=scripts.CLOSED_LOOP, full=10,
        check=lambda context, fault: [
            text for check in checks for text in check(context, fault)],
        quick=int(IN_CLOSED_LOOP.index(what) < QUICK_IN_CLOSED_LOOP))


#: The faults that are also tested in a corner, with the same limits; quick form first.
IN_CORNER = (
    'SIGKILL', 'SIGINT (Ctrl+C)', 'SIGSTOP', 'frozen for 120 ms', 'listener leaves')
QUICK_IN_CORNER = 1


def _in_corner(row: Row) -> Row:
    what = row.expectation.what
    return replace(
        row, expectation=replace(row.expectation, what=f'{what}, in a corner'),
        inject=pauses.in_corner(row.inject), script=scripts.CORNERS, full=10,
        quick=int(IN_CORNER.index(what) < QUICK_IN_CORNER))


def _paused_in_corner(row: Row) -> Row:
    paused, what = _at(State.PAUSED, row), row.expectation.what
    return replace(
        paused, expectation=replace(paused.expectation, what=f'{what}, while paused in a corner'),
        inject=pauses.in_corner(paused.inject), script=scripts.CORNERS,
        quick=int(what == IN_CORNER[0]))


#: The faults that are also tested while a person drives by hand, with the same limits; quick form
#: first.
BY_HAND = (
    'SIGINT (Ctrl+C)', 'SIGKILL', 'SIGSTOP', 'frozen for 150 ms', 'SIGTERM', 'listener leaves',
    'guardian killed', 'somebody else comes, and sends velocities')
QUICK_BY_HAND = 2
#: The time limits for the first zero after the last command by hand: HAND_LEASE_TIME, the period
#: of the commands and a margin; and after the commanding program is killed [s].
HAND_LAPSED, HAND_KILLED = 0.35, 0.05


def _by_hand(row: Row) -> Row:
    what = row.expectation.what
    return replace(
        row, expectation=replace(row.expectation, what=f'{what}, by hand'),
        script=scripts.BY_HAND, full=20, measures_distance=False,
        quick=int(BY_HAND.index(what) < QUICK_BY_HAND))


#: The robots of a fleet, and the time limits for all its first zeros [s].
FLEET_SIZE = 5
FLEET_KILLED, FLEET_FROZEN = 0.1, 0.2


def _fleet(
        what: str, who: str, codes: tuple[int, ...], limit: float | None,
        inject: Callable[[TrialContext], float], zero: Zero = Zero.REQUIRED,
        **more: object) -> Row:
    row = {'script': fleets.FLEET, 'quick': 0, **more}
    return Row(
        Expectation(f'{what}, a fleet of {FLEET_SIZE}', who, codes, zero, limit), inject,
        robots=FLEET_SIZE, batch_size=2, measures_distance=False,
        **row)  # type: ignore[arg-type]


FLEETS = (
    _fleet('SIGINT', NODE, (130,), SIGNAL, faults.send_signals('SIGINT')),
    _fleet('SIGKILL', GUARDIAN, (137,), FLEET_KILLED, faults.send_signals('SIGKILL'), quick=1),
    _fleet('SIGSTOP', GUARDIAN, (), FLEET_FROZEN, faults.send_signals('SIGSTOP')),
    _fleet('guardian killed', NODE, (1,), None, faults.kill_guardian),
    _fleet('the bridge of one robot killed', NODE, (1,), ODOMETRY,
           faults.signal_robot('SIGKILL'), check=fleets.check_stopped_together,
           robot_reusable=False, exclusive=False, quick=1),
    _fleet('the bridge of one robot killed, the others go on', NODE, (1,), None,
           fleets.kill_one_robot, Zero.AT_END, script=fleets.GOES_ON, duration=4.0,
           check=fleets.check_others_went_on, robot_reusable=False, exclusive=False),
    _fleet('one robot is missing', 'nothing moves', (3,), None, faults.fault_now, Zero.NONE,
           script=fleets.INCOMPLETE, check=fleets.check_nobody_moved, moves=False),
)


#: What is left out of the quick form: other rows, or tests of nodes, try nearly the same.
NOT_QUICK = (
    'SIGINT twice', 'SIGHUP', 'frozen for 120 ms', 'frozen for 200 ms', 'frozen for 280 ms',
    'frozen for 320 ms', 'frozen for 1 s', 'stdout and stderr full, normal end',
    'terminal stopped (Ctrl+S), SIGINT', 'listener frozen for 2 s',
    'somebody else has a publisher, and never sends',
    'a second program on another machine, found late: both stop',
    'odometry begins in mid-run, then its robot is killed', 'odometry never comes to rest',
    'manual control switched off from outside', '`use_sim_time`, nobody publishes `/clock`',
    '`use_sim_time`, one message on `/clock`', 'system clock stepped by 1 h (faked)',
    'twelve busy processes, nothing else', 'guardian frozen',
    "a user's script with `rclpy.init()`, SIGINT")
ROWS = tuple(replace(row, quick=0) if row.expectation.what in NOT_QUICK else row for row in (
    *IN_MOTION,
    *OVER_LINK,
    *(_by_hand(row) for row in IN_MOTION if row.expectation.what in BY_HAND),
    Row(Expectation('the commands end, by hand', NODE, (0,), limit=HAND_LAPSED),
        faults.own_fault, scripts.SILENT_HAND, full=20, measures_distance=False),
    Row(Expectation('the commanding program is killed, by hand', NODE, (137,), limit=HAND_KILLED),
        faults.send_signals('SIGKILL'), scripts.BY_PIPE, full=20, measures_distance=False),
    *(in_corner(row) for in_corner in (_in_corner, _paused_in_corner) for row in IN_MOTION
      if row.expectation.what in IN_CORNER),
    *(_closed(row) for row in IN_MOTION if row.expectation.what in IN_CLOSED_LOOP),
    Row(Expectation('the robot is held, in a closed loop', NODE, (1,), limit=HELD),
        faults.own_fault, scripts.HELD, exclusive=False, full=10, measures_distance=False),
    Row(Expectation('odometry drifts while the heading settles, in a closed loop', NODE, (1,),
                    limit=DRIFTED),
        faults.wait_for_drift, scripts.DRIFTS, exclusive=False, full=10, measures_distance=False,
        check=faults.check_turned_little),
    Row(Expectation('pushed while paused, and ten resume it at once; SIGINT', NODE, (130,),
                    limit=SIGNAL),
        pauses.push_and_ask('pause', 'ask_ten_times'), scripts.PUSHED,
        check=pauses.check_still_held, full=10),
    Row(Expectation('pushed while a sensor holds it, which releases it; SIGINT', NODE, (130,),
                    limit=SIGNAL),
        pauses.push_and_ask('hold', 'release'), scripts.PUSHED, check=pauses.check_still_held,
        full=10),
    *(_two(name, who, codes, limit, faults.send_signals(name), script)
      for script in (scripts.TWO_ROBOTS, scripts.IN_STEP)
      for name, who, codes, limit in (
          ('SIGINT', NODE, (130,), SIGNAL), ('SIGKILL', GUARDIAN, (137,), KILLED),
          ('SIGSTOP', GUARDIAN, (), FROZEN))),
    _two('`sys.exit(3)` while other threads drive', NODE, (3,), EXIT, faults.own_fault,
         scripts.EXIT_OF_TWO),
    _two('exception while other threads drive', NODE, (1,), EXIT, faults.own_fault,
         scripts.ERROR_OF_TWO),
    *FLEETS,
    *(_at(state, row) for state in QUICK_AROUND_PAUSE for row in IN_MOTION
      if row.expectation.what in AROUND_PAUSE),
    Row(Expectation('frozen for 1 s while paused, then resumed', GUARDIAN, (1,), limit=FROZEN),
        pauses.at(State.PAUSED, faults.send_signals('SIGSTOP')), scripts.PAUSED,
        after=pauses.resume_continued(1.0), check=pauses.check_not_resumed, full=10, quick=0),
    *obstacle_rows({row.expectation.what: row for row in IN_MOTION}),
))
#: The rows that are also tested with a robot over gRPC.
CORE = ('normal end', 'SIGINT (Ctrl+C)', 'SIGTERM', 'SIGKILL', 'SIGSTOP', 'frozen for 1 s')
