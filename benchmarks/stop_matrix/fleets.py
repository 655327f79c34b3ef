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
"""The programs of trials with a fleet, the faults of one of its robots, and their checks."""

from __future__ import annotations

import signal
import time

from benchmarks.stop_matrix.expectation import END_TOLERANCE
from benchmarks.stop_matrix.faults import no_fault
from benchmarks.stop_matrix.scripts import BEGIN, LASER
from benchmarks.stop_matrix.trial_setup import TrialContext

#: The name of a robot that nobody shows.
GHOST = 'ghost'
#: By how much the first zeros of the robots may be apart, when one of them fails [s].
APART = 0.05

#: The command ``kachaka_fleet``; before its motion the fleet is at rest for a moment.
FLEET = BEGIN + """
from kachaka_simple_control import Motion, Move
from kachaka_simple_control.commands.fleet import main
from kachaka_simple_control.fleet.fleet import Fleet
from kachaka_simple_control.motion.drive_order import DriveOrder

ON_FAULT, TIMEOUT, MISSING = 'stop_all', 30.0, []
robots = [*os.environ['ROBOTS'].split(), *MISSING]
Path('forward.yaml').write_text(
    'steps: [move: {linear_x: 0.1 m/s, angular_z: 0 rad/s, duration: %g s}]' % DURATION)
Path('fleet.yaml').write_text('\\n'.join([f'on_fault: {ON_FAULT}', 'robots:', *(
    f'  {name}: {{motion: ./forward.yaml, start: {{y: {3 * number} m}}}}'
    for number, name in enumerate(robots)), '']))
drive = Fleet.drive

def rest(fleet):
    motion = Motion('rest', (Move(0.0, 0.0, 0.2),))
    fleet.node.commander.drive({
        robot: DriveOrder.of(motion, robot.settings.profile.planning_limits, 10.0)
        for robot in fleet.node.robots.values()})

def drive_when_told(fleet, *arguments):
    rest(fleet)
    wait_for_go()
    drive(fleet, *arguments)

Fleet.drive = drive_when_told
sys.exit(main(['./fleet.yaml', '--quiet', '--ros-args', *(
    word for name in robots for word in ('-p', f'{name}.robot_timeout:={TIMEOUT}'))]))
"""
#: The same; a fault of one robot does not end the drives of the others.
GOES_ON = FLEET.replace("'stop_all'", "'go_on'")
#: The same, with robots whose lasers the obstacle watch uses.
WATCHED = LASER + FLEET.replace(
    '{{motion: ./forward.yaml,', '{{motion: ./forward.yaml, robot: ./laser.yaml,').replace(
        "'--quiet'", "'--quiet', '--watch'")
#: The same with one more robot, which is not there.
INCOMPLETE = FLEET.replace(
    '30.0, []', f"3.0, ['{GHOST}']").replace('    rest(fleet)\n', '')


def kill_one_robot(context: TrialContext) -> float:
    """Kill the bridge of one robot; return the planned end of the others [s, system clock]."""
    time.sleep(0.2)
    context.robot.process.send(signal.SIGKILL)
    return no_fault(context)


def check_stopped_together(context: TrialContext, _fault: float) -> list[str]:
    """Check that the first zeros of all robots left soon after each other."""
    zeros = [context.stop_zeros(recorder) for recorder in context.recorders]
    if not all(zeros):
        return []  # known already: no zero came
    apart = max(times[0] for times in zeros) - min(times[0] for times in zeros)
    return [f'the first zeros were {1e3 * apart:.0f} ms apart'] * (apart > APART)


def check_others_went_on(context: TrialContext, fault: float) -> list[str]:
    """Check that only the robot whose bridge was killed got a zero before the planned end."""
    early = [[time for time in context.stop_zeros(recorder) if time < fault - END_TOLERANCE]
             for recorder in context.recorders]
    return [*([] if early[0] else ['the robot whose bridge was killed was not stopped']),
            *['another robot was stopped, too'] * any(early[1:])]


def check_nobody_moved(context: TrialContext, _fault: float) -> list[str]:
    """Check that no robot was moved, and that the program names the one that is missing."""
    moved = any(one.moves for recorder in context.recorders
                for one in recorder.sent_since(context.first))
    return [*['a robot was moved'] * moved,
            *['it did not name the missing robot'] * (GHOST not in context.program.text)]
