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
"""The page of a fleet in a real browser, with the real server and imagined robots."""

from contextlib import closing
import os
import re
import signal
import time
from urllib.parse import urlsplit

from page_browser import Console, Page
import pytest
from test_page_looks import IMAGES, LOW_CONTRAST, OVERFLOWING, SCREENSHOTS, STAYING

pytestmark = [pytest.mark.real_time, pytest.mark.browser]

ESCAPE, SPACE, TAB = '\ue00c', ' ', '\ue004'
#: The names in the rows, and what stands beside them.
ROWS = """
    return [...document.querySelectorAll('#rows tr')].map(row => [
        '.row-name', '.row-motion', '.row-state', '.row-trouble'].map(
            part => row.querySelector(part).textContent));
"""
#: Where each robot is drawn: x, y [m] and heading [degrees].
PLACES = """
    return [...document.querySelectorAll('.floor-robot')].map(
        body => body.getAttribute('transform').match(/-?[0-9.]+/g).map(Number));
"""


class FleetPage(Page):
    """The page of a fleet in a browser."""

    def _wait_until_ready(self):
        self.wait(lambda: self.find('#run').is_enabled(), 'that the fleet can be run')

    def run_fleet(self):
        """Run the fleet, and wait until it drives."""
        self.click('#run')
        self.wait(lambda: self.find('#ask').is_displayed(), 'the question')
        self.click('#ask-run')
        self.wait(lambda: self.text('#state') == 'driving', 'that the fleet drives')


def many(count):
    """Return a fleet file as text, with a number of robots on a grid."""
    rows = ''.join(
        f'  r{number + 1}: {{motion: {"square_cw" if number % 2 else "square"}, start: '
        f'{{x: {1.6 * (number % 10):.1f} m, y: {1.6 * (number // 10):.1f} m, '
        f'heading: {90 * (number % 4)} deg}}}}\n' for number in range(count))
    return f'name: parade\nrobots:\n{rows}repeat: 3\n'


@pytest.fixture(scope='module')
def record(tmp_path_factory):
    """Return the file with the lines that the drive process has got."""
    return tmp_path_factory.mktemp('record') / 'lines'


@pytest.fixture(scope='module')
def console(browser, record):
    """Yield the console of a fleet of two."""
    with closing(Console(record.parent, f'--record={record}', fleet='minuet')) as console:
        yield console


@pytest.fixture(scope='module')
def parade(browser, tmp_path_factory):
    """Yield the console of a fleet of 50, of which one fails."""
    file = tmp_path_factory.mktemp('fleet') / 'parade.yaml'
    file.write_text(many(50))
    with closing(Console(
            file.parent, '--fault=r13', '--fault-at=5.0', fleet=str(file))) as console:
        yield console


@pytest.fixture
def page(browser, console):
    """Return the page, newly loaded, of a fleet that stands."""
    page = FleetPage(browser, console.address).open()
    yield page
    page.press(ESCAPE)
    page.wait(lambda: page.find('#run').is_enabled(), 'that the fleet can be run again')


def test_the_page_asks_no_other_host_and_breaks_no_rule(page, console):
    own = urlsplit(console.address).netloc
    assert {urlsplit(url).netloc for url in page.requests()} == {own}
    assert page.complaints() == []


def test_rows_appear_and_the_robots_stand_on_the_floor_and_are_driven(page):
    assert page.text('#fleet-name') == 'minuet'
    assert [row[:2] for row in page.run(ROWS)] == [['r1', 'square'], ['r2', 'square_cw']]
    start = page.received('welcome')[0]['fleet']['robots'][0]['start']
    page.run_fleet()

    def trail():
        """Return what was driven, in metres."""
        text = page.run('return document.querySelector(".floor-trail")?.getAttribute("points")')
        return [[float(value) for value in point.split(',')] for point in (text or '').split()]

    page.wait(lambda: len(trail()) > 10, 'that the robots are driven')
    assert [row[2] for row in page.run(ROWS)] == ['driving', 'driving']
    first, second = page.run(PLACES)
    assert first[0] == pytest.approx(second[0], abs=0.05)
    assert trail()[0] == pytest.approx(start[:2], abs=0.05)
    assert trail()[-1][0] > trail()[0][0]
    assert page.text('#round') == '1 of 2'
    assert float(page.text('#time').split()[0]) > 0.0


@pytest.mark.parametrize('how', ['pointer', 'Escape', 'space', 'in the question'])
def test_stop_stops_all(page, record, how):
    if how == 'in the question':
        page.click('#run')
        page.wait(lambda: page.find('#ask').is_displayed(), 'the question')
        page.click('#ask-stop')
        page.wait(lambda: not page.find('#ask').is_displayed(), 'the end of the question')
    else:
        page.run_fleet()
        page.run('document.activeElement.blur()')
        {'pointer': lambda: page.click('#stop'), 'Escape': lambda: page.press(ESCAPE),
         'space': lambda: page.press(SPACE)}[how]()
    page.wait(lambda: page.text('#stop-result') == 'stopped (odometry confirms)', 'the outcome')
    assert page.text('#state') == 'stopped'
    assert len(page.sent('stop')) == 1
    kinds = re.findall(r'"type": "(\w+)"', record.read_text())
    assert [kind for kind in kinds if kind != 'alive'][-1] == 'stop'


def test_it_is_paused_and_resumed(page):
    page.run_fleet()
    page.click('#pause')
    page.wait(lambda: page.text('#state') == 'paused', 'the pause')
    assert page.text('#pause') == 'Resume'
    assert page.text('#speed') == '0 %'
    # Space stops: the button does not keep the focus.
    assert page.run('return document.activeElement === document.body')
    page.click('#pause')
    page.wait(lambda: page.text('#state') == 'driving', 'that it goes on')
    assert page.text('#apart') == '7 ms'


def test_a_press_on_a_row_or_a_robot_marks_it_in_both(page):
    selected = ('return [document.querySelector("#rows .selected")?.textContent ?? "", '
                'document.querySelectorAll(".floor-robot[data-selected=true]").length]')
    page.run('document.querySelectorAll(".row-name")[1].click()')
    assert page.run(selected)[0].startswith('r2')
    assert page.run(selected)[1] == 1
    page.run('document.querySelectorAll(".floor-robot")[0].dispatchEvent(new Event("click"))')
    assert page.run(selected)[0].startswith('r1')
    page.run('document.querySelectorAll(".floor-robot")[0].dispatchEvent(new Event("click"))')
    assert page.run(selected) == ['', 0]


def test_a_robot_in_trouble_is_the_first_of_50(browser, parade):
    page = FleetPage(browser, parade.address).open()
    assert [row[0] for row in page.run(ROWS)] == [f'r{number}' for number in range(1, 51)]
    page.run_fleet()
    page.wait(lambda: page.text('#state') == 'stopped', 'the fault', 30.0)
    name, _, state, trouble = page.run(ROWS)[0]
    assert (name, state) == ('r13', 'stopped')
    assert trouble.startswith('the robot has left')
    assert page.text('#trouble') == '1 robot'
    assert page.run('return document.querySelectorAll('
                    '".floor-robot[data-trouble=true]").length') == 1
    assert page.text('#summary') == '50 stopped'
    # Without a new drive the driven paths stay.
    assert page.run('return document.querySelectorAll(".floor-trail").length') >= 50


def test_the_page_says_that_the_process_or_the_connection_has_gone(browser, record):
    with closing(Console(record.parent, fleet='minuet')) as console:
        page = FleetPage(browser, console.address).open()
        pid = int(re.findall(r'process (\d+)', page.text('#log-lines'))[-1])
        os.kill(pid, signal.SIGTERM)
        page.wait(lambda: page.text('#release') == 'Start again', 'the button')
        assert page.text('#fault-text') == 'stopped by a signal'
        assert page.text('#state') == 'ended'
        assert not page.find('#run').is_enabled()
        page.click('#release')
        page.wait(lambda: page.find('#run').is_enabled(), 'the new process')
        assert not page.find('#fault').is_displayed()
    page.wait(lambda: page.find('#lost').is_displayed(), 'that the connection is lost')
    page.press(ESCAPE)
    page.wait(lambda: page.text('#fault-text').startswith('STOP was not sent.'), 'the fault')
    assert 'each robot' in page.text('#fault-text')


@pytest.mark.parametrize('width', [320, 360, 768, 1024, 1440, 2560])
def test_nothing_is_wider_than_the_page(browser, parade, width):
    page = FleetPage(browser, parade.address).open(width, 800)
    page.run("""
        document.querySelector('#lost').hidden = false;
        document.querySelector('#lost-title').textContent = 'Connection lost';
        document.querySelector('#fault').hidden = false;
        document.querySelector('#fault-text').textContent = 'a_fault_of_one_word_'.repeat(10);
        document.querySelector('.row-trouble').textContent = 'a_trouble_of_one_word_'.repeat(9);
    """)
    assert page.run(OVERFLOWING) == []


@pytest.mark.parametrize('scheme', ['light', 'dark'])
def test_every_visible_text_has_enough_contrast(browser, parade, scheme):
    page = FleetPage(browser, parade.address).open(1440, 900, scheme)
    page.run("""
        for (const [place, tone] of ['idle', 'busy', 'warn', 'good', 'bad'].entries()) {
            document.querySelectorAll('.row-state')[place].dataset.tone = tone;
        }
        document.querySelector('.row-trouble').textContent = 'trouble';
    """)
    assert page.run(LOW_CONTRAST) == []


@pytest.mark.parametrize('width, height', [(360, 640), (640, 360), (1440, 900)])
def test_stop_is_large_and_always_in_view(browser, parade, width, height):
    page = FleetPage(browser, parade.address).open(width, height)
    for part in ('floor', 'robots', 'log'):
        page.run('document.querySelector(arguments[0]).scrollIntoView()', f'#{part}')
        left, top, right, bottom, is_hit = page.run("""
            const box = document.querySelector('#stop').getBoundingClientRect();
            const hit = document.elementFromPoint(
                box.left + box.width / 2, box.top + box.height / 2);
            return [box.left, box.top, box.right, box.bottom, hit.closest('#stop') !== null];""")
        assert 0 <= top < bottom <= height
        assert right - left >= 200
        assert bottom - top >= 44
        assert is_hit
    assert page.run(STAYING) < 0.5 * height


def test_a_large_screen_shows_the_whole_page(browser, parade):
    page = FleetPage(browser, parade.address).open(1440, 900)
    assert page.run('return document.documentElement.scrollHeight') == 900


def test_the_tab_key_begins_with_stop_and_every_control_has_a_name(page):
    page.run('document.activeElement.blur()')
    reached = []
    for _ in range(5):
        page.press(TAB)
        reached.append(page.run('return document.activeElement.id'))
    assert reached[:4] == ['stop', 'release', 'run', '']
    for control in page.driver.find_elements('css selector', 'button'):
        if control.is_displayed():
            assert control.accessible_name.strip(), control.get_attribute('outerHTML')
    assert page.find('#floor-svg').accessible_name.startswith('The floor from above: 2 robots on ')


@pytest.mark.skipif(not SCREENSHOTS, reason='writes docs/images: KACHAKA_SCREENSHOTS=1')
def test_screenshots(browser, parade):
    page = FleetPage(browser, parade.address).open()
    page.run_fleet()
    time.sleep(4.0)
    page.run('document.activeElement.blur()')
    page.run('document.querySelector("#fleet-source").textContent = "./parade.yaml"')
    assert page.driver.save_screenshot(str(IMAGES / 'console-fleet.png'))
    page.press(ESCAPE)
