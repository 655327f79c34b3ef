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
"""
What a robot does when the connection breaks, hangs, is slow or comes back, in figures.

Each scenario drives a robot through the bridge at 0.1 m/s, causes a fault, and goes on
publishing velocities as if nothing had happened.  Run as a program, this prints the table of
``docs/kachaka.md``.
"""

from __future__ import annotations

from dataclasses import dataclass
import signal
import sys
import time

from grpc_client_support import commander, FaultyRobot, real_bridge
from ros_domain import isolate_ros
from ros_support import Probe
from waiting import wait_until

SPEED = 0.1


@dataclass(frozen=True)
class Result:
    """
    The result of a scenario.

    :param drift: distance driven after the fault [m]
    :param late: how long after the commander's zero the last velocity reached it [s]; with a fault
        that has no commander's zero, after the fault
    """

    drift: float
    after_stop: int
    late: float
    said: str


def broken(robot, driver, process, fault, pause=2.0, before_return=''):
    """Break the connection during a motion, restore it, and come to rest."""
    where, when = robot.x, robot.ask(fault)
    assert wait_until(lambda: 'link to the robot is lost' in process.text)
    time.sleep(pause)
    if before_return:
        robot.ask(before_return)
    back = robot.ask('flow')
    assert wait_until(lambda: 'link to the robot is back' in process.text)
    # The commander never stopped publishing.
    assert wait_until(lambda: robot.stops(back))
    time.sleep(1.0)
    first_zero = robot.stops(back)[0]
    moves = robot.moves(when)
    result = Result(robot.x - where, len(robot.moves(first_zero)),
                    max([0.0, *(move - when for move in moves if move < back)]), process.text)
    assert process.text.count('is lost') == process.text.count('is back') == 1
    # After a rest it drives again.
    driver.drive(0.0)
    resting = time.monotonic()
    assert wait_until(lambda: robot.stops(resting))
    driver.drive(SPEED)
    assert wait_until(lambda: robot.moves(resting))
    return result


def slow(robot, driver, process, delay):
    """Delay each call, then stop."""
    robot.ask(f'delay {delay}')
    time.sleep(3.0)
    asked = driver.drive(0.0)
    where = robot.x
    assert wait_until(lambda: robot.stops(asked + delay))
    time.sleep(2.0 * delay + 0.5)
    zero = robot.stops(asked)[0]
    late = max([0.0, *(move - asked for move in robot.moves(asked))])
    return Result(robot.x - where, len(robot.moves(zero)), late, process.text)


def killed(robot, driver, process):
    """Kill the bridge during a motion: only the robot's command timeout is left."""
    where, when = robot.x, time.monotonic()
    process.process.kill()
    time.sleep(1.0)
    return Result(robot.x - where, 0, max([0.0, *(m - when for m in robot.moves(when))]), '')


def frozen(robot, driver, process):
    """Suspend the bridge; the commander ends meanwhile, and leaves velocities in the queue."""
    where, when = robot.x, time.monotonic()
    process.send(signal.SIGSTOP)
    time.sleep(0.5)
    driver.drive(None)
    time.sleep(1.5)
    continued = time.monotonic()
    process.send(signal.SIGCONT)
    time.sleep(1.0)
    late = max([0.0, *(move - when for move in robot.moves(when) if move < continued)])
    return Result(robot.x - where, len(robot.moves(continued)), late, process.text)


SCENARIOS = {
    'the connection breaks, and is back after 2 s': lambda *own: broken(*own, 'cut'),
    'the robot starts anew, without manual control':
        lambda *own: broken(*own, 'cut', before_return='forget'),
    'the robot accepts everything and answers nothing, for 3 s':
        lambda *own: broken(*own, 'hang', pause=1.5),
    'each call takes 0.25 s, then a stop': lambda *own: slow(*own, 0.25),
    'each call takes 0.5 s, then a stop': lambda *own: slow(*own, 0.5),
    'the bridge is killed (SIGKILL)': killed,
    'the bridge is frozen for 2 s; its publisher falls silent meanwhile': frozen,
}
#: What the bridge does about each of them.
DOES = (
    'logs it once; when it is back, a zero; velocities are dropped until a rest',
    'the same; manual control is not taken again before a rest',
    'a zero after 0.3 s without an answer; the link counts as lost after 1 s more',
    ('drives, with the newest velocity each time; the zero overtakes the one under way, and is '
     'sent again after it'),
    'after three velocities without an answer in 0.3 s it says so, and sends no more until a rest',
    'nothing: only the command timeout is left',
    'detects it; velocities that waited are not sent',
)
HEAD = ('what happens', 'what the bridge does', 'the robot drove on for',
        'last velocity at the robot after', 'velocities after the stop')
#: Less than what one velocity would have moved it [m].
STILL = 0.0005


def run_scenario(probe, name, namespace):
    """Run a scenario with a robot and a bridge of its own."""
    with FaultyRobot() as robot, \
            real_bridge(robot.address, '--namespace', namespace) as process, \
            commander(probe, namespace, process) as driver:
        driver.drive(SPEED)
        assert wait_until(lambda: len(robot.moves()) > 10)
        return SCENARIOS[name](robot, driver, process)


def line(*cells):
    """Return a line of the table."""
    return f'| {" | ".join(cells)} |'


def row(name, does, result):
    """Return the line of a scenario."""
    if result.drift < STILL and not result.late:
        drove, late = 'stood still', ''
    else:
        drove, late = f'{1e3 * result.drift:.0f} mm', f'{1e3 * result.late:.0f} ms'
    return line(name, does, drove, late, str(result.after_stop))


def main():
    """Print the table, and the warnings of the bridges."""
    isolate_ros()
    probe = Probe()
    print(line(*HEAD), line(*('---' for _ in HEAD)), sep='\n', flush=True)
    for number, (name, does) in enumerate(zip(SCENARIOS, DOES)):
        result = run_scenario(probe, name, f'/fault{number}')
        print(row(name, does, result), flush=True)
        for said in result.said.splitlines():
            if 'WARN' in said or 'ERROR' in said:
                print('   ', said.partition(']: ')[2], file=sys.stderr, flush=True)
    probe.close()


if __name__ == '__main__':
    main()
