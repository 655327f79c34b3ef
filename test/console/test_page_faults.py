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
"""What the page of the console shows when something does not work, in a real browser."""

from contextlib import closing
import os
import re
import signal
import time

from page_browser import Console, Page
import pytest

pytestmark = [pytest.mark.real_time, pytest.mark.browser]

ESCAPE = '\ue00c'


def test_a_lost_connection_is_said_in_large_letters_and_ends_the_hand(browser, tmp_path):
    with closing(Console(tmp_path)) as console:
        page = Page(browser, console.address).open()
        page.take()
        page.keys().key_down('w').perform()
        time.sleep(0.2)
    page.wait(lambda: page.find('#lost').is_displayed(), 'that the connection is lost')
    assert page.text('#lost-title') == 'Connection lost'
    assert float(page.find('#lost-title').value_of_css_property('font-size')[:-2]) >= 24.0
    assert page.find('#lost').get_attribute('role') == 'alert'
    assert page.find('#stick').get_attribute('aria-disabled') == 'true'
    assert not page.find('#run').is_enabled()
    assert page.text('#link-age') == 'lost'
    page.let_go()
    page.press(ESCAPE)
    page.wait(lambda: page.text('#fault-text').startswith('STOP was not sent.'), 'the fault')
    assert page.text('#stop-result') == 'STOP not sent'


def test_without_odometry_a_stop_is_shown_as_unconfirmed(browser, tmp_path):
    with closing(Console(tmp_path, '--no-odometry')) as console:
        page = Page(browser, console.address).open()
        page.press(ESCAPE)
        page.wait(lambda: page.text('#stop-result') == 'sent, unconfirmed', 'the outcome')
        assert page.text('#odometry-age') == 'none'


@pytest.mark.parametrize('is_still, text, tone', [
    ('true', 'stopped', 'good'), ('false', 'still moving', 'bad'), ('null', 'stop sent', 'warn')])
def test_stopped_is_shown_only_when_odometry_shows_it(browser, tmp_path, is_still, text, tone):
    with closing(Console(tmp_path, f'--stopped={is_still}')) as console:
        page = Page(browser, console.address).open()
        page.press(ESCAPE)
        page.wait(lambda: page.text('#state') == text, 'the state')
        assert page.find('#state').get_attribute('data-tone') == tone


def test_a_stop_closes_the_question_about_the_floor(browser, tmp_path):
    with closing(Console(tmp_path)) as console:
        page = Page(browser, console.address).open()
        page.wait(lambda: page.find('#lease').is_enabled(), 'the lease button')
        page.click('#lease')
        page.wait(lambda: page.find('#ask').is_displayed(), 'the question')
        page.click('#ask-stop')
        page.wait(lambda: not page.find('#ask').is_displayed(), 'no question')
        page.wait(lambda: page.text('#stop-result'), 'the outcome')
        assert page.text('#state') == 'standing by'


def test_battery_and_errors_of_the_robot_are_shown(browser, tmp_path):
    with closing(Console(tmp_path, '--battery=0.15', '--errors=error 21051 (paused)')) as console:
        page = Page(browser, console.address).open()
        page.wait(lambda: page.text('#battery') == '15 %', 'the charge')
        assert page.find('#battery-chip').get_attribute('data-tone') == 'warn'
        assert page.text('#robot-errors') == 'The robot reports: error 21051 (paused)'
        assert page.find('#robot-errors').is_displayed()


def test_after_the_drive_process_has_died_only_a_press_starts_another(browser, tmp_path):
    with closing(Console(tmp_path)) as console:
        page = Page(browser, console.address).open()
        page.take()
        pid = int(re.findall(r'process (\d+)', page.text('#log-lines'))[-1])
        page.keys().key_down('w').perform()
        page.wait(lambda: page.text('#state') == 'driving by hand', 'that the robot is driven')
        os.kill(pid, signal.SIGTERM)
        page.wait(lambda: page.text('#fault-text'), 'why it has ended')
        page.wait(lambda: page.text('#lease') == 'Start again', 'the button')
        assert page.text('#state') == 'ended'
        count = len(page.sent('hand'))
        time.sleep(0.3)
        assert len(page.sent('hand')) == count
        page.let_go()
        page.click('#lease')
        page.wait(lambda: page.text('#state') == 'standing by', 'the new process')
        page.take()


def test_the_page_connects_again_by_itself(browser, tmp_path):
    console = Console(tmp_path)
    page = Page(browser, console.address).open()
    port = page.address.rstrip('/').rpartition(':')[2]
    console.close()
    page.wait(lambda: page.find('#lost').is_displayed(), 'that the connection is lost')
    with closing(Console(tmp_path, port=int(port))) as console:
        page.wait(lambda: not page.find('#lost').is_displayed(), 'that it is there again')
        page.wait(lambda: page.text('#state') == 'standing by', 'the state')
        page.take()


def test_geometry(browser, tmp_path):
    with closing(Console(tmp_path)) as console:
        page = Page(browser, console.address).open()
        values = page.driver.execute_async_script("""
            const done = arguments[arguments.length - 1];
            import('./geometry.js').then(geometry => done([
                geometry.relativeTo([1, 2, Math.PI / 2], [1, 3, Math.PI]),
                geometry.sizeText([0, 0, 1.0300001, 0.5]),
                geometry.sizeText([0, 0, 1.0300000001, 0.5]),
                geometry.arrowsOn([[0, 0, 0], [1, 0, 0]], 0.5),
                geometry.turnsOn([[0, 0, 0], [0, 0, 1], [0, 0, 2], [1, 0, 2]])]));
        """)
        pose, larger, rounded, arrows, turns = values
        assert pose == pytest.approx([1.0, 0.0, 1.5707963])
        assert larger.startswith('1.04 m')
        # A rounding error does not add a centimetre.
        assert rounded.startswith('1.03 m')
        assert arrows == [[0.25, 0, 0], [0.75, 0, 0]]
        assert turns == [{'x': 0, 'y': 0, 'from': 0, 'angle': 2, 'end': 2}]
