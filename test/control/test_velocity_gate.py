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
"""The velocity gate: what it sends, and what it refuses."""

import contextlib
import re
import signal
import threading

from fake_time import FakePublisher, FakeTime
from kachaka_simple_control.control.events import VelocityKind, VelocitySent
from kachaka_simple_control.control.guardian_memory import Latch, SharedFlag
from kachaka_simple_control.control.velocity_gate import VelocityGate
from kachaka_simple_control.errors import HELD_UP_ADVICE, MotionRefusedError, RunFaultError
from kachaka_simple_control.motion.calibration import Calibration
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.process import signals
import pytest

FORWARD = Velocity(0.1, 0.0)


@pytest.fixture
def time():
    """Return a clock that only the test advances."""
    return FakeTime()


@pytest.fixture
def wire(time):
    """Return a publisher that records."""
    return FakePublisher(time)


@pytest.fixture
def latch():
    """Return a latch that is not set."""
    return Latch()


@pytest.fixture
def gate(time, wire, latch):
    """Return a gate that is not open yet."""
    return VelocityGate(wire.transmit, Limits(0.3, 1.57), latch, None, time.clock, time.clock)


def test_before_the_gate_is_open_not_even_a_zero_is_sent(gate, wire):
    """A zero switches a Kachaka's manual control on, and drives it off its dock."""
    assert not gate.send_zero(after=None)
    with pytest.raises(MotionRefusedError, match='the robot cannot be driven: it is'):
        gate.begin(0.2)
    assert wire.sent == []


def test_after_the_gate_is_closed_nothing_is_sent(gate, wire):
    gate.open()
    run = gate.begin(0.2)
    gate.close()
    assert not gate.send_zero(after=run)
    with pytest.raises(MotionRefusedError, match='the robot cannot be driven: it is'):
        gate.send(run, FORWARD)
    gate.open()
    with pytest.raises(MotionRefusedError, match='the robot cannot be driven: it is'):
        gate.begin(0.2)
    assert wire.sent == []


def test_what_is_sent_follows_by_the_calibration(time, wire, latch):
    calibration = Calibration(0.95, 0.9, 0.97, 1.05, 0.035)
    gate = VelocityGate(wire.transmit, Limits(0.3, 1.57), latch, None, time.clock, time.clock,
                        command=calibration.command)
    logged = []
    gate.publish = lambda event: logged.append(event.velocity)
    gate.open()
    run = gate.begin(0.2)
    velocities = [Velocity(0.19, 0.0), Velocity(-0.18, -0.5), Velocity(0.0, 0.97), ZERO]
    for velocity in velocities:
        gate.send(run, velocity)
    gate.send_zero(after=run)
    sent = [velocity for _, velocity in wire.sent]
    assert sent == logged == [*map(calibration.command, velocities), ZERO]
    assert sent[0] == Velocity(0.2, pytest.approx(-0.035 * 0.19 / 1.05))
    # Within the limits before it was corrected, and beyond them after that.
    with pytest.raises(RunFaultError, match='not sent: linear_x is 0.31'):
        gate.send(gate.begin(0.2), Velocity(0.295, 0.0))


@pytest.mark.parametrize('velocity', [
    Velocity(0.31, 0.0), Velocity(0.0, -1.6), Velocity(float('nan'), 0.0),
    Velocity(0.0, float('inf'))])
def test_a_velocity_beyond_the_limits_is_never_sent(gate, wire, velocity):
    gate.open()
    with pytest.raises(RunFaultError, match='not sent: .* outside the robot'):
        gate.send(gate.begin(0.2), velocity)
    assert wire.sent == []


def test_after_the_latch_is_set_only_zeros_are_sent(gate, wire, latch):
    gate.open()
    run = gate.begin(0.2)
    latch.trip()
    with pytest.raises(MotionRefusedError, match='stopped permanently'):
        gate.send(run, FORWARD)
    with pytest.raises(MotionRefusedError, match='stopped permanently'):
        gate.begin(0.2)
    assert gate.send_zero(after=run)
    assert [v for _, v in wire.sent] == [ZERO]


def test_a_cancelled_run_gets_the_reason_and_sends_no_more(gate, wire):
    gate.open()
    run = gate.begin(0.2)
    gate.send(run, FORWARD)
    gate.cancel(RunFaultError('because'))
    with pytest.raises(RunFaultError, match='because'):
        gate.send(run, FORWARD)
    with pytest.raises(RunFaultError, match='because'):
        gate.check(run)
    assert len(wire.sent) == 1


def test_only_the_newest_run_sends(gate, wire):
    gate.open()
    old = gate.begin(0.2)
    new = gate.begin(0.2)
    with pytest.raises(MotionRefusedError, match='another one has begun'):
        gate.send(old, FORWARD)
    assert not gate.send_zero(after=old)
    gate.send(new, FORWARD)
    assert [v for _, v in wire.sent] == [FORWARD]


def test_the_gap_is_checked_directly_before_publishing(gate, time, wire):
    gate.open()
    run = gate.begin(0.2)
    gate.send(run, FORWARD)
    time.now += 0.2001
    with pytest.raises(RunFaultError, match='200 ms'):
        gate.send(run, FORWARD)
    assert len(wire.sent) == 1


def test_a_suspended_machine_is_a_gap_although_the_steady_clock_stopped(wire, latch):
    steady, awake = FakeTime(), FakeTime()
    gate = VelocityGate(wire.transmit, Limits(0.3, 1.57), latch, None, steady.clock, awake.clock)
    gate.open()
    run = gate.begin(0.2)
    gate.send(run, FORWARD)
    awake.now += 3600.0
    with pytest.raises(RunFaultError, match=(
            'nothing was sent for 3600000 ms, more than the 200 ms allowed: the program was held '
            f'up, {re.escape(HELD_UP_ADVICE)}')):
        gate.send(run, FORWARD)
    assert len(wire.sent) == 1


def test_each_sent_velocity_is_reported_with_its_time(gate, time):
    published = []
    gate.publish = published.append
    gate.open()
    gate.send_zero(None, VelocityKind.PRIME)
    run = gate.begin(0.2)
    gate.send(run, FORWARD, VelocityKind.CORRECTION, 0.5, 0.25, 2)
    gate.send_zero(after=run)
    assert published == [
        VelocitySent(time.now, ZERO, VelocityKind.PRIME),
        VelocitySent(time.now, FORWARD, VelocityKind.CORRECTION, 0.5, 0.25, 2),
        VelocitySent(time.now, ZERO, VelocityKind.STOP)]


def test_no_motion_follows_the_first_zero_of_a_stop_in_another_thread():
    """Two threads, one stopping the other, many times: order on the wire is what counts."""
    for _ in range(200):
        sent = []
        gate = VelocityGate(sent.append, Limits(0.3, 1.57), Latch())
        gate.open()
        run = gate.begin(10.0)
        begun = threading.Event()

        def drive(gate=gate, run=run, begun=begun):
            with contextlib.suppress(MotionRefusedError):
                while True:
                    gate.send(run, FORWARD)
                    begun.set()

        thread = threading.Thread(target=drive)
        thread.start()
        begun.wait()
        gate.cancel(MotionRefusedError('enough'))
        gate.send_zero(after=run)
        thread.join()
        assert sent[-1] == ZERO


def test_the_flag_is_set_while_dds_publishes():
    flag, seen = SharedFlag(), []
    gate = VelocityGate(lambda _: seen.append(flag.is_set), Limits(0.3, 1.57), Latch(), flag)
    gate.open()
    gate.send(gate.begin(0.2), FORWARD)
    assert seen == [True]
    assert not flag.is_set


def test_the_flag_is_set_during_a_dds_query_and_cleared_if_it_fails(gate):
    flag, seen = SharedFlag(), []
    gate = VelocityGate(lambda _: None, Limits(0.3, 1.57), Latch(), flag)
    gate.open()

    def ask():
        seen.append(flag.is_set)
        raise RunFaultError('the robot left')

    with pytest.raises(RunFaultError, match='the robot left'):
        gate.wait_for_dds(ask)
    assert seen == [True]
    assert not flag.is_set


@pytest.mark.parametrize('waits, ends', [([0.3], False), ([0.1] * 4, False), ([0.8], True),
                                         ([0.3] * 3, True)])
def test_time_of_dds_queries_is_no_gap_within_a_bound(gate, time, wire, waits, ends):
    """The bound is for all queries between two messages together."""
    gate.open()
    run = gate.begin(0.12)
    gate.send(run, FORWARD)
    for wait in waits:
        gate.wait_for_dds(lambda wait=wait: time.sleep(wait))
    if ends:
        with pytest.raises(RunFaultError, match='nothing was sent for .* more than the 620 ms'):
            gate.send(run, FORWARD)
    else:
        gate.send(run, FORWARD)
    assert len(wire.sent) == 1 + (not ends)


def test_a_wait_for_dds_does_not_extend_the_gap_after_the_next_message(gate, time):
    gate.open()
    run = gate.begin(0.12)
    gate.send(run, FORWARD)
    gate.wait_for_dds(lambda: time.sleep(0.3))
    gate.send(run, FORWARD)
    time.sleep(0.2)
    with pytest.raises(RunFaultError, match='more than the 120 ms'):
        gate.send(run, FORWARD)


def test_time_that_publishing_takes_is_no_gap(time):
    """A participant joined, and publishing took a third of a second."""
    def transmit(_):
        time.now += 0.33

    gate = VelocityGate(
        transmit, Limits(0.3, 1.57), Latch(), None, time.clock, time.clock)
    gate.open()
    run = gate.begin(0.2)
    gate.send(run, FORWARD)
    gate.send(run, FORWARD)


def test_a_run_that_was_cancelled_before_it_began_never_begins(gate, wire):
    """It may wait for its robot: a stop ends it all the same."""
    run = gate.prepare()
    gate.cancel(MotionRefusedError('enough'))
    gate.open()
    with pytest.raises(MotionRefusedError, match='enough'):
        gate.begin(0.2, run)
    assert wire.sent == []


def test_a_run_that_waits_does_not_end_the_zeros_of_the_one_before(gate, wire):
    """Its whole stop goes on until the next run really begins."""
    gate.open()
    first = gate.begin(0.2)
    second = gate.prepare()
    assert gate.send_zero(after=first)
    gate.begin(0.2, second)
    assert not gate.send_zero(after=first)
    assert len(wire.sent) == 1


def test_a_program_that_was_stopped_while_a_message_was_sent_is_told_at_once(latch):
    """Not with its next message: the guardian has set the latch while this one was frozen."""
    gate = VelocityGate(lambda _: latch.trip(), Limits(0.3, 1.57), latch)
    gate.open()
    run = gate.begin(0.2)
    with pytest.raises(MotionRefusedError, match='stopped permanently'):
        gate.send(run, FORWARD)


def test_ctrl_c_while_a_velocity_leaves_loses_no_event(gate, wire, monkeypatch):
    """As Python's handler runs in the main thread, between the message and its event."""
    monkeypatch.setattr(signals.signal_dispatcher, '_previous', {
        signal.SIGINT: signal.default_int_handler})
    monkeypatch.setattr(signals.signal_dispatcher, '_first', None)
    monkeypatch.setattr(signals.signal_dispatcher, 'signum', None)
    logged = []
    gate.publish = lambda event: logged.append(event.velocity)
    gate.open()
    run = gate.begin(0.2)
    transmit = wire.transmit

    def interrupted(velocity):
        transmit(velocity)
        signals.signal_dispatcher._handle(signal.SIGINT, None)

    monkeypatch.setattr(gate, '_transmit', interrupted)
    with pytest.raises(KeyboardInterrupt):
        gate.send(run, FORWARD)
    monkeypatch.setattr(signals.signal_dispatcher, '_first', None)
    with pytest.raises(KeyboardInterrupt):
        gate.send_zero(after=run)
    assert logged == [FORWARD, ZERO]
    assert not gate._lock.locked()


def test_a_stop_of_the_guardian_is_logged_before_the_zeros_after_it(time, gate, latch):
    logged = []
    gate.publish = lambda event: logged.append((event.time, event.velocity, event.kind))
    gate.open()
    run = gate.begin(1.0)
    time.now = 5.0
    gate.send(run, FORWARD)
    latch.trip(5.1)
    time.now = 7.0
    with pytest.raises(MotionRefusedError):
        gate.send(run, FORWARD)
    gate.send_zero(after=run)
    gate.send_zero(after=run)
    assert logged == [
        (5.0, FORWARD, VelocityKind.PLAN), (5.1, ZERO, VelocityKind.GUARDIAN),
        (7.0, ZERO, VelocityKind.STOP), (7.0, ZERO, VelocityKind.STOP)]
