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
Get control of a robot before this program drives it, and give up control at the end.

Tested by test/ros/test_robot_discovery.py.
"""

from __future__ import annotations

from dataclasses import dataclass
import threading
from weakref import WeakKeyDictionary

from kachaka_simple_control.control.drive_monitor import LeaseRenewer
from kachaka_simple_control.control.events import VelocityKind
from kachaka_simple_control.control.guardian import Guardian, GuardianProcess, NullGuardian
from kachaka_simple_control.control.pose_feedback import PoseFeedback
from kachaka_simple_control.control.preparation import Moment, pause, Steps, until
from kachaka_simple_control.control.robot_drive import RobotDrive
from kachaka_simple_control.control.standstill import StandstillDetector
from kachaka_simple_control.control.timing import (
    FEEDBACK_MAX_AGE,
    FEEDBACK_START_TIMEOUT,
    GUARDIAN_PRIME_TIMEOUT,
    MIN_ANSWER_TIME,
    ODOMETRY_WAIT_TIME,
    RELEASE_TIMEOUT,
    REST_TIMEOUT,
    STOP_REPEAT_PERIOD,
)
from kachaka_simple_control.errors import MotionRefusedError, RobotTakenError, RunFaultError
from kachaka_simple_control.files.robot_profile import RobotProfile
from kachaka_simple_control.process import processes
from kachaka_simple_control.ros.executors import BackgroundExecutor
from kachaka_simple_control.ros.foreign_messages import ForeignMessages
from kachaka_simple_control.ros.manual_control_client import ManualControlClient
from kachaka_simple_control.ros.node_parameters import NodeParameters
from kachaka_simple_control.ros.robot_claim import RobotClaim
from kachaka_simple_control.ros.robot_discovery import RobotDiscovery
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from rclpy.context import Context
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node


@dataclass
class RobotConnection:
    """
    Gets control of a robot for a drive, and releases the robot at the end.

    To get control is: to find the robot, claim it, check that nobody else drives it, switch on
    manual control, open the velocity gate, and send zero velocities for some time, so that no
    message of the motion is lost.

    :param odometry_topic: None if odometry is not checked
    :param is_taken: whether this program has control: after all this, until a drive ends early
    """

    node: Node
    logger: RcutilsLogger
    publisher: VelocityPublisher
    parameters: NodeParameters
    odometry_topic: str | None
    odometry: StandstillDetector
    drive: RobotDrive
    claim: RobotClaim
    guardian: Guardian | NullGuardian
    discovery: RobotDiscovery
    foreign: ForeignMessages
    manual_control: ManualControlClient
    lease: LeaseRenewer
    executor: BackgroundExecutor
    is_taken: bool = False

    def prepare(self, moment: Moment) -> Steps[None]:
        """
        Get control of the robot; a program that has it requests manual control again after 20 s.

        :raises ControlError: if this program cannot get control of the robot
        """
        self.executor.ensure_spinning()
        self.claim.require()
        if not (self.is_taken and self.discovery.is_subscribed):
            yield from self._connect(moment)
        elif self.manual_control.is_needed and self.lease.is_stale(moment.now):
            yield from self._enable_manual_control(moment, self.parameters.robot_timeout)

    def release(self, moment: Moment) -> Steps[None]:
        """
        Switch off manual control, if this node has requested it and no other program drives now.

        Not with the ROS parameter ``release_manual_control`` false.
        """
        wanted = self.parameters.release_manual_control and self.manual_control.was_requested
        if not (wanted and self.node.context.ok()):
            return
        self.executor.ensure_spinning(take_over=True)
        # Another program may now drive the robot with manual control.
        if self.foreign.has_recent(moment.now) or (yield from self.foreign.detect(moment)):
            return
        if not (yield from self.manual_control.release(moment, RELEASE_TIMEOUT)):
            self.logger.warning(
                f'The robot did not confirm within {RELEASE_TIMEOUT:g} s that manual control is '
                'off; it goes off by itself')

    def _connect(self, moment: Moment) -> Steps[None]:
        timeout = self.parameters.robot_timeout
        end = moment.now + timeout
        yield from self.discovery.wait_for_robot(moment, timeout)
        # Take the claim before any message or request is sent.
        yield from self.claim.take(moment, lambda: self.discovery.is_alone)
        try:
            if not self.parameters.allow_other_publishers:
                yield from self.discovery.wait_for_publishers(moment)
            yield from self.foreign.require_none(moment)
            if not self.parameters.allow_other_publishers:
                yield from self._require_at_rest(moment)
        except BaseException:
            self.claim.withdraw()
            raise
        self.claim.hold()
        if self.manual_control.is_needed:
            yield from self._enable_manual_control(
                moment, max(MIN_ANSWER_TIME, round(end - moment.now, 1)))
        yield from self.discovery.wait_for_guardian(
            moment, max(MIN_ANSWER_TIME, round(end - moment.now, 1)))
        self.drive.gate.open()
        self.drive.connect(moment.now)
        yield from self._prime(moment)
        self.discovery.remember_robot()
        self.is_taken = True
        if self.odometry_topic is not None and self.odometry.age(moment.now) is None:
            self.logger.warning(
                f'No odometry has come on {self.odometry_topic} yet: until some does, no stop can '
                'be confirmed, and a robot that is lost is noticed only when its subscription '
                'goes, which may take 20 s')

    def _require_at_rest(self, moment: Moment) -> Steps[None]:
        """
        Check with odometry, if any arrives, that the robot is at rest before it is driven.

        If it moves, another program drives it, which may be discovered seconds later than the
        robot, or somebody pushes it.

        :raises RobotTakenError: if odometry shows motion for REST_TIMEOUT (1 s)
        """
        topic, began = self.odometry_topic, moment.now
        if topic is None:
            return

        def is_at_rest_or_unknown() -> bool:
            now = moment.now
            if self.odometry.age(now) is None:
                # The odometry of a robot is discovered a moment later than its subscription.
                return not self.node.count_publishers(topic) and now - began > ODOMETRY_WAIT_TIME
            return not self.odometry.is_moving(now)

        yield from until(moment, is_at_rest_or_unknown, 'rest', REST_TIMEOUT)
        if self.odometry.is_moving(moment.now):
            raise RobotTakenError(
                f'{topic} sees the robot move already: another program drives it, '
                'or somebody pushes it; nothing was sent. Stop that, or set the parameter '
                'allow_other_publishers to true')

    def _enable_manual_control(self, moment: Moment, timeout: float) -> Steps[None]:
        requested = moment.now
        yield from self.manual_control.enable(moment, timeout)
        self.lease.granted(requested)

    def _prime(self, moment: Moment) -> Steps[None]:
        """
        Send zeros for ``prime_time`` before the first motion, and let the guardian send some.

        The robot may discover a publisher later than the publisher the robot: the first messages
        can be lost.

        :raises RunFaultError: if the guardian does not send its zero velocities
        """
        end, count = moment.now + self.parameters.prime_time, self.guardian.prime_count
        gate = self.drive.gate
        while moment.now < end:
            gate.send_zero(gate.permit, VelocityKind.PRIME)
            self.publisher.sent.record_guardian_zero(moment.now)
            self.guardian.prime()
            count += 1
            yield from pause(moment, STOP_REPEAT_PERIOD, 'its reader')
        # A late zero of the guardian would disturb the motion.
        if not (yield from until(
                moment, lambda: self.guardian.prime_count >= count, 'the guardian',
                GUARDIAN_PRIME_TIMEOUT)):
            raise RunFaultError(f'the guardian did not answer within {GUARDIAN_PRIME_TIMEOUT:g} s')


#: The guardian's process of each ROS context.
_guardian_processes: WeakKeyDictionary[Context, GuardianProcess] = WeakKeyDictionary()
_starting = threading.Lock()


def start_guardian(
        node: Node, publisher: VelocityPublisher, profile: RobotProfile,
        parameters: NodeParameters, claim: int) -> Guardian | NullGuardian:
    """
    Let the guardian watch a robot; a NullGuardian if the ROS parameter ``guardian`` is false.

    One process watches all robots of a ROS context; it is started for the first.

    :param claim: the descriptor of the claim, which the guardian keeps open while it watches
    :raises UsageError: if the guardian already watches the largest possible number of robots
    :raises RunFaultError: if the process could not be started
    """
    if not parameters.guardian:
        return NullGuardian()
    robot = (publisher.topic_name, profile.command_timeout, profile.message_type, profile.frame,
             claim)
    with _starting:
        process = _guardian_processes.get(node.context)
        guardian = None if process is None else process.add(*robot)
        if guardian is None:
            process = _guardian_processes[node.context] = GuardianProcess(
                [*processes.python_command('kachaka_simple_control.ros.guardian_program'),
                 str(node.context.get_domain_id())], processes.child_environment())
            guardian = process.add(*robot)
    if guardian is None:
        raise RunFaultError('the guardian has ended at its start')
    return guardian


def wait_for_rest(
        moment: Moment, feedback: PoseFeedback, odometry: StandstillDetector,
        name: str) -> Steps[None]:
    """
    Wait before a motion with a closed loop until odometry shows the robot at rest.

    :param name: how error messages call the odometry
    :raises MotionRefusedError: if, after FEEDBACK_START_TIMEOUT (3 s), odometry still shows
        motion, has time stamps that do not change, or has not arrived
    """
    def is_at_rest() -> bool:
        now = moment.now
        # A stamp that never changes counts as new only once.
        return (feedback.sample_count > 1 and feedback.age(now) <= FEEDBACK_MAX_AGE
                and odometry.still_since(now) is not None)

    if (yield from until(moment, is_at_rest, 'odometry at rest', FEEDBACK_START_TIMEOUT)):
        return
    now = moment.now
    if odometry.is_moving(now):
        raise MotionRefusedError(f'a closed loop begins at rest, and {name} sees the robot move')
    if odometry.still_since(now) is not None:
        raise MotionRefusedError(
            f'a closed loop needs odometry that goes on, and the stamps of {name} do not')
    raise MotionRefusedError(
        f'a closed loop needs {name}, and within {FEEDBACK_START_TIMEOUT:g} s none has come')
