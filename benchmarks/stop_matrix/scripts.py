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
"""The programs of the trials: the command, and what users write."""

from __future__ import annotations

#: The start of each script: create a file when ready, wait for a line, and write the time of a
#: fault that the script causes to a file.
BEGIN = """
import os, random, signal, sys, threading, time
from pathlib import Path

DURATION = float(os.environ['DURATION'])

def wait_for_go():
    Path('ready').touch()
    sys.stdin.readline()

def write_fault():
    Path('fault').write_text(repr(time.time()))

def time_to_fault():
    return random.uniform(0.2, 0.4)
"""

#: The command, which drives a short rest and one long step instead of the lesson.
COMMAND = BEGIN + """
from kachaka_simple_control import kachaka_simple_control as command

def short_lesson(robot):
    robot.move_robot(0.0, 0.0, 0.2)
    wait_for_go()
    robot.move_robot(0.1, 0.0, DURATION)

command.play_lesson = short_lesson
sys.exit(command.main())
"""

#: The command; during the drive, each input line names a method to call: pause or resume.
PAUSED = BEGIN + """
from kachaka_simple_control import ControlError
from kachaka_simple_control import kachaka_simple_control as command

def obey(robot):
    # Not sys.stdin: its lock would be held while Python ends.
    while names := os.read(0, 100).decode().split():
        for name in names:
            try:
                getattr(robot, name)()
            except ControlError as error:
                print(f'{name}: {error}', file=sys.stderr, flush=True)

def short_lesson(robot):
    robot.move_robot(0.0, 0.0, 0.2)
    wait_for_go()
    threading.Thread(target=obey, args=(robot,), daemon=True).start()
    robot.move_robot(0.3, 0.0, DURATION)

command.play_lesson = short_lesson
sys.exit(command.main())
"""

#: The robot whose laser the obstacle watch uses; see ``lasers``.
LASER = """
from pathlib import Path
Path('laser.yaml').write_text(
    'extends: kachaka\\nlaser: {topic: matrix/scan, ahead: 0.156 m, margin: 5 cm}')
"""
#: The script with pauses, with the robot whose laser the obstacle watch uses.
WATCHED = LASER + PAUSED
#: The same, without a motion before the one that needs the first scan.
UNSEEING = WATCHED.replace('    robot.move_robot(0.0, 0.0, 0.2)\n', '')

#: The script with pauses, with a motion through corners of 5 cm, each after the other.
CORNERS = """
from math import radians
from kachaka_simple_control import Forward, Motion, Repeat, Turn
""" + PAUSED.replace('robot.move_robot(0.3, 0.0, DURATION)', (
    "robot.run(Motion('corners', [Repeat(1000, [Forward(0.5), Turn(radians(90.0))])], "
    'corners=0.05))'))

#: The script with pauses; ``push`` moves the robot by 0.5 m in odometry.  Further commands: ten
#: resume requests at once, and the hold and release by a sensor.
PUSHED = """
import threading
from dataclasses import replace
from kachaka_simple_control import KachakaSimpleControl
from kachaka_simple_control.ros.robot import Robot
on_odometry, pushed = Robot._on_odometry, []

def shifted(self, now, pose, velocity, is_new=True):
    on_odometry(self, now, replace(pose, x=pose.x + 0.5 * bool(pushed)), velocity, is_new)

def ask_ten_times(self):
    for _ in range(10):
        threading.Thread(target=ask, args=(self,), daemon=True).start()

def ask(robot):
    try:
        robot.commander.resume_when_confirmed()
    except Exception as error:
        print(error, flush=True)

Robot._on_odometry = shifted
KachakaSimpleControl.push = lambda self: pushed.append(True)
KachakaSimpleControl.ask_ten_times = ask_ten_times
KachakaSimpleControl.hold = lambda self: self.speed.set('obstacle', 0.0)
KachakaSimpleControl.release = lambda self: self.speed.set('obstacle', 1.0)
""" + PAUSED

#: Starts when another program already drives the robot, whose publisher is discovered too late.
TAKEN = BEGIN + """
import rclpy
from kachaka_simple_control import KachakaSimpleControl
from kachaka_simple_control.ros.foreign_messages import ForeignMessages
from kachaka_simple_control.process.run_command import run_command

ForeignMessages.update = lambda self: False

def drive():
    rclpy.init()
    KachakaSimpleControl().move_robot(0.1, 0.0, DURATION)

wait_for_go()
sys.exit(run_command(drive))
"""

USER = BEGIN + """
import rclpy
from kachaka_simple_control import ControlError, KachakaSimpleControl

rclpy.init()
node = KachakaSimpleControl()
node.move_robot(0.0, 0.0, 0.2)
"""

USER_MOTION = USER + """
wait_for_go()
node.move_robot(0.1, 0.0, DURATION)
"""

#: Drives by hand: a thread commands 20 times a second.
BY_HAND = USER + """
from kachaka_simple_control.control.hand_source import HandSource
from kachaka_simple_control.motion.geometry import Velocity

hand = HandSource(node.profile.planning_limits, node.robot.drive.on_source_changed)

def command(duration):
    for number in range(round(duration / 0.05)):
        hand.command(Velocity(0.1 if number else 0.0, 0.0), number, hand.stamp())
        time.sleep(0.05)

def drive():
    command(DURATION)
    hand.end()

wait_for_go()
threading.Thread(target=drive, daemon=True).start()
node.commander.drive_source(node.robot, 'by hand', hand, 0.05)
"""

#: Drives by hand; the commands end without a zero.
SILENT_HAND = BY_HAND.replace('    command(DURATION)\n', """
    command(0.5 + time_to_fault())
    write_fault()
    time.sleep(1.0)
""")

#: Drives by hand through the pipes of the command.
BY_PIPE = BEGIN + """
import json, subprocess

stamps = [0.0]

def read():
    for line in drive.stdout:
        report = json.loads(line)
        if report['type'] == 'stamp':
            stamps.append(report['stamp'])
        elif report['type'] == 'answer':
            Path('ready').touch()

def send(**values):
    print(json.dumps({'v': 1, **values}), file=drive.stdin, flush=True)

drive = subprocess.Popen(
    [sys.executable, '-m', 'kachaka_simple_control', '--pipe', *sys.argv[1:]],
    stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
threading.Thread(target=read, daemon=True).start()
send(type='take', id=1)
while not Path('ready').exists():
    time.sleep(0.02)
sys.stdin.readline()
for number in range(round(DURATION / 0.05)):
    send(type='hand', sequence=number, stamp=stamps[-1], linear_x=0.1 if number else 0.0,
         angular_z=0.0)
    time.sleep(0.05)
"""

#: Drives two robots at the same time, one of them in the main thread.
TWO_ROBOTS = BEGIN + """
import rclpy
from kachaka_simple_control import ControlError, KachakaSimpleControl
from rclpy.parameter import Parameter

def drive(node):
    try:
        node.move_robot(0.1, 0.0, DURATION)
    except ControlError:
        pass

rclpy.init()
first, second = (
    KachakaSimpleControl(namespace=robot, parameter_overrides=[
        Parameter('robot_namespace', value=robot)])
    for robot in os.environ['ROBOTS'].split())
for node in (first, second):
    node.move_robot(0.0, 0.0, 0.2)
wait_for_go()
threading.Thread(target=drive, args=(second,), daemon=True).start()
first.move_robot(0.1, 0.0, DURATION)
"""

#: Drives two robots of one node in one thread.
IN_STEP = BEGIN + """
import rclpy
from kachaka_simple_control import Motion, Move
from kachaka_simple_control.motion.drive_order import DriveOrder
from kachaka_simple_control.ros.drive_node import DriveNode

def drive(speed, duration):
    motion = Motion('forward', (Move(speed, 0.0, duration),))
    node.commander.drive({
        robot: DriveOrder.of(motion, robot.settings.profile.planning_limits, 10.0)
        for robot in node.robots.values()})

rclpy.init()
node = DriveNode('lab', {f'robot{number}': {'robot_namespace': robot}
                         for number, robot in enumerate(os.environ['ROBOTS'].split())})
drive(0.0, 0.2)
wait_for_go()
drive(0.1, DURATION)
"""

#: Drives two robots in other threads, and the main thread ends.
EXIT_OF_TWO = TWO_ROBOTS.replace('first.move_robot(0.1, 0.0, DURATION)', """
threading.Thread(target=drive, args=(first,), daemon=True).start()
time.sleep(0.3 + time_to_fault())
write_fault()
sys.exit(3)""")

#: Drives two robots in other threads, and an error ends the main thread.
ERROR_OF_TWO = EXIT_OF_TWO.replace('sys.exit(3)', "raise ValueError('of the user')")

#: A closed loop with a wrong calibration, so that odometry always corrects the velocities.
CLOSED_LOOP = BEGIN + """
import rclpy
from kachaka_simple_control import KachakaSimpleControl, Motion, Move

Path('own.yaml').write_text(
    'extends: kachaka\\ncalibration: {forward_gain: 0.9, veer: 0.3 rad/m, delay: 0.1 s}')
rclpy.init()
node = KachakaSimpleControl({'robot': './own.yaml', 'closed_loop': True})
node.move_robot(0.0, 0.0, 0.2)
wait_for_go()
node.run(Motion('closed', (Move(0.1, 0.0, DURATION),)))
"""

#: The closed loop; odometry repeats one pose, as if the robot were blocked.
HELD = """
from kachaka_simple_control.control.pose_feedback import PoseFeedback
on_odometry, poses = PoseFeedback.on_odometry, []

def repeat(self, arrived, pose, is_moving):
    poses.append(pose)
    on_odometry(self, arrived, poses[0], is_moving)

PoseFeedback.on_odometry = repeat
""" + CLOSED_LOOP.replace('wait_for_go()\nnode', 'wait_for_go()\nwrite_fault()\nnode')

#: The closed loop; odometry drifts by 0.25 rad/s while the heading settles.
DRIFTS = """
import time
from dataclasses import replace
from kachaka_simple_control.control.pose_feedback import PoseFeedback
on_odometry, settling = PoseFeedback.on_odometry, []

def drift(self, arrived, pose, is_moving):
    turned = 0.25 * (time.monotonic() - settling[0]) if settling else 0.0
    on_odometry(self, arrived, replace(pose, theta=pose.theta + turned), is_moving)

PoseFeedback.on_odometry = drift
""" + CLOSED_LOOP.partition('node.run')[0] + """
from kachaka_simple_control import Settle

def begin_to_drift():
    write_fault()
    settling.append(time.monotonic())

threading.Timer(1.5, begin_to_drift).start()
node.run(Motion('closed', (Move(0.1, 0.0, 1.0), Settle(60.0))))
"""

#: Stops while it waits for its robot, or while it sends its first zeros.
STOPPED_EARLY = BEGIN + """
import rclpy
from kachaka_simple_control import ControlError, KachakaSimpleControl

def move():
    try:
        node.move_robot(0.1, 0.0, DURATION)
    except ControlError as error:
        print(error, file=sys.stderr, flush=True)

rclpy.init()
node = KachakaSimpleControl()
wait_for_go()
driving = threading.Thread(target=move)
driving.start()
time.sleep(random.uniform(0.0, 0.5))
node.stop_robot()
driving.join()
time.sleep(2.0)
"""

#: Changes the received odometry.
ODOMETRY = """
from kachaka_simple_control.control.standstill import StandstillDetector
from kachaka_simple_control.motion.geometry import Velocity
on_odometry, begun = StandstillDetector.on_odometry, []
"""

LATE_ODOMETRY = ODOMETRY + """
StandstillDetector.on_odometry = lambda self, now, velocity: begun and on_odometry(
    self, now, velocity)
""" + USER + """
wait_for_go()
threading.Timer(0.1, begun.append, [True]).start()
node.move_robot(0.1, 0.0, DURATION)
"""

NEVER_AT_REST = ODOMETRY + """
StandstillDetector.on_odometry = lambda self, now, velocity: on_odometry(
    self, now, Velocity(0.1, 0.0) if begun else velocity)
""" + COMMAND.replace('    wait_for_go()\n', '    wait_for_go()\n    begun.append(True)\n')

#: A program as on another machine: no kernel lock, and it receives no claims or velocities of
#: other programs before a file exists.
OTHER_MACHINE = """
import os
from pathlib import Path
from kachaka_simple_control.control.claims import Claims
from kachaka_simple_control.control.claims import MachineClaim
from kachaka_simple_control.ros import robot_claim
from kachaka_simple_control.ros.foreign_messages import ForeignMessages
from kachaka_simple_control.ros.robot_connection import RobotConnection

CONNECTED = Path(os.environ.get('CONNECTED', 'connected')).resolve()
MachineClaim.take = lambda self, moment, name, who: iter(())
ForeignMessages.update = lambda self: False
# As where no odometry shows that the robot moves already.
RobotConnection._require_at_rest = lambda self, moment: iter(())
robot_claim.is_localhost_only = lambda: False
on_claim = Claims.on_claim
Claims.on_claim = lambda self, claim, now: CONNECTED.exists() and on_claim(
    self, claim, now)
""" + USER.replace('node.move_robot(0.0, 0.0, 0.2)', '') + """
wait_for_go()
node.move_robot(float(os.environ.get('SPEED', '0.08')), 0.0, DURATION)
"""

IDLE = USER + """
wait_for_go()
rclpy.spin(node)
"""

CALLBACK = USER + """
def fail():
    write_fault()
    raise ValueError('in a callback')

wait_for_go()
node.create_timer(time_to_fault(), fail)
node.move_robot(0.1, 0.0, DURATION)
"""

MOTION_THREAD = USER + """
def give_up(*_):
    write_fault()
    raise TimeoutError('that takes too long')

signal.signal(signal.SIGALRM, give_up)
wait_for_go()
signal.setitimer(signal.ITIMER_REAL, time_to_fault())
node.move_robot(0.1, 0.0, DURATION)
"""

EXIT = USER + """
wait_for_go()
threading.Thread(target=node.move_robot, args=(0.1, 0.0, DURATION), daemon=True).start()
time.sleep(time_to_fault())
write_fault()
sys.exit(3)
"""

CLOCK_STEPPED = USER + """
true, true_ns = time.time, time.time_ns

def step():
    time.time = lambda: true() + 3600.0
    time.time_ns = lambda: true_ns() + 3600 * 10 ** 9

wait_for_go()
threading.Timer(time_to_fault(), step).start()
node.move_robot(0.1, 0.0, DURATION)
"""

SUSPENDED = USER + """
gate = node.robot.gate
clock = gate._gap_clock

def suspend():
    write_fault()
    gate._gap_clock = lambda: clock() + 60.0

wait_for_go()
threading.Timer(time_to_fault(), suspend).start()
node.move_robot(0.1, 0.0, DURATION)
"""

#: Continues to run after its fault.
STAYS_AFTER_FAULT = USER + """
wait_for_go()
try:
    node.move_robot(0.1, 0.0, DURATION)
except ControlError as error:
    print(error, file=sys.stderr, flush=True)
rclpy.spin(node)
"""
