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
"""Drives that are requested, and stops that come before they begin."""

import threading

from fake_time import FakePublisher, FakeTime
from kachaka_simple_control.control.drive_requests import DriveRequests
from kachaka_simple_control.control.guardian_memory import Latch
from kachaka_simple_control.control.velocity_gate import VelocityGate
from kachaka_simple_control.errors import MotionRefusedError
from kachaka_simple_control.motion.limits import Limits
import pytest

PERIOD = 0.1
STOPPED = MotionRefusedError('stopped from outside')


class Bench:
    """Requests, the gate that prepares their runs, and a clock."""

    def __init__(self):
        self.time = FakeTime()
        self.gate = VelocityGate(
            FakePublisher(self.time).transmit, Limits(0.3, 1.57), Latch(), None, self.time.clock,
            self.time.clock)
        self.gate.open()
        self.requests = DriveRequests(self.time.clock)

    def stop(self):
        """Stop as a session does."""
        self.requests.on_stop(STOPPED, [self.gate])
        self.gate.cancel(STOPPED)

    def stop_from_outside(self):
        """Stop in another thread."""
        thread = threading.Thread(target=self.stop)
        thread.start()
        thread.join()

    def drive(self, is_complete=True, period=PERIOD):
        """Begin and end a drive."""
        request = self.requests.accept([self.gate])
        request.period = period
        self.gate.begin(0.2, request.permits[self.gate])
        self.requests.finish(request, is_complete)


@pytest.fixture
def bench():
    """Return a bench."""
    return Bench()


def test_one_drive_at_a_time(bench):
    first = bench.requests.accept([bench.gate])
    with pytest.raises(MotionRefusedError, match='running already'):
        bench.requests.accept([bench.gate])
    bench.requests.finish(first, is_complete=True)
    bench.drive()


@pytest.mark.parametrize('stop', [Bench.stop, Bench.stop_from_outside])
def test_a_stop_between_two_rounds_ends_the_drive(bench, stop):
    """Also one by the thread that has requested it, for another may drive."""
    request = bench.requests.accept([bench.gate])
    bench.gate.begin(0.2, request.permits[bench.gate])
    bench.requests.renew(request)
    bench.gate.begin(0.2, request.permits[bench.gate])
    stop(bench)
    with pytest.raises(MotionRefusedError, match='from outside'):
        bench.requests.renew(request)


def test_a_stop_before_the_next_round_begins_ends_it(bench):
    request = bench.requests.accept([bench.gate])
    bench.gate.begin(0.2, request.permits[bench.gate])
    bench.requests.renew(request)
    bench.stop()
    with pytest.raises(MotionRefusedError, match='from outside'):
        bench.gate.begin(0.2, request.permits[bench.gate])


def test_a_drive_that_has_not_begun_is_ended_by_a_stop(bench):
    request = bench.requests.accept([bench.gate])
    bench.stop_from_outside()
    with pytest.raises(MotionRefusedError, match='from outside'):
        bench.gate.begin(0.2, request.permits[bench.gate])


def test_a_stop_between_two_movements_that_follow_at_once_refuses_the_second(bench):
    bench.drive()
    bench.time.now += 0.9 * PERIOD
    bench.stop_from_outside()
    with pytest.raises(MotionRefusedError, match='from outside'):
        bench.drive()
    # A request after that is a new one.
    bench.drive()


def test_a_stop_at_the_last_moment_of_a_movement_refuses_the_next(bench):
    request = bench.requests.accept([bench.gate])
    request.period = PERIOD
    bench.gate.begin(0.2, request.permits[bench.gate])
    bench.stop_from_outside()
    bench.requests.finish(request, is_complete=True)
    with pytest.raises(MotionRefusedError, match='from outside'):
        bench.drive()


@pytest.mark.parametrize('period', [0.02, 0.19])
def test_a_series_goes_by_the_period_of_the_drive_that_ended(bench, period):
    bench.drive(period=period)
    bench.time.now += 0.9 * period
    bench.stop_from_outside()
    with pytest.raises(MotionRefusedError, match='from outside'):
        bench.drive(period=PERIOD)
    bench.drive(period=period)
    bench.stop_from_outside()
    bench.time.now += 1.1 * period
    bench.drive(period=PERIOD)


def test_a_movement_some_time_after_a_stop_is_a_new_request(bench):
    bench.drive()
    bench.stop_from_outside()
    bench.time.now += 1.1 * PERIOD
    bench.drive()


def test_a_thread_that_stops_its_own_drive_may_drive_on(bench):
    bench.drive()
    bench.stop()
    bench.drive()


def test_of_two_stops_the_first_gives_the_reason(bench):
    bench.drive()
    later = MotionRefusedError('stopped once more')
    for reason in (STOPPED, later):
        thread = threading.Thread(target=bench.requests.on_stop, args=(reason, [bench.gate]))
        thread.start()
        thread.join()
    with pytest.raises(MotionRefusedError, match='stopped from outside'):
        bench.requests.accept([bench.gate])
