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
"""How the page of the console looks: contrast, layout, order and names, and its pictures."""

import os
from pathlib import Path
import re
import time

from kachaka_simple_control import __file__ as package_file
from page_browser import Console, Page
import pytest

pytestmark = [pytest.mark.real_time, pytest.mark.browser]

STATIC = Path(package_file).parent / 'console' / 'static'
IMAGES = Path(__file__).resolve().parents[2] / 'docs' / 'images'
SCREENSHOTS = os.environ.get('KACHAKA_SCREENSHOTS') == '1'
SCHEMES = ('light', 'dark')
ESCAPE, TAB = '\ue00c', '\ue004'
#: Level AA of WCAG 2: for text, and for what is needed to recognize a control or a drawing.
TEXT, PART = 4.5, 3.0
#: Which colours are text, and on what they stand.
TEXTS = {
    'text': ('page', 'surface', 'raised', 'line'), 'muted': ('page', 'surface', 'raised'),
    'on-accent': ('accent', 'accent-down'), 'on-stop': ('stop', 'stop-down'),
    'accent': ('surface',), 'surface': ('bad',), 'good': ('good-soft', 'surface'),
    'warn': ('warn-soft', 'surface', 'raised'), 'busy': ('busy-soft', 'surface'),
    'bad': ('bad-soft', 'surface', 'raised')}
#: Which colours are borders of controls, or lines of a drawing.
PARTS = {
    'control-line': ('surface', 'raised'), 'focus': ('surface', 'page'), 'stop': ('surface',),
    'planned': ('surface',), 'driven': ('surface',), 'body': ('surface',), 'area': ('surface',)}

#: Elements that reach beyond the width of the page.
OVERFLOWING = """
    const width = document.documentElement.clientWidth;
    return [...document.querySelectorAll('body *')].filter(element => {
        const box = element.getBoundingClientRect();
        const isClipped = element.closest('.unseen, .editor, svg') !== null;
        return !isClipped && box.width && (box.right > width + 0.5 || box.left < -0.5);
    }).map(element => element.outerHTML.slice(0, 120))
      .concat(document.documentElement.scrollWidth > width ? ['the page scrolls'] : []);
"""
#: The height of what stays at the top when the page is scrolled.
STAYING = """
    scrollTo(0, 500);
    const bottoms = [...document.querySelectorAll('.bar, .bar > *')]
        .filter(element => getComputedStyle(element).position === 'sticky')
        .map(element => element.getBoundingClientRect().bottom);
    return Math.max(...bottoms);
"""
#: The lowest contrast of each visible text with the next background behind it.
LOW_CONTRAST = """
    const parse = text => (text.match(/[0-9.]+/g) || []).map(Number);
    const light = ([r, g, b]) => {
        const part = value => (value /= 255) <= 0.04045 ?
            value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
        return 0.2126 * part(r) + 0.7152 * part(g) + 0.0722 * part(b);
    };
    const behind = element => {
        for (let at = element; at; at = at.parentElement) {
            const [r, g, b, a = 1] = parse(getComputedStyle(at).backgroundColor);
            if (a === 1) return [r, g, b];
        }
        return [255, 255, 255];
    };
    const found = [];
    for (const element of document.querySelectorAll('body *')) {
        const hasText = [...element.childNodes].some(
            node => node.nodeType === 3 && node.data.trim() !== '');
        if (!hasText || !element.checkVisibility() || element.closest('.unseen')) continue;
        const style = getComputedStyle(element);
        const isDrawn = element instanceof SVGElement;
        const ink = light(parse(isDrawn ? style.fill : style.color));
        const paper = light(behind(element));
        const contrast = (Math.max(ink, paper) + 0.05) / (Math.min(ink, paper) + 0.05);
        if (contrast < 4.5) found.push([contrast.toFixed(2), element.outerHTML.slice(0, 100)]);
    }
    return found;
"""


def palette(scheme):
    """Return the colours of the style sheet by name."""
    text = (STATIC / 'style.css').read_text(encoding='utf-8')
    light, dark = re.findall(r':root \{(.*?)\}', text, re.DOTALL)
    colours = dict(re.findall(r'--([\w-]+): (#[0-9a-f]{6});', light))
    if scheme == 'dark':
        changed = dict(re.findall(r'--([\w-]+): (#[0-9a-f]{6});', dark))
        assert changed.keys() == colours.keys()
        return changed
    return colours


def luminance(colour):
    """Return the relative luminance of a colour, as WCAG 2 defines it."""
    parts = [int(colour[place:place + 2], 16) / 255.0 for place in (1, 3, 5)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4
              for part in parts]
    return sum(weight * part for weight, part in zip((0.2126, 0.7152, 0.0722), linear))


def contrast(one, other):
    lighter, darker = sorted((luminance(one), luminance(other)), reverse=True)
    return (lighter + 0.05) / (darker + 0.05)


@pytest.mark.parametrize('scheme', SCHEMES)
@pytest.mark.parametrize('pairs, least', [(TEXTS, TEXT), (PARTS, PART)], ids=['text', 'parts'])
def test_the_colours_of_the_style_sheet_have_enough_contrast(scheme, pairs, least):
    colours = palette(scheme)
    low = {(name, ground): round(contrast(colours[name], colours[ground]), 2)
           for name, grounds in pairs.items() for ground in grounds
           if contrast(colours[name], colours[ground]) < least}
    assert low == {}


def test_the_page_of_a_fleet_has_no_colours_of_its_own():
    text = (STATIC / 'fleet.css').read_text(encoding='utf-8')
    assert re.findall(r'#[0-9a-fA-F]{3,8}\b(?! *\{)|\brgb|\bhsl', text) == []
    assert set(re.findall(r'var\(--([\w-]+)\)', text)) <= palette('light').keys()


def test_nothing_is_parsed_as_markup_and_nothing_is_inline():
    for file in sorted(STATIC.glob('*.html')):
        page = file.read_text(encoding='utf-8')
        assert re.findall(r'<style|\sstyle=|\son\w+=|<script(?![^>]*\ssrc=)', page) == []
        assert re.findall(r'(?:src|href)="(?:\w+:)?//[^"]*"', page) == []
    for file in sorted(STATIC.glob('*.js')):
        text = file.read_text(encoding='utf-8')
        assert re.findall(
            r'\.(?:innerHTML|outerHTML|insertAdjacentHTML|cssText)\b|document\.write|\beval\(|'
            r'new Function|new Worker|https?://(?!www\.w3\.org/2000/svg)', text) == [], file.name


@pytest.fixture(scope='module')
def console(browser, tmp_path_factory):
    """Yield a console."""
    console = Console(tmp_path_factory.mktemp('motions'), '--duration=12')
    yield console
    console.close()


def show_everything(page):
    """Fill what is empty at first: errors, a fault, the log."""
    page.run("""
        const area = document.querySelector('#text');
        area.value += '  - sideways_and_much_too_long_to_show_in_one_line: 1 m\\n';
        area.dispatchEvent(new Event('input', {bubbles: true}));
        document.querySelector('#fault').hidden = false;
        document.querySelector('#fault-text').textContent = 'a_fault_of_one_word_'.repeat(10);
        document.querySelector('#lost').hidden = false;
        document.querySelector('#lost-title').textContent = 'Connection lost';
        document.querySelector('#lost-text').textContent = 'This page cannot stop the robot now.';
    """)
    page.press(ESCAPE)
    page.wait(lambda: page.text('#problems').startswith('Line'), 'the error')
    page.wait(lambda: page.text('#stop-result') != '', 'the outcome')
    page.run("""
        document.querySelector('#held').textContent =
            'no scan of the laser, goes on with the next one; r goes on slowly';
        for (const key of ['#key-scan', '#key-held']) document.querySelector(key).hidden = false;
    """)


@pytest.mark.parametrize('width', [320, 360, 414, 768, 1024, 1440, 2560])
def test_nothing_is_wider_than_the_page(browser, console, width):
    page = Page(browser, console.address).open(width, 800)
    show_everything(page)
    assert page.run(OVERFLOWING) == []


@pytest.mark.parametrize('scheme', SCHEMES)
def test_every_visible_text_has_enough_contrast(browser, console, scheme):
    page = Page(browser, console.address).open(1440, 900, scheme)
    show_everything(page)
    assert page.run('return getComputedStyle(document.body).backgroundColor') == {
        'light': 'rgb(238, 241, 245)', 'dark': 'rgb(13, 18, 24)'}[scheme]
    assert page.run(LOW_CONTRAST) == []


@pytest.mark.parametrize('width, height', [(360, 640), (640, 360), (1440, 900)])
def test_stop_is_large_and_always_in_view(browser, console, width, height):
    page = Page(browser, console.address).open(width, height)
    for part in ('motion', 'hand', 'log'):
        page.run('document.querySelector(arguments[0]).scrollIntoView()', f'#{part}')
        # Nothing lies on it, wherever the page is scrolled.
        box = page.run("""
            const box = document.querySelector('#stop').getBoundingClientRect();
            const hit = document.elementFromPoint(
                box.left + box.width / 2, box.top + box.height / 2);
            return [box.top, box.bottom, box.width, box.height, hit.closest('#stop') !== null];""")
        assert 0 <= box[0] < box[1] <= height
        assert box[2] >= 200
        assert box[3] >= 44
        assert box[4]
    assert page.run(STAYING) < 0.5 * height


@pytest.mark.parametrize('width, height', [(1440, 900), (2560, 1440)])
def test_a_large_screen_shows_the_whole_page_also_after_other_sizes(
        browser, console, width, height):
    page = Page(browser, console.address).open(width, height)

    def fits():
        return page.run('return document.documentElement.scrollHeight') == height

    page.wait(fits, 'the whole page')
    for other in ((1000, 800), (360, 740)):
        page.resize(*other)
        time.sleep(0.2)
        page.resize(width, height)
        page.wait(fits, f'the whole page again, after {other}')


def test_the_tab_key_begins_with_stop_and_reaches_all_controls_in_order(browser, console):
    page = Page(browser, console.address).open()
    page.run('document.activeElement.blur()')
    reached = []
    for _ in range(40):
        page.press(TAB)
        name = page.run('return document.activeElement.id || document.activeElement.textContent')
        if name in reached:
            break
        reached.append(name)
    assert reached[:2] == ['stop', 'lease']
    wanted = page.run("""
        return [...document.querySelectorAll('button, input, select, textarea')]
            .filter(control => control.checkVisibility() && !control.disabled)
            .map(control => control.id)""")
    assert [name for name in reached if name in wanted] == wanted
    # The focused element has an outline.
    page.run('document.querySelector("#save").focus({focusVisible: true})')
    assert page.find('#save').value_of_css_property('outline-style') == 'solid'


def test_every_control_has_a_name(browser, console):
    page = Page(browser, console.address).open()
    for control in page.driver.find_elements('css selector', 'button, input, select, textarea'):
        if control.is_displayed():
            assert control.accessible_name.strip(), control.get_attribute('outerHTML')
    for picture in page.driver.find_elements('css selector', '[role=img]'):
        assert picture.accessible_name.strip()
    headings = page.run('return [...document.querySelectorAll("h1, h2")].filter('
                        'part => part.checkVisibility()).map(part => part.textContent)')
    assert len(headings) == len(set(headings)) == 7
    assert page.run('return document.documentElement.lang') == 'en'


def test_changes_of_the_state_are_told_politely_and_faults_at_once(browser, console):
    page = Page(browser, console.address).open()

    def politeness(selector):
        return page.run('return document.querySelector(arguments[0]).closest("[aria-live]")'
                        '.getAttribute("aria-live")', selector)

    assert [politeness(part) for part in ('#state', '#stop-result', '#problems')] == 3 * ['polite']
    assert politeness('#fault') == 'assertive'
    # A screen reader does not announce values that change all the time.
    for part in ('#link-age', '#remaining', '#linear', '#progress-text'):
        assert page.run('return document.querySelector(arguments[0]).closest('
                        '"[aria-live], [role=status], [role=alert], [role=log]") === null', part)


def test_nothing_moves_by_itself_when_the_user_wants_no_motion(browser, console):
    page = Page(browser, console.address).open()
    page.driver.execute_cdp_cmd('Emulation.setEmulatedMedia', {'features': [
        {'name': 'prefers-reduced-motion', 'value': 'reduce'}]})
    assert page.run("""
        return [...document.querySelectorAll('*')].filter(element => {
            const style = getComputedStyle(element);
            return parseFloat(style.transitionDuration) > 0 || style.animationName !== 'none';
        }).length""") == 0


@pytest.mark.skipif(not SCREENSHOTS, reason='writes docs/images: KACHAKA_SCREENSHOTS=1')
def test_screenshots(browser, tmp_path):
    console = Console(tmp_path, script=Path(__file__).with_name('planned_drive.py'))
    try:
        page = Page(browser, console.address).open()
        page.run('const choice = document.querySelector("#choice");'
                 'choice.value = "figure_eight"; choice.dispatchEvent(new Event("change"))')
        page.wait(lambda: page.text('#plan-steps') == '2', 'the plan')
        page.take()
        page.run('const speed = document.querySelector("#speed"); speed.value = "80";'
                 'speed.dispatchEvent(new Event("input"))')
        page.click('#run')
        page.wait(lambda: page.find('#ask').is_displayed(), 'the question')
        page.click('#ask-run')
        page.wait(lambda: page.text('#step') == '2 of 2', 'the second step', 30.0)
        time.sleep(4.0)
        page.run('document.activeElement.blur()')
        for name, scheme in (('desktop', 'light'), ('dark', 'dark')):
            page.resize(1440, 900, scheme)
            time.sleep(0.4)
            assert page.driver.save_screenshot(str(IMAGES / f'console-{name}.png'))
        page.press(ESCAPE)
        page.wait(lambda: page.text('#state') == 'ready', 'the stop')
        page.resize(390, 844)
        page.run('document.querySelector("#hand").scrollIntoView()')
        page.hold_stick(0.12, -0.3)
        time.sleep(0.7)
        assert page.driver.save_screenshot(str(IMAGES / 'console-phone.png'))
        page.touch('touchEnd')
    finally:
        console.close()
