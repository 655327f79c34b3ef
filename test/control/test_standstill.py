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
"""Whether the robot stands still by its odometry, and stays where it was paused."""

from kachaka_simple_control.control.standstill import PausePose, StandstillDetector
from kachaka_simple_control.control.timing import ODOMETRY_MAX_AGE, REST_SETTLE_TIME
from kachaka_simple_control.errors import RobotMovedError
from kachaka_simple_control.motion.geometry import Pose, Velocity, ZERO
import pytest

FORWARD = Velocity(0.1, 0.0)


def test_still_since_the_first_of_the_still_samples():
    detector = StandstillDetector()
    for now, velocity in ((1.0, FORWARD), (1.1, ZERO), (1.2, Velocity(0.001, -0.001))):
        detector.on_odometry(now, velocity)
    assert detector.still_since(1.25) == 1.1
    assert not detector.is_moving(1.25)


def test_old_odometry_is_ignored():
    """Otherwise a robot whose link is lost would count as moving, or as standing still."""
    moving, standing = StandstillDetector(), StandstillDetector()
    moving.on_odometry(1.0, FORWARD)
    standing.on_odometry(1.0, ZERO)
    assert not moving.is_moving(1.0 + ODOMETRY_MAX_AGE + 0.01)
    assert standing.still_since(1.0 + ODOMETRY_MAX_AGE + 0.01) is None
    assert moving.age(2.0) == 1.0


class Pause(PausePose):
    """What tells how far a robot was moved, with the detector of the robot."""

    def __init__(self):
        """Stand still, and begin a pause."""
        super().__init__()
        self.detector = StandstillDetector()
        self.see(0.0, Pose(), ZERO)
        self.on_sent(is_paused=True)

    def see(self, now, pose, velocity):
        """Take an odometry message."""
        self.detector.on_odometry(now, velocity)
        self.on_odometry(now, pose, self.detector.still_since(now))


def paused(pose):
    """Return such a pause, after the robot has stood at a pose."""
    pause_pose = Pause()
    for now in (1.0, 1.0 + REST_SETTLE_TIME):
        pause_pose.see(now, pose, ZERO)
    return pause_pose


def test_a_robot_that_is_moved_while_paused_is_seen():
    pause_pose = paused(Pose(1.0, 2.0, 3.0))
    assert pause_pose.moved() == (0.0, 0.0)
    pause_pose.see(2.0, Pose(1.03, 2.04, 2.9), FORWARD)
    assert pause_pose.moved() == pytest.approx((0.05, 0.1))


def test_the_pose_of_a_pause_is_that_of_a_robot_that_has_stood_for_a_while():
    """Before, it may still brake, and what it sends may be late."""
    pause_pose = Pause()
    pause_pose.see(0.9, Pose(0.0), ZERO)
    pause_pose.see(1.0, Pose(0.0), FORWARD)
    pause_pose.see(1.2, Pose(0.1), ZERO)
    pause_pose.see(1.6, Pose(0.1), ZERO)
    pause_pose.see(1.65, Pose(0.3), FORWARD)
    assert pause_pose.moved() == (0.0, 0.0), 'it had stood for less than half a second'


def test_each_pause_has_its_own_pose_and_motion_has_none():
    pause_pose = paused(Pose(0.0))
    pause_pose.on_sent(is_paused=False)
    pause_pose.see(2.0, Pose(1.0), FORWARD)
    assert pause_pose.moved() == (0.0, 0.0)
    pause_pose.on_sent(is_paused=True)
    for now in (3.0, 3.0 + REST_SETTLE_TIME):
        pause_pose.on_sent(is_paused=True)
        pause_pose.see(now, Pose(2.0), ZERO)
    pause_pose.see(4.0, Pose(2.5), ZERO)
    assert pause_pose.moved() == (0.5, 0.0)


@pytest.mark.parametrize(('pose', 'text'), [
    (Pose(1.03, 2.0, 3.0), 'the robot was moved by 3.0 cm and 0.0 deg while it was held'),
    (Pose(1.0, 2.0, 2.9), 'the robot was moved by 0.0 cm and 5.7 deg while it was held'),
])
def test_a_robot_that_was_moved_while_paused_may_not_go_on(pose, text):
    pause_pose = paused(Pose(1.0, 2.0, 3.0))
    pause_pose.see(2.0, Pose(1.01, 2.0, 3.01), FORWARD)
    pause_pose.require_not_moved()
    pause_pose.see(2.1, pose, FORWARD)
    with pytest.raises(RobotMovedError, match=text):
        pause_pose.require_not_moved()
