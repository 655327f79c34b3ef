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
"""The stop: a burst of zeros, long enough, sent once, and ended by a new run."""

from itertools import pairwise

from fake_time import FakePublisher, FakeTime
from kachaka_simple_control.control.guardian_memory import Latch
from kachaka_simple_control.control.stop import LateStops, StopController
from kachaka_simple_control.control.timing import STOP_CONFIRM_TIMEOUT
from kachaka_simple_control.control.velocity_gate import VelocityGate
from kachaka_simple_control.errors import MotionRefusedError
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
import pytest
from waiting import wait_until

COMMAND_TIMEOUT = 0.3
REASON = MotionRefusedError('test')


class FakeGuardian:
    """Records what is reported to the guardian."""

    def __init__(self):
        """Begin without reports."""
        self.received = []

    def report_stopping(self):
        """Record it."""
        self.received.append('rest')

    def report_stopped(self):
        """Record it."""
        self.received.append('stopped')


class Bench:
    """A stop controller, and a run that has sent a velocity."""

    def __init__(self):
        """Send one velocity."""
        self.time = FakeTime()
        self.wire = FakePublisher(self.time)
        self.gate = VelocityGate(
            self.wire.transmit, Limits(0.3, 1.57), Latch(), None,
            self.time.clock, self.time.clock)
        self.guardian = FakeGuardian()
        self.moves = lambda: False
        self.controller = StopController(
            self.gate, COMMAND_TIMEOUT, self.guardian, self.more_time, self.time.clock,
            self.time.sleep)
        self.gate.open()
        self.run = self.gate.begin(0.2)
        self.gate.send(self.run, Velocity(0.1, 0.0))

    def more_time(self):
        """Return how much longer the stop must go on [s]."""
        return STOP_CONFIRM_TIMEOUT if self.moves() else 0.0

    @property
    def zeros(self):
        """When zeros were sent [s]."""
        return [at for at, velocity in self.wire.sent if velocity == ZERO]


def test_ten_zeros_are_sent_back_to_back():
    """A subscriber that was suspended executes its queue: ten zeros displace ten velocities."""
    bench = Bench()
    begun = bench.time.now
    bench.controller.stop(REASON)
    assert sum(at == begun for at in bench.zeros) >= 10


def test_zeros_are_sent_beyond_the_command_timeout_at_20_hz_or_faster():
    bench = Bench()
    bench.controller.stop(REASON)
    zeros = bench.zeros
    assert zeros[-1] - zeros[0] >= COMMAND_TIMEOUT + 0.1
    assert max(two - one for one, two in pairwise(zeros)) <= 0.05


def test_a_stop_is_sent_once_for_a_run_however_often_it_is_asked_for():
    bench = Bench()
    bench.controller.stop(REASON)
    count = len(bench.zeros)
    bench.controller.stop(REASON)
    assert len(bench.zeros) == count


def test_an_interrupted_stop_is_sent_whole_by_the_next():
    """Ctrl+C in the middle of a stop raises there; the next call begins again."""
    bench = Bench()

    def interrupt():
        bench.time.on_sleep = lambda: None
        raise KeyboardInterrupt

    bench.time.on_sleep = interrupt
    with pytest.raises(KeyboardInterrupt):
        bench.controller.stop(REASON)
    begun = bench.time.now
    bench.controller.stop(REASON)
    assert bench.zeros[-1] - begun >= COMMAND_TIMEOUT + 0.1


def test_nothing_is_sent_if_the_robot_was_never_moved():
    time = FakeTime()
    wire = FakePublisher(time)
    gate = VelocityGate(wire.transmit, Limits(0.3, 1.57), Latch(), None, time.clock, time.clock)
    controller = StopController(
        gate, COMMAND_TIMEOUT, FakeGuardian(), clock=time.clock, sleep=time.sleep)
    controller.stop(REASON)
    gate.open()
    controller.stop(REASON)
    assert wire.sent == []


def test_the_stopped_run_gets_the_reason():
    bench = Bench()
    bench.controller.stop(REASON)
    with pytest.raises(MotionRefusedError, match='test'):
        bench.gate.check(bench.run)


def test_a_new_run_ends_the_stop_of_the_one_before():
    """No zero of an old stop may fall into a new motion."""
    bench = Bench()

    def begin():
        bench.time.on_sleep = lambda: None
        bench.gate.send(bench.gate.begin(0.2), Velocity(0.2, 0.0))

    bench.time.on_sleep = begin
    bench.controller.stop(REASON)
    assert bench.wire.sent[-1][1] == Velocity(0.2, 0.0)


def test_late_stops_are_sent_together_unless_another_run_follows():
    late, benches = LateStops(), [Bench() for _ in range(4)]
    for number, bench in enumerate(benches):
        late.schedule(bench.controller, bench.run, within=0.1 if number else 0.0)
    late.cancel(benches[1].controller)
    benches[2].gate.begin(0.2)
    assert wait_until(lambda: all(
        benches[number].controller.is_stopped for number in (0, 3)), 5.0)
    late.close()
    assert [len(bench.zeros) >= 10 for bench in benches] == [True, False, False, True]


def test_the_stop_is_reported_to_the_guardian_before_and_after():
    """Before, or it would stop too; after, or it would stop again when the program ends."""
    bench = Bench()
    bench.controller.stop(REASON)
    received = bench.guardian.received
    assert received == ['rest'] * len(bench.zeros) + ['stopped']


def test_each_zero_is_reported_to_the_guardian_before_it_is_sent():
    """A node that is held up before the last zero must not count as stopped."""
    bench = Bench()
    bench.end = bench.time.now + 1.0
    bench.moves = lambda: bench.time.now < bench.end
    reports = []
    transmit = bench.wire.transmit

    def count(velocity):
        reports.append(bench.guardian.received.count('rest'))
        transmit(velocity)

    bench.gate._transmit = count
    bench.controller.stop(REASON)
    assert reports == [*range(1, len(reports) + 1)]
    assert 'stopped' not in bench.guardian.received[:-1]


def test_a_late_stop_does_not_end_a_run_that_begins_at_that_moment():
    bench = Bench()
    gate, begun = bench.gate, []

    class Late:
        """Begins another run after the newest one was read."""

        def __getattr__(self, name):
            found = getattr(gate, name)
            if name == 'permit' and not begun:
                begun.append(gate.begin(0.2))
            return found

    bench.controller._gate = Late()
    bench.controller.stop(None, only=bench.run)
    gate.send(begun[0], Velocity(0.2, 0.0))


def test_zeros_go_on_while_the_robot_is_seen_to_move():
    bench = Bench()
    end = bench.time.now + 1.0
    bench.moves = lambda: bench.time.now < end
    bench.controller.stop(REASON)
    assert bench.zeros[-1] == pytest.approx(end, abs=0.05)


def test_zeros_end_within_2_s_even_if_the_robot_still_moves():
    bench = Bench()
    begun = bench.time.now
    bench.moves = lambda: True
    bench.controller.stop(REASON)
    assert bench.zeros[-1] - begun < 2.0
