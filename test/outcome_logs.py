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
"""Drives that ended in every way, as records, in simulated time."""

from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.motion.steps import Motion, Repeat
from kachaka_simple_control.telemetry.events import MotionEnded, MotionPlanned
from plans import LESSON, SQUARE
from simulated_drive import Rehearsal

HELD_UP = 'the program was held up for 0.41 s, longer than 0.15 s'
NOBODY = 'no robot listens: nobody subscribes to /kachaka/manual_control/cmd_vel'


def done(title='square'):
    """Return a square, driven to its end."""
    rehearsal = Rehearsal(20.0, title=title)
    rehearsal.drive(SQUARE)
    return rehearsal.close()


def lesson():
    """Return the lesson: seven motions of one step."""
    rehearsal = Rehearsal(title='lesson')
    for step in LESSON.steps:
        rehearsal.drive(Motion('move_robot', [step]))
    return rehearsal.close()


def stopped(signum=2, name='SIGINT'):
    """Return a square that a signal ended."""
    rehearsal = Rehearsal(20.0, title='square')
    rehearsal.drive(SQUARE, 5.03, f'stopped by {name}')
    return rehearsal.close(signal=signum)


def faulted():
    """Return a square in which the program was held up."""
    rehearsal = Rehearsal(20.0, title='square')
    rehearsal.drive(SQUARE, 6.4, HELD_UP, lost=(5.99, 6.4))
    return rehearsal.close(error=HELD_UP)


def ended_on_request():
    """Return a square that somebody ended by the node's service."""
    rehearsal = Rehearsal(20.0, title='square')
    rehearsal.drive(SQUARE, 5.03, 'the movement was ended by stop_robot()', is_fault=False)
    return rehearsal.close()


def killed():
    """Return a square of which nobody told the end."""
    rehearsal = Rehearsal(20.0, title='square')
    rehearsal.drive(SQUARE, 5.03)
    return rehearsal.record


def never_began():
    """Return a program that found no robot."""
    rehearsal = Rehearsal(20.0, title='square', odometry_period=None)
    rehearsal.tell(MotionPlanned(SQUARE, rehearsal.limits, 20.0))
    rehearsal.tell(MotionEnded(rehearsal.now + 10.0, NOBODY))
    return rehearsal.close(None, None, NOBODY)


def hour():
    """Return an hour of squares at 50 Hz, with odometry at 20 Hz."""
    rehearsal = Rehearsal(
        50.0, parameters=SimulationParameters(linear_gain=0.9995, angular_gain=1.0002,
        odometry_noise=0.001),
        odometry_period=0.05, title='hour')
    rehearsal.drive(Motion('hour', [Repeat(205, SQUARE.steps)]))
    return rehearsal.close()
