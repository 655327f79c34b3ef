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
"""The console of a fleet, with the real server and a drive process that imagines the robots."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path
import signal
from typing import Any

from console_client import ConsoleProgram, fetch, PageClient, serve
from kachaka_simple_control.console.fleet_page_protocol import Ping
from kachaka_simple_control.console.page_protocol import Start
from kachaka_simple_control.files.protocol import Pause, Release, Resume, RunFleet, Take
import pytest

pytestmark = [pytest.mark.needs('tornado', 'yaml', 'jsonschema'), pytest.mark.real_time]

#: Two robots, two rounds.
FLEET = '--fleet=minuet'


async def ready(program: ConsoleProgram, **headers: str) -> PageClient:
    """Return a page that has said hello, when the fleet is known."""
    page = await PageClient.connect(program, **headers)
    await page.greet()
    await page.until(lambda: page.state['process'] == 'running')
    return page


def fleet_of(page: PageClient) -> Any:
    """Return the fleet as a page was told."""
    found = next(fleet for message in page.messages if (
        fleet := message if message['type'] == 'fleet' else message.get('fleet')))
    return {key: value for key, value in found.items() if key not in ('v', 'type')}


def test_a_page_gets_the_fleet_and_sees_it_driven_round_by_round(tmp_path: Path):
    async def scenario(program: ConsoleProgram) -> None:
        page = await ready(program)
        fleet = fleet_of(page)
        assert ('minuet', 2) == (fleet['name'], fleet['rounds'])
        starts = {name: [0.0, y, 0.0] for name, y in (('r1', 0.4), ('r2', -0.4))}
        assert starts == {robot['name']: robot['start'] for robot in fleet['robots']}
        assert 'standing by' == page.state['state']
        await page.until(lambda: page.state['poses'] == [None, None])
        assert (await page.ask(RunFleet))['is_done']
        await page.until(lambda: page.state['state'] == 'driving' and all(page.state['poses']))
        assert 1 == page.state['round']
        refused = await page.ask(RunFleet)
        assert (False, 'a motion is running already') == (refused['is_done'], refused['text'])
        await page.until(lambda: page.state['round'] == 2)
        # Whoever comes later sees the same.
        other = await ready(program)
        assert fleet == fleet_of(other)
        await page.until(lambda: page.state['state'] == 'standing by')
        assert ['done', 'done'] == page.state['states']
        assert 2 == page.state['watchers']

    serve(tmp_path, scenario, FLEET, '--drive=--pace=20')


def test_it_is_paused_resumed_and_stopped_without_a_lease(tmp_path: Path):
    async def scenario(program: ConsoleProgram) -> None:
        page, other = await ready(program), await ready(program)
        assert (await page.ask(RunFleet))['is_done']
        await page.until(lambda: page.state['state'] == 'driving')
        assert (await other.ask(Pause))['is_done']
        await page.until(lambda: page.state['state'] == 'paused')
        assert ['paused', 'paused'] == page.state['states']
        assert (await other.ask(Resume))['is_done']
        await page.until(lambda: page.state['apart'] == 0.007)
        answer = await other.stop()
        assert (True, True) == (answer['is_done'], answer['is_confirmed'])
        await page.until(lambda: page.state['state'] == 'stopped')
        assert ['run', 'pause', 'resume', 'stop'] == [line['type'] for line in program.lines()]

    serve(tmp_path, scenario, FLEET)


def test_a_robot_in_trouble_is_named(tmp_path: Path):
    async def scenario(program: ConsoleProgram) -> None:
        page = await ready(program)
        await page.ask(RunFleet)
        await page.until(lambda: page.state['state'] == 'stopped')
        assert ['r2'] == [*page.state['troubles']]
        assert 'r2: the robot has left' == page.state['reason']
        await page.ask(RunFleet)
        await page.until(lambda: page.state['state'] == 'driving')
        assert {} == page.state['troubles']

    serve(tmp_path, scenario, FLEET, '--drive=--fault=r2', '--drive=--fault-at=0.2')


def test_a_viewer_may_stop_and_pause_but_not_run(tmp_path: Path):
    async def scenario(program: ConsoleProgram) -> None:
        viewer, driver = await ready(program, token=program.viewer), await ready(program)
        for kind in (RunFleet, Resume, Release, Start):
            refused = await viewer.ask(kind)
            assert (False, True) == (refused['is_done'], 'for viewers' in refused['text'])
        assert (await viewer.ask(Ping))['is_done']
        assert (await driver.ask(RunFleet))['is_done']
        await viewer.until(lambda: viewer.state['state'] == 'driving')
        assert (await viewer.ask(Pause))['is_done']
        assert (await viewer.stop())['is_done']

    serve(tmp_path, scenario, FLEET, '--token')


def test_nothing_of_the_console_of_one_robot_is_understood(tmp_path: Path):
    async def scenario(program: ConsoleProgram) -> None:
        page = await ready(program)
        page.send(Take(1))
        page.hand(0.1)
        await page.until(lambda: 2 == sum(
            'is unknown here' in message.get('text', '') for message in page.messages))
        assert [] == program.lines()
        status, _, text = fetch(program, '/', Host=program.host)
        assert (200, True) == (status, 'src="fleet.js"' in text)
        assert 404 == fetch(program, '/index.html', Host=program.host)[0]

    serve(tmp_path, scenario, FLEET)


def test_a_release_ends_the_process_and_starts_another_and_shows_the_report(tmp_path: Path):
    async def scenario(program: ConsoleProgram) -> None:
        page = await ready(program)
        first = program.drive_pid()
        assert page.state['report'] is None
        assert (await page.ask(Release))['is_done']
        await page.until(lambda: page.state['report'] == 1)
        await page.until(lambda: page.state['process'] == 'running')
        assert program.drive_pid() != first
        status, _, text = fetch(program, '/report/1')
        assert (200, '<title>of the drive</title>') == (status, text)

    serve(tmp_path, scenario, FLEET, f'--reports={tmp_path / "reports"}')


def test_when_the_drive_process_has_died_only_a_press_starts_another(tmp_path: Path):
    async def scenario(program: ConsoleProgram) -> None:
        page = await ready(program)
        await page.ask(RunFleet)
        await page.until(lambda: page.state['state'] == 'driving')
        os.kill(program.drive_pid(), signal.SIGTERM)
        await page.until(lambda: page.state['process'] == 'ended')
        assert ('ended', 'stopped by a signal') == (page.state['state'], page.state['reason'])
        await asyncio.sleep(0.3)
        assert 'ended' == page.state['process']
        assert not (await page.ask(RunFleet))['is_done']
        assert (await page.ask(Start))['is_done']
        await page.until(lambda: page.state['process'] == 'running')
        assert (await page.ask(RunFleet))['is_done']

    serve(tmp_path, scenario, FLEET)
