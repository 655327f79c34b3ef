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
"""The sentences of a report's page."""

from __future__ import annotations

from kachaka_simple_control.report.naive import EXTRA, Naive
from kachaka_simple_control.report.page.parts import degrees, number
from kachaka_simple_control.report.preview import amount, counted

# What stands below the pictures, and is read aloud for them.
PATH_SENT = (
    'The path to scale: as planned, as sent (for a robot that does exactly as it is told), and as '
    'odometry saw it; with the robot where it stood at t = 0, and in the end.')
PATH_PLANNED = 'The path to scale as it was planned, with the robot at its start and at its end.'
VELOCITIES_SENT = (
    'Velocities as planned, as sent and as odometry told them. Limits are dashed; at the faint '
    'lines steps end.')
VELOCITIES_PLANNED = (
    'Velocities as they were planned. Limits are dashed; at the faint lines steps end.')
ERRORS_SEEN = (
    'How far odometry saw the robot from where the messages should have brought it by then: '
    'distance, and heading (positive to the left).')
PERIODS_SENT = (
    'By how much the intervals between two messages were longer than due; how often is on a '
    'logarithmic scale.')
LOWEST = 'So long a drive is shown by the lowest and the highest value in each'
#: What the words mean.
MEANINGS = {
    'planned': (
        'What the motion comes to under the limits, for a robot that does as it is told. Each '
        'motion begins where the one before was to end; after one that was cut short, where the '
        'messages had brought the robot.'),
    'sent': (
        'What the messages come to, at the times at which they were published, for a robot that '
        'keeps each velocity until the next, but not longer than its hold.'),
    'odometry': (
        'What the robot told. Its frame is laid so that its last pose before t = 0, or its first '
        'one after that, is where the messages had brought the robot by then. It arrives a little '
        'late, and so lags behind what was sent while the robot moves.'),
    't = 0': 'When the first velocity of the first motion was published, on the steady clock.',
    'error of a step': (
        'Odometry less requested; of a step that was cut short, odometry less sent. Where two '
        'steps meet without a rest between them, what belongs to which is blurred by the delay of '
        'odometry.'),
    'due, late, lost': (
        'A message is due when the velocity changes, and each period in between. It is late if it '
        'came a quarter of a period or more from its time, and lost if none came within half a '
        'period. The benchmarks count alike.'),
    'stop': 'How long after the stop began odometry saw the robot still.',
}


def loop_in_words(naive: Naive) -> str:
    """
    Say what the lesson's loop would have lost, and how that was worked out.

    :param naive: what it would have made of the same plans
    :returns: the inside of a paragraph
    """
    fewer = 'as many messages' if not naive.missing else (
        f'{counted(abs(naive.missing), "message")} {"fewer" if naive.missing > 0 else "more"}')
    return (
        '<strong>What the loop of the lesson would have lost.</strong> For what was planned it '
        f'would have taken {number(naive.longer, 3)} s longer, sent {fewer}, and brought a robot '
        f'that does exactly as it is told {number(1e3 * naive.distance, 1)} mm and '
        f'{degrees(naive.angle)} from the planned end. <span class="note">This is worked out, not '
        'measured here: the loop publishes what is due, waits for as long as that is to be held, '
        'a period at most, and begins again until the time of the step is up; each turn takes '
        f'{amount(1e3 * EXTRA)} ms longer than it should, as the benchmarks measured it at 10 Hz '
        '(docs/why.md). What it loses before a robot listens is not counted.</span>')
