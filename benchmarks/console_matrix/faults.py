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
"""Rows in which the page drives by hand, and the faults of browser, link and console."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
import os
import random
import shutil
import signal
import subprocess
import time

from benchmarks.console_matrix.browser import SCREEN_MISSING
from benchmarks.console_matrix.console_run import end_processes, time_until
from benchmarks.console_matrix.proxy import Proxy
from benchmarks.console_matrix.stage import Stage
from benchmarks.console_matrix.trial import Expectation, hand_trial, SpoiltError, Trial
from kachaka_simple_control.process.processes import is_running

#: How long the hand drives before the fault [s].
TIME_TO_FAULT = (0.6, 0.9)
#: How long the browser is frozen, and the link cut [s].
FREEZE = 2.0
#: How long bytes are held back, and the console is frozen [s].
LAG = 1.0
#: How long the velocities are recorded after what follows the fault [s].
SETTLING_TIME = 1.0
#: How long a velocity may be on its way to the observer [s].
LATENCY = 0.2
#: How long a drive process may go on without its console [s].
DRIVE_EXIT = 5.0
#: The name of the firewall's table.
TABLE = 'inet kachaka_console_matrix'


@dataclass(frozen=True)
class HandRow:
    """A row in which the page drives by a held key when a fault comes."""

    expectation: Expectation
    inject: Fault
    has_windows: bool = False
    full: int = 20
    quick: int = 1

    def run(self, stage: Stage) -> Trial:
        """Run one trial."""
        stage.use_windows(self.has_windows)
        browser, recorder = stage.browser, stage.console.recorder
        browser.open(stage.console.address)
        browser.take(stage.console.address)
        began = time.time()
        commands = stage.console.proxy.commands
        browser.press()
        try:
            first = recorder.wait_for(lambda velocity: velocity.moves, began, 3.0)
            if first is None:
                raise SpoiltError('the robot did not move')
            time.sleep(random.uniform(*TIME_TO_FAULT))
            injected = self.inject(stage)
            time.sleep(LATENCY)
            since = first.time - 1e-6
            velocities = recorder.sent_since(since)
            trial = hand_trial(
                velocities, [one for one in commands if one.time > began], injected.time,
                injected.effect)
        finally:
            stage.let_go()
        return replace(trial, broken=injected.broken, note=injected.note,
                       not_tried=injected.not_tried)


@dataclass
class Injected:
    """
    An injected fault.

    :param effect: the time after which the console can pass nothing on [s, system clock]; None if
        the fault is on the way to the console
    """

    time: float
    effect: float | None = None
    broken: tuple[str, ...] = ()
    note: str = ''
    not_tried: str = ''


Fault = Callable[[Stage], Injected]


def close_tab(stage: Stage) -> Injected:
    """Close the tab with the page."""
    fault = time.time()
    stage.browser.driver.close()
    time.sleep(SETTLING_TIME)
    return Injected(fault)


def kill_browser(stage: Stage) -> Injected:
    """Kill all processes of the browser."""
    pids = stage.browser.processes
    fault = stage.browser.signal(signal.SIGKILL, pids)
    stage.drop_browser()
    time.sleep(SETTLING_TIME)
    return Injected(fault)


def freeze_browser(stage: Stage) -> Injected:
    """Freeze all processes of the browser, and continue them later."""
    pids = stage.browser.processes
    with frozen(stage, pids) as fault:
        time.sleep(FREEZE)
    stage.browser.repeat(SETTLING_TIME)
    return Injected(fault, note=f'{len(pids)} processes')


def freeze_renderer(stage: Stage) -> Injected:
    """Freeze only the processes that run the page, and continue them later."""
    pids = stage.browser.renderers
    with frozen(stage, pids) as fault:
        time.sleep(FREEZE)
    stage.browser.repeat(SETTLING_TIME)
    return Injected(fault, note=f'{len(pids)} processes')


def freeze_page(stage: Stage) -> Injected:
    """Freeze the page as a browser does with tabs in the background, and continue it later."""
    def set_state(state: str) -> None:
        stage.browser.command('Page.setWebLifecycleState', state=state)
    return _for_a_while(stage, lambda: set_state('frozen'), lambda: set_state('active'), 'freeze')


def hide_tab(stage: Stage) -> Injected:
    """Bring another tab of the window to the front, and the page back later."""
    return _for_a_while(
        stage, lambda: stage.browser.cover(new_window=False), stage.browser.uncover,
        'visibilitychange')


def minimize(stage: Stage) -> Injected:
    """Minimize the window, and restore it later."""
    return _for_a_while(
        stage, stage.browser.minimize, stage.browser.restore, 'visibilitychange')


def unfocus(stage: Stage) -> Injected:
    """Bring another window to the front, and the page back later."""
    return _for_a_while(
        stage, lambda: stage.browser.cover(new_window=True), stage.browser.uncover, 'blur')


def open_menu(stage: Stage) -> Injected:
    """Open a context menu; it takes the release of the key."""
    fault = time.time()
    stage.browser.open_menu()
    time.sleep(SETTLING_TIME)
    return _with_events(stage, Injected(fault), 'contextmenu')


def lose_release(stage: Stage) -> Injected:
    """Let the key repeat, and then send the page no key event, as a menu of the browser does."""
    stage.browser.repeat(SETTLING_TIME)
    fault = time.time()
    time.sleep(SETTLING_TIME)
    return Injected(fault)


def cut_link(stage: Stage) -> Injected:
    """Hold back all bytes in both directions, and pass them on later."""
    fault = stage.console.proxy.hold()
    stage.browser.repeat(FREEZE)
    stage.console.proxy.release()
    stage.browser.repeat(SETTLING_TIME)
    return Injected(fault)


def cut_link_by_firewall(stage: Stage) -> Injected:
    """Drop all packets between browser and console, and let them pass again later."""
    if reason := firewall_missing():
        return Injected(time.time(), not_tried=reason)
    with cut_packets(Proxy.ADDRESS, stage.console.port) as fault:
        stage.browser.repeat(FREEZE)
    stage.browser.repeat(SETTLING_TIME)
    return Injected(fault)


def lag(*sides: str) -> Fault:
    """Return a fault: bytes are held back for 1 s, and then delivered all at once."""
    def inject(stage: Stage) -> Injected:
        proxy = stage.console.proxy
        fault = proxy.hold(*sides)
        stage.browser.repeat(LAG)
        before, burst = len(proxy.commands), proxy.release()
        stage.browser.repeat(SETTLING_TIME)
        count = sum(one.moves and one.time < burst + 0.1 for one in proxy.commands[before:])
        return Injected(
            fault, note=f'motions in the burst: {count}; page: {stage.browser.hand_text()}')
    return inject


def kill_console(stage: Stage) -> Injected:
    """Kill the console; its drive process must stop the robot, and end."""
    fault, children = stage.console.kill()
    ended = time_until(lambda: not any(map(is_running, children)), fault, DRIVE_EXIT)
    time.sleep(SETTLING_TIME)
    stage.drop_console()
    left = end_processes(children, 0.0)
    if ended is None:
        broken = f'{len(left)} of its processes did not end within {DRIVE_EXIT:g} s'
        return Injected(fault, fault, (broken,))
    return Injected(fault, fault, note=f'all processes ended {ended:.1f} s later')


def freeze_console(stage: Stage) -> Injected:
    """Freeze the console for 1 s, and continue it."""
    fault = stage.console.signal(signal.SIGSTOP)
    try:
        stage.browser.repeat(LAG)
    finally:
        stage.console.signal(signal.SIGCONT)
    stage.browser.repeat(SETTLING_TIME)
    return Injected(fault, fault)


@contextmanager
def frozen(stage: Stage, pids: list[int]) -> Iterator[float]:
    """Freeze processes of the browser during a ``with`` block, and yield when [s]."""
    try:
        yield stage.browser.signal(signal.SIGSTOP, pids)
    finally:
        stage.browser.signal(signal.SIGCONT, pids)


def _for_a_while(
        stage: Stage, begin: Callable[[], object], end: Callable[[], object],
        wanted: str) -> Injected:
    """Begin something that causes an event of the page, and end it later."""
    fault = time.time()
    begin()
    time.sleep(FREEZE)
    end()
    stage.browser.repeat(SETTLING_TIME)
    return _with_events(stage, Injected(fault), wanted)


def _with_events(stage: Stage, injected: Injected, wanted: str) -> Injected:
    """Note the real events that the page got; without the wanted event nothing was tried."""
    seen = stage.browser.seen()
    injected.note = 'the page got ' + (', '.join(dict.fromkeys(seen)) or 'no event')
    if wanted not in seen:
        injected.not_tried = (
            f'the browser told the page nothing of it (no real event {wanted!r}); without windows '
            f'it does not: it {SCREEN_MISSING}')
    return injected


def firewall_missing() -> str:
    """Return what is missing to cut a link by the firewall; empty if nothing is missing."""
    if shutil.which('nft') is None:
        return 'needs nft: make browser'
    if os.geteuid() != 0:
        return 'needs root for nftables'
    result = subprocess.run(
        ['nft', 'list', 'tables'], capture_output=True, text=True, check=False)
    return result.stderr.strip()


@contextmanager
def cut_packets(address: str, port: int) -> Iterator[float]:
    """Drop all packets to and from an address and a port during a ``with`` block."""
    rules = f"""
        table {TABLE} {{
            chain output {{
                type filter hook output priority 0;
                ip daddr {address} tcp dport {port} drop
                ip saddr {address} tcp sport {port} drop
            }}
        }}"""
    subprocess.run(['nft', '-f', '-'], input=rules, text=True, check=True)
    try:
        yield time.time()
    finally:
        subprocess.run(['nft', 'delete', 'table', *TABLE.split()], check=True)
