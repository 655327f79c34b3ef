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
"""The programs that things happen to: the command, and what users write."""

from __future__ import annotations

#: Ready, a program waits for a line; what it lets happen by itself, it notes the time of.
BEGIN = """
import os, random, signal, sys, threading, time
from pathlib import Path

DURATION = float(os.environ['DURATION'])

def gate():
    Path('ready').touch()
    sys.stdin.readline()

def mark():
    Path('fault').write_text(repr(time.time()))

def soon():
    return random.uniform(0.2, 0.4)
"""

#: The real command; in place of the lesson's movements it plays a short rest and one long one.
COMMAND = BEGIN + """
from kachaka_simple_control import kachaka_simple_control as command

def play(robot):
    robot.move_robot(0.0, 0.0, 0.2)
    gate()
    robot.move_robot(0.1, 0.0, DURATION)

command.play_lesson = play
sys.exit(command.main())
"""

USER = BEGIN + """
import rclpy
from kachaka_simple_control import ControlError, KachakaSimpleControl

rclpy.init()
node = KachakaSimpleControl()
node.move_robot(0.0, 0.0, 0.2)
"""

PLAIN = USER + """
gate()
node.move_robot(0.1, 0.0, DURATION)
"""

#: Stopped while it still waits for its robot, or sends its first zeros.
NOT_BEGUN = BEGIN + """
import rclpy
from kachaka_simple_control import ControlError, KachakaSimpleControl

def move():
    try:
        node.move_robot(0.1, 0.0, DURATION)
    except ControlError as error:
        print(error, file=sys.stderr, flush=True)

rclpy.init()
node = KachakaSimpleControl()
gate()
driving = threading.Thread(target=move)
driving.start()
time.sleep(random.uniform(0.0, 0.5))
node.stop_robot()
driving.join()
time.sleep(2.0)
"""

#: Odometry as it might come: patched where it arrives.
ODOMETRY = """
from kachaka_simple_control.control.stop import StandstillDetector
from kachaka_simple_control.motion.geometry import Velocity
hear, begun = StandstillDetector.on_odometry, []
"""

LATE_ODOMETRY = ODOMETRY + """
StandstillDetector.on_odometry = lambda self, now, velocity: begun and hear(self, now, velocity)
""" + USER + """
gate()
threading.Timer(0.1, begun.append, [True]).start()
node.move_robot(0.1, 0.0, DURATION)
"""

RESTLESS = ODOMETRY + """
StandstillDetector.on_odometry = lambda self, now, velocity: hear(
    self, now, Velocity(0.1, 0.0) if begun else velocity)
""" + COMMAND.replace('gate()\n    robot', 'gate()\n    begun.append(True)\n    robot')

#: As on another machine: no kernel decides, and neither claims nor velocities of others are heard
#: before a file is there.
ELSEWHERE = """
import os
from pathlib import Path
from kachaka_simple_control.control.claims import Claims
from kachaka_simple_control.control.claims import MachineClaim
from kachaka_simple_control.ros import robot_claim
from kachaka_simple_control.ros.foreign_messages import ForeignMessages

HEARD = Path(os.environ.get('HEARD', 'heard')).resolve()
MachineClaim.take = lambda self, name, who: None
ForeignMessages.update = lambda self: False
robot_claim.is_localhost_only = lambda: False
hear = Claims.on_claim
Claims.on_claim = lambda self, claim, now: HEARD.exists() and hear(self, claim, now)
""" + USER.replace('node.move_robot(0.0, 0.0, 0.2)', '') + """
gate()
node.move_robot(float(os.environ.get('SPEED', '0.08')), 0.0, DURATION)
"""

IDLE = USER + """
gate()
rclpy.spin(node)
"""

CALLBACK = USER + """
def fail():
    mark()
    raise ValueError('in a callback')

gate()
node.create_timer(soon(), fail)
node.move_robot(0.1, 0.0, DURATION)
"""

MOTION_THREAD = USER + """
def give_up(*_):
    mark()
    raise TimeoutError('that takes too long')

signal.signal(signal.SIGALRM, give_up)
gate()
signal.setitimer(signal.ITIMER_REAL, soon())
node.move_robot(0.1, 0.0, DURATION)
"""

EXIT = USER + """
gate()
threading.Thread(target=node.move_robot, args=(0.1, 0.0, DURATION), daemon=True).start()
time.sleep(soon())
mark()
sys.exit(3)
"""

STEPPED = USER + """
true, true_ns = time.time, time.time_ns

def step():
    time.time = lambda: true() + 3600.0
    time.time_ns = lambda: true_ns() + 3600 * 10 ** 9

gate()
threading.Timer(soon(), step).start()
node.move_robot(0.1, 0.0, DURATION)
"""

SUSPENDED = USER + """
edge = node.session.gate
clock = edge._gap_clock

def suspend():
    mark()
    edge._gap_clock = lambda: clock() + 60.0

gate()
threading.Timer(soon(), suspend).start()
node.move_robot(0.1, 0.0, DURATION)
"""

#: Survives its fault, as a program with more to do would.
STAYING = USER + """
gate()
try:
    node.move_robot(0.1, 0.0, DURATION)
except ControlError as error:
    print(error, file=sys.stderr, flush=True)
rclpy.spin(node)
"""
