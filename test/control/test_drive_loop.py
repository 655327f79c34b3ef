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
"""One thread drives one robot or many; a stop, and a port that blocks, hold up nobody."""

from __future__ import annotations

from collections import defaultdict
import contextlib
import itertools
import math
import os
import tempfile
import threading
import time
from types import SimpleNamespace

from fake_time import FakeTime
from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.control.drive_loop import DriveLoop, Sleeper
from kachaka_simple_control.control.events import MotionStarted, VelocityKind, VelocitySent
from kachaka_simple_control.control.guardian_memory import GuardianMemory, Latch
from kachaka_simple_control.control.hand_source import HandSource
from kachaka_simple_control.control.robot_drive import RobotDrive
from kachaka_simple_control.control.speed_factor import SpeedFactor
from kachaka_simple_control.control.tick_scheduler import TickScheduler
from kachaka_simple_control.control.timing import CHECK_PERIOD, HEARTBEAT_TIMEOUT, PUBLISH_TIMEOUT
from kachaka_simple_control.control.velocity_gate import PortTime, VelocityGate
from kachaka_simple_control.control.watchdog import GuardianMessage, silent_robots, Watchdog
from kachaka_simple_control.errors import ControlError, MotionRefusedError, RunFaultError
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Motion, Move
import pytest

LIMITS = Limits(0.3, 1.57)
FORWARD = Velocity(0.1, 0.0)
SECOND = plan(Motion('second', (Move(0.1, 0.0, 1.0),)), LIMITS, 10.0)


class QuietMonitor:
    """A run monitor that finds no fault."""

    speed_factor, watch = 1.0, None

    def correct(self, tick, now):
        """Return what was planned."""
        return tick.velocity

    def on_sent(self, now, rest, plan_time):
        """Do nothing."""

    def check(self, now):
        """Find nothing."""


class Fleet:
    """Robots whose ports record, on one loop."""

    def __init__(
            self, count, clock=time.monotonic, sleep=None, command_timeout=0.6,
            beat=lambda: None):
        """Make the robots."""
        self.clock = clock
        self.loop = DriveLoop(clock, sleep, beat)
        self.sent = defaultdict(list)
        self.drives = []
        port_time = PortTime()
        for number in range(count):
            gate = VelocityGate(
                lambda velocity, number=number: self.transmit(number, velocity), LIMITS, Latch(),
                None, clock, clock)
            gate.port_time = port_time
            gate.open()
            drive = RobotDrive(gate, QuietMonitor(), SpeedFactor(), command_timeout)
            gate.wake = lambda drive=drive: self.loop.wake(drive)
            self.drives.append(drive)

    def transmit(self, number, velocity):
        """Record a velocity."""
        self.sent[number].append((self.clock(), velocity))

    def begin(self, t0, planned=SECOND):
        """Begin a run of each robot."""
        for drive in self.drives:
            drive.begin(TickScheduler(planned), t0, planned.period)


@given(st.integers(1, 12))
def test_all_robots_are_driven_at_the_same_deadlines(count):
    fake = FakeTime()
    fleet = Fleet(count, fake.clock, fake.sleep)
    fleet.begin(fake.now)
    start = fake.now
    fleet.loop.run(fleet.drives)
    for number in range(count):
        assert [at - start for at, _ in fleet.sent[number]] == pytest.approx(
            [0.1 * tick for tick in range(11)])
        assert [velocity for _, velocity in fleet.sent[number]] == [FORWARD] * 10 + [ZERO]


def test_what_one_port_takes_is_no_gap_of_another_robot():
    """With 50 robots of which one blocks for 0.3 s nobody faults."""
    fake = FakeTime()
    fleet = Fleet(50, fake.clock, fake.sleep)
    transmit = fleet.transmit

    def blocking(number, velocity):
        transmit(number, velocity)
        if number == 7 and len(fleet.sent[7]) == 4:
            fake.now += 0.3

    fleet.transmit = blocking
    fleet.begin(fake.now)
    fleet.loop.run(fleet.drives)
    assert {sent[-1][1] for sent in fleet.sent.values()} == {ZERO}


def test_a_robot_that_faults_ends_alone():
    fake, failures = FakeTime(), []
    fleet = Fleet(3, fake.clock, fake.sleep)
    fleet.drives[1].monitor.check = lambda now: (_ for _ in ()).throw(RunFaultError('lost')) if (
        len(fleet.sent[1]) == 4) else None
    fleet.begin(fake.now)
    fleet.loop.run(fleet.drives, lambda drive, error: failures.append((drive, str(error))))
    assert failures == [(fleet.drives[1], 'lost')]
    assert [len(fleet.sent[number]) for number in range(3)] == [11, 5, 11]
    assert fleet.sent[1][-1][1] == ZERO


@pytest.mark.parametrize('count', [1, 5])
@pytest.mark.parametrize('error', [RunFaultError('lost'), KeyboardInterrupt(), OSError('odd')])
def test_whatever_ends_the_loop_each_robot_has_a_zero_at_once(error, count):
    fake = FakeTime()
    fleet = Fleet(count, fake.clock, fake.sleep)

    def fail(now):
        if len(fleet.sent[count // 2]) == 4:
            raise error

    fleet.drives[count // 2].monitor.check = fail
    fleet.begin(fake.now)
    with pytest.raises(type(error)):
        fleet.loop.run(fleet.drives)
    assert [fleet.sent[number][-1] for number in range(count)] == [(fake.now, ZERO)] * count
    for drive in fleet.drives:
        with pytest.raises((RunFaultError, MotionRefusedError)):
            drive.step(fake.now)


def test_a_port_that_fails_keeps_no_zero_from_the_others():
    """And the loop raises what has ended it."""
    fake = FakeTime()
    fleet = Fleet(3, fake.clock, fake.sleep)
    transmit = fleet.transmit

    def fail(number, velocity):
        if number == 1 and len(fleet.sent[0]) >= 4:
            raise OSError('gone' if velocity == ZERO else 'lost')
        transmit(number, velocity)

    fleet.transmit = fail
    fleet.begin(fake.now)
    with pytest.raises(OSError, match='lost'):
        fleet.loop.run(fleet.drives)
    assert [fleet.sent[number][-1] for number in (0, 2)] == [(fake.now, ZERO)] * 2


def test_a_change_of_the_source_while_it_is_asked_is_not_lost():
    """As when somebody lets go of a key just then."""
    fake = FakeTime()
    fleet = Fleet(1, fake.clock, fake.sleep)
    (drive,) = fleet.drives
    source = HandSource(LIMITS, drive.on_source_changed, fake.clock)
    source.command(ZERO, 1, source.stamp())
    source.command(FORWARD, 2, source.stamp())
    due = source.due

    def changed_meanwhile(elapsed, factor=1.0):
        tick = due(elapsed, factor)
        if not fleet.sent[0]:
            source.command(ZERO, 3, source.stamp())
        return tick

    source.due = changed_meanwhile
    drive.begin(source, fake.now)
    drive.step(fake.now)
    drive.step(fake.now)
    assert [velocity for _, velocity in fleet.sent[0]] == [FORWARD, ZERO]


def test_a_wake_up_that_fails_keeps_no_stop_back():
    """As in a program that has closed all its files."""
    fleet = Fleet(1)
    (drive,) = fleet.drives
    fleet.begin(time.monotonic())
    drive.step(time.monotonic())
    closed, writer = fleet.loop._sleeper._writer, os.dup(fleet.loop._sleeper._writer)
    os.close(closed)
    try:
        assert drive.end(RunFaultError('enough'))
    finally:
        os.dup2(writer, closed)
        os.close(writer)
    assert fleet.sent[0][-1][1] == ZERO


@pytest.mark.real_time
def test_a_stop_wakes_the_loop_and_does_not_wait_for_it():
    """Its zero leaves in the asking thread; the loop raises within its sleep."""
    latencies, ends = [], []
    for _ in range(20):
        fleet, ended = Fleet(1), []

        def drive(fleet=fleet, ended=ended):
            try:
                fleet.loop.run(fleet.drives)
            except MotionRefusedError:
                ended.append(time.monotonic())

        fleet.begin(time.monotonic())
        thread = threading.Thread(target=drive)
        thread.start()
        time.sleep(0.015)
        asked = time.monotonic()
        fleet.drives[0].end(MotionRefusedError('enough'))
        thread.join()
        at, velocity = fleet.sent[0][-1]
        assert velocity == ZERO
        latencies.append(at - asked)
        ends.append(ended[0] - asked)
    # A machine with other work may hold up one of them.
    assert sorted(latencies)[-2] < 0.005
    assert sorted(ends)[len(ends) // 2] < 0.005


@pytest.mark.real_time
def test_a_stop_does_not_wait_for_a_port_that_blocks_another_robot():
    fleet, blocked, release = Fleet(50), threading.Event(), threading.Event()
    transmit = fleet.transmit

    def blocking(number, velocity):
        transmit(number, velocity)
        if number == 0 and len(fleet.sent[0]) == 2:
            blocked.set()
            release.wait(5.0)

    fleet.transmit = blocking
    fleet.begin(time.monotonic())
    errors = []
    thread = threading.Thread(
        target=fleet.loop.run, args=(fleet.drives, lambda drive, error: errors.append(error)))
    thread.start()
    assert blocked.wait(5.0)
    asked = time.monotonic()
    for drive in fleet.drives[1:]:
        drive.end(MotionRefusedError('enough'))
    latest = max(fleet.sent[number][-1][0] for number in range(1, 50)) - asked
    assert all(fleet.sent[number][-1][1] == ZERO for number in range(1, 50))
    release.set()
    thread.join()
    # The port still blocked when all 49 zeros were sent, which is slow beside busy processes.
    assert latest < 2.5
    assert [str(error) for error in errors] == ['enough'] * 49


def test_a_wanted_velocity_ends_with_its_lease():
    """No plan, no end, no period; and whoever wants it may be gone."""
    fake, events = FakeTime(), []
    fleet = Fleet(1, fake.clock, fake.sleep)
    (drive,) = fleet.drives
    drive.gate.publish = events.append
    start, source = fake.now, HandSource(LIMITS, drive.on_source_changed, fake.clock)
    wishes = [(0.1, FORWARD), (0.15, Velocity(0.2, 0.5)), (0.9, ZERO), (1.0, FORWARD)]

    def want(velocity):
        source.command(velocity, next(numbers), source.stamp())

    def on_sleep():
        while wishes and fake.now >= start + wishes[0][0] - 1e-9:
            want(wishes.pop(0)[1])
        if fake.now > start + 2.0:
            source.end()

    numbers = itertools.count()
    want(ZERO)
    want(FORWARD)
    fake.on_sleep = on_sleep
    drive.request(0.0, 'by hand')
    drive.begin(source, start)
    fleet.loop.run(fleet.drives)
    at = [(round(when - start, 2), velocity) for when, velocity in fleet.sent[0]]
    moving = [when for when, velocity in at if not velocity.is_zero]
    assert moving[0] == 0.0
    # Fake time wakes no sleep: a change is seen at the next check.
    assert any(velocity == Velocity(0.2, 0.5) and 0.15 <= when < 0.23 for when, velocity in at)
    first_rest = next(when for when, velocity in at if velocity.is_zero)
    assert first_rest == pytest.approx(0.43, abs=0.031)
    assert at[-1][1] == ZERO
    assert [event.has_plan for event in events if isinstance(event, MotionStarted)] == [False]
    sent = [event for event in events if isinstance(event, VelocitySent)]
    assert {event.kind for event in sent} == {VelocityKind.HAND}
    assert {event.plan_time for event in sent} == {None}
    assert drive.progress.step == (0, 0)


class HoldUp:
    """What holds a thread up at some time: a check, a call to DDS, or no processor."""

    def __init__(self, how='', at=math.inf, duration=0.0):
        """Plan it [s]."""
        self.how, self.at, self.left = how, at, duration

    def __call__(self, how, fake):
        """Let time pass, if it is time for it."""
        if how == self.how and fake.now >= self.at:
            fake.now, self.left = fake.now + self.left, 0.0


class Guarded:
    """Robots that threads drive, and their guardian, which sees what the threads have written."""

    def __init__(self, file):
        """Share memory."""
        self.memory, self.robots = GuardianMemory(file.fileno()), {}
        #: when something happens [s], whether it wakes the guardian, and what happens
        self.events = []

    def drive(self, thread, count, start, hold_up):
        """Drive robots in a thread; return their numbers."""
        fake, begun = FakeTime(start), set()
        numbers = range(len(self.robots) + 1, len(self.robots) + 1 + count)
        for number in numbers:
            self.robots[number] = SimpleNamespace(
                slot=self.memory.slot(number), watchdog=Watchdog())
            self.robots[number].slot.thread = thread
        sending = self.robots[numbers[-1]].slot.sending

        def happens(what, *arguments, is_message=False):
            self.events.append((fake.now, is_message, lambda: what(*arguments)))

        def tell(number, message):
            happens(self.robots[number].watchdog.on_message, message, fake.now, is_message=True)

        def check(number):
            if number not in begun:
                begun.add(number)
                tell(number, GuardianMessage.HEARTBEAT)
            hold_up('checking', fake)

        def publish(index, velocity):
            happens(sending.set)
            hold_up('in DDS', fake)
            happens(sending.clear)
            transmit(index, velocity)

        fleet = Fleet(count, fake.clock, fake.sleep, beat=lambda: happens(
            self.memory.write_heartbeat, thread, fake.now))
        transmit, fleet.transmit = fleet.transmit, publish
        fake.on_sleep = lambda: hold_up('asleep', fake)
        for number, drive in zip(numbers, fleet.drives):
            drive.monitor.check = lambda _, number=number: check(number)
        fleet.begin(fake.now)
        # If it was held up for too long, the gate says so as well.
        with contextlib.suppress(ControlError):
            fleet.loop.run(fleet.drives)
        for number in numbers:
            tell(number, GuardianMessage.STOPPED)
        return numbers

    def guard(self):
        """Guard; return when each robot is stopped, by its number."""
        self.events.sort(key=lambda event: event[0])
        stopped, now = {}, 0.0
        while self.events:
            timeouts = [robot.watchdog.timeout() for robot in self.robots.values()]
            now = min(
                [now + timeout for timeout in timeouts if timeout is not None]
                + [time for time, is_message, _ in self.events if is_message][:1])
            while self.events and self.events[0][0] <= now:
                self.events.pop(0)[2]()
            silent = silent_robots(self.robots, self.memory, now, lambda: False)
            assert not stopped.keys() & silent
            stopped.update(dict.fromkeys(silent, now))
        return stopped


@given(
    st.lists(st.tuples(st.integers(1, 6), st.floats(0.0, 0.2)), min_size=1, max_size=4),
    st.floats(0.001, 0.9), st.sampled_from([
        ('asleep', 0.0, 0.07, False), ('asleep', 0.13, 3.0, True),
        ('checking', 0.0, 0.07, False), ('checking', 0.13, 3.0, True),
        ('in DDS', 0.0, 0.4, False), ('in DDS', 0.65, 3.0, True)]), st.floats(0.0, 1.0))
def test_a_thread_that_is_held_up_stops_exactly_its_robots(threads, moment, hold_up, share):
    """A wait in a DDS call for one robot gives all robots of the thread the longer timeout."""
    how, least, longest, is_stopped = hold_up
    with tempfile.TemporaryFile() as file:
        file.truncate(GuardianMemory.SIZE)
        guarded = Guarded(file)
        for thread, (count, phase) in enumerate(threads[1:], 2):
            guarded.drive(thread, count, 1000.0 + phase, HoldUp())
        count, phase = threads[0]
        at = 1000.0 + phase + moment
        numbers = guarded.drive(1, count, 1000.0 + phase, HoldUp(
            how, at, least + share * (longest - least)))
        stopped = guarded.guard()
    assert set(stopped) == (set(numbers) if is_stopped else set())
    allowed = PUBLISH_TIMEOUT if how == 'in DDS' else HEARTBEAT_TIMEOUT
    # The next velocity, or the next sleep, comes up to a period after the moment.
    assert all(time - at <= 0.1 + allowed + CHECK_PERIOD for time in stopped.values())


def test_what_is_due_together_is_sent_before_any_check():
    """Otherwise the checks of the first robots would delay the velocities of the last."""
    fake = FakeTime()
    fleet, happened = Fleet(3, fake.clock, fake.sleep), []
    fleet.transmit = lambda number, _: happened.append('sent')
    for drive in fleet.drives:
        drive.monitor.check = lambda _: happened.append('checked')
    # At 15 Hz no check is due at the moment of a velocity, and one is nearly due.
    fleet.begin(fake.now + 0.01, plan(Motion('second', (Move(0.1, 0.0, 1.0),)), LIMITS, 15.0))
    fleet.loop.run(fleet.drives)
    turns = [(what, len([*group])) for what, group in itertools.groupby(happened)]
    assert turns[0] == ('checked', 3), 'before the first velocity'
    assert {count for what, count in turns if what == 'sent'} == {3}
    assert all(count % 3 == 0 for _, count in turns)


def test_robots_that_are_driven_together_are_checked_in_one_wake_up():
    """Each velocity takes some time, in which the next checks must not drift apart."""
    fake, sleeps = FakeTime(), []
    fleet = Fleet(50, fake.clock, lambda left: (sleeps.append(left), fake.sleep(left)))
    transmit = fleet.transmit

    def publish(number, velocity):
        transmit(number, velocity)
        fake.now += 0.0001

    fleet.transmit = publish
    fleet.begin(fake.now)
    fleet.loop.run(fleet.drives)
    # A check that is due with a velocity may be a rounding error earlier.
    assert len([left for left in sleeps if left > 1e-6]) <= 1.0 / CHECK_PERIOD


@pytest.mark.real_time
def test_a_sleep_ends_early_when_it_is_woken():
    sleeper = Sleeper()
    threading.Timer(0.05, sleeper.wake).start()
    began = time.monotonic()
    sleeper.sleep(5.0)
    assert 0.04 < time.monotonic() - began < 1.0
    sleeper.wake()
    sleeper.wake()
    began = time.monotonic()
    sleeper.sleep(5.0)
    assert time.monotonic() - began < 1.0
    # A later sleep takes its whole time again.
    began = time.monotonic()
    sleeper.sleep(0.05)
    assert time.monotonic() - began > 0.04
