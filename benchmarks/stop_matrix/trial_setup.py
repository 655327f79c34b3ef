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
"""One program, its robot, and what is heard of both."""

from __future__ import annotations

from collections.abc import Callable
import time

from benchmarks.stop_matrix.expectation import Zero
from benchmarks.stop_matrix.message import message
from benchmarks.stop_matrix.observer import Stranger
from benchmarks.stop_matrix.program import Program
from benchmarks.stop_matrix.robot_pool import Member
from benchmarks.stop_matrix.rows import Row
from benchmarks.stop_matrix.trial import Trial

#: How fast our programs drive [m/s]: tells their velocities from those of others.
OURS = 0.1
#: How long a program may take from what happened, and what followed, to its end [s].
PATIENCE = 6.0
#: From then on a program that was killed sends nothing [s].
JUST_THEN = 0.02
#: How long it is listened for after that [s].
SETTLE = 0.5


class Scene:
    """Set for one trial; ``end`` leaves nothing of it."""

    def __init__(self, row: Row, member: Member) -> None:
        """
        Start the program.

        :param row: what will happen to it
        :param member: the robot that it drives, and what is heard of it
        """
        self.row, self._member = row, member
        self.robot, self.ears, self.played = member.robot, member.ears, member.played
        self.observer, self.domain = member.observer, member.domain
        self.program = self._program()
        #: what was promised for this row alone, and not kept
        self.broken: list[str] = []
        #: when the first velocity was sent [s, system clock]
        self.first = 0.0
        #: when something else happened to the robot [s, system clock]
        self.changed = 0.0
        #: somebody else who has a publisher of velocities
        self.stranger: Stranger | None = None
        #: another program of ours for the same robot
        self.second: Program | None = None

    def wait_until_ready(self) -> bool:
        """
        Wait until the program has met its robot; one that gives up is started again, once.

        :returns: whether it had to be
        """
        try:
            self.program.wait_until_ready()
        except RuntimeError as error:
            print(f'\nStarted again: {error}')
            self.program.end()
            self.program = self._program()
            self.program.wait_until_ready()
            return True
        return False

    def begin(self) -> None:
        """Let the program move, and wait until it does, if it will."""
        self.first = time.time()
        self.program.go()
        if self.row.drives:
            first = self.ears.wait(lambda heard: heard.moves, self.first, PATIENCE)
            if first is None:
                self.broken.append('it never moved')
            else:
                self.first = first.time

    def replace_robot(self) -> None:
        """Let another robot come in place of the one that left."""
        self._member.replace_robot()
        self.robot = self._member.robot

    def judge(self, fault: float) -> Trial:
        """
        Wait for the end, and tell what was seen.

        :param fault: when it happened [s, system clock]
        :returns: what was seen
        """
        code = self.program.wait(PATIENCE if self.row.promise.codes else 0.0)
        time.sleep(SETTLE)
        if self.row.check is not None:
            self.broken += self.row.check(self, fault)
        text = self.program.text
        if not self.program.end():
            self.broken.append('its guardian outlived it')
        # The first velocity itself does not matter, and may be rounded to before it was sent.
        heard = self.ears.since(self.first + 0.01)
        zeros = [one.time for one in heard if not one.moves]
        # What is killed may be sending something just then.
        stopped = zeros[0] if zeros else fault + JUST_THEN
        return Trial(
            zeros[0] - fault if zeros else None, len(zeros),
            sum(one.linear_x == OURS and one.time > stopped for one in heard),
            self._driven(fault), code,
            message(text, self.ears.namespace, 'rclpy.init()' in self.row.script),
            tuple(self.broken))

    def end(self) -> None:
        """End what is left of the programs, whatever became of them."""
        for program in filter(None, (self.program, self.second)):
            if program.folder.exists():
                program.end()

    def start_another(self, script: str, **variables: str) -> Program:
        """
        Start one more program for the same robot.

        :param script: the program
        :param variables: what is added to its environment
        :returns: the program, which somebody has to wait for
        """
        return self._program(script, variables)

    def _program(
            self, script: str | None = None, more: dict[str, str] | None = None) -> Program:
        options = ['--ros-args']
        for option in (f'robot_namespace:={self.ears.namespace}', 'robot_timeout:=30.0',
                       *self.row.options):
            options += ['-p', option]
        variables = {
            'DURATION': str(self.row.duration), 'ROS_DOMAIN_ID': str(self.domain),
            **(more or {})}
        return Program(script or self.row.script, options, variables, self.row.outlet)

    def _driven(self, fault: float) -> float | None:
        tells = self.row.tells_way and self.row.promise.zero is not Zero.ON_TIME
        return self.ears.driven(fault) if tells else None


def play(scene: Scene, pause: Callable[[], float]) -> float:
    """
    Let the program move, and something happen to it.

    :param scene: the scene
    :param pause: returns how long it moves before [s]
    :returns: when it happened [s, system clock]
    """
    scene.begin()
    time.sleep(pause())
    fault = scene.row.cause(scene)
    if scene.row.alone and scene.row.promise.zero is not Zero.NONE:
        end = scene.first + 0.01
        scene.ears.wait(lambda heard: not heard.moves, end, fault - time.time() + 0.5)
    return fault


def follow(scene: Scene, fault: float) -> Trial:
    """
    Let the rest happen, and wait for the end.

    :param scene: the scene
    :param fault: when it happened [s, system clock]
    :returns: what was seen
    """
    if scene.row.after is not None:
        scene.row.after(scene)
    return scene.judge(fault)

