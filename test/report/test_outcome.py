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
"""How a drive ended, in words: for every ending."""

from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.analysis.summary import outcome, OutcomeKind
from kachaka_simple_control.motion.steps import Motion, Move
from outcome_logs import (
    done,
    ended_on_request,
    faulted,
    HELD_UP,
    killed,
    lesson,
    never_began,
    NO_ROBOT,
    stopped,
)
from plans import SQUARE
import pytest
from simulated_drive import SimulatedDrive

SECOND = Motion('second', [Move(0.1, 0.0, 1.0)])


@pytest.mark.parametrize(('drive', 'ending', 'headline', 'says'), [
    (done, OutcomeKind.DONE, 'Done', 'Its motion was driven to its end, all 8 steps.'),
    (lesson, OutcomeKind.DONE, 'Done', '7 motions were driven to their end, 7 steps in all.'),
    (stopped, OutcomeKind.STOPPED, 'Stopped by SIGINT',
     'The motion ended in step 3 of 8, 5.03 s after its t = 0, of 17.58 s.'),
    (faulted, OutcomeKind.FAULTED, 'Faulted',
     HELD_UP[1:] + '. The motion ended in step 3 of 8, 6.40 s'),
    (ended_on_request, OutcomeKind.STOPPED, 'Stopped on request',
     'The movement was ended by stop_robot(). The motion ended in step 3 of 8, 5.03 s'),
    (killed, OutcomeKind.KILLED, 'Killed', 'The motion ended in step 3 of 8, 4.99 s'),
    (never_began, OutcomeKind.NEVER_BEGAN, 'Never began', NO_ROBOT[1:] + '.'),
    (DriveLog, OutcomeKind.KILLED, 'Killed', 'No motion had begun.'),
])
def test_the_outcome_says_how_it_ended_and_why(drive, ending, headline, says):
    found = outcome(drive())
    assert (found.kind, found.headline) == (ending, headline)
    assert says in found.reason


def test_a_fault_before_the_signal_is_reported_too():
    """Standing by, a program goes on after a motion that failed."""
    simulated = SimulatedDrive(20.0)
    simulated.drive(SQUARE, 6.4, HELD_UP)
    simulated.drive(SECOND)
    found = outcome(simulated.close(signal=2))
    assert found.kind is OutcomeKind.STOPPED
    assert HELD_UP[1:] in found.reason
    assert 'of 2 motions 1 were driven to their end' in found.reason


def test_an_error_after_the_last_motion_is_a_fault():
    simulated = SimulatedDrive()
    simulated.drive(SECOND)
    found = outcome(simulated.close(error='the disk is full'))
    assert found.kind is OutcomeKind.FAULTED
    assert found.reason == 'The disk is full. Its motion was driven to its end, 1 step.'
