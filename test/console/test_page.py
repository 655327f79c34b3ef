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
"""The page of the console in a real browser, with the real server and a scripted robot."""

from itertools import pairwise
import json
import os
import re
import signal
from statistics import median
import time
from urllib.parse import urlsplit

from page_browser import Console, NOTHING, Page
import pytest

pytestmark = [pytest.mark.real_time, pytest.mark.browser]

W, ESCAPE, SPACE, BACKSPACE = 'w', '\ue00c', ' ', '\ue003'
#: After the end of a hold, so long nothing more may be sent [s].
QUIET = 0.5
#: How long what a page does at once may take on a loaded machine [s].  A page that sends nothing
#: drives the robot no longer than HAND_LEASE_TIME, which is less.
AT_ONCE = 0.4


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """Return the folder of the console."""
    return tmp_path_factory.mktemp('motions')


@pytest.fixture(scope='module')
def record(tmp_path_factory):
    """Return the file with the lines that the drive process has got."""
    return tmp_path_factory.mktemp('record') / 'lines'


@pytest.fixture(scope='module')
def console(browser, folder, record):
    """Yield a console."""
    console = Console(folder, '--duration=3', f'--record={record}')
    yield console
    console.close()


@pytest.fixture
def page(browser, console):
    """Return the page, newly loaded."""
    return Page(browser, console.address).open()


def is_zero(hand):
    return hand['linear_x'] == 0.0 and hand['angular_z'] == 0.0


def type_text(page, text):
    """Replace the text of the editor as a user does: the events of the keyboard follow."""
    page.run('const area = document.querySelector("#text"); area.value = arguments[0];'
             'area.dispatchEvent(new Event("input", {bubbles: true}))', text)


def choose(page, name):
    """Choose a motion of the list."""
    page.wait(lambda: name in page.text('#choice'), 'the motion in the list')
    page.run('const choice = document.querySelector("#choice"); choice.value = arguments[0];'
             'choice.dispatchEvent(new Event("change"))', name)


def agree(page):
    page.wait(lambda: page.find('#ask').is_displayed(), 'the question')
    page.click('#ask-run')


def test_the_page_asks_no_other_host_and_breaks_no_rule(page, console):
    from selenium.common.exceptions import WebDriverException
    own = urlsplit(console.address).netloc
    assert {urlsplit(url).netloc for url in page.requests()} == {own}
    assert len(page.requests()) > 15
    assert page.complaints() == []
    assert page.text('#state') in {'standing by', 'ready'}
    # The browser of these tests reaches no other host, so nothing of the page needs one.
    with pytest.raises(WebDriverException, match='ERR_NAME_NOT_RESOLVED'):
        page.driver.get('http://192.0.2.1/')


def test_a_held_key_sends_20_times_a_second(page):
    page.take()
    page.keys().key_down(W).perform()
    time.sleep(2.0)
    page.keys().key_up(W).perform()
    time.sleep(QUIET)
    hands = page.sent('hand')
    moving = [hand for hand in hands if not is_zero(hand)]
    # The drive process asks for a zero before the first velocity, and gets one at the end.
    assert [is_zero(hand) for hand in hands] == [True] + len(moving) * [False] + [True]
    gaps = [after['time'] - before['time'] for before, after in pairwise(moving)]
    assert median(gaps) == pytest.approx(0.05, rel=0.1)  # on a loaded machine some are late
    assert max(gaps) < AT_ONCE
    sequences = [hand['sequence'] for hand in hands]
    assert sequences == list(range(sequences[0], sequences[0] + len(hands)))
    stamps = [hand['stamp'] for hand in hands]
    assert stamps == sorted(stamps)
    # It is the newest stamp, but for one that has only just arrived.
    told = page.received('stamp')
    for hand in hands:
        assert hand['stamp'] >= max(
            stamp['stamp'] for stamp in told if stamp['time'] < hand['time'] - 0.05)
    assert [hand['linear_x'] for hand in moving] == pytest.approx(len(moving) * [0.4 * 0.3])
    assert {hand['angular_z'] for hand in moving} == {0}


def hold_stick(page):
    # Outside of the stick: it is captured.
    page.hold_stick(0.0, -0.8)


def hold_key(page):
    page.keys().key_down(W).perform()


def new_window(kind):
    return lambda page: page.driver.switch_to.new_window(kind)


def emulate(command, **values):
    return lambda page: page.driver.execute_cdp_cmd(command, values)


def repeat_key(page):
    """Hold a key as a keyboard does: it is repeated until a menu of the browser has it."""
    for is_repeated in [False] + 12 * [True]:
        page.driver.execute_cdp_cmd('Input.dispatchKeyEvent', {
            'type': 'keyDown', 'key': W, 'code': 'KeyW', 'windowsVirtualKeyCode': 87,
            'autoRepeat': is_repeated})
        time.sleep(0.04)


def leave_with_pointer(page):
    for x in (100, -100):
        page.driver.execute_cdp_cmd(
            'Input.dispatchMouseEvent', {'type': 'mouseMoved', 'x': x, 'y': 100})


def dispatch(target, kind):
    return lambda page: page.run(f'{target}.dispatchEvent(new Event("{kind}"))')


@pytest.mark.parametrize('hold, end', [
    pytest.param(hold_key, lambda page: page.keys().key_up(W).perform(), id='key released'),
    pytest.param(hold_key, new_window('tab'), id='another tab'),
    pytest.param(hold_key, dispatch('window', 'blur'), id='blur'),
    pytest.param(hold_key, dispatch('window', 'pagehide'), id='pagehide'),
    pytest.param(hold_key, emulate('Page.setWebLifecycleState', state='frozen'), id='frozen'),
    pytest.param(hold_key, lambda page: page.keys().context_click(page.find('h1')).perform(),
                 id='a menu'),
    pytest.param(hold_key, lambda page: page.click('#choice'), id='a list'),
    pytest.param(hold_key, leave_with_pointer, id='the pointer leaves'),
    pytest.param(hold_stick, lambda page: page.touch('touchEnd'), id='finger lifted'),
    pytest.param(hold_stick, lambda page: page.touch('touchCancel'), id='pointercancel'),
    pytest.param(hold_stick, new_window('tab'), id='another tab, finger down')])
def test_the_end_of_a_hold_sends_one_zero_at_once_and_nothing_after_it(page, hold, end):
    page.take()
    hold(page)
    page.wait(lambda: page.text('#state') == 'driving by hand', 'that the robot is driven')
    before = len(page.sent('hand'))
    end(page)
    time.sleep(QUIET)
    hands = page.sent('hand')
    assert len(hands) > before
    assert [is_zero(hand) for hand in hands] == [True] + (len(hands) - 2) * [False] + [True]
    assert hands[-1]['time'] - hands[-2]['time'] < AT_ONCE
    page.let_go()


def test_a_key_that_is_no_longer_repeated_ends_the_hold(page):
    """A menu of the browser takes its release, and tells the page nothing."""
    page.take()
    repeat_key(page)
    held = page.sent('hand')
    assert not is_zero(held[-1])
    page.wait(lambda: 'the key was not repeated' in page.text('#hand-state'), 'why it ended', 2.0)
    hands = page.sent('hand')
    assert is_zero(hands[-1])
    assert hands[-1]['time'] - held[-1]['time'] < 1.0
    page.let_go()


def test_leaving_the_page_ends_the_hold_at_the_robot(page, record):
    page.take()
    hold_key(page)
    page.wait(lambda: page.text('#state') == 'driving by hand', 'that the robot is driven')
    left = time.monotonic()
    page.driver.get('about:blank')
    time.sleep(QUIET)
    hands = [(entry['time'], is_zero(entry['line']))
             for entry in map(json.loads, record.read_text().splitlines())
             if entry['line']['type'] == 'hand']
    end = next(place for place in reversed(range(len(hands))) if not hands[place][1])
    # Here the browser tells no more what it has sent.  The server adds a zero of its own.
    assert 1 <= len(hands) - 1 - end <= 2
    assert hands[end + 1][0] - max(hands[end][0], left) < AT_ONCE
    page.let_go()


def test_nothing_is_sent_by_hand_before_the_robot_is_taken_or_while_a_text_is_edited(page):
    if page.text('#state') == 'ready':
        page.take()
        page.click('#lease')
        page.wait(lambda: page.text('#state') == 'standing by', 'that the robot is released')
    page.keys().key_down(W).perform()
    time.sleep(0.2)
    page.keys().key_up(W).perform()
    page.take()
    page.click('#text')
    page.keys().key_down(W).key_up(W).perform()
    page.click('#file')
    page.keys().key_down(W).key_up(W).perform()
    time.sleep(0.2)
    assert page.sent('hand') == []


def test_late_stamps_end_the_hold_until_the_next_press(page):
    page.take()
    pid = int(re.findall(r'process (\d+)', page.text('#log-lines'))[-1])
    hold_key(page)
    page.wait(lambda: page.text('#state') == 'driving by hand', 'that the robot is driven')
    os.kill(pid, signal.SIGSTOP)
    try:
        time.sleep(0.7)
        hands = page.sent('hand')
        assert is_zero(hands[-1])
        assert 'stamps of the robot are late' in page.text('#hand-state')
    finally:
        os.kill(pid, signal.SIGCONT)
    time.sleep(0.4)
    # The key is still held, and nothing follows.
    assert len(page.sent('hand')) == len(hands)
    page.let_go()


GAMEPAD = """
    window.pad = {index: 0, connected: true, axes: [0, 0, 0, 0],
                  buttons: Array.from({length: 17}, () => ({pressed: false}))};
    navigator.getGamepads = () => [window.pad];
    const event = new Event('gamepadconnected');
    event.gamepad = window.pad;
    dispatchEvent(event);
"""


def test_a_gamepad_drives_while_its_shoulder_button_is_held(page):
    page.take()
    page.run(GAMEPAD)
    page.run('pad.axes[1] = -1')
    time.sleep(0.2)
    assert page.sent('hand') == []
    page.run('pad.buttons[4].pressed = true')
    page.wait(lambda: page.text('#state') == 'driving by hand', 'that the robot is driven')
    page.run('pad.connected = false')
    time.sleep(QUIET)
    hands = page.sent('hand')
    assert [is_zero(hand) for hand in hands] == [True] + (len(hands) - 2) * [False] + [True]
    assert 'the gamepad is gone' in page.text('#hand-state')
    # It returns with the button held: that is no new press.
    page.run('pad.connected = true; const event = new Event("gamepadconnected");'
             'event.gamepad = pad; dispatchEvent(event)')
    time.sleep(0.3)
    assert len(page.sent('hand')) == len(hands)
    page.run('pad.buttons[4].pressed = false')
    time.sleep(0.1)
    page.run('pad.buttons[4].pressed = true')
    page.wait(lambda: page.text('#state') == 'driving by hand', 'that the robot is driven')
    page.run('pad.connected = false')
    page.wait(lambda: page.text('#state') == 'ready', 'that the robot stands')
    page.run(GAMEPAD.replace('pressed: false', 'pressed: true'))
    page.wait(lambda: page.text('#stop-result') == 'stopped (odometry confirms)', 'the outcome')
    assert len(page.sent('stop')) == 1


def test_only_one_page_drives_and_every_page_stops(page):
    page.run("""
        const other = new WebSocket(`ws://${location.host}/ws`);
        const send = message => other.send(JSON.stringify({v: 1, ...message}));
        other.onopen = () => {
            send({type: 'hello'});
            send({type: 'lease', id: 1, want: true});
        };
        window.other = other;""")
    page.wait(lambda: page.text('#lease-note') == 'Another page has the robot.', 'the other page')
    assert not page.find('#lease').is_enabled()
    assert not page.find('#run').is_enabled()
    page.press(ESCAPE)
    page.wait(lambda: page.text('#stop-result') == 'stopped (odometry confirms)', 'the outcome')
    page.run('other.close()')
    page.wait(lambda: page.find('#lease').is_enabled(), 'the lease button')


def stop_button(page):
    page.click('#stop')


def stop_in_a_list(page):
    # The browser closes the list, and tells the page only that the key is released.
    page.driver.execute_cdp_cmd('Input.dispatchKeyEvent', {
        'type': 'keyUp', 'key': 'Escape', 'code': 'Escape', 'windowsVirtualKeyCode': 27})


def stop_in_a_list_after_a_lost_release(page):
    page.run('dispatchEvent(new KeyboardEvent("keydown", {key: "Escape", repeat: true}))')
    dispatch('window', 'blur')(page)
    stop_in_a_list(page)


def stop_by(key, selector=None):
    def press(page):
        if selector is not None:
            page.run('document.querySelector(arguments[0]).focus()', selector)
        page.press(key)
    return press


@pytest.mark.parametrize('press', [
    pytest.param(stop_button, id='button'),
    pytest.param(stop_by(ESCAPE), id='escape'),
    pytest.param(stop_by(ESCAPE, '#text'), id='escape in a text'),
    pytest.param(stop_by(ESCAPE, '#speed'), id='escape on a slider'),
    pytest.param(stop_in_a_list, id='escape in an open list'),
    pytest.param(stop_in_a_list_after_a_lost_release, id='the same after a lost release'),
    pytest.param(stop_by(SPACE), id='space'),
    pytest.param(stop_by(SPACE, '#log-lines'), id='space on the log'),
    pytest.param(stop_by(SPACE, '#stop'), id='space on the button'),
    pytest.param(stop_by('\ue007', '#stop'), id='enter on the button')])
def test_stop(page, press):
    press(page)
    page.wait(lambda: page.text('#stop-result') == 'stopped (odometry confirms)', 'the outcome')
    assert len(page.sent('stop')) == 1


def test_stop_comes_first_while_a_hand_drives(page):
    page.take()
    hold_key(page)
    page.wait(lambda: page.text('#state') == 'driving by hand', 'that the robot is driven')
    page.press(ESCAPE)
    time.sleep(QUIET)
    stop = page.sent('stop')[0]
    after = [hand for hand in page.sent('hand') if hand['time'] >= stop['time']]
    assert [is_zero(hand) for hand in after] == [True]
    page.keys().key_up(W).perform()


def test_errors_are_at_their_lines(page):
    type_text(page, 'name: mine\nsteps:\n  - forward: 1 m\n  - sideways: 1 m\n')
    page.wait(lambda: page.text('#problems').startswith('Line 4'), 'the error')
    assert page.run('return [...document.querySelectorAll("#lines .wrong")].map('
                    'line => line.textContent)') == ['4']
    assert page.find('#text').get_attribute('aria-invalid') == 'true'
    assert page.text('#plan-area') == NOTHING
    page.click('#problems button')
    assert page.run('const area = document.querySelector("#text"); return area.value.slice('
                    'area.selectionStart, area.selectionEnd)') == '  - sideways: 1 m'
    type_text(page, 'name: mine\nsteps:\n  - forward: 1 m\n')
    page.wait(lambda: page.text('#plan-steps') == '1', 'the plan')
    assert page.text('#problems') == ''
    assert page.find('#text').get_attribute('aria-invalid') is None


def test_a_draft_outlives_a_reload(page):
    text = 'name: mine\nsteps:\n  - forward: 1 m\n  - forward: 2 m\n'
    type_text(page, text)
    page.run('document.querySelector("#file").value = "mine.yaml"')
    page.driver.refresh()
    page.wait(lambda: page.text('#plan-steps') == '2', 'the plan of the draft')
    assert page.run('return document.querySelector("#text").value') == text
    assert page.run('return document.querySelector("#file").value') == 'mine.yaml'
    assert page.text('#motion-source') == 'edited, not saved'


SQUARE = """parameters:
  side: {max: 4 m, description: of the square}
  laps: 1
steps:
  - include: {motion: ./leg.yaml, with: {side: $side, laps: $laps}}
"""
LEG = 'parameters: {side: , laps: }\nsteps: [repeat: {times: $laps, steps: [forward: $side]}]\n'


def type_value(page, number, value):
    """Replace the value of a parameter."""
    field = page.find(f'#parameter-{number}')
    field.clear()
    field.send_keys(value)


def test_a_motion_is_planned_and_run_with_the_values_of_its_parameters(page, folder):
    (folder / 'leg.yaml').write_text(LEG)
    page.take()
    type_text(page, SQUARE)
    page.wait(lambda: page.text('#parameters').startswith(
        'sideat most 4 mit must be given: a length, at most 4 m'), 'what is missing')
    assert page.find('#parameter-0').get_attribute('aria-invalid') == 'true'
    assert page.find('#parameter-1').get_attribute('placeholder') == '1'
    assert page.text('#run-note') == 'The motion has errors.'
    assert page.text('#problems') == ''
    type_value(page, 0, '5 m')
    page.wait(lambda: '5 m is above its largest' in page.text('#parameter-note-0'), 'the error')
    # The field that is typed in keeps the focus when the answer comes.
    page.keys().send_keys(*3 * [BACKSPACE], '1 m').perform()
    type_value(page, 1, '3')
    page.wait(lambda: page.text('#parameter-note-0') == 'of the square', 'the description')
    page.wait(lambda: page.text('#plan-area').startswith('3.'), 'the plan of three metres')
    assert page.find('#parameter-0').get_attribute('aria-invalid') is None
    # A text that is no YAML for a moment does not take the fields away.
    type_text(page, SQUARE + '  - [')
    page.wait(lambda: 'Line' in page.text('#problems'), 'the error')
    assert page.find('#parameter-1').get_attribute('value') == '3'
    type_text(page, SQUARE)
    page.wait(lambda: page.find('#run').is_enabled(), 'the run button')
    # The page runs the texts that it has planned, even if the file has changed.
    (folder / 'leg.yaml').write_text('steps: [wait: 1 s]')
    page.click('#run')
    agree(page)
    page.wait(lambda: page.text('#state') == 'driving', 'that the robot is driven')
    run = page.sent('run')[0]
    assert (run['text'], run['values']) == (SQUARE, {'side': '1 m', 'laps': '3'})
    assert run['included'] == {'leg.yaml': LEG}
    page.press(ESCAPE)
    page.wait(lambda: page.text('#stop-result') == 'stopped (odometry confirms)', 'the outcome')


def test_values_are_kept_with_their_motion(page, folder):
    (folder / 'far.yaml').write_text('parameters: {far: 1 m}\nsteps: [forward: $far]\n')
    page.driver.refresh()
    choose(page, 'far.yaml')
    page.wait(lambda: page.text('#parameters') == 'far', 'its parameter')
    type_value(page, 0, '2 m')
    page.wait(lambda: page.text('#plan-area').startswith('2.'), 'the plan of two metres')
    assert page.text('#motion-source') == ''
    choose(page, 'flowing_eight')
    page.wait(lambda: '2 m' not in page.run(
        'return [...document.querySelectorAll("#parameters input")].map(field => field.value)'),
        'another motion')
    page.wait(lambda: page.text('#plan-steps') not in {NOTHING, '1'}, 'another plan')
    choose(page, 'far.yaml')
    page.wait(lambda: page.text('#plan-area').startswith('2.'), 'the plan of two metres')
    page.driver.refresh()
    page.wait(lambda: page.text('#plan-area').startswith('2.'), 'the plan of two metres')
    assert page.find('#parameter-0').get_attribute('value') == '2 m'


def test_an_error_of_an_included_file_is_at_the_line_of_the_include(page, folder):
    (folder / 'leg.yaml').write_text('steps:\n  - wait: 1 s\n  - turn: 90\n')
    type_text(page, 'name: mine\nsteps:\n  - wait: 1 s\n  - include: ./leg.yaml\n')
    page.wait(lambda: page.text('#problems').startswith(
        'Line 4leg.yaml:3: step 2: turn: 90 has no unit'), 'the error')
    assert page.run('return [...document.querySelectorAll("#lines .wrong")].map('
                    'line => line.textContent)') == ['4']


def test_the_plan_is_drawn_to_scale(page):
    choose(page, 'square')
    page.wait(lambda: page.text('#plan-steps') == '8', 'the plan')
    # In one script: the plan is drawn again when the layout gives it another size.
    points, width, length, box = page.run(
        'const part = name => document.querySelectorAll(`#plan-svg .${name}`);'
        'const box = part("area-box")[0].getBBox();'
        'return [part("planned-line")[0].getAttribute("points"),'
        '        part("scale-bar")[1].getBBox().width, part("scale-text")[0].textContent,'
        '        [box.width, box.height]]')
    xs, ys = zip(*(map(float, point.split(',')) for point in points.split()))
    assert length.endswith(' cm')
    pixels = width / (float(length.removesuffix(' cm')) / 100.0)
    # Half a metre to each side, and the area as the plan in a terminal says it.
    assert (max(xs) - min(xs)) / pixels == pytest.approx(0.5, abs=0.005)
    assert (max(ys) - min(ys)) / pixels == pytest.approx(0.5, abs=0.005)
    sizes = [float(size) for size in re.findall(r'[0-9.]+', page.text('#plan-area'))]
    assert box == pytest.approx([size * pixels for size in sizes], rel=0.02)
    for part in ('.arrow', '.turn-line', '.footprint', '.start-dot'):
        assert page.run('return document.querySelectorAll(arguments[0]).length', part) > 0
    assert page.find('#plan-svg').get_attribute('aria-label').startswith(
        f'Plan from above: area {page.text("#plan-area")}')


def test_a_motion_runs_after_the_question_about_the_floor(page):
    page.take()
    page.wait(lambda: page.find('#run').is_enabled(), 'the run button')
    page.click('#run')
    page.wait(lambda: page.find('#ask').is_displayed(), 'the question')
    assert page.text('#ask-area') == page.text('#plan-area')
    assert page.run('return document.activeElement.id') == 'ask-cancel'
    page.click('#ask-cancel')
    assert page.sent('run') == []
    page.click('#run')
    agree(page)
    page.wait(lambda: page.text('#state') == 'driving', 'that the robot is driven')
    assert page.sent('run')[0]['text'] == page.run('return document.querySelector("#text").value')
    assert page.sent('run')[0]['name'] == page.run('return document.querySelector("#file").value')
    page.click('#pause')
    page.wait(lambda: page.text('#pause') == 'Resume', 'the pause')
    page.click('#pause')
    page.wait(lambda: page.text('#state') == 'driving', 'that it goes on')
    page.run('const speed = document.querySelector("#speed"); speed.value = "50";'
             'speed.dispatchEvent(new Event("input"))')
    page.wait(lambda: '50 %' in page.text('#factors'), 'who holds the speed factor')
    assert page.sent('speed')[-1]['factor'] == 0.5
    page.wait(lambda: page.text('#progress-text') not in {NOTHING, '0 %'}, 'the progress')
    page.wait(lambda: page.text('#remaining').endswith(' s'), 'the time left')
    assert page.run('return document.querySelector(".driven-line").getAttribute("points").length')
    page.click('#pause')
    # Space stops: it would resume if the button kept the focus.
    page.press(SPACE)
    page.wait(lambda: page.text('#stop-result') == 'stopped (odometry confirms)', 'the outcome')


def test_a_hold_by_an_obstacle_is_shown_with_what_the_laser_sees(page):
    page.take()
    type_text(page, 'name: watched\nsteps:\n  - forward: 1 m\n')
    page.wait(lambda: page.text('#plan-steps') == '1' and page.find('#run').is_enabled(), 'it')
    assert not page.find('#key-scan').is_displayed()
    page.click('#run')
    agree(page)
    page.wait(lambda: page.text('#state') == 'HELD', 'the hold')
    assert page.text('#held') == 'obstacle 0.31 m ahead, goes on by itself'
    assert page.text('#factors') == 'Held: obstacle 0.31 m ahead, goes on by itself.'
    # Who is there may pause it, so that it does not go on; only then it waits for a person.
    assert page.text('#pause') == 'Pause'
    lines, seen, robot, width, length = page.run(
        'const part = name => document.querySelector(`#plan-svg .${name}`);'
        'const middle = box => box.x + box.width / 2;'
        'return [part("scan-points").getAttribute("d"), middle(part("scan-points").getBBox()),'
        '        middle(part("robot-driven").getBBox()), document.querySelectorAll('
        '        "#plan-svg .scale-bar")[1].getBBox().width, part("scale-text").textContent]')
    assert lines.count('M') == 2
    pixels = width / (float(length.split()[0]) / (100.0 if length.endswith('cm') else 1.0))
    assert (seen - robot) / pixels == pytest.approx(0.6, abs=0.02)
    page.click('#pause')
    page.wait(lambda: page.text('#state') == 'paused', 'the pause')
    assert (page.text('#pause'), page.text('#held')) == ('Resume', '')
    page.click('#pause')
    page.wait(lambda: page.text('#state') == 'driving', 'that it goes on')
    assert page.text('#held') == ''
    # Where it was held stays marked until the next drive.
    assert page.find('#key-held').is_displayed()
    marks = 'return document.querySelector("#plan-svg .held-mark").getAttribute("d")'
    assert page.run(marks).count('Z') == 1
    page.press(ESCAPE)
    page.wait(lambda: page.text('#stop-result') == 'stopped (odometry confirms)', 'the outcome')
    page.wait(lambda: page.run('return document.querySelector("#plan-svg .scan-points")'
                               '.getAttribute("d")') == '', 'that the laser is gone')


def test_what_stands_on_the_floor_of_a_simulated_robot_is_drawn(browser, tmp_path):
    console = Console(tmp_path, '--floor')
    try:
        page = Page(browser, console.address).open()
        page.wait(lambda: page.run(
            'return ["floor-wall", "floor-post", "floor-person"].map('
            'kind => document.querySelectorAll(`#plan-svg .${kind}`).length)') == [1, 1, 1], 'it')
        # To the scale of the rest: the post is a metre to the left of the person.
        post, person, width, length = page.run(
            'const box = name => document.querySelector(`#plan-svg .${name}`)'
            '    .getBoundingClientRect();'
            'const middle = ({top, bottom}) => (top + bottom) / 2;'
            'return [middle(box("floor-post")), middle(box("floor-person")),'
            '        document.querySelectorAll("#plan-svg .scale-bar")[1].getBBox().width,'
            '        document.querySelector("#plan-svg .scale-text").textContent]')
        pixels = width / (float(length.split()[0]) / (100.0 if length.endswith('cm') else 1.0))
        assert (person - post) / pixels == pytest.approx(1.0, abs=0.02)
    finally:
        console.close()


def test_a_page_that_is_opened_in_mid_drive_shows_the_plan_that_is_driven(page):
    page.take()
    type_text(page, 'name: mine\nsteps:\n  - forward: 1 m\n')
    page.wait(lambda: page.text('#plan-steps') == '1' and page.find('#run').is_enabled(), 'it')
    page.click('#run')
    agree(page)
    page.wait(lambda: page.text('#state') == 'driving', 'that the robot is driven')
    page.open()
    page.wait(lambda: page.text('#state') == 'driving', 'that the robot is driven')
    # Its own motion is the square, with eight steps.
    page.wait(lambda: page.text('#plan-steps') == '1', 'the plan of the drive')
    assert page.received('state')[0]['changes']['start'] is not None
    page.press(ESCAPE)
    page.wait(lambda: page.text('#state') != 'driving', 'the stop')


def test_the_question_has_a_stop_of_its_own(page):
    page.wait(lambda: page.find('#lease').is_enabled(), 'the lease button')
    page.click('#lease')
    page.wait(lambda: page.find('#ask').is_displayed(), 'the question')
    page.click('#ask-stop')
    page.wait(lambda: page.text('#stop-result') == 'stopped (odometry confirms)', 'the outcome')
    page.press(ESCAPE)
    assert not page.find('#ask').is_displayed()
    assert len(page.sent('stop')) == 2
    assert page.sent('take') == []


def test_a_drive_by_hand_is_recorded_saved_and_opened_again(page, folder):
    page.take()
    page.click('#record')
    page.wait(lambda: page.text('#record') == 'End recording', 'that it records')
    page.run('document.activeElement.blur()')
    hold_key(page)
    time.sleep(0.5)
    page.keys().key_up(W).perform()
    time.sleep(0.3)
    page.click('#record')
    page.wait(lambda: page.find('#replay').is_enabled(), 'the record')
    page.click('#replay')
    page.wait(lambda: 'move' in page.run('return document.querySelector("#text").value'), 'it')
    page.wait(lambda: page.text('#plan-duration') != NOTHING, 'its plan')
    file = page.run('return document.querySelector("#file").value')
    page.click('#save')
    page.wait((folder / file).exists, 'that it is saved')
    page.wait(lambda: file in page.text('#choice'), 'the file in the list')
    page.click('#save')
    page.wait(lambda: page.text('#save-result').endswith(f'Replace {file}'), 'that it exists')
    assert page.find('#save-result').value_of_css_property('padding-left') != '0px'
