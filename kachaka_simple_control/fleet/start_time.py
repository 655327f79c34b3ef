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
The time at which fleets on several machines begin, by clocks that chrony keeps.

Tested by test/fleet/test_start_time.py.
"""

from __future__ import annotations

from datetime import datetime, timedelta
from datetime import time as time_of_day
import math
import subprocess
import time

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.text import quoted

#: The largest error of the clock of a machine that starts with others [s].  At 0.3 m/s a robot
#: drives 1.5 mm in this time.
MAX_CLOCK_ERROR = 0.005
#: How far ahead a start may be: a later one is a mistake [s].
MAX_WAIT = 86_400.0
CHRONYC = ('chronyc', '-n', '-c', 'tracking')
#: How long chrony may take to answer [s].
ANSWER_TIMEOUT = 5.0
#: The columns of its answer: the offset of the clock, the delay to the source, its dispersion.
OFFSET, ROOT_DELAY, ROOT_DISPERSION, COLUMNS = 4, 10, 11, 14
LEAP_STATES = ('Normal', 'Insert second', 'Delete second')


def start_time(text: str) -> float:
    """
    Return the steady clock's time of a start that this machine's clock says [s].

    :param text: a time of day, as in ``14:30:00``, the next one; or a date and time (ISO 8601)
    :raises UsageError: if it is none, is over or too far ahead, or chrony does not vouch for the
        clock of this machine to 5 ms
    """
    now = datetime.now().astimezone()
    start = _parse(text, now)
    wait = (start - now).total_seconds()
    if wait <= 0.0:
        raise UsageError(f'--start-at {text}: that was {-wait:.1f} s ago')
    if wait > MAX_WAIT:
        raise UsageError(f'--start-at {text}: that is {wait / 3600.0:.0f} h ahead, and a fleet '
                         'waits a day at most')
    require_clock()
    return time.monotonic() + start.timestamp() - time.time()


def _parse(text: str, now: datetime) -> datetime:
    try:
        if 'T' in text or ' ' in text.strip():
            return datetime.fromisoformat(text.strip()).astimezone()
        of_day = time_of_day.fromisoformat(text.strip())
    except ValueError:
        raise UsageError(
            f'--start-at {quoted(text, 60)} is no time; write one as in 14:30:00 or '
            '2026-11-28T14:30:00') from None
    start = datetime.combine(now.date(), of_day).astimezone()
    return start if start > now else (start + timedelta(days=1)).astimezone()


def require_clock() -> None:
    """
    Check that chrony vouches for the clock of this machine.

    :raises UsageError: if the error of the clock may be above 5 ms, or chrony does not say
    """
    try:
        answer = subprocess.run(
            CHRONYC, capture_output=True, text=True, timeout=ANSWER_TIMEOUT, check=True).stdout
    except FileNotFoundError:
        raise UsageError(
            'robots of several machines begin by their clocks, and chrony, which keeps them, is '
            'not here: `sudo apt install chrony`') from None
    except (OSError, subprocess.SubprocessError) as error:
        raise UsageError(
            f'`{" ".join(CHRONYC)}` does not answer ({error.__class__.__name__}): is chronyd '
            'running?') from None
    if (wrong := clock_error(answer)) > MAX_CLOCK_ERROR:
        how = f'may be wrong by {wrong * 1e3:.1f} ms' if wrong < math.inf else (
            'is not synchronised')
        raise UsageError(
            f'the clock of this machine {how} by chrony, and robots of several machines need '
            f'{MAX_CLOCK_ERROR * 1e3:g} ms: `chronyc tracking` shows it, `chronyc waitsync` waits')


def clock_error(answer: str) -> float:
    """
    Return the largest error of the clock [s] that chrony's answer leaves; infinite if none is.

    From the documentation of ``chronyc tracking``: offset + dispersion + delay / 2.
    """
    columns = answer.strip().split(',')
    if len(columns) != COLUMNS or columns[-1] not in LEAP_STATES:
        return math.inf
    try:
        offset, delay, dispersion = (
            float(columns[column]) for column in (OFFSET, ROOT_DELAY, ROOT_DISPERSION))
    except ValueError:
        return math.inf
    return abs(offset) + dispersion + delay / 2.0
