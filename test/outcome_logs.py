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
"""Logs of drives with every outcome, in simulated time."""

from kachaka_simple_control.control.events import MotionEnded, MotionPlanned
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.motion.steps import Motion, Repeat
from plans import LESSON, SQUARE
from simulated_drive import SimulatedDrive

HELD_UP = 'the program was held up for 0.41 s, longer than 0.15 s'
NO_ROBOT = 'no robot listens: nobody subscribes to /kachaka/manual_control/cmd_vel'


def done(title='square'):
    """Return a square, driven to its end."""
    simulated = SimulatedDrive(20.0, title=title)
    simulated.drive(SQUARE)
    return simulated.close()


def lesson():
    """Return the lesson: seven motions of one step."""
    simulated = SimulatedDrive(title='lesson')
    for step in LESSON.steps:
        simulated.drive(Motion('move_robot', [step]))
    return simulated.close()


def stopped(signum=2, name='SIGINT'):
    """Return a square that a signal ended."""
    simulated = SimulatedDrive(20.0, title='square')
    simulated.drive(SQUARE, 5.03, f'stopped by {name}')
    return simulated.close(signal=signum)


def faulted():
    """Return a square in which the program was held up."""
    simulated = SimulatedDrive(20.0, title='square')
    simulated.drive(SQUARE, 6.4, HELD_UP, lost=(5.99, 6.4))
    return simulated.close(error=HELD_UP)


def ended_on_request():
    """Return a square that the node's service ended."""
    simulated = SimulatedDrive(20.0, title='square')
    simulated.drive(SQUARE, 5.03, 'the movement was ended by stop_robot()', is_fault=False)
    return simulated.close()


def killed():
    """Return a square without the events of its end."""
    simulated = SimulatedDrive(20.0, title='square')
    simulated.drive(SQUARE, 5.03)
    return simulated.drive_log


def never_began():
    """Return a drive without a robot."""
    simulated = SimulatedDrive(20.0, title='square', odometry_period=None)
    simulated.publish(MotionPlanned(SQUARE, simulated.limits, 20.0))
    simulated.publish(MotionEnded(simulated.now + 10.0, NO_ROBOT))
    return simulated.close(None, None, NO_ROBOT)


def hour():
    """Return an hour of squares at 50 Hz, with odometry at 20 Hz."""
    simulated = SimulatedDrive(
        50.0, parameters=SimulationParameters(
            linear_gain=0.9995, angular_gain=1.0002, odometry_noise=0.001),
        odometry_period=0.05, title='hour')
    simulated.drive(Motion('hour', [Repeat(205, SQUARE.steps)]))
    return simulated.close()
