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
"""The rows of the console matrix."""

from __future__ import annotations

from typing import TypeAlias

from benchmarks.console_matrix import faults, refusals
from benchmarks.console_matrix.bursts import BurstRow
from benchmarks.console_matrix.faults import HandRow
from benchmarks.console_matrix.refusals import RefusalRow
from benchmarks.console_matrix.replay import ReplayRow
from benchmarks.console_matrix.stops import EarlyStopRow, StopRow
from benchmarks.console_matrix.trial import Expectation, STOP_LIMIT

PAGE, LEASE, SERVER = 'the page', 'the lease', 'the console'
Row: TypeAlias = HandRow | BurstRow | StopRow | EarlyStopRow | ReplayRow | RefusalRow


def _stop(what: str) -> Expectation:
    return Expectation(what, 'STOP', STOP_LIMIT, STOP_LIMIT)


def _refused(what: str) -> Expectation:
    return Expectation(what, SERVER, None, None)


ROWS: tuple[Row, ...] = (
    HandRow(Expectation('tab closed', f'{PAGE}, {SERVER}'), faults.close_tab),
    HandRow(Expectation('another tab in front: page hidden', PAGE), faults.hide_tab),
    HandRow(Expectation('window minimized', PAGE), faults.minimize, quick=0),
    HandRow(Expectation('another window in front: focus lost', PAGE), faults.unfocus,
            has_windows=True),
    HandRow(Expectation('a context menu takes the release of the key', PAGE), faults.open_menu),
    HandRow(Expectation('a menu of the browser takes it: the key repeats no more', PAGE),
            faults.lose_release),
    HandRow(Expectation('page frozen by its life cycle, thawed', PAGE), faults.freeze_page),
    HandRow(Expectation("page's process frozen, continued", LEASE), faults.freeze_renderer,
            quick=0),
    HandRow(Expectation('browser frozen, continued', LEASE), faults.freeze_browser),
    HandRow(Expectation('link cut by a proxy, restored after 2 s', LEASE), faults.cut_link),
    HandRow(Expectation('link cut by nftables, restored after 2 s', LEASE),
            faults.cut_link_by_firewall),
    HandRow(Expectation('1 s of lag to the console, then a burst', LEASE), faults.lag('browser')),
    HandRow(Expectation('1 s of lag to the page, then a burst', f'{PAGE}, {LEASE}'),
            faults.lag('console')),
    HandRow(Expectation('1 s of lag both ways, then a burst', LEASE), faults.lag(), quick=0),
    BurstRow(Expectation('the same by a client that never lets go', LEASE)),
    HandRow(Expectation('console frozen for 1 s, thawed', LEASE), faults.freeze_console),
    HandRow(Expectation('browser killed', SERVER), faults.kill_browser),
    StopRow(_stop('STOP beside a flood')),
    StopRow(_stop('STOP beside a flood and twelve busy processes'), busy_count=12, quick=0),
    EarlyStopRow(Expectation('STOP before t = 0', 'STOP', None, None)),
    HandRow(Expectation('console killed', 'the drive process'), faults.kill_console),
    ReplayRow(Expectation('30 s by hand, recorded and replayed', 'the motion', None, None)),
    RefusalRow(_refused('foreign Origin'), refusals.foreign_origin),
    RefusalRow(_refused('Origin of another port'), refusals.other_port, quick=0),
    RefusalRow(_refused('wrong Host'), refusals.wrong_host),
    RefusalRow(_refused('no token'), refusals.no_token),
    RefusalRow(_refused('wrong token'), refusals.wrong_token, quick=0),
    RefusalRow(_refused("viewer's token driving"), refusals.viewer, connects=True),
    RefusalRow(_refused('oversized messages'), refusals.second_page, refusals.send_oversized,
               connects=True),
    RefusalRow(_refused('a flood of messages'), refusals.second_page, refusals.send_flood,
               connects=True),
)
