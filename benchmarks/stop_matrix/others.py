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
"""What others do beside a program that drives: strangers, newcomers and second programs."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import time
from typing import TYPE_CHECKING

from benchmarks.stop_matrix.faults import at_its_end, STOP

if TYPE_CHECKING:
    from benchmarks.stop_matrix.trial_setup import Scene

#: How fast somebody else drives [m/s].
OTHERS = 0.05
#: How long a stranger is listed before it sends [s].
LISTED = 0.6
#: For how long a stranger drives [s], and how often it sends [s].
DRIVES, PERIOD = 4.5, 0.1
#: How long a second program may take from its start to its first velocity, or its end [s].
COMING = 20.0
#: A program that was told to stop sends no velocity after this time [s].
SOON = 1.0
#: The exit code of a program that was refused.
REFUSED = 3
#: How many other nodes there are beside a drive, and how many are restarted a second: two
#: processors have time left.  With 28 they had none, and half of the runs were ended.
NODES, RESTARTS = 20, 3.0
#: How long they have to find each other before the drive, and how much longer than its motion a
#: trial may take [s].
SETTLING, LONGEST = 10.0, 20.0


def comes_and_sends(scene: Scene) -> float:
    """
    Let somebody else come, and send at once.

    :param scene: whose robot
    :returns: when the first velocity was sent [s, system clock]
    """
    scene.stranger = scene.ears.somebody_else()
    return scene.stranger.send(OTHERS)


def sends_after_silence(scene: Scene) -> float:
    """
    Let somebody else come, be silent for a while, and then send.

    :param scene: whose robot
    :returns: when the first velocity was sent [s, system clock]
    """
    scene.stranger = scene.ears.somebody_else()
    time.sleep(LISTED)
    return scene.stranger.send(OTHERS)


def goes_on(scene: Scene) -> None:
    """
    Let somebody else drive for a while, and go.

    :param scene: whose robot
    """
    assert scene.stranger is not None
    end = time.monotonic() + DRIVES
    while time.monotonic() < end:
        time.sleep(PERIOD)
        scene.stranger.send(OTHERS)
    scene.stranger.leave()


def never_sends(scene: Scene) -> float:
    """
    Let somebody else come who never sends.

    :param scene: whose robot
    :returns: when its motion should end [s, system clock]
    """
    scene.stranger = scene.ears.somebody_else()
    return at_its_end(scene)


def not_fought(scene: Scene, fault: float) -> list[str]:
    """
    See whether our zeros ended, and let the other drive.

    :param scene: whose robot
    :param fault: when the other sent first [s, system clock]
    :returns: a sentence if they did not
    """
    zeros = [heard.time for heard in scene.ears.since(fault) if not heard.moves]
    fought = bool(zeros) and zeros[-1] - zeros[0] > STOP
    return ['it fought the other with zeros'] if fought else []


def wants_the_robot(scene: Scene) -> float:
    """
    Start the same program a second time.

    :param scene: whose robot
    :returns: when the motion of the first should end [s, system clock]
    """
    scene.second = scene.start_another(scene.row.script)
    return at_its_end(scene)


def was_refused(scene: Scene, _fault: float) -> list[str]:
    """
    See whether the second program was refused, with a line that names the first.

    :param scene: whose program
    :returns: sentences if it was not
    """
    assert scene.second is not None
    code = scene.second.wait(COMING)
    named = f'(process {scene.program.process.pid}' in scene.second.text
    return [*([f'the newcomer ended with {code}'] if code != REFUSED else []),
            *([] if named else ['the newcomer was not told who drives'])]


def drives_as_well(scene: Scene) -> float:
    """
    Start a second program, and let both hear of each other when both drive.

    :param scene: whose robot
    :returns: when they could hear of each other [s, system clock]
    """
    heard = scene.program.folder / 'heard'
    scene.second = scene.start_another(scene.row.script, SPEED=str(OTHERS), HEARD=str(heard))
    scene.second.go()
    if scene.ears.wait(lambda heard: heard.linear_x == OTHERS, scene.first, COMING) is None:
        scene.broken.append('the second program never moved')
    time.sleep(LISTED)
    now = time.time()
    heard.touch()
    return now


def both_stopped(scene: Scene, fault: float) -> list[str]:
    """
    See whether the second program stopped as well.

    :param scene: whose robot
    :param fault: when it could hear of the first [s, system clock]
    :returns: sentences if it did not
    """
    assert scene.second is not None
    code = scene.second.wait(COMING)
    after = [heard for heard in scene.ears.since(fault + SOON) if heard.moves]
    return [*([f'the second program ended with {code}'] if code != 1 else []),
            *(['the second program drove on'] if after else [])]


@contextlib.contextmanager
def nodes_come_and_go(scene: Scene) -> Iterator[None]:
    """
    Have many other nodes beside the ``with`` block, and restart one after the other.

    :param scene: whose robot
    """
    # It loads rclpy, which is too early while rows are only listed.
    from benchmarks import churn
    longest = SETTLING + LONGEST + scene.row.duration
    with churn.others(NODES, RESTARTS, longest, scene.domain):
        time.sleep(SETTLING)
        yield
