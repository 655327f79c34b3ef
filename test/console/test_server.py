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
"""A page drives through the console: hand, motions, stop, recordings, and all that can end."""

from __future__ import annotations

import asyncio
import json
import os
from pathlib import Path
import signal
import time

from console_client import console, ConsoleProgram, fetch, PageClient, serve
from kachaka_simple_control.console.page_protocol import (
    AskPreview,
    Lease,
    RunMotion,
    Start,
)
from kachaka_simple_control.files.motion_reader import loads
from kachaka_simple_control.files.protocol import Pause, Release, Resume, Speed, Take
import pytest
from waiting import wait_until

pytestmark = [pytest.mark.needs('tornado', 'yaml', 'jsonschema'), pytest.mark.real_time]


async def drive(client: PageClient, linear_x: float, duration: float) -> None:
    """Hold a direction for a time [s], with 20 messages a second."""
    end = time.monotonic() + duration
    while time.monotonic() < end:
        client.hand(linear_x)
        await asyncio.sleep(0.05)


def test_the_first_state_is_whole_and_the_others_are_differences(tmp_path: Path):
    async def scenario(program: ConsoleProgram) -> None:
        page = await PageClient.connect(program)
        welcome = await page.greet()
        assert welcome['may_drive']
        assert welcome['folder'] is None
        assert {'name': 'square', 'is_file': False} in welcome['motions']
        await page.until(lambda: page.state['process'] == 'running')
        assert {'state', 'velocity', 'factors', 'driver', 'watchers'} <= {*page.state}
        assert 'nobody' == page.state['driver']
        await page.ask(Lease, want=True)
        assert 'you' == page.state['driver']
        robots = [message if message['type'] == 'robot' else message['robot']
                  for message in page.messages if message['type'] in ('robot', 'welcome')]
        assert 'scripted' == next(robot for robot in robots if robot)['robot']

    serve(tmp_path, scenario)


def test_velocities_pass_with_their_stamps_unchanged(tmp_path: Path):
    async def scenario(program: ConsoleProgram) -> None:
        page = await PageClient.connect(program)
        await page.take()
        sent = []
        for linear_x, angular_z in ((0.0, 0.0), (0.1, 0.0), (0.1, -0.25), (0.123456789, 0.0)):
            text = page.hand_text(linear_x, angular_z)
            sent.append(json.loads(text))
            page.send_text(text)
            await asyncio.sleep(0.03)
        page.hand(0.0)
        await page.until(lambda: len(program.lines('hand')) == 5)
        lines = program.lines('hand')
        for text, line in zip(sent, lines):
            assert [text[key] for key in ('stamp', 'linear_x', 'angular_z')] == [
                line[key] for key in ('stamp', 'linear_x', 'angular_z')]
        assert len({line['sequence'] for line in lines}) == 5

    serve(tmp_path, scenario)


def test_no_velocity_is_repeated_queued_or_sent_twice(tmp_path: Path):
    async def scenario(program: ConsoleProgram) -> None:
        page = await PageClient.connect(program)
        await page.take()
        page.hand(0.0)
        text = page.hand_text(0.1)
        for _ in range(3):
            page.send_text(text)
        page.send_text(json.dumps({**json.loads(text), 'sequence': 1}))
        await page.until(lambda: page.state['state'] == 'driving by hand')
        await page.until(lambda: page.state['state'] == 'ready')
        await asyncio.sleep(0.3)
        assert [0.0, 0.1] == [line['linear_x'] for line in program.lines('hand')]

    serve(tmp_path, scenario)


@pytest.mark.parametrize('how', ['close', 'give up'])
def test_who_loses_the_lease_while_driving_sends_a_zero(tmp_path: Path, how: str):
    async def scenario(program: ConsoleProgram) -> None:
        page, other = await PageClient.connect(program), await PageClient.connect(program)
        await page.take()
        await other.greet()
        page.hand(0.0)
        await drive(page, 0.2, 0.3)
        last = program.lines('hand')[-1]
        if how == 'close':
            page.close()
        else:
            await page.ask(Lease, want=False)
        await other.until(lambda: other.state['driver'] == 'nobody')
        await other.until(lambda: program.lines('hand')[-1]['linear_x'] == 0.0)
        zero = program.lines('hand')[-1]
        assert zero['stamp'] >= last['stamp']
        await other.until(lambda: other.state['velocity'] == [0.0, 0.0])
        if how == 'give up':  # then the robot is released, and a new process stands by
            await other.until(lambda: program.lines('release'))
            await other.until(lambda: other.state['state'] == 'standing by')
        assert (await other.ask(Lease, want=True))['is_done']

    serve(tmp_path, scenario)


def test_a_motion_is_driven_paused_slowed_and_stopped(tmp_path: Path):
    async def scenario(program: ConsoleProgram) -> None:
        page = await PageClient.connect(program)
        await page.take()
        answer = await page.ask(RunMotion, text='no motion')
        assert not answer['is_done']
        assert 'motion.yaml:1:' in answer['text']
        assert not (await page.ask(RunMotion))['is_done']
        assert not (await page.ask(RunMotion, name='absent.yaml'))['is_done']
        answer = await page.ask(RunMotion, name='mine.yaml', text='no motion')
        assert 'mine.yaml:1:' in answer['text']
        assert (await page.ask(RunMotion, name='square'))['is_done']
        await page.until(lambda: page.state['state'] == 'driving' and page.state['progress'])
        assert 'square' == page.state['motion']
        assert (await page.ask(Pause))['is_done']
        await page.until(lambda: page.state['state'] == 'paused')
        assert (await page.ask(Speed, factor=0.5))['is_done']
        assert (await page.ask(Resume))['is_done']
        await page.until(lambda: page.state['factors'] == {'override': 0.5})
        answer = await page.stop()
        assert answer['is_done']
        assert answer['is_confirmed']
        run = program.lines('run')[-1]
        assert 'square' == run['name']
        assert loads(run['text']).motion.steps

    serve(tmp_path, scenario)


def test_a_motion_is_driven_with_the_values_and_texts_of_its_preview(tmp_path: Path):
    folder = tmp_path / 'folder'
    folder.mkdir()
    leg = 'parameters: {side: 9 m}\nsteps: [forward: $side]\n'
    (folder / 'leg.yaml').write_text(leg)
    text = 'parameters: {side: }\nsteps: [include: {motion: ./leg.yaml, with: {side: $side}}]\n'

    async def scenario(program: ConsoleProgram) -> None:
        page = await PageClient.connect(program)
        await page.take()
        asked = {'text': text, 'values': {'side': '2 m'}}
        told = await page.ask(AskPreview, **asked)
        assert told['included'] == {'leg.yaml': leg}
        (folder / 'leg.yaml').write_text('steps: [forward: 1 m]')
        answer = await page.ask(
            RunMotion, name='../x/mine.yaml', included=told['included'], **asked)
        assert answer['is_done']
        [run] = program.lines('run')
        assert [run[key] for key in ('text', 'name', 'values', 'included')] == [
            text, 'mine.yaml', {'side': '2 m'}, {'leg.yaml': leg}]
        await page.until(lambda: [message for message in page.messages
                                  if message['type'] == 'driven'])
        driven = next(message for message in page.messages if message['type'] == 'driven')
        assert driven['plan'] == told['plan']
        assert driven['plan']['points'][-1] == [2.0, 0.0, 0.0]

    serve(tmp_path, scenario, '--folder', str(folder))


def test_a_preview_does_not_hold_up_a_stop(tmp_path: Path):
    async def scenario(program: ConsoleProgram) -> None:
        page = await PageClient.connect(program)
        await page.greet()
        await page.until(lambda: page.state['process'] == 'running')
        long = 'steps:\n' + '  - arc: {radius: 1 m, angle: 350 deg}\n' * 300
        asked = asyncio.ensure_future(page.ask(AskPreview, text=long))
        await asyncio.sleep(0.05)
        begun = time.monotonic()
        assert (await page.stop())['is_done']
        assert time.monotonic() - begun < 0.5
        assert not asked.done()
        assert (await asked)['plan']['steps'] == 300
        result = await page.ask(AskPreview, text='steps:\n  - turn: 90\n')
        assert 2 == result['errors'][0]['line']

    serve(tmp_path, scenario)


def test_a_release_leaves_a_report(tmp_path: Path):
    async def scenario(program: ConsoleProgram) -> None:
        page = await PageClient.connect(program)
        await page.take()
        assert page.state['report'] is None
        assert 404 == fetch(program, '/report/1')[0]
        assert (await page.ask(Release))['is_done']
        # The folder 1 is of another console.
        await page.until(lambda: page.state['report'] == 2)
        status, headers, text = fetch(program, '/report/2')
        assert (200, '<title>of the drive</title>') == (status, text)
        assert headers['Content-Security-Policy'].startswith("default-src 'none'; ")
        assert 'sandbox' in headers['Content-Security-Policy']
        for path in ('/report/0', '/report/3', '/report/x', '/report/2/run.json'):
            assert 404 == fetch(program, path)[0]

    (tmp_path / 'reports' / '1').mkdir(parents=True)
    (tmp_path / 'reports' / '1' / 'report.html').write_text('of another console')
    serve(tmp_path, scenario, '--reports', str(tmp_path / 'reports'))


def test_a_process_that_dies_is_started_only_by_a_press(tmp_path: Path):
    async def scenario(program: ConsoleProgram) -> None:
        page = await PageClient.connect(program)
        await page.take()
        page.hand(0.0)
        page.hand(0.2)
        os.kill(program.drive_pid(), signal.SIGKILL)
        await page.until(lambda: page.state['process'] == 'ended')
        assert 'signal 9' in page.state['reason']
        assert 'ended' == page.state['state']
        assert [0.0, 0.0] == page.state['velocity']
        page.hand(0.2)
        answer = await page.ask(Take)
        assert not answer['is_done']
        assert 'does not run' in answer['text']
        await asyncio.sleep(0.5)
        assert 'ended' == page.state['process']
        assert (await page.ask(Start))['is_done']
        await page.until(lambda: page.state['process'] == 'running')
        assert not (await page.ask(Start))['is_done']

    serve(tmp_path, scenario)


def test_a_console_that_is_killed_leaves_no_process(tmp_path: Path):
    async def scenario(program: ConsoleProgram) -> int:
        page = await PageClient.connect(program)
        await page.take()
        page.hand(0.0)
        await drive(page, 0.2, 0.2)
        pid = program.drive_pid()
        program.process.kill()
        return pid

    with console(tmp_path) as program:
        pid = asyncio.run(scenario(program))
        wait_until(lambda: not Path(f'/proc/{pid}/exe').exists(), 5.0)


def test_ctrl_c_ends_the_console_and_the_drive_process(tmp_path: Path):
    with console(tmp_path) as program:
        pid = program.drive_pid()
        begun = time.monotonic()
        assert 130 == program.end()
        assert time.monotonic() - begun < 5.0
        assert not Path(f'/proc/{pid}').exists()
