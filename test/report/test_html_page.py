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
"""The page of a report in a real browser: its figures and layout, and that it needs no network."""

import base64
import json
import math
import re

import chromium
import fleet_drive
from kachaka_simple_control.analysis.fleet_summary import FleetLog, FleetSummary
from kachaka_simple_control.analysis.summary import Summary
from kachaka_simple_control.control.events import RobotsApart
from kachaka_simple_control.report.report_program import write_report
from outcome_logs import done, faulted, killed, lesson, never_began, stopped
import pytest

DRIVES = {
    'done': done, 'lesson': lesson, 'faulted': faulted, 'killed': killed,
    'never_began': never_began,
    **{name: lambda signum=signum, name=name: stopped(signum, name)
       for signum, name in ((1, 'SIGHUP'), (2, 'SIGINT'), (15, 'SIGTERM'))},
    'fleet': lambda: fleet_drive.log_of(
        fleet_drive.driven(fault_at=4.0, goes_on=True), RobotsApart(5007.0, 5.25, 0.0123, 3),
        near_passes=('r1 and r2: 4 cm at 3.2 s, both in step 2',), text='robots: {}')}
#: From a telephone to a wide screen [px].
WIDTHS = (400, 900, 1400)

#: Elements that reach beyond the width of the page.
OVERFLOWING = """
    const width = document.documentElement.clientWidth;
    return [...document.querySelectorAll('body *')].filter(element => {
        const box = element.getBoundingClientRect();
        return box.width && (box.right > width + 0.5 || box.left < -0.5);
    }).map(element => element.outerHTML.slice(0, 120))
      .concat(document.documentElement.scrollWidth > width ? ['the page scrolls'] : []);
"""
#: Cells and headings whose text does not fit, or is broken within a word.
BROKEN = """
    const range = document.createRange();
    return [...document.querySelectorAll('thead th, td.n, dd')].filter(cell => {
        if (!cell.getClientRects().length) return false;
        return [...cell.childNodes].filter(node => node.nodeType === 3).some(node =>
            [...node.data.matchAll(/\\S+/g)].some(word => {
                range.setStart(node, word.index);
                range.setEnd(node, word.index + word[0].length);
                return new Set([...range.getClientRects()].map(box => box.top)).size > 1;
            }));
    }).map(cell => cell.textContent);
"""
#: Labels of a plot that overlap, or are cut off at its edge.
LABELS = """
    const bad = [];
    for (const svg of document.querySelectorAll('figure svg')) {
        const edge = svg.getBoundingClientRect();
        const labels = [...svg.querySelectorAll('text')].map(
            text => [text.textContent, text.getBoundingClientRect()]);
        labels.forEach(([name, box], place) => {
            if (box.left < edge.left - 0.5 || box.right > edge.right + 0.5 ||
                box.top < edge.top - 0.5 || box.bottom > edge.bottom + 0.5)
                bad.push(`${name} is cut off`);
            for (const [other, beside] of labels.slice(place + 1))
                if (Math.min(box.right, beside.right) - Math.max(box.left, beside.left) > 0.5 &&
                    Math.min(box.bottom, beside.bottom) - Math.max(box.top, beside.top) > 0.5)
                    bad.push(`${name} lies on ${other}`);
        });
    }
    return bad;
"""


@pytest.fixture(scope='module')
def browser(tmp_path_factory):
    """Yield a browser with a new profile."""
    pytest.importorskip('jinja2', reason='needs Jinja2')
    pytest.importorskip('matplotlib', reason='plots need matplotlib')
    with chromium.browser(tmp_path_factory.mktemp('profile')) as driver:
        yield driver


@pytest.fixture(scope='module')
def reports(tmp_path_factory):
    """Return a folder with a report for every ending."""
    folder = tmp_path_factory.mktemp('reports')
    for name, drive in DRIVES.items():
        (folder / name).mkdir()
        write_report(drive(), folder / name, None)
    return folder


def show(browser, file, width=1400):
    """Open a page at a width."""
    browser.execute_cdp_cmd('Emulation.setDeviceMetricsOverride', {
        'width': width, 'height': 900, 'deviceScaleFactor': 1, 'mobile': False})
    browser.get_log('performance')
    browser.get(file.as_uri())


def requests(browser):
    """Return the addresses that were asked for since the page was opened."""
    events = [json.loads(entry['message'])['message'] for entry in browser.get_log('performance')]
    return [event['params']['request']['url'] for event in events
            if event['method'] == 'Network.requestWillBeSent']


def texts(browser, selector):
    """Return the visible texts of some elements."""
    return [element.text for element in browser.find_elements('css selector', selector)]


def test_the_page_requests_nothing_but_itself(browser, reports):
    for name in DRIVES:
        file = reports / name / 'report.html'
        show(browser, file)
        assert [url for url in requests(browser) if not url.startswith('data:')] == [file.as_uri()]
    # Nor does anything violate its content security policy.
    assert [entry for entry in browser.get_log('browser') if entry['level'] == 'SEVERE'] == []


@pytest.mark.parametrize('name', DRIVES)
def test_the_outcome_comes_first(browser, reports, name):
    show(browser, reports / name / 'report.html', 400)
    log = DRIVES[name]()
    summary = FleetSummary(log) if isinstance(log, FleetLog) else Summary(log)
    (headline,) = browser.find_elements('css selector', 'h1')
    assert headline.text == summary.outcome.headline
    assert headline.rect['y'] + headline.rect['height'] < 200
    assert texts(browser, '.why') == [' '.join(summary.outcome.reason.split())]
    # Shown by a sign and a word as well as by colour.
    assert headline.find_elements('css selector', 'svg path')


def test_the_figures_are_those_of_the_record(browser, reports):
    show(browser, reports / 'done' / 'report.html')
    record = done()
    (motion,) = record.motions
    own = motion.own_messages
    figures = dict(zip(texts(browser, '.figures dt'), texts(browser, '.figures dd')))
    assert figures['Driven for'] == (
        f'{own[-1].time - own[0].time:.3f} s\nplanned: {motion.plan.duration:.3f} s')
    assert figures['Late or lost'] == f'0\nof {len(own) - 1} messages due; 0 lost'
    assert figures['Stop'].startswith('0.12 s')
    first, last = record.odometry[0].pose, record.odometry[-1].pose
    # It came back nearly to its start: as far as odometry, which has no noise, says.
    away = 1e3 * math.hypot(last.x - first.x, last.y - first.y)
    told = re.match(r'(\S+) mm, (\S+)°', figures['Ended'])
    assert float(told[1]) == pytest.approx(away, abs=0.1)
    turned = math.degrees(math.remainder(last.theta - first.theta, math.tau))
    assert float(told[2]) == pytest.approx(turned, abs=0.1)


@pytest.mark.slow
def test_the_table_has_every_step(browser, reports):
    for name in ('done', 'lesson', 'faulted'):
        show(browser, reports / name / 'report.html')
        told = json.loads((reports / name / 'run.json').read_text())
        rows = browser.find_elements('css selector', 'table.steps tbody tr')
        assert len(rows) == len(told['steps'])
        for row, step in zip(rows, told['steps']):
            cells = [cell.text.split('\n') for cell in row.find_elements('css selector', 'td.n')]
            assert cells[0] == [str(step['number'])]
            for cell, key in zip(cells[1:], ('requested', 'sent', 'odometry', 'error')):
                scale = 1e3 if key == 'error' else 1.0
                assert float(cell[0]) == pytest.approx(
                    scale * step[key]['distance_m'], abs=0.051 if key == 'error' else 5.1e-5)
                assert float(cell[1].rstrip('°')) == pytest.approx(
                    math.degrees(step[key]['angle_rad']), abs=0.0051)
            assert ('cut short' in row.text) == (not step['is_whole'])


@pytest.mark.parametrize('width', WIDTHS)
@pytest.mark.parametrize('name', DRIVES)
def test_nothing_is_cut_off_or_overlaps(browser, reports, name, width):
    show(browser, reports / name / 'report.html', width)
    browser.execute_script(
        "document.querySelectorAll('details').forEach(part => part.open = true)")
    assert browser.execute_script(OVERFLOWING) == []
    assert browser.execute_script(BROKEN) == []
    assert browser.execute_script(LABELS) == []
    assert browser.execute_script(
        "return document.querySelectorAll('figure svg text').length") > 10


@pytest.mark.slow
def test_it_is_dark_where_the_reader_wants_that(browser, reports):
    """The plots have the page's ground, and every text can be read (WCAG: 4.5)."""
    ground_of = """
        const ground = element => {
            const color = getComputedStyle(element).backgroundColor;
            return color === 'rgba(0, 0, 0, 0)' && element.parentElement
                ? ground(element.parentElement) : color;
        };
    """
    contrast = ground_of + """
        const light = text => {
            const [r, g, b] = text.match(/[0-9.]+/g).map(Number).map(c => c / 255).map(
                c => c <= 0.04045 ? c / 12.92 : Math.pow((c + 0.055) / 1.055, 2.4));
            return 0.2126 * r + 0.7152 * g + 0.0722 * b;
        };
        return [...document.querySelectorAll(
                'h1 span, p, td, th, small, dt, dd, pre, summary, figure svg text')]
            .map(element => {
                const style = getComputedStyle(element);
                const [a, b] = [
                    light(element.localName === 'text' ? style.fill : style.color),
                    light(ground(element))];
                return (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
            });
    """
    has_ground_of_page = ground_of + """
        return [...document.querySelectorAll('figure svg')].map(svg => getComputedStyle(
            svg.querySelector('path[style*="fill"]')).fill == ground(svg));
    """
    for name in DRIVES:
        show(browser, reports / name / 'report.html')
        for scheme, is_dark in (('light', False), ('dark', True)):
            browser.execute_cdp_cmd('Emulation.setEmulatedMedia', {
                'features': [{'name': 'prefers-color-scheme', 'value': scheme}]})
            ground = browser.execute_script(
                'return getComputedStyle(document.body).backgroundColor')
            assert (sum(map(int, re.findall(r'\d+', ground))) < 200) == is_dark
            assert min(browser.execute_script(contrast)) >= 4.5, (name, scheme)
            assert all(browser.execute_script(has_ground_of_page)), (name, scheme)
    browser.execute_cdp_cmd('Emulation.setEmulatedMedia', {'features': []})


@pytest.mark.slow
def test_it_is_printed_completely(browser, reports):
    """With the collapsed parts, on few pages."""
    show(browser, reports / 'done' / 'report.html')
    browser.execute_cdp_cmd('Emulation.setEmulatedMedia', {'media': 'print'})
    try:
        (folded,) = browser.find_elements('xpath', '//details//td[text()="jazzy"]')
        assert browser.execute_script('return arguments[0].checkVisibility()', folded)
        pdf = base64.b64decode(browser.execute_cdp_cmd('Page.printToPDF', {})['data'])
    finally:
        browser.execute_cdp_cmd('Emulation.setEmulatedMedia', {'media': ''})
    assert pdf.startswith(b'%PDF')
    assert 2 <= pages_of(pdf) <= 5


def pages_of(pdf):
    """Return how many pages a document has."""
    return len(re.findall(rb'/Type\s*/Page\b', pdf))
