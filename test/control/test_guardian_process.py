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
"""The node's side of the guardian: a slot for each robot, and one process for all of them."""

import math
import os
import sys
import tempfile

from kachaka_simple_control.control.guardian import begin_heartbeat, GuardianProcess
from kachaka_simple_control.control.guardian_memory import GuardianMemory
from kachaka_simple_control.control.preparation import complete
from kachaka_simple_control.control.timing import CHECK_PERIOD, GUARDIAN_TIMEOUT
from kachaka_simple_control.control.watchdog import GuardianMessage
from kachaka_simple_control.errors import RunFaultError
from kachaka_simple_control.process.processes import boottime, is_running
import pytest
from waiting import wait_until

pytestmark = pytest.mark.real_time

#: A guardian's program that answers as the real one does, and shows each message it gets.
PROGRAM = """
import json, os, socket, sys
pipe, robots, shared = map(int, sys.argv[1:])
robots = socket.socket(fileno=robots)
print('participant 0a', 'participant 0b', sep=os.linesep, flush=True)
while data := os.read(pipe, 2):
    number, message = data[0], chr(data[1])
    with open(os.environ['SEEN'], 'a') as seen:
        seen.write(f'{number}{message} ')
    if message == 'l':
        print('left', number, flush=True)
    elif message == 'p':
        claim = socket.recv_fds(robots, 4096, 1)[1]
        print('matched', number, '0c 0d', flush=True)
        print('primed', number, flush=True)
"""
ROBOT = ('/cmd_vel', 0.3, 'Twist', 'base_link')


@pytest.fixture
def seen(tmp_path, monkeypatch):
    """Return a function that returns the messages which the guardian has got."""
    file = tmp_path / 'seen'
    file.touch()
    monkeypatch.setenv('SEEN', str(file))
    return lambda: file.read_text().split()


@pytest.fixture
def start(seen):
    """Return a function that starts a guardian's program; it is ended after the test."""
    started = []

    def start(text=PROGRAM):
        process = GuardianProcess([sys.executable, '-c', text], dict(os.environ))
        started.append(process)
        return process

    yield start
    for process in started:
        process._process.kill()
        process._process.wait()
        process._close()


@pytest.fixture
def claim():
    """Return a descriptor to pass to the guardian."""
    with tempfile.TemporaryFile() as file:
        yield file.fileno()


def test_all_participants_of_a_guardian_that_joined_again_are_known(start, claim):
    """A participant that has left may be listed for a while, and is no foreign publisher."""
    process = start()
    guardian = process.add(*ROBOT, claim)
    assert wait_until(lambda: len(guardian.participants) == 2)
    assert guardian.participants == {b'\x0a', b'\x0b'}


def test_each_robot_has_its_own_slot_and_answers(start, claim, seen):
    process = start()
    first, second = (process.add(*ROBOT, claim) for _ in range(2))
    second.prime()
    wait_until(lambda: second.prime_count)
    assert (first.is_matched, second.is_matched) == (False, True)
    assert second.unmatched({b'\x0c', b'\x0e'}) == {b'\x0e'}
    first.latch.trip()
    first.sending.set()
    begin_heartbeat([first])
    first.check()
    assert not second.latch.is_set
    assert not second.sending.is_set
    assert wait_until(lambda: seen() == ['2p', '1b'])


def test_a_heartbeat_is_a_message_once_and_then_in_memory(start, claim, seen):
    process = start()
    guardian = process.add(*ROBOT, claim)
    memory = GuardianMemory(guardian.shared_memory[0])
    slot = memory.slot(guardian.shared_memory[1])
    beat = begin_heartbeat([guardian])
    for _ in range(3):
        before = boottime()
        beat()
        guardian.check()
        assert before <= memory.heartbeat(slot.thread) <= boottime()
    guardian.report_stopping()
    guardian.report_stopped()
    guardian.check()
    assert wait_until(lambda: seen() == ['1b', '1r', '1s', '1b'])


def test_the_process_ends_with_its_last_robot(start, claim):
    process = start()
    first, second = (process.add(*ROBOT, claim) for _ in range(2))
    complete([first.leave])
    assert is_running(process._process.pid)
    assert second.shared_memory is not None
    complete([second.leave])
    assert not is_running(process._process.pid)
    assert process.add(*ROBOT, claim) is None
    assert second.shared_memory is None
    complete([second.leave])  # without effect


def test_a_guardian_that_starts_late_is_not_killed_while_another_robot_needs_it(start, claim):
    process = start('import time; time.sleep(2.5)' + PROGRAM)
    first, second = (process.add(*ROBOT, claim) for _ in range(2))
    complete([first.leave])
    assert is_running(process._process.pid)
    second.prime()
    assert wait_until(lambda: second.prime_count)


def test_nothing_is_sent_for_a_robot_after_it_was_released(start, claim, seen):
    """Its slot may belong to another robot by then, whose run must not be called stopped."""
    process = start()
    first, second = (process.add(*ROBOT, claim) for _ in range(2))
    begin_heartbeat([first])
    complete([first.leave])
    process._number = 0
    third = process.add(*ROBOT, claim)
    assert third.number == first.number
    first.report_stopping()
    first.report_stopped()
    for send in (first.prime, first.check):
        with pytest.raises(RunFaultError, match=r'the guardian is gone \(Bad file descriptor\)'):
            send()
    second.report_stopped()
    assert wait_until(lambda: seen() == ['1l', '2s'])
    assert third.latch.guardian_stop_time is None


def test_a_slot_is_used_again_as_late_as_possible_and_is_then_empty(start, claim, monkeypatch):
    monkeypatch.setattr(GuardianMemory, 'MAX_ROBOTS', 5)
    process = start()
    first, kept = (process.add(*ROBOT, claim) for _ in range(2))
    first.latch.trip(1.0)
    begin_heartbeat([first])
    complete([first.leave])
    numbers = []
    for _ in range(GuardianMemory.MAX_ROBOTS - 2):
        following = process.add(*ROBOT, claim)
        numbers.append(following.number)
        complete([following.leave])
    assert numbers == [3, 4, 5]
    last = process.add(*ROBOT, claim)
    assert last.number == first.number
    assert not last.latch.is_set
    assert last._slot.thread == 0
    assert kept.number == 2


def test_a_run_that_begins_while_the_run_before_is_reported_as_stopped_is_guarded(
        start, claim, seen, monkeypatch):
    """Its first heartbeat came before the report of another thread, and tells nothing then."""
    process = start()
    guardian = process.add(*ROBOT, claim)
    begin_heartbeat([guardian])
    guardian.check()
    send = process.send

    def send_late(sender, message):
        if message is GuardianMessage.STOPPED:
            monkeypatch.setattr(process, 'send', send)
            guardian.check()
            guardian.check()
        send(sender, message)

    guardian.report_stopping()
    monkeypatch.setattr(process, 'send', send_late)
    guardian.report_stopped()
    guardian.check()
    assert wait_until(lambda: seen() == ['1b', '1r', '1b', '1s', '1b'])


def test_a_guardian_may_send_a_complete_stop_before_it_leaves(start, claim):
    """To a robot that keeps a velocity for long that takes longer than to end a process."""
    process = start("""
import os, sys, time
os.read(int(sys.argv[1]), 2)
time.sleep(1.2)
print('left 1', flush=True)
time.sleep(5.0)
""")
    slow, other = process.add('/cmd_vel', 1.0, *ROBOT[2:], claim), process.add(*ROBOT, claim)
    complete([slow.leave])
    assert slow.has_left.is_set()
    assert not process.has_ended
    assert other.shared_memory is not None


def test_a_guardian_that_does_not_leave_a_robot_is_killed(start, claim):
    """Its publisher must be gone before the robot is released; it guards no other robot either."""
    process = start('import time; time.sleep(60)')
    first, second = (process.add(*ROBOT, claim) for _ in range(2))
    begin_heartbeat([second])
    complete([first.leave])
    wait_until(lambda: process.has_ended)
    with pytest.raises(RunFaultError, match='the guardian is gone'):
        second.check()


def test_a_guardian_that_is_frozen_ends_the_drives_of_all_its_robots(start, claim):
    """It checks no heartbeats; the clock that counts here is that of the thread's heartbeats."""
    process = start()
    guardians = [process.add(*ROBOT, claim) for _ in range(2)]
    begin_heartbeat(guardians)
    now = boottime()
    for check in range(1, 2 * math.ceil(GUARDIAN_TIMEOUT / CHECK_PERIOD)):
        if check * CHECK_PERIOD <= GUARDIAN_TIMEOUT:
            for guardian in guardians:
                guardian.check()
        guardians[0]._heartbeat.write(now + check * CHECK_PERIOD)
    for guardian in guardians:
        with pytest.raises(RunFaultError, match='the guardian has not answered for 0.5 s'):
            guardian.check()


def test_each_thread_has_a_heartbeat_in_each_guardian_process_that_no_other_robot_follows(
        start, claim, monkeypatch):
    """The robots of two ROS contexts may be driven by one thread, and then by others."""
    monkeypatch.setattr(GuardianMemory, 'MAX_THREADS', 4)
    first, second = start(), start()
    one, two, three = (first.add(*ROBOT, claim) for _ in range(3))
    other = second.add(*ROBOT, claim)

    def newest(guardian):
        return guardian._process.memory.heartbeat(guardian._slot.thread)

    begin_heartbeat([three])
    kept, begun = three._slot.thread, newest(three)
    for _ in range(GuardianMemory.MAX_THREADS):
        beat = begin_heartbeat([one, two, other])
        before = boottime()
        assert newest(one) < before
        beat()
        assert before <= newest(one) == newest(two) == newest(other)
        begin_heartbeat([two])
        assert len({guardian._slot.thread for guardian in (one, two, three)}) == 3
        last = newest(two)
        beat()
        assert newest(one) == newest(other) > newest(two) == last
    assert (three._slot.thread, newest(three)) == (kept, begun)
